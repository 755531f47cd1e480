# SPDX-License-Identifier: BSD-3-Clause
"""The worlds of `scripts/evaluation/splinegons.py`: a fixed-wing-like vehicle flies around large obstacles, with an
IMU, fixes and a scanner that tilts with each turn. Everything follows from the shape, the variant and the seed.

    python3 scripts/evaluation/splinegon_worlds.py DIR [--shapes ellipse peanut kidney lobes box two columns wings island] [--seeds 1 2]
        [--variants plain wind yawed flipped outage outliers short]

NAME is SHAPE_SEED, then _ and the variant if it is not the plain one. Written are

    NAME.bag         /scan, /imu, /fix, and /tf_static base_link -> laser
    NAME_tf.bag      the same, and /tf world -> base_link, the truth, at 200 Hz
    NAME.truth.json  the truth, in the world's frame: local east, north and up at the origin

The truth: `origin`: [latitude, longitude, altitude]. `obstacles`: `id`, `outline` (closed, counter-clockwise, a point
each 2 cm at most), `corners` (indices of its points), `length_m`, `area_m2`. `scans`: of each scan `stamp`, the pose of
base_link at the stamp (`x`, `y`, `z`, `roll`, `pitch`, `yaw`; R = Rz(yaw) Ry(pitch) Rx(roll)) and `seen`, for each
obstacle the share of its outline, in bins of 10 cm, that a beam has hit so far. `fixes`: of each good one `stamp` and
where it says that the vehicle is (`x`, `y`, `z`), `arrived`, when it is in the bag, and `outlier`. `flight`: `begin_s`,
`end_s`, `wind` [east, north] in m/s. `outage`: [begin, end] and `ins_alone_m`, how far the IMU alone, from the true
motion at the begin, is off at the end; or null.

The vehicle flies straight and level for 15 s and then one and a half times (outage: 5.5, outliers: 2.5) around
everything that stands there, to the left if the seed is odd, else to the right, at constant altitude and airspeed. Its
way is the outline of the convex hull at a distance, with rounded corners. It banks as a coordinated turn asks, up to 20
deg. Axes are forward, left and up: a turn to the left has a negative roll, a nose that is up a negative pitch. Walls
are vertical and higher than any beam. A beam is cast at its own time; a scan is in the bag when its sweep has ended, a
fix 0.1 s after its stamp."""

import argparse
import dataclasses
import functools
import heapq
import json
import math
import pathlib
import sys

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import polygon_worlds

SHAPES = ("ellipse", "peanut", "kidney", "lobes", "box", "two", "columns", "wings", "island")
VARIANTS = ("plain", "wind", "yawed", "flipped", "outage", "outliers", "short")
ORIGIN = (47.3769, 8.5417, 408.0)  # latitude, longitude, altitude
GRAVITY_M_S2 = 9.80665
BEGIN_S = 1000.0  # the first sample of the IMU

# Outlines.
OUTLINE_M = 0.02  # between its points
BIN_M = 0.1  # of an outline, for what was seen of it
POCKET_M = 3.0  # depth of the kidney's, below its hull
APART_M = 3.0  # the two obstacles
PLACE_M = 40.0  # an obstacle is so far from the origin, at most, east and north

# The way.
AIRSPEED_M_S = 5.0
STRAIGHT_S = 15.0
DISTANCE_M = (6.3, 7.0)  # from the hull, its corners rounded
DISTANCE_CHANGE_M = 0.3  # over the laps
WAVES, MOST_WAVE_M = 4, 0.5  # per lap, as high as the turning radius allows
TURNING_RADIUS_M = 6.4  # before places are smoothed, which adds up to 1 m
CORNER_RAD = math.radians(15.0)  # standard deviation over which directions of the hull's corners are rounded
TURN_IN_M = 2.0  # the same, of places along the way
MAX_BANK_RAD = math.radians(20.0)
SOFT = 20  # exponent of the bank's limit
NOSE_UP_RAD = (math.radians(2.0), math.radians(4.0))  # straight, and what a bank of 60 deg would add
ALTITUDE_M = 15.0
WIND_M_S = 1.2
GUST_RAD = {"roll": math.radians(0.5), "pitch": math.radians(0.4), "yaw": math.radians(0.4)}  # in wind, each of three
GUST_HZ = (0.2, 0.9)
KNOT_S = 0.02  # of the splines of the flight

# Scanner.
RANGE_MIN_M, RANGE_MAX_M, RANGE_SIGMA_M = 0.1, 30.0, 0.03
LOST_CHANCE = 0.002
INCREMENT_RAD = math.radians(0.5)

# IMU: a good MEMS one, as in include/situation_awareness/sim/imu.hpp.
IMU_PERIOD_S = 0.005
GYROSCOPE = {"noise": 1.0e-4, "bias_sigma": 2.0e-3, "bias_walk": 2.0e-5}
ACCELEROMETER = {"noise": 2.0e-3, "bias_sigma": 0.05, "bias_walk": 3.0e-4}

# Fixes. An error of 1.5 m per axis, most of it slow.
FIX_PERIOD_S, FIX_DELAY_S = 0.2, 0.1
FIX_SLOW_M, FIX_SLOW_S, FIX_WHITE_M = 1.4, 30.0, 0.54
FIX_SHORT_S = 5.0  # of the variant short, instead of FIX_SLOW_S
NO_FIX_CHANCE, NAN_CHANCE = 0.02, 0.02
OUTAGE_S = (60.0, 90.0)  # after the begin
OUTLIER_M, OUTLIER_CHANCE = 30.0, 0.03

TF_PERIOD_S = 0.005


@dataclasses.dataclass(frozen=True)
class Variant:
    wind_m_s: float
    fov_rad: float
    scan_period_s: float
    mount: tuple  # of laser on base_link: x, y, z, roll, pitch, yaw
    laps: float = 1.5
    outage_s: tuple = None
    outlier_chance: float = 0.0
    fix_slow_s: float = FIX_SLOW_S


LEVEL = (0.1, 0.0, -0.05, 0.0, 0.0, 0.0)
SETTINGS = {
    "plain": Variant(0.0, math.radians(270.0), 0.04, LEVEL),
    "wind": Variant(WIND_M_S, math.radians(270.0), 0.04, LEVEL),
    "outage": Variant(0.0, math.radians(270.0), 0.04, LEVEL, laps=5.5, outage_s=OUTAGE_S),
    "outliers": Variant(0.0, math.radians(270.0), 0.04, LEVEL, laps=2.5, outlier_chance=OUTLIER_CHANCE),
    "short": Variant(0.0, math.radians(270.0), 0.04, LEVEL, fix_slow_s=FIX_SHORT_S),
    "yawed": Variant(0.0, math.radians(360.0), 0.1, (-0.2, 0.05, 0.1, 0.0, 0.0, math.radians(35.0))),
    "flipped": Variant(0.0, math.radians(270.0), 0.05, (0.15, -0.03, -0.1, math.pi, 0.0, math.radians(-10.0)))}


# --- poses


def rotations(attitudes):
    """Rz(yaw) Ry(pitch) Rx(roll) of rows of roll, pitch and yaw: (n, 3, 3)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(attitudes).T, np.sin(attitudes).T
    return np.stack((np.stack((cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr), -1),
                     np.stack((sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr), -1),
                     np.stack((-sp, cp * sr, cp * cr), -1)), -2)


def quaternion(attitude):
    """(x, y, z, w) of roll, pitch and yaw."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(np.multiply(0.5, attitude)), np.sin(np.multiply(0.5, attitude))
    return (float(sr * cp * cy - cr * sp * sy), float(cr * sp * cy + sr * cp * sy), float(cr * cp * sy - sr * sp * cy),
            float(cr * cp * cy + sr * sp * sy))


# --- geodesy: WGS84

MAJOR_M, FLATTENING = 6378137.0, 1.0 / 298.257223563
ECCENTRICITY_2 = FLATTENING * (2.0 - FLATTENING)


def ecef_of(geodetic):
    """Rows of x, y and z of rows of latitude, longitude (degrees) and height above the ellipsoid."""
    latitude, longitude = np.radians(geodetic[..., 0]), np.radians(geodetic[..., 1])
    height = geodetic[..., 2]
    normal = MAJOR_M / np.sqrt(1.0 - ECCENTRICITY_2 * np.sin(latitude)**2)
    across = (normal + height) * np.cos(latitude)
    return np.stack((across * np.cos(longitude), across * np.sin(longitude),
                     (normal * (1.0 - ECCENTRICITY_2) + height) * np.sin(latitude)), -1)


def east_north_up(origin):
    """The matrix whose rows are these directions in the earth's frame."""
    sin_lat, cos_lat = math.sin(math.radians(origin[0])), math.cos(math.radians(origin[0]))
    sin_lon, cos_lon = math.sin(math.radians(origin[1])), math.cos(math.radians(origin[1]))
    return np.array(((-sin_lon, cos_lon, 0.0), (-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat),
                     (cos_lat * cos_lon, cos_lat * sin_lon, sin_lat)))


def local_of(geodetic, origin):
    """East, north and up at the origin, as GeographicLib::LocalCartesian::Forward."""
    return (ecef_of(np.asarray(geodetic, float)) - ecef_of(np.asarray(origin, float))) @ east_north_up(origin).T


def geodetic_of(local, origin):
    """Latitude, longitude and height, as GeographicLib::LocalCartesian::Reverse: by iteration to round-off, which
    takes five steps near the ground."""
    x, y, z = np.moveaxis(np.asarray(local, float) @ east_north_up(origin) + ecef_of(np.asarray(origin, float)), -1, 0)
    across = np.hypot(x, y)
    latitude = np.arctan2(z, across * (1.0 - ECCENTRICITY_2))
    for _ in range(5):
        normal = MAJOR_M / np.sqrt(1.0 - ECCENTRICITY_2 * np.sin(latitude)**2)
        latitude = np.arctan2(z + ECCENTRICITY_2 * normal * np.sin(latitude), across)
    normal = MAJOR_M / np.sqrt(1.0 - ECCENTRICITY_2 * np.sin(latitude)**2)
    height = across * np.cos(latitude) + z * np.sin(latitude) - MAJOR_M**2 / normal
    return np.stack((np.degrees(latitude), np.degrees(np.arctan2(y, x)), height), -1)


# --- obstacles


@dataclasses.dataclass
class Obstacle:
    """A closed outline, counter-clockwise."""

    id: str
    outline: np.ndarray
    corners: tuple = ()  # indices of its points

    @property
    def length_m(self):
        return float(np.hypot(*(np.roll(self.outline, -1, axis=0) - self.outline).T).sum())

    @property
    def area_m2(self):
        x, y = (self.outline - self.outline[0]).T
        return 0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())

    def placed(self, place, yaw_rad):
        return Obstacle(self.id, polygon_worlds.placed(self.outline, *place, yaw_rad), self.corners)


def smooth_outline(curve):
    """Points at equal distances on a closed curve, a function of an angle."""
    angle = np.linspace(0.0, 2.0 * math.pi, 100001)
    points = curve(angle)
    arc = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    count = math.ceil(arc[-1] / OUTLINE_M)
    return curve(np.interp(arc[-1] / count * np.arange(count), arc, angle))


def polar(radius):
    return lambda phi: radius(phi)[:, None] * np.column_stack((np.cos(phi), np.sin(phi)))


def ellipse(a, b):
    return smooth_outline(lambda t: np.column_stack((a * np.cos(t), b * np.sin(t))))


def cornered(name, corners):
    corners = np.asarray(corners, float)
    points, at = [], []
    for start, end in zip(corners, np.roll(corners, -1, axis=0)):
        count = math.ceil(np.hypot(*(end - start)) / OUTLINE_M)
        at.append(sum(map(len, points)))
        points.append(start + (np.arange(count) / count)[:, None] * (end - start))
    return Obstacle(name, np.vstack(points), tuple(at))


def kidney_curve(dent_m):
    """An ellipse with semi-axes of 9.5 m and 7 m and a dent towards +y, 1.8 m wide (standard deviation)."""
    def curve(t):
        x = 9.5 * np.cos(t)
        dent = dent_m * (0.5 * (1.0 + np.sin(t)))**2 * np.exp(-0.5 * (x / 1.8)**2)
        return np.column_stack((x, 7.0 * np.sin(t) - dent))

    return curve


def pocket_depth(outline):
    """How far the deepest point below the hull's edges is from them."""
    hull = ConvexHull(outline)
    return float((-(outline @ hull.equations[:, :2].T + hull.equations[:, 2])).min(1).max())


@functools.lru_cache(maxsize=None)
def kidney():
    """Its pocket is 3 m deep."""
    low, high = 2.0, 6.0
    angle = np.linspace(0.0, 2.0 * math.pi, 3000, endpoint=False)
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if pocket_depth(kidney_curve(middle)(angle)) < POCKET_M else (low, middle)
    return smooth_outline(kidney_curve(high))


def columns():
    """A building of 40 m x 20 m with 16 columns of 1 m, 1 m in front of its wall."""
    corners, step_m = [], 7.5
    next_m = 0.5 * step_m
    for start, length in (((-20.0, -10.0), 40.0), ((20.0, -10.0), 20.0), ((20.0, 10.0), 40.0), ((-20.0, 10.0), 20.0)):
        along = -np.sign(start) * (abs(start[0]) if length == 40.0 else 0.0, abs(start[1]) if length == 20.0 else 0.0)
        along /= np.hypot(*along)
        out = np.array((along[1], -along[0]))
        corners.append(np.array(start))
        while next_m < length:
            for side, depth in ((-0.5, 0.0), (-0.5, 1.0), (0.5, 1.0), (0.5, 0.0)):
                corners.append(start + (next_m + side) * along + depth * out)
            next_m += step_m
        next_m -= length
    return corners


def wings():
    """A building with four wings, 4 m wide and 3 m deep, 6 m apart."""
    corners = [(0.0, -8.0), (34.0, -8.0)]
    for x in (30.0, 20.0, 10.0, 0.0):
        corners += [(x + 4.0, 3.0), (x, 3.0)] + ([(x, 0.0), (x - 6.0, 0.0)] if x > 0.0 else [])
    return corners


def island():
    """Banks of 330 m altogether, with bends of 8 m to 60 m."""
    def curve(t):
        waves = sum(a * np.sin(k * t + p) for k, a, p in ((5, 1.6, 0.3), (9, 0.9, 1.1), (17, 0.45, 2.0), (29, 0.22, 0.7)))
        x, y = (70.0 + waves) * np.cos(t), (28.0 + waves) * np.sin(t)
        return np.column_stack((x, y))

    return smooth_outline(curve)


def obstacles_of(shape):
    """At the origin."""
    if shape in ("columns", "wings"):
        return [cornered(shape, {"columns": columns, "wings": wings}[shape]())]
    if shape == "two":
        width = 7.0
        box = cornered("box", polygon_worlds.rectangle(width, 6.0))
        return [Obstacle("ellipse", ellipse(5.5, 4.0)).placed((-0.5 * APART_M - 5.5, 0.0), 0.0),
                box.placed((0.5 * APART_M + 0.5 * width, 0.0), 0.0)]
    if shape == "box":
        return [cornered("box", polygon_worlds.rectangle(12.0, 7.0))]
    outline = {"ellipse": lambda: ellipse(10.0, 6.0),
               "peanut": lambda: smooth_outline(polar(lambda phi: 7.0 + 3.0 * np.cos(2.0 * phi))),
               "kidney": kidney,
               "lobes": lambda: smooth_outline(polar(lambda phi: 7.5 + 2.0 * np.cos(3.0 * phi))),
               "island": island}[shape]()
    return [Obstacle(shape, outline)]


# --- the flight


class Flight:
    """The true motion of base_link, by splines of five degrees over time. Of an IMU in it the measurements follow."""

    def __init__(self, times_s, positions, attitudes, wind):
        self.begin_s, self.end_s, self.wind = float(times_s[0]), float(times_s[-1]), wind
        self._motion = make_interp_spline(times_s - self.begin_s, np.hstack((positions, attitudes)), k=5)
        self._derivatives = [self._motion, *(self._motion.derivative(order) for order in (1, 2))]

    def at(self, times_s, order=0):
        """Rows of x, y, z, roll, pitch and yaw (without jumps), or their derivatives."""
        return self._derivatives[order](np.asarray(times_s, float) - self.begin_s)

    def specific_force(self, times_s):
        """In the body."""
        force = self.at(times_s, 2)[..., :3] + (0.0, 0.0, GRAVITY_M_S2)
        return np.einsum("nji,nj->ni", rotations(self.at(times_s)[..., 3:]), force)

    def angular_velocity(self, times_s):
        """In the body."""
        roll, pitch, _ = self.at(times_s)[..., 3:].T
        d_roll, d_pitch, d_yaw = self.at(times_s, 1)[..., 3:].T
        return np.column_stack((d_roll - d_yaw * np.sin(pitch),
                                d_pitch * np.cos(roll) + d_yaw * np.cos(pitch) * np.sin(roll),
                                -d_pitch * np.sin(roll) + d_yaw * np.cos(pitch) * np.cos(roll)))


def way_around(points, chance, leftwards, laps):
    """Places each 5 cm, smooth: straight, then around the hull of the points. The support function of the hull is
    smoothed over directions, which rounds its corners and keeps it convex: the radius of curvature, h + h" of the
    support function h, is the distance at least. Waves make it less in places, for turns as tight as allowed."""
    count = 3600
    direction = 2.0 * math.pi / count * np.arange(count)
    hull = points[ConvexHull(points).vertices]
    support = (hull @ np.stack((np.cos(direction), np.sin(direction)))).max(0)
    support = gaussian_filter1d(support, CORNER_RAD / (2.0 * math.pi / count), mode="wrap")
    smooth = CubicSpline(np.append(direction, 2.0 * math.pi), np.append(support, support[0]), bc_type="periodic")
    first, phase, wave_phase = chance.uniform(0.0, 2.0 * math.pi, 3)
    distance_m = chance.uniform(*DISTANCE_M)

    turned = np.linspace(0.0, 2.0 * math.pi * laps, round(13000 * laps) + 1)
    angle = first + turned
    h = smooth(angle % (2.0 * math.pi)) + distance_m + DISTANCE_CHANGE_M * np.sin(turned / laps + phase)
    slope = smooth(angle % (2.0 * math.pi), 1) + DISTANCE_CHANGE_M / laps * np.cos(turned / laps + phase)
    radius_m = h + smooth(angle % (2.0 * math.pi), 2) - DISTANCE_CHANGE_M / laps**2 * np.sin(turned / laps + phase)
    wave = np.sin(WAVES * angle + wave_phase)
    with np.errstate(divide="ignore"):
        highest_m = (radius_m - TURNING_RADIUS_M) / np.maximum((WAVES**2 - 1) * wave, 1e-9)
    wave_m = float(np.clip(highest_m.min(), 0.0, MOST_WAVE_M))
    h += wave_m * wave
    slope += wave_m * WAVES * np.cos(WAVES * angle + wave_phase)
    cos, sin = np.cos(angle), np.sin(angle)
    around = np.column_stack((h * cos - slope * sin, h * sin + slope * cos))
    ahead = np.array((-sin[0], cos[0]))
    straight = around[0] + np.linspace(-AIRSPEED_M_S * STRAIGHT_S * 1.5, 0.0, 2000, endpoint=False)[:, None] * ahead
    raw = np.vstack((straight, around))
    if not leftwards:
        # A mirror image of the way around a mirror image.
        raw = raw * (1.0, -1.0)
    arc = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(raw, axis=0).T))))
    step_m = 0.05
    even = np.column_stack([np.interp(np.arange(0.0, arc[-1], step_m), arc, raw[:, axis]) for axis in (0, 1)])
    even = gaussian_filter1d(even, TURN_IN_M / step_m, axis=0, mode="nearest")
    end = round(3.0 * TURN_IN_M / step_m)  # where there is nothing to smooth with
    start_m = arc[len(straight)] - AIRSPEED_M_S * STRAIGHT_S
    return even[int(start_m / step_m):-end]


def flight_along(places, chance, wind_m_s):
    """At constant airspeed, with the nose into the wind as it takes to stay on the way."""
    arc = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))))
    way = make_interp_spline(arc, places, k=5)
    fine = np.arange(0.0, arc[-1], 0.01)
    along = way(fine, 1)
    along /= np.hypot(*along.T)[:, None]
    wind_from = chance.uniform(0.0, 2.0 * math.pi)
    wind = wind_m_s * np.array((math.cos(wind_from), math.sin(wind_from)))
    beside = along[:, 0] * wind[1] - along[:, 1] * wind[0]
    speed = along @ wind + np.sqrt(AIRSPEED_M_S**2 - beside**2)
    after_s = np.concatenate(([0.0], np.cumsum(0.01 * 2.0 / (speed[1:] + speed[:-1]))))
    times_s = np.arange(0.0, after_s[-1], KNOT_S)
    distance = make_interp_spline(after_s, fine, k=5)
    motion = make_interp_spline(times_s, way(distance(times_s)), k=5)
    velocity, acceleration = motion(times_s, 1), motion(times_s, 2)
    heading = velocity - wind
    yaw = np.unwrap(np.arctan2(heading[:, 1], heading[:, 0]))
    to_left = (acceleration[:, 1] * heading[:, 0] - acceleration[:, 0] * heading[:, 1]) / np.hypot(*heading.T)
    bank = np.arctan(to_left / GRAVITY_M_S2) / MAX_BANK_RAD
    roll = -MAX_BANK_RAD * bank / (1.0 + bank**SOFT)**(1.0 / SOFT)
    pitch = -(NOSE_UP_RAD[0] + NOSE_UP_RAD[1] * (1.0 / np.cos(roll) - 1.0))
    attitudes = np.column_stack((roll, pitch, yaw))
    if wind_m_s > 0.0:
        for axis, most in enumerate(GUST_RAD.values()):
            for _ in range(3):
                rate, phase = 2.0 * math.pi * chance.uniform(*GUST_HZ), chance.uniform(0.0, 2.0 * math.pi)
                attitudes[:, axis] += most / 3.0 * np.sin(rate * times_s + phase)
    positions = np.column_stack((motion(times_s), np.full(len(times_s), ALTITUDE_M)))
    return Flight(BEGIN_S + times_s, positions, attitudes, wind)


# --- sensors


def walk(chance, count, period_s, sigma, density):
    """A bias on three axes: constant, and a random walk."""
    steps = density * math.sqrt(period_s) * chance.standard_normal((count, 3))
    steps[0] = sigma * chance.standard_normal(3)
    return np.cumsum(steps, axis=0)


def imu_of(chance, flight):
    """Stamps, specific forces and angular velocities."""
    stamps = BEGIN_S + IMU_PERIOD_S * np.arange(int((flight.end_s - flight.begin_s) / IMU_PERIOD_S) + 1)
    stamps = stamps[stamps <= flight.end_s]
    values = []
    for true, error in ((flight.specific_force(stamps), ACCELEROMETER), (flight.angular_velocity(stamps), GYROSCOPE)):
        bias = walk(chance, len(stamps), IMU_PERIOD_S, error["bias_sigma"], error["bias_walk"])
        noise = error["noise"] / math.sqrt(IMU_PERIOD_S) * chance.standard_normal((len(stamps), 3))
        values.append(true + bias + noise)
    return stamps, *values


@dataclasses.dataclass
class Fixes:
    stamps: np.ndarray
    positions: np.ndarray  # east, north, up
    state: np.ndarray  # 0 good, 1 without a fix, 2 not a number
    outlier: np.ndarray


def fixes_of(chance, flight, outage_s=None, outlier_chance=0.0, slow_s=FIX_SLOW_S):
    stamps = np.round(np.arange(flight.begin_s + 0.05, flight.end_s - FIX_DELAY_S, FIX_PERIOD_S), 6)
    kept = math.exp(-FIX_PERIOD_S / slow_s)
    slow = np.empty((len(stamps), 3))
    value = chance.standard_normal(3)
    for k in range(len(stamps)):
        slow[k] = value
        value = kept * value + math.sqrt(1.0 - kept**2) * chance.standard_normal(3)
    error = FIX_SLOW_M * slow + FIX_WHITE_M * chance.standard_normal(slow.shape)
    draw = chance.random(len(stamps))
    state = np.where(draw < NO_FIX_CHANCE, 1, np.where(draw < NO_FIX_CHANCE + NAN_CHANCE, 2, 0))
    outlier = (state == 0) & (chance.random(len(stamps)) < outlier_chance)
    angle = chance.uniform(0.0, 2.0 * math.pi, len(stamps))
    error[outlier, :2] += OUTLIER_M * np.column_stack((np.cos(angle), np.sin(angle)))[outlier]
    kept = np.ones(len(stamps), bool)
    if outage_s is not None:
        kept = (stamps < flight.begin_s + outage_s[0]) | (stamps >= flight.begin_s + outage_s[1])
    return Fixes(stamps[kept], (flight.at(stamps)[:, :3] + error)[kept], state[kept], outlier[kept])


def inertial_navigation(flight, stamps, forces, rates):
    """(places, attitudes) by the IMU alone, from the true motion at the first stamp on."""
    turns = Rotation.from_rotvec(0.5 * (rates[:-1] + rates[1:]) * np.diff(stamps)[:, None])
    attitude = Rotation.from_euler("ZYX", flight.at(stamps[:1])[0, :2:-1])
    attitudes = [attitude]
    for turn in turns:
        attitude = attitude * turn
        attitudes.append(attitude)
    attitudes = Rotation.concatenate(attitudes)
    acceleration = attitudes.apply(forces) - (0.0, 0.0, GRAVITY_M_S2)
    dt = np.diff(stamps)[:, None]
    mean = 0.5 * (acceleration[1:] + acceleration[:-1])
    velocity = flight.at(stamps[:1], 1)[0, :3] + np.vstack((np.zeros(3), np.cumsum(mean * dt, axis=0)))
    steps = velocity[:-1] * dt + 0.5 * mean * dt**2
    return flight.at(stamps[:1])[0, :3] + np.vstack((np.zeros(3), np.cumsum(steps, axis=0))), attitudes


# --- simulation


class Simulation:
    """`scans()` gives (stamp, ranges) one after the other; then `truth()`."""

    def __init__(self, shape, seed, variant="plain"):
        self.shape, self.seed, self.variant = shape, seed, variant
        settings = self.settings = SETTINGS[variant]
        stream = lambda which: np.random.default_rng((17, SHAPES.index(shape), VARIANTS.index(variant), seed, which))
        # The place is that of the shape and the seed in all variants.
        chance = np.random.default_rng((17, SHAPES.index(shape), seed))
        place, yaw_rad = chance.uniform(-PLACE_M, PLACE_M, 2), chance.uniform(0.0, 2.0 * math.pi)
        self.obstacles = [obstacle.placed((0.0, 0.0), yaw_rad) for obstacle in obstacles_of(shape)]
        self.obstacles = [obstacle.placed(place, 0.0) for obstacle in self.obstacles]
        leftwards = seed % 2 == 1
        mirror = (1.0, 1.0 if leftwards else -1.0)
        way = way_around(np.vstack([obstacle.outline for obstacle in self.obstacles]) * mirror, stream(0), leftwards,
                         settings.laps)
        self.flight = flight_along(way, stream(1), settings.wind_m_s)
        self.imu = imu_of(stream(2), self.flight)
        self.fixes = fixes_of(stream(3), self.flight, settings.outage_s, settings.outlier_chance,
                              settings.fix_slow_s)
        self._noise = stream(4)
        self.beams = round(settings.fov_rad / INCREMENT_RAD) + (settings.fov_rad < 2.0 * math.pi - 1e-9)
        self.angle_min_rad = -0.5 * settings.fov_rad
        self.angles = self.angle_min_rad + INCREMENT_RAD * np.arange(self.beams)
        self.time_increment_s = settings.scan_period_s * INCREMENT_RAD / (2.0 * math.pi)
        self.sweep_s = self.time_increment_s * (self.beams - 1)
        self._things = [polygon_worlds.Thing(obstacle.id, "wall", "plaster", obstacle.outline)
                        for obstacle in self.obstacles]
        self._bins = [np.zeros(math.ceil(thing.length_m / BIN_M), bool) for thing in self._things]
        self._rows = {key: [] for key in ("stamp", "x", "y", "z", "roll", "pitch", "yaw", "seen")}

    def rays(self, stamp_s):
        """Origins and unit directions of a scan's beams in the world, each at its own time."""
        poses = self.flight.at(stamp_s + self.time_increment_s * np.arange(self.beams))
        mount = np.array(self.settings.mount)
        turns = rotations(poses[:, 3:])
        in_base = rotations(mount[None, 3:])[0] @ np.stack((np.cos(self.angles), np.sin(self.angles),
                                                            np.zeros(self.beams)))
        return poses[:, :3] + turns @ mount[:3], np.einsum("nij,jn->ni", turns, in_base)

    def scans(self):
        caster = polygon_worlds.Caster(self._things)
        first_s = self.flight.begin_s + 0.1
        for k in range(int((self.flight.end_s - self.sweep_s - first_s) / self.settings.scan_period_s)):
            stamp_s = round(first_s + k * self.settings.scan_period_s, 6)
            origins, directions = self.rays(stamp_s)
            level = np.hypot(*directions[:, :2].T)  # cosine of the elevation
            hits = caster.cast(origins[:, :2], directions[:, :2] / level[:, None])
            range_m = hits.range_m / level
            draws = self._noise.random(self.beams)
            noise = RANGE_SIGMA_M * self._noise.standard_normal(self.beams)
            is_hit = (range_m <= RANGE_MAX_M) & (draws >= LOST_CHANCE)
            range_m = np.where(is_hit, range_m + noise, np.inf)
            range_m[(range_m < RANGE_MIN_M) | (range_m > RANGE_MAX_M)] = np.inf
            for i, (thing, bins) in enumerate(zip(self._things, self._bins)):
                own = hits.arc_m[is_hit & (hits.thing == i)]
                bins[np.minimum((own / thing.length_m * len(bins)).astype(int), len(bins) - 1)] = True
            pose = self.flight.at(np.array([stamp_s]))[0]
            pose[5] = (pose[5] + math.pi) % (2.0 * math.pi) - math.pi
            for key, value in zip(self._rows, (stamp_s, *(round(float(v), 9) for v in pose),
                                               [round(float(bins.mean()), 4) for bins in self._bins])):
                self._rows[key].append(value)
            yield stamp_s, range_m

    def truth(self):
        """After all scans."""
        good = self.fixes.state == 0
        return {"shape": self.shape, "seed": self.seed, "variant": self.variant, "origin": list(ORIGIN),
                "scan_period_s": self.settings.scan_period_s, "mount": list(self.settings.mount),
                "flight": {"begin_s": self.flight.begin_s, "end_s": self.flight.end_s,
                           "wind": [float(v) for v in self.flight.wind]},
                "obstacles": [{"id": obstacle.id, "outline": [[round(float(v), 6) for v in point]
                                                              for point in obstacle.outline],
                               "corners": list(obstacle.corners), "length_m": round(obstacle.length_m, 6),
                               "area_m2": round(obstacle.area_m2, 6)} for obstacle in self.obstacles],
                "fixes": {"stamp": self.fixes.stamps[good].tolist(),
                          **{key: [round(float(v), 6) for v in self.fixes.positions[good, axis]]
                             for axis, key in enumerate("xyz")},
                          "arrived": np.round(self.fixes.stamps[good] + FIX_DELAY_S, 6).tolist(),
                          "outlier": self.fixes.outlier[good].tolist()},
                "outage": self._outage(),
                "scans": self._rows}

    def _outage(self):
        if self.settings.outage_s is None:
            return None
        begin_s, end_s = (self.flight.begin_s + after_s for after_s in self.settings.outage_s)
        own = (self.imu[0] >= begin_s) & (self.imu[0] <= end_s)
        places, _ = inertial_navigation(self.flight, *(values[own] for values in self.imu))
        off = places[-1] - self.flight.at(self.imu[0][own][-1:])[0, :3]
        return {"begin_s": begin_s, "end_s": end_s, "ins_alone_m": round(float(np.hypot(*off[:2])), 3)}


# --- bags


def write_bags(simulation, path, tf_path):
    import genpy
    import rosbag  # not where worlds alone are wanted
    from geometry_msgs.msg import TransformStamped
    from sensor_msgs.msg import Imu, LaserScan, NavSatFix, NavSatStatus
    from tf2_msgs.msg import TFMessage

    flight = simulation.flight
    both, only_tf = (0, 1), (1,)

    def time(stamp_s):
        return genpy.Time(0, int(round(stamp_s * 1e6)) * 1000)

    def set_vector(message, values):
        message.x, message.y, message.z = (float(value) for value in values)

    def transform(stamp_s, parent, child, pose):
        message = TransformStamped()
        message.header.stamp, message.header.frame_id, message.child_frame_id = time(stamp_s), parent, child
        set_vector(message.transform.translation, pose[:3])
        rotation = message.transform.rotation
        rotation.x, rotation.y, rotation.z, rotation.w = quaternion(pose[3:])
        return TFMessage([message])

    # Each stream: (when it is written, order, topic, message, bags), by time.
    def transforms():
        yield flight.begin_s, 0, "/tf_static", transform(flight.begin_s, "base_link", "laser",
                                                         simulation.settings.mount), both
        stamps = flight.begin_s + TF_PERIOD_S * np.arange(int((flight.end_s - flight.begin_s) / TF_PERIOD_S) + 1)
        for stamp_s, pose in zip(stamps, flight.at(stamps)):
            yield stamp_s, 1, "/tf", transform(stamp_s, "world", "base_link", pose), only_tf

    def imu():
        for k, (stamp_s, force, rate) in enumerate(zip(*simulation.imu)):
            message = Imu()
            message.header.seq, message.header.stamp, message.header.frame_id = k, time(stamp_s), "base_link"
            message.orientation_covariance[0] = -1.0
            set_vector(message.linear_acceleration, force)
            set_vector(message.angular_velocity, rate)
            for key, error in (("linear_acceleration", ACCELEROMETER), ("angular_velocity", GYROSCOPE)):
                variance = error["noise"]**2 / IMU_PERIOD_S
                setattr(message, f"{key}_covariance", (variance * np.eye(3)).ravel().tolist())
            yield stamp_s, 2, "/imu", message, both

    def fixes():
        own = simulation.fixes
        for k, (stamp_s, place, state) in enumerate(zip(own.stamps, geodetic_of(own.positions, ORIGIN), own.state)):
            message = NavSatFix()
            message.header.seq, message.header.stamp, message.header.frame_id = k, time(stamp_s), "base_link"
            message.status.status = NavSatStatus.STATUS_NO_FIX if state == 1 else NavSatStatus.STATUS_FIX
            message.status.service = NavSatStatus.SERVICE_GPS
            if state == 0:
                message.latitude, message.longitude, message.altitude = (float(value) for value in place)
            elif state == 2:
                message.latitude = message.longitude = message.altitude = math.nan
            variance = FIX_SLOW_M**2 + FIX_WHITE_M**2
            message.position_covariance = (variance * np.eye(3)).ravel().tolist()
            message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
            yield stamp_s + FIX_DELAY_S, 3, "/fix", message, both

    def scans():
        for k, (stamp_s, range_m) in enumerate(simulation.scans()):
            message = LaserScan()
            message.header.seq, message.header.stamp, message.header.frame_id = k, time(stamp_s), "laser"
            message.angle_min, message.angle_increment = simulation.angle_min_rad, INCREMENT_RAD
            message.angle_max = float(simulation.angles[-1])
            message.time_increment, message.scan_time = simulation.time_increment_s, simulation.settings.scan_period_s
            message.range_min, message.range_max = RANGE_MIN_M, RANGE_MAX_M
            message.ranges = range_m.tolist()
            yield stamp_s + simulation.sweep_s, 4, "/scan", message, both

    bags = [rosbag.Bag(str(path), "w"), rosbag.Bag(str(tf_path), "w")]
    try:
        for at_s, _, topic, message, which in heapq.merge(transforms(), imu(), fixes(), scans(),
                                                          key=lambda entry: entry[:2]):
            for i in which:
                bags[i].write(topic, message, time(at_s))
    finally:
        for bag in bags:
            bag.close()


def name_of(shape, seed, variant="plain"):
    return f"{shape}_{seed}" + ("" if variant == "plain" else f"_{variant}")


def write_world(directory, shape, seed, variant="plain"):
    """Its files; the name of them."""
    directory = pathlib.Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    name = name_of(shape, seed, variant)
    simulation = Simulation(shape, seed, variant)
    write_bags(simulation, directory / f"{name}.bag", directory / f"{name}_tf.bag")
    (directory / f"{name}.truth.json").write_text(json.dumps(simulation.truth(), separators=(",", ":")))
    return name


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directory", type=pathlib.Path)
    parser.add_argument("--shapes", nargs="+", choices=SHAPES, default=list(SHAPES))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2])
    parser.add_argument("--variants", nargs="+", choices=VARIANTS, default=["plain"])
    arguments = parser.parse_args()
    for shape in arguments.shapes:
        for seed in arguments.seeds:
            for variant in arguments.variants:
                name = write_world(arguments.directory, shape, seed, variant)
                print(arguments.directory / name, file=sys.stderr)


if __name__ == "__main__":
    main()
