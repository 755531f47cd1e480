# SPDX-License-Identifier: BSD-3-Clause
"""The worlds of `scripts/evaluation/polygons.py`: a corridor and a hall in which a robot drives the same way again and
again, while what stands there changes between the transits. Everything follows from the world's name and the seed.

    python3 scripts/evaluation/polygon_worlds.py DIR [--worlds corridor hall] [--seeds 1 2]
        [--sweep off on both] [--initial-pose off on both]

NAME is WORLD_SEED, then _sweep with a sweep, then _lost without an initial pose, then _ and the numbers of the transits
if some of them are picked. Written are

    NAME.bag              /scan, /odom, /tf odom -> base_link, and /tf_static base_link -> laser (shifted and turned)
    NAME_tf.bag           the same, and map -> odom such that map -> base_link is the truth
    NAME_odometry.bag     (if asked for) the same, but true at the beginning of each transit only
    NAME.reflectors.yaml  where the reflectors are known to be: {reflectors: [{x, y, radius_m}]}
    NAME.truth.json       the truth, in the world's frame (map)

The truth: `transits`: [first scan's stamp, the time that none reaches] of each; `initial_pose`: [x, y, yaw] as it is
told, or null; `scans`: of each scan `stamp`, `transit`, the pose of base_link at the stamp (`x`, `y`, `yaw`),
`reflectors_in_sight`, and `walker`, [x, y] or null. `things`: `id`, `kind`, `optional` (it may be on the map but need
not), `outline` (closed), `circle` ([x, y, radius] or null), `present` (transits) and `length_m` of the outline. The
outline is divided in bins of equal length from its first point on, a circle from its point towards +x; of each bin
`first_s`: when a beam first hit it; `seen_s`: when `seen_scans` scans had; `first_free_s`, `free_s`: the same of beams
that went through its place after the thing had gone; or null. `in_sight`: runs [first, last] of scans that hit the
thing with two beams at least; `passed`: of scans whose beams went through a third of the gone outline.

All in the plane of the scanner: rays are cast exactly on line segments and circles. A walker is where it is in the
middle of a scan; everything else is at the time of each beam. Between the transits the robot is docked: in the corridor
it turns for the way back, in the hall it stands; odometry goes on."""

import argparse
import dataclasses
import json
import math
import pathlib
import sys

import numpy as np
from scipy.interpolate import CubicSpline

WORLDS = ("corridor", "hall")
TRANSITS = 8
SHORT = (1, 3, 5, 6)  # in which everything that changes does, the screen comes and goes, and a person walks in each
BEGIN_S = 1000.0  # the first odometry
SPEED_M_S, ACCELERATION_M_S2 = 0.5, 0.5
ON_S = 0.6  # the scanner is on so long before the robot sets off, and after it has stopped
DOCKED_S = 10.0  # with the scanner off
TURN_S = 6.0  # of them, for half a turn
LEAD_S = 1.0  # of odometry before the first scan
GRID_S = 0.001  # of the true path; between its points it is straight
ODOMETRY_PERIOD_S = 0.02

# As models/scanners/lms100.yaml, but it sees what is near as well, and beams over an edge may give a range between.
BEAMS, ANGLE_MIN_RAD, ANGLE_INCREMENT_RAD = 541, math.radians(-135.0), math.radians(0.5)
SCAN_PERIOD_S, SWEEP_S = 0.04, 0.03
RANGE_MIN_M, RANGE_MAX_M, RANGE_SIGMA_M, RANGE_QUANTUM_M = 0.05, 20.0, 0.012, 0.001
# Rays of a beam, over the middle two thirds of its 15 mrad, where most of its power is.
FOOTPRINT_RAD = np.array((-0.005, -0.0025, 0.0, 0.0025, 0.005))
CENTRE = len(FOOTPRINT_RAD) // 2
EDGE_M = 0.03  # least difference of ranges over a beam that makes it one across an edge
MIXED_MOST_M = 1.5  # beyond a pulse's length the echoes are apart
MIXED_LEAST_RATIO, MIXED_CHANCE = 0.5, 0.6
LOST_CHANCE = 0.002
GRAZING_COS, GRAZING_LOST = 0.12, 0.5
DARK_REFLECTIVITY, DARK_LOST = 0.1, 0.15  # at 10 m, with the square of the range
DIFFUSE_MOST = 345.0  # intensity: with its noise below 400
FADE_M = 25.0  # at this range intensity is half
INTENSITY_SIGMA = 0.04  # relative

ODOMETRY = {"scale": 0.01, "turn_scale": 0.015, "drift_rad_m": 0.003, "way_sigma_sqrt_m": 0.004,
            "turn_sigma_rad_sqrt_m": 0.006, "turn_sigma_sqrt_rad": 0.006}
INITIAL_M, INITIAL_RAD = 0.12, math.radians(4.0)  # the initial pose is good to

BIN_M = 0.01  # of an outline, for what was seen of it
SEEN_SCANS = 10  # a bin was seen, or seen to be free, after so many scans
FREE_MARGIN_M = 0.1  # so far behind a bin must the beams beside it end
GAP_M = 0.3  # between two neighbouring hits on a thing, at most
PASSED_PART = 1 / 3  # of the bins of what has gone, for a scan that has seen it to be gone
IN_SIGHT_BEAMS, IN_SIGHT_INTENSITY = 2, 420.0
CIRCLE_SIDES = 180


@dataclasses.dataclass(frozen=True)
class Material:
    reflectivity: float
    gloss: float = 0.0  # intensity of the reflection at right angles
    lobe_rad: float = 0.2  # of the gloss
    retro: float = 0.0  # intensity at any incidence, for reflectors


MATERIALS = {"plaster": Material(0.75), "wood": Material(0.5), "card": Material(0.4), "dark": Material(0.06),
             "ceramic": Material(0.85), "steel": Material(0.3), "glossy": Material(0.35, 700.0, 0.2),
             "trousers": Material(0.3, 550.0, 0.5), "reflector": Material(0.8, retro=1000.0)}


# --- things


@dataclasses.dataclass
class Thing:
    """A closed outline, or a circle. `present`: the transits in which it stands there."""

    id: str
    kind: str
    material: str
    outline: np.ndarray = None
    circle: tuple = None
    present: tuple = tuple(range(TRANSITS))

    def __post_init__(self):
        if self.circle is not None:
            x, y, radius = self.circle
            angle = 2.0 * math.pi / CIRCLE_SIDES * np.arange(CIRCLE_SIDES)
            self.outline = np.column_stack((x + radius * np.cos(angle), y + radius * np.sin(angle)))
            self.length_m = 2.0 * math.pi * radius
        else:
            self.outline = np.asarray(self.outline, float)
            self.length_m = float(np.hypot(*(np.roll(self.outline, -1, axis=0) - self.outline).T).sum())
        self.bins = max(8, math.ceil(self.length_m / BIN_M))

    @property
    def optional(self):
        """Whether it may be on the map but need not."""
        return self.kind == "reflector"

    def at(self, arcs_m):
        """Points of the outline."""
        arcs_m = np.asarray(arcs_m, float) % self.length_m
        if self.circle is not None:
            x, y, radius = self.circle
            return np.column_stack((x + radius * np.cos(arcs_m / radius), y + radius * np.sin(arcs_m / radius)))
        ends = np.vstack((self.outline, self.outline[:1]))
        arc = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(ends, axis=0).T))))
        return np.column_stack([np.interp(arcs_m, arc, ends[:, axis]) for axis in (0, 1)])

    def bin_centres(self):
        return self.at((np.arange(self.bins) + 0.5) * self.length_m / self.bins)


def placed(corners, x, y, yaw=0.0):
    c, s = math.cos(yaw), math.sin(yaw)
    return np.asarray(corners, float) @ np.array(((c, s), (-s, c))) + (x, y)


def rectangle(length, width):
    x, y = length / 2, width / 2
    return ((-x, -y), (x, -y), (x, y), (-x, y))


def l_shape(length, width, thickness):
    x, y, t = length / 2, width / 2, thickness
    return ((-x, -y), (x, -y), (x, t - y), (t - x, t - y), (t - x, y), (-x, y))


def u_shape(length, depth, thickness):
    """Open towards +y."""
    x, y, t = length / 2, depth / 2, thickness
    return ((-x, -y), (x, -y), (x, y), (x - t, y), (x - t, t - y), (t - x, t - y), (t - x, y), (-x, y))


# --- ray casting


@dataclasses.dataclass
class Hits:
    """Of each ray; without a hit the range is infinite and the thing -1."""

    range_m: np.ndarray
    thing: np.ndarray
    arc_m: np.ndarray
    cos_incidence: np.ndarray


class Caster:
    """Casts rays on things. Circles given with a cast (a walker's) are things after those."""

    def __init__(self, things):
        starts, edges, owners, arcs, circles = [], [], [], [], []
        for i, thing in enumerate(things):
            if thing.circle is not None:
                circles.append((*thing.circle, i))
                continue
            edge = np.roll(thing.outline, -1, axis=0) - thing.outline
            length = np.hypot(*edge.T)
            starts.append(thing.outline)
            edges.append(edge)
            owners += [i] * len(edge)
            arcs.append(np.cumsum(length) - length)
        self.count = len(things)
        self.starts = np.vstack(starts) if starts else np.zeros((0, 2))
        self.edges = np.vstack(edges) if edges else np.zeros((0, 2))
        self.lengths = np.hypot(*self.edges.T)
        self.owners = np.array(owners, int)
        self.arcs = np.concatenate(arcs) if arcs else np.zeros(0)
        self.circles = np.array(circles, float).reshape(-1, 4)

    def _pairs(self, origins, directions):
        """(ray, edge) of the rays that may hit it: those between its ends, as seen from any of the origins."""
        middle = origins.mean(0)
        spread_m = np.hypot(*(origins - middle).T).max()
        start = self.starts - middle
        part = np.clip(-(start * self.edges).sum(1) / np.maximum(self.lengths**2, 1e-18), 0.0, 1.0)
        away_m = np.hypot(*(start + part[:, None] * self.edges).T)
        end = start + self.edges
        first = np.arctan2(start[:, 1], start[:, 0])
        turn = (np.arctan2(end[:, 1], end[:, 0]) - first + math.pi) % (2.0 * math.pi) - math.pi
        with np.errstate(divide="ignore", invalid="ignore"):
            margin = np.arcsin(np.minimum(spread_m / away_m, 1.0)) + 1e-6
        low = first + np.minimum(turn, 0.0) - margin
        width = np.abs(turn) + 2.0 * margin
        width[~(away_m > spread_m + 1e-6) | (width > 2.0 * math.pi)] = 2.0 * math.pi
        low = (low + math.pi) % (2.0 * math.pi) - math.pi
        angle = np.arctan2(directions[:, 1], directions[:, 0])
        order = np.argsort(angle)
        round_twice = np.concatenate((angle[order], angle[order] + 2.0 * math.pi))
        begin = np.searchsorted(round_twice, low)
        counts = np.minimum(np.searchsorted(round_twice, low + width, side="right") - begin, len(order))
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        return order[(np.repeat(begin, counts) + within) % len(order)], np.repeat(np.arange(len(counts)), counts)

    def cast(self, origins, directions, extra_circles=()):
        """`origins`: one or one per ray; `directions` are of unit length."""
        count = len(directions)
        origins = np.broadcast_to(origins, (count, 2))
        ox, oy, dx, dy = origins[:, 0, None], origins[:, 1, None], directions[:, 0, None], directions[:, 1, None]
        rows = np.arange(count)
        best = Hits(np.full(count, np.inf), np.full(count, -1), np.zeros(count), np.zeros(count))
        if len(self.starts):
            ray, edge = self._pairs(origins, directions)
            ex, ey = self.edges[edge].T
            own_dx, own_dy = directions[ray].T
            to_x, to_y = (self.starts[edge] - origins[ray]).T
            with np.errstate(divide="ignore", invalid="ignore"):
                inverse = 1.0 / (own_dx * ey - own_dy * ex)
                t = (to_x * ey - to_y * ex) * inverse
                u = (to_x * own_dy - to_y * own_dx) * inverse
                hit = np.flatnonzero((u >= 0.0) & (u <= 1.0) & (t > 0.0))
            farthest_first = hit[np.argsort(t[hit], kind="stable")[::-1]]
            nearest = np.full(count, -1)
            nearest[ray[farthest_first]] = farthest_first  # the last one stays
            rows_hit = np.flatnonzero(nearest >= 0)
            pair = nearest[rows_hit]
            own = edge[pair]
            best.range_m[rows_hit] = t[pair]
            best.thing[rows_hit] = self.owners[own]
            best.arc_m[rows_hit] = self.arcs[own] + u[pair] * self.lengths[own]
            across = np.abs(own_dx[pair] * ey[pair] - own_dy[pair] * ex[pair])
            best.cos_incidence[rows_hit] = across / self.lengths[own]
        own = [(x, y, radius, self.count + i) for i, (x, y, radius) in enumerate(extra_circles)]
        circles = np.vstack((self.circles, np.array(own, float).reshape(-1, 4)))
        if len(circles):
            x, y, radius, owner = circles.T
            to_x, to_y = x - ox, y - oy
            along = to_x * dx + to_y * dy
            across = to_x * dy - to_y * dx
            inside = radius**2 - across**2
            t = np.where(inside >= 0.0, along - np.sqrt(np.maximum(inside, 0.0)), np.inf)
            t[t <= 0.0] = np.inf
            nearest = t.argmin(1)
            range_m = t[rows, nearest]
            nearer = range_m < best.range_m
            point = origins + np.where(nearer, range_m, 0.0)[:, None] * directions
            normal = point - circles[nearest, :2]
            best.range_m = np.where(nearer, range_m, best.range_m)
            best.thing = np.where(nearer, owner[nearest].astype(int), best.thing)
            arc = np.arctan2(normal[:, 1], normal[:, 0]) % (2.0 * math.pi) * radius[nearest]
            best.arc_m = np.where(nearer, arc, best.arc_m)
            cos = np.sqrt(np.maximum(inside[rows, nearest], 0.0)) / radius[nearest]
            best.cos_incidence = np.where(nearer, cos, best.cos_incidence)
        return best


# --- scanner


@dataclasses.dataclass
class Scan:
    range_m: np.ndarray  # +inf: lost
    intensity: np.ndarray
    thing: np.ndarray  # -1 where the beam is lost or between two things
    arc_m: np.ndarray


def intensities(materials, hits):
    """Without a unit. Far things and those at grazing incidence are darker."""
    reflectivity, gloss, lobe_rad, retro = np.array(
        [(m.reflectivity, m.gloss, m.lobe_rad, m.retro) for m in materials] + [(0.0, 0.0, 1.0, 0.0)])[hits.thing].T
    fade = 1.0 / (1.0 + (np.where(np.isfinite(hits.range_m), hits.range_m, 0.0) / FADE_M)**2)
    diffuse = np.minimum(420.0 * reflectivity * np.sqrt(hits.cos_incidence), DIFFUSE_MOST)
    incidence = np.arccos(np.clip(hits.cos_incidence, 0.0, 1.0))
    glossy = gloss * np.exp(-(incidence / lobe_rad)**2)
    returned = retro * (0.55 + 0.45 * hits.cos_incidence)
    return np.where(hits.thing < 0, 0.0, (np.maximum(diffuse, returned) + glossy) * fade), reflectivity, gloss


def measure(chance, materials, hits):
    """A scan of the rays of all beams, (BEAMS, rays of a beam)."""
    power, reflectivity, gloss = intensities(materials, hits)
    shape = (-1, len(FOOTPRINT_RAD))
    power, reflectivity, gloss = (values.reshape(shape) for values in (power, reflectivity, gloss))
    ranges, things, arcs, cos = (values.reshape(shape) for values in (hits.range_m, hits.thing, hits.arc_m,
                                                                     hits.cos_incidence))
    beams = len(ranges)
    rows = np.arange(beams)
    sorted_m = np.sort(ranges, axis=1)
    # The widest gap between the rays' ranges parts a beam in what is near and what is far. A slanted surface has gaps
    # as well, of one thing: these are no edges.
    with np.errstate(invalid="ignore"):
        gaps = np.nan_to_num(np.diff(sorted_m, axis=1), nan=0.0, posinf=np.inf)
    widest = gaps.argmax(1)
    limit_m = sorted_m[rows, widest]
    near = ranges <= limit_m[:, None]
    is_one = (things == things[:, :1]).all(1) & (np.abs(arcs.max(1) - arcs.min(1)) < GAP_M)
    is_edge = (gaps[rows, widest] > EDGE_M) & ~is_one
    near_power, far_power = (power * near).sum(1), (power * ~near).sum(1)
    of_near = near_power >= far_power
    wins = np.where(is_edge[:, None], near == of_near[:, None], True)
    # The ray of the winner that is nearest to the beam's middle.
    distance = np.abs(np.arange(len(FOOTPRINT_RAD)) - CENTRE)
    ray = np.where(wins, distance, 99).argmin(1)
    range_m, thing, arc_m = ranges[rows, ray].copy(), things[rows, ray].copy(), arcs[rows, ray]
    intensity = np.where(is_edge, np.maximum(near_power, far_power) / len(FOOTPRINT_RAD), power[:, CENTRE])

    draws = chance.random((3, beams))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.minimum(near_power, far_power) / np.maximum(near_power, far_power)
        finite = np.where(np.isfinite(ranges), ranges, 0.0)
        mean_m = (finite * power).sum(1) / power.sum(1)
        mixed = (is_edge & (ratio > MIXED_LEAST_RATIO) & (gaps[rows, widest] < MIXED_MOST_M)
                 & (draws[0] < MIXED_CHANCE))
    range_m = np.where(mixed, mean_m, range_m)
    intensity = np.where(mixed, power.mean(1), intensity)
    thing[mixed] = -1

    own_cos, own_reflectivity, own_gloss = cos[rows, ray], reflectivity[rows, ray], gloss[rows, ray]
    lost = LOST_CHANCE + GRAZING_LOST * np.clip(1.0 - own_cos / GRAZING_COS, 0.0, 1.0)
    lost += np.where(own_reflectivity < DARK_REFLECTIVITY, DARK_LOST * (np.minimum(range_m, 20.0) / 10.0)**2, 0.0)
    lost += np.where((own_gloss > 0.0) & (own_cos < 0.5), 0.1, 0.0)
    is_lost = (draws[1] < lost) | ~np.isfinite(range_m) | (range_m > RANGE_MAX_M) | (range_m < RANGE_MIN_M)
    range_m = range_m + RANGE_SIGMA_M * chance.standard_normal(beams)
    intensity = intensity * (1.0 + INTENSITY_SIGMA * chance.standard_normal(beams))
    range_m = np.where(is_lost, np.inf, np.maximum(RANGE_MIN_M, np.round(range_m / RANGE_QUANTUM_M) * RANGE_QUANTUM_M))
    return Scan(range_m, np.where(is_lost, 0.0, np.maximum(0.0, np.round(intensity))), np.where(is_lost, -1, thing),
                arc_m)


# --- the way


class Way:
    """A path by its arc length; beyond the ends straight on, or round and round."""

    def __init__(self, points, closed=False):
        points = np.asarray(points, float)
        if closed:
            points = np.vstack((points, points[:1]))
        knots = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
        spline = CubicSpline(knots, points, bc_type="periodic" if closed else "natural")
        fine = np.linspace(0.0, knots[-1], 4001)
        places = spline(fine)
        arc = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))))
        self.length_m, self.closed = float(arc[-1]), closed
        self._by_arc = CubicSpline(arc, places, bc_type="periodic" if closed else "natural")

    def at(self, arcs_m):
        """Places, and the unit normals to the left."""
        arcs_m = np.asarray(arcs_m, float)
        inside = arcs_m % self.length_m if self.closed else np.clip(arcs_m, 0.0, self.length_m)
        along = self._by_arc(inside, 1)
        along = along / np.hypot(along[..., 0], along[..., 1])[..., None]
        beyond = 0.0 if self.closed else (arcs_m - inside)[..., None]
        return self._by_arc(inside) + beyond * along, np.stack((-along[..., 1], along[..., 0]), axis=-1)


def driven_m(length_m, times_s):
    """The way after a time: it speeds up, cruises and slows down."""
    v, a = SPEED_M_S, ACCELERATION_M_S2
    ramp_s, total_s = v / a, length_m / v + v / a
    t = np.clip(times_s, 0.0, total_s)
    up = 0.5 * a * np.minimum(t, ramp_s)**2
    flat = v * np.clip(t - ramp_s, 0.0, total_s - 2.0 * ramp_s)
    late = np.clip(t - (total_s - ramp_s), 0.0, ramp_s)
    return up + flat + v * late - 0.5 * a * late**2


@dataclasses.dataclass
class Drive:
    """The true poses of base_link on a grid of time, and when the scanner is on."""

    begin_s: float
    poses: np.ndarray  # x, y, yaw; yaw without jumps
    transits: list  # (first scan, the time that none reaches)

    def at(self, times_s):
        at = (np.asarray(times_s, float) - self.begin_s) / GRID_S
        low = np.clip(at.astype(int), 0, len(self.poses) - 2)
        part = (at - low)[..., None]
        return self.poses[low] * (1.0 - part) + self.poses[low + 1] * part

    @property
    def end_s(self):
        return self.begin_s + GRID_S * (len(self.poses) - 1)


def drive_along(chance, way, transits):
    """There and back on an open way, with half a turn at each end; round after round on a closed one. The robot is off
    the way by up to 3 cm, as it happens."""
    pieces, spans, now = [], [], BEGIN_S
    yaw = None

    def stand(place, heading, duration_s, turn_rad=0.0, turn_s=0.0):
        nonlocal now
        t = GRID_S * np.arange(round(duration_s / GRID_S))
        if turn_s:
            part = np.clip(t / turn_s, 0.0, 1.0)
            heading = heading + turn_rad * (3.0 * part**2 - 2.0 * part**3)
        pieces.append(np.column_stack((np.tile(place, (len(t), 1)), np.broadcast_to(heading, len(t)))))
        now += len(t) * GRID_S

    drive_s = round((way.length_m / SPEED_M_S + SPEED_M_S / ACCELERATION_M_S2) / GRID_S) * GRID_S
    for transit in range(transits):
        back = not way.closed and transit % 2 == 1
        arc = np.linspace(0.0, way.length_m, 2401)
        place, normal = way.at(arc)
        part = arc / way.length_m
        off_m = (chance.uniform(0.01, 0.03) * np.sin(2.0 * math.pi * (chance.integers(1, 4) * part + chance.random()))
                 * (16.0 * (part * (1.0 - part))**2))
        place = place + off_m[:, None] * normal
        if back:
            place = place[::-1]
        spline = CubicSpline(arc, place)
        s = driven_m(way.length_m, GRID_S * np.arange(round(drive_s / GRID_S)))
        along = spline(s, 1)
        heading = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
        if yaw is not None:
            heading += 2.0 * math.pi * round((yaw - heading[0]) / (2.0 * math.pi))
        if transit == 0:
            stand(place[0], heading[0], LEAD_S)
        begin = now
        stand(place[0], heading[0], ON_S)
        pieces.append(np.column_stack((spline(s), heading)))
        now += len(s) * GRID_S
        yaw = heading[-1]
        stand(place[-1], yaw, ON_S)
        spans.append((begin, now))
        turn_rad = 0.0 if way.closed else math.pi
        if transit + 1 < transits:
            stand(place[-1], yaw, DOCKED_S, turn_rad, TURN_S)
            yaw += turn_rad
        else:
            stand(place[-1], yaw, LEAD_S)
    return Drive(BEGIN_S, np.vstack(pieces), spans)


# --- a walker


@dataclasses.dataclass
class Walk:
    """Along the robot's way: (time of the transit, arc length) in pairs, beside the way by `aside_m`; before the first
    and after the last it is not there. Two legs, or one circle at the height of the hips."""

    times_s: tuple
    arcs_m: tuple
    aside_m: float
    legs: bool

    def at(self, way, t_s, back):
        """Circles at a time of the transit, and the middle; or none."""
        if not self.times_s[0] <= t_s <= self.times_s[-1]:
            return (), None
        s = float(np.interp(t_s, self.times_s, self.arcs_m))
        ahead = float(np.interp(t_s + 0.01, self.times_s, self.arcs_m)) - s
        place, normal = way.at(way.length_m - s if back else s)
        left = -normal if back else normal
        middle = place + self.aside_m * left
        if not self.legs:
            return ((*middle, 0.15),), middle
        swing = 0.22 * math.sin(2.0 * math.pi * t_s / 1.1) if abs(ahead) > 1e-6 else 0.0
        forward = np.array((left[1], -left[0]))
        return tuple((*(middle + sign * (0.1 * left + swing * forward)), 0.065) for sign in (1.0, -1.0)), middle


def walks_of(chance, way, transits, aside_m):
    """Who walks in which transit: ahead; towards the robot; towards it with a stop; ahead with a stop. A stop takes
    3 s. The shapes alternate, the first by chance."""
    length = way.length_m
    drive_s = length / SPEED_M_S + SPEED_M_S / ACCELERATION_M_S2
    legs = bool(chance.integers(2))
    far = length + (1.0 if not way.closed else -3.0)
    meet = length * chance.uniform(0.5, 0.6)
    walks = {}
    side = aside_m * (1 if chance.integers(2) or way.closed else -1)
    lead = 2.2
    walks[1] = Walk((0.0, drive_s - 5.0), (lead, lead + 0.97 * SPEED_M_S * (drive_s - 5.0)), side, legs)
    walks[3] = Walk((0.5, 0.5 + (far + 0.6) / 0.8), (far, -0.6), side, not legs)
    at_s = (far - meet) / 0.7
    walks[5] = Walk((0.0, at_s, at_s + 3.0, at_s + 3.0 + (meet + 0.6) / 0.7), (far, meet, meet, -0.6), -side
                    if not way.closed else side, legs)
    walks[6] = Walk((0.0, 5.0, 8.0, 8.0 + (far - 7.0) / 0.6), (4.5, 7.0, 7.0, far), side, not legs)
    return {transit: walk for transit, walk in walks.items() if transit < transits}


# --- worlds


@dataclasses.dataclass
class World:
    name: str  # its kind
    seed: int
    things: list
    way: Way
    reflectors: list  # as they are known: (x, y, radius)
    walks: dict
    mount: tuple  # of the scanner on base_link: x, y, yaw
    transits: int


def room(x0, y0, x1, y1, niche, pilaster):
    """The outline of the walls, seen from inside: a niche (middle, width, depth) at y1 and a pilaster (middle, width,
    depth) at y0."""
    n, n_width, n_depth = niche
    p, p_width, p_depth = pilaster
    return ((x0, y0), (p - p_width / 2, y0), (p - p_width / 2, y0 + p_depth), (p + p_width / 2, y0 + p_depth),
            (p + p_width / 2, y0), (x1, y0), (x1, y1), (n + n_width / 2, y1), (n + n_width / 2, y1 + n_depth),
            (n - n_width / 2, y1 + n_depth), (n - n_width / 2, y1), (x0, y1))


def transits_of(*spans):
    return tuple(k for first, last in spans for k in range(first, last + 1))


def reflector_things(chance, places, radius_m, changes):
    """Things, and the list as it is known. With changes one vanishes before transit 4 and one moves before transit
    5."""
    known = [(x, y, radius_m) for x, y in places]
    things = []
    vanishes, moves = (int(i) for i in chance.permutation(len(places))[:2]) if changes else (-1, -1)
    for i, (x, y, radius) in enumerate(known):
        name = f"reflector_{i + 1}"
        if i == vanishes:
            things.append(Thing(name, "reflector", "reflector", circle=known[i], present=transits_of((0, 3))))
        elif i == moves:
            things.append(Thing(name, "reflector", "reflector", circle=known[i], present=transits_of((0, 4))))
            away = 0.3 if x < np.mean([place[0] for place in places]) else -0.3  # stays inside
            things.append(Thing(f"{name}_moved", "reflector", "reflector", circle=(x + away, y, radius),
                                present=transits_of((5, TRANSITS - 1))))
        else:
            things.append(Thing(name, "reflector", "reflector", circle=known[i]))
    return things, known


def boxes(chance, slots, yaw_rad):
    """Those that change, at six places: one appears, one moves, one goes, one goes and comes back."""
    def box(name, slot, present, size):
        x, y = slots[slot]
        return Thing(name, "box", "card", placed(rectangle(*size), x, y, turns[slot]), present=present)

    turns = chance.uniform(-yaw_rad, yaw_rad, len(slots))
    sizes = np.column_stack((chance.uniform(0.3, 0.5, 4), chance.uniform(0.22, 0.32, 4)))
    last = TRANSITS - 1
    return [box("box_appears", 0, transits_of((2, last)), sizes[0]),
            box("box_moves", 1, transits_of((0, 3)), sizes[1]),
            box("box_moved", 2, transits_of((4, last)), sizes[1]),
            box("box_goes", 3, transits_of((0, 2)), sizes[2]),
            box("box_goes_late", 4, transits_of((1, last - 1)), sizes[2]),
            box("box_was_here", 5, transits_of((1, 3)), sizes[3]),
            box("box_is_back", 5, transits_of((6, last)), sizes[3])]


def behind_screen(chance, x, y, wall_y):
    """Two crates by a wall at +y of (x, y); a screen hides them for four transits. One goes meanwhile."""
    side = 1.0 if wall_y > y else -1.0
    depth = abs(wall_y - y) - 0.01
    screen = np.array(u_shape(1.1, depth, 0.03)) * (1.0, side)
    middle = (x, y + side * depth / 2)
    size = chance.uniform(0.2, 0.26, 2)
    return [Thing("hidden_stays", "crate", "wood", placed(rectangle(0.3, size[0]), x - 0.26, middle[1] + 0.02 * side)),
            Thing("hidden_goes", "crate", "wood", placed(rectangle(0.28, size[1]), x + 0.26, middle[1] + 0.02 * side),
                  present=transits_of((0, 3))),
            Thing("screen", "screen", "wood", placed(screen, *middle), present=transits_of((2, 5)))]


def corridor(seed, transits):
    chance = np.random.default_rng((1, seed))
    j = lambda size=0.12: chance.uniform(-size, size)
    x1, y1 = 15.6, 1.6
    walls = room(0.0, -y1, x1, y1, (5.6 + j(), 1.3, 0.4), (3.7 + j(), 0.4, 0.2))
    things = [
        Thing("walls", "walls", "plaster", walls),
        Thing("post", "post", "steel", placed(rectangle(0.05, 0.05), 2.2 + j(), -1.25, 0.3 + j())),
        Thing("crate", "crate", "wood", placed(rectangle(0.6, 0.36), 5.4 + j(), -1.38, j(0.05))),
        Thing("l_shape", "l_shape", "wood", placed(l_shape(0.7, 0.38, 0.12), 7.6 + j(), -1.38)),
        Thing("by_the_wall", "box", "card", placed(rectangle(0.45, 0.28), 9.9 + j(), -1.31)),
        Thing("barrel", "barrel", "dark", circle=(3.2 + j(), 1.37, 0.21)),
        Thing("pillar", "pillar", "glossy", circle=(12.4 + j(), -1.36, 0.11)),
        Thing("cup", "cup", "ceramic", circle=(7.3 + j(), 1.15 + j(0.03), 0.04),
              present=transits_of((1, TRANSITS - 1))),
        *behind_screen(chance, 9.1 + j(), 1.15, y1),
    ]
    slots = [(x + j(), y + j(0.02)) for x, y in ((11.3, 1.36), (1.3, 1.36), (13.6, 1.36), (6.4, -1.36), (11.2, -1.36),
                                                 (13.9, -1.36))]
    things += boxes(chance, slots, 0.08)
    places = ((0.6 + j(0.05), -1.45), (2.9 + j(0.05), -1.48), (4.55 + j(0.08), 1.48), (8.75 + j(0.08), -1.48),
              (10.25 + j(0.08), 1.48), (12.95 + j(0.05), -1.48), (15.4, -0.5 + j(0.3)))
    added, known = reflector_things(chance, places, 0.05, seed % 2 == 0)
    x = np.linspace(1.6, 13.6, 7)
    y = np.concatenate(([0.0], chance.uniform(-0.2, 0.2, 5), [0.0]))
    way = Way(np.column_stack((x, y)))
    return World("corridor", seed, things + added, way, known, walks_of(chance, way, transits, 0.65),
                 (0.16, 0.01, 0.0), transits)


def hall(seed, transits):
    chance = np.random.default_rng((2, seed))
    j = lambda size=0.25: chance.uniform(-size, size)
    x1, y1 = 8.0, 6.0
    walls = room(-x1, -y1, x1, y1, (-3.5 + j(), 1.6, 0.5), (2.5 + j(), 0.5, 0.25))
    things = [
        Thing("walls", "walls", "plaster", walls),
        Thing("post", "post", "steel", placed(rectangle(0.05, 0.05), 3.3 + j(), 0.9 + j(), 0.3 + j())),
        Thing("crate", "crate", "wood", placed(rectangle(0.8, 0.6), -4.0 + j(), -3.0 + j(), 0.6 + j())),
        Thing("l_shape", "l_shape", "wood", placed(l_shape(1.1, 0.8, 0.25), 4.6 + j(), -2.6 + j(), 2.4 + j())),
        Thing("by_the_wall", "box", "card", placed(rectangle(0.7, 0.4), -0.3 + j(), -y1 + 0.35)),
        Thing("barrel", "barrel", "dark", circle=(-3.7 + j(), 2.2 + j(), 0.29)),
        Thing("pillar", "pillar", "glossy", circle=(1.6 + j(), 4.3 + j(), 0.15)),
        Thing("cup", "cup", "ceramic", circle=(0.2 + j(), -3.5 + j(0.1), 0.04), present=transits_of((1, TRANSITS - 1))),
        *behind_screen(chance, 5.0 + j(), y1 - 0.5, y1),
    ]
    slots = [(x + j(0.1), y + j(0.1)) for x, y in ((3.4, 3.2), (-1.4, 3.9), (-5.6, 0.2), (5.4, 0.8), (-1.9, -4.4),
                                                   (2.4, -4.2))]
    things += boxes(chance, slots, 1.5)
    places = ((-7.5 + j(0.2), -4.5 + j()), (-5.4 + j(0.2), 3.8 + j()), (3.6 + j(0.1), 5.2 + j(0.2)),
              (7.0 + j(0.2), -1.0 + j(0.3)), (0.9 + j(0.1), -5.1 + j(0.2)))
    added, known = reflector_things(chance, places, 0.06, seed % 2 == 0)
    angle = 2.0 * math.pi / 8 * np.arange(8) - math.pi / 2
    size = chance.uniform(0.9, 1.1, 8)
    points = np.column_stack((2.15 * size * np.cos(angle), 1.62 * size * np.sin(angle)))
    way = Way(points, closed=True)
    return World("hall", seed, things + added, way, known, walks_of(chance, way, transits, -0.7),
                 (0.14, -0.03, math.radians(5.0)), transits)


MAKERS = {"corridor": corridor, "hall": hall}


def make_world(name, seed, transits=TRANSITS):
    return MAKERS[name](seed, transits)


def only_transits(world, picked):
    """The world in some of its transits, as if it were never driven through in the others."""
    numbers = {transit: k for k, transit in enumerate(picked)}
    things = [dataclasses.replace(thing, present=tuple(numbers[k] for k in picked if k in thing.present))
              for thing in world.things]
    return dataclasses.replace(world, things=[thing for thing in things if thing.present], transits=len(picked),
                               walks={numbers[k]: walk for k, walk in world.walks.items() if k in numbers})


# --- the truth of what was seen


class Sight:
    """When the bins of the outlines were first hit, had been seen by SEEN_SCANS scans, were first passed by the beams
    after the thing had gone, and had been passed by SEEN_SCANS scans."""

    def __init__(self, things):
        self.things = things
        counts = [thing.bins for thing in things]
        self.offsets = np.concatenate(([0], np.cumsum(counts)))
        self.lengths_m = np.array([thing.length_m for thing in things] + [1.0])
        self.bins = np.array(counts + [1])
        self.centres = np.vstack([thing.bin_centres() for thing in things])
        self.seen_count, self.free_count = (np.zeros(self.offsets[-1], int) for _ in range(2))
        self.first_s, self.seen_s, self.first_free_s, self.free_s = (np.full(self.offsets[-1], np.nan)
                                                                     for _ in range(4))
        self.in_sight, self.passed = ([[] for _ in things] for _ in range(2))  # scans, as [first, last] of runs

    @staticmethod
    def _extend(runs, scan):
        if runs and runs[-1][1] == scan - 1:
            runs[-1][1] = scan
        else:
            runs.append([scan, scan])

    def add_hits(self, scan, stamp_s, things, arcs_m, points):
        """`things`: of each beam, an index or -1. What is between two neighbouring hits was seen as well."""
        known = (things >= 0) & (things < len(self.things))
        index = np.where(known, things, -1)
        for thing in np.flatnonzero(np.bincount(things[known], minlength=len(self.things)) >= IN_SIGHT_BEAMS):
            self._extend(self.in_sight[thing], scan)
        at = np.minimum((arcs_m / self.lengths_m[index] * self.bins[index]).astype(int), self.bins[index] - 1)
        edge = np.zeros(self.offsets[-1] + 1, int)

        def mark(thing, first, last):
            np.add.at(edge, self.offsets[thing] + first, 1)
            np.add.at(edge, self.offsets[thing] + last + 1, -1)

        mark(index[known], at[known], at[known])
        one = index[:-1]
        along = arcs_m[1:] - arcs_m[:-1]
        length = self.lengths_m[one]
        along = along - length * np.round(along / length)
        chord = np.hypot(*(points[1:] - points[:-1]).T)
        joined = known[:-1] & known[1:] & (one == index[1:]) & (np.abs(along) <= np.minimum(GAP_M, 1.5 * chord + 0.005))
        thing, along = one[joined], along[joined]
        first = np.where(along >= 0.0, at[:-1][joined], at[1:][joined])
        last = np.where(along >= 0.0, at[1:][joined], at[:-1][joined])
        over = first > last  # across the outline's beginning
        mark(thing[~over], first[~over], last[~over])
        mark(thing[over], first[over], self.bins[thing[over]] - 1)
        mark(thing[over], np.zeros(over.sum(), int), last[over])
        seen = np.cumsum(edge[:-1]) > 0
        self.seen_count += seen
        self.first_s[seen & (self.seen_count == 1)] = stamp_s
        self.seen_s[seen & (self.seen_count == SEEN_SCANS)] = stamp_s

    def add_free(self, scan, stamp_s, gone, range_m, pose_of_beam):
        """`gone`: indices of things that are not there any more. `pose_of_beam` gives the scanner's poses of beams."""
        if not gone:
            return
        bins = np.concatenate([np.arange(self.offsets[i], self.offsets[i + 1]) for i in gone])
        beam = np.zeros(len(bins))
        for _ in range(2):  # the beam's time depends on the beam
            poses = pose_of_beam(beam)
            away = self.centres[bins] - poses[:, :2]
            bearing = np.arctan2(away[:, 1], away[:, 0]) - poses[:, 2] - ANGLE_MIN_RAD
            beam = np.clip(bearing % (2.0 * math.pi) / ANGLE_INCREMENT_RAD, 0.0, 720.0)
        inside = beam <= BEAMS - 1
        low = np.minimum(beam.astype(int), BEAMS - 2)
        behind_m = np.minimum(np.where(np.isfinite(range_m[low]), range_m[low], 0.0),
                              np.where(np.isfinite(range_m[low + 1]), range_m[low + 1], 0.0))
        free = bins[inside & (behind_m > np.hypot(*away.T) + FREE_MARGIN_M)]
        self.free_count[free] += 1
        self.first_free_s[free[self.free_count[free] == 1]] = stamp_s
        passed = np.zeros(self.offsets[-1], bool)
        passed[free] = True
        for i in gone:
            own = passed[self.offsets[i]:self.offsets[i + 1]]
            if own.mean() >= PASSED_PART:
                self._extend(self.passed[i], scan)
        self.free_s[free[self.free_count[free] == SEEN_SCANS]] = stamp_s


# --- simulation


def composed(a, b):
    """Poses (x, y, yaw): a, then b in its axes."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack((a[..., 0] + c * b[..., 0] - s * b[..., 1], a[..., 1] + s * b[..., 0] + c * b[..., 1],
                     a[..., 2] + b[..., 2]), axis=-1)


def inverse(a):
    a = np.asarray(a, float)
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack((-c * a[..., 0] - s * a[..., 1], s * a[..., 0] - c * a[..., 1], -a[..., 2]), axis=-1)


def odometry_of(chance, drive):
    """Stamps, poses in odom, (v, w), and the variances along x, y and yaw that have accumulated."""
    stamps = drive.begin_s + ODOMETRY_PERIOD_S * np.arange(int((drive.end_s - drive.begin_s) / ODOMETRY_PERIOD_S))
    true = drive.at(stamps)
    step = composed(inverse(true[:-1]), true[1:])
    way, turn = step[:, 0], step[:, 2]
    scale = 1.0 + ODOMETRY["scale"] * chance.uniform(-1.0, 1.0)
    turn_scale = 1.0 + ODOMETRY["turn_scale"] * chance.uniform(-1.0, 1.0)
    drift_rad_m = ODOMETRY["drift_rad_m"] * chance.uniform(-1.0, 1.0)
    way_sigma = ODOMETRY["way_sigma_sqrt_m"] * np.sqrt(np.abs(way))
    turn_sigma = np.hypot(ODOMETRY["turn_sigma_rad_sqrt_m"] * np.sqrt(np.abs(way)),
                          ODOMETRY["turn_sigma_sqrt_rad"] * np.sqrt(np.abs(turn)))
    way = scale * way + way_sigma * chance.standard_normal(len(way))
    turn = turn_scale * turn + drift_rad_m * way + turn_sigma * chance.standard_normal(len(turn))
    yaw = np.concatenate(([0.0], np.cumsum(turn)))
    middle = yaw[:-1] + 0.5 * turn
    zero = np.zeros(1)
    poses = np.column_stack((np.concatenate((zero, np.cumsum(way * np.cos(middle)))),
                             np.concatenate((zero, np.cumsum(way * np.sin(middle)))), yaw))
    speeds = np.vstack((np.zeros((1, 2)), np.column_stack((way, turn)) / ODOMETRY_PERIOD_S))
    path_m = np.concatenate((zero, np.cumsum(np.abs(step[:, 0]))))
    turned = np.concatenate((zero, np.cumsum(np.abs(step[:, 2]))))
    yaw_variance = np.concatenate((zero, np.cumsum(turn_sigma**2))) + (0.01 * turned)**2 + (0.002 * path_m)**2
    variance = np.concatenate((zero, np.cumsum(way_sigma**2))) + (0.006 * path_m)**2 + yaw_variance * path_m**2 / 3.0
    return stamps, poses, speeds, variance, yaw_variance


class Simulation:
    """`scans()` gives (stamp, transit, Scan) one after the other; then `truth()`."""

    def __init__(self, world, sweep=False, with_initial_pose=True):
        self.world, self.sweep = world, sweep
        kind = WORLDS.index(world.name) + 1
        stream = lambda which: np.random.default_rng((kind, world.seed, which))
        self.drive = drive_along(stream(10), world.way, world.transits)
        self.odometry = odometry_of(stream(11), self.drive)
        self._noise = stream(12)
        chance = stream(13)
        self.initial_pose = None
        if with_initial_pose:
            angle, away = chance.uniform(0.0, 2.0 * math.pi), INITIAL_M * math.sqrt(chance.random())
            error = (away * math.cos(angle), away * math.sin(angle), INITIAL_RAD * chance.uniform(-1.0, 1.0))
            self.initial_pose = self.drive.at(BEGIN_S) + error
        self.time_increment_s = SWEEP_S / (BEAMS - 1) if sweep else 0.0
        self.sight = Sight(world.things)
        self._rows = {key: [] for key in ("stamp", "transit", "x", "y", "yaw", "reflectors_in_sight", "walker")}

    def scans(self):
        world, mount = self.world, np.array(self.world.mount)
        angles = ANGLE_MIN_RAD + ANGLE_INCREMENT_RAD * np.arange(BEAMS)
        rays_rad = (angles[:, None] + FOOTPRINT_RAD).ravel()
        after_s = self.time_increment_s * np.arange(BEAMS)
        trousers = MATERIALS["trousers"]
        scans = 0
        for transit, (begin_s, end_s) in enumerate(self.drive.transits):
            here = [i for i, thing in enumerate(world.things) if transit in thing.present]
            gone = [i for i, thing in enumerate(world.things) if max(thing.present) < transit]
            caster = Caster([world.things[i] for i in here])
            materials = [MATERIALS[world.things[i].material] for i in here]
            index_of = np.array(here + [-1] * 3)  # a walker's circles, and no thing, are none
            reflectors = [k for k, i in enumerate(here) if world.things[i].kind == "reflector"]
            walk = world.walks.get(transit)
            back = not world.way.closed and transit % 2 == 1
            for k in range(math.floor((end_s - begin_s - SWEEP_S) / SCAN_PERIOD_S)):
                stamp_s = round(begin_s + k * SCAN_PERIOD_S, 6)
                base = self.drive.at(stamp_s + after_s)
                poses = composed(base, mount)
                legs, middle = ((), None) if walk is None else walk.at(
                    world.way, stamp_s + 0.5 * after_s[-1] - begin_s - ON_S, back)
                heading = np.repeat(poses[:, 2], len(FOOTPRINT_RAD)) + rays_rad
                hits = caster.cast(np.repeat(poses[:, :2], len(FOOTPRINT_RAD), axis=0),
                                   np.column_stack((np.cos(heading), np.sin(heading))), legs)
                scan = measure(self._noise, materials + [trousers] * len(legs), hits)
                direction = poses[:, 2] + angles
                reach = np.where(np.isfinite(scan.range_m), scan.range_m, 0.0)
                points = poses[:, :2] + reach[:, None] * np.column_stack((np.cos(direction), np.sin(direction)))
                things = index_of[np.minimum(scan.thing, len(here))]
                self.sight.add_hits(scans, stamp_s, things, scan.arc_m, points)
                self.sight.add_free(scans, stamp_s, gone, scan.range_m, lambda beam: composed(
                    self.drive.at(stamp_s + self.time_increment_s * np.minimum(beam, BEAMS - 1.0)), mount))
                bright = scan.intensity >= IN_SIGHT_INTENSITY
                in_sight = sum(int(((scan.thing == i) & bright).sum()) >= IN_SIGHT_BEAMS for i in reflectors)
                for key, value in zip(self._rows, (stamp_s, transit, *(round(float(v), 7) for v in base[0]), in_sight,
                                                   None if middle is None else [round(float(v), 4) for v in middle])):
                    self._rows[key].append(value)
                scans += 1
                yield stamp_s, transit, scan

    def truth(self):
        def stamps(values, i):
            own = values[self.sight.offsets[i]:self.sight.offsets[i + 1]]
            return [None if math.isnan(value) else round(value, 3) for value in own]

        things = []
        for i, thing in enumerate(self.world.things):
            things.append({
                "id": thing.id, "kind": thing.kind, "optional": thing.optional, "closed": True,
                "outline": [[round(float(v), 6) for v in point] for point in thing.outline],
                "circle": None if thing.circle is None else [round(float(v), 6) for v in thing.circle],
                "present": [k for k in thing.present if k < self.world.transits],
                "length_m": round(thing.length_m, 6), "first_s": stamps(self.sight.first_s, i),
                "seen_s": stamps(self.sight.seen_s, i), "first_free_s": stamps(self.sight.first_free_s, i),
                "free_s": stamps(self.sight.free_s, i), "in_sight": self.sight.in_sight[i],
                "passed": self.sight.passed[i]})
        return {"world": self.world.name, "seed": self.world.seed, "sweep": self.sweep,
                "initial_pose": None if self.initial_pose is None else [float(v) for v in self.initial_pose],
                "scan_period_s": SCAN_PERIOD_S, "seen_scans": SEEN_SCANS,
                "transits": [[round(v, 6) for v in span] for span in self.drive.transits],
                "reflectors": [list(map(float, reflector)) for reflector in self.world.reflectors],
                "scans": self._rows, "things": things}


# --- bags


class BagWriter:
    """The bag, and that with the true map -> odom besides."""

    def __init__(self, simulation, path, tf_path):
        import rosbag  # not where worlds alone are wanted

        self.simulation = simulation
        self.bags = [rosbag.Bag(str(path), "w"), rosbag.Bag(str(tf_path), "w")]
        self._at = 0
        self._sequence = 0

    def write_all(self):
        import genpy
        from geometry_msgs.msg import Quaternion, TransformStamped
        from nav_msgs.msg import Odometry
        from sensor_msgs.msg import LaserScan
        from tf2_msgs.msg import TFMessage

        def time(stamp_s):
            return genpy.Time(0, int(round(stamp_s * 1e6)) * 1000)

        def transform(stamp, parent, child, pose, z=0.0):
            message = TransformStamped()
            message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, parent, child
            translation = message.transform.translation
            translation.x, translation.y, translation.z = float(pose[0]), float(pose[1]), z
            message.transform.rotation = rotation(pose[2])
            return message

        def rotation(yaw):
            return Quaternion(0.0, 0.0, math.sin(0.5 * float(yaw)), math.cos(0.5 * float(yaw)))

        stamps, poses, speeds, variances, yaw_variances = self.simulation.odometry
        true = self.simulation.drive.at(stamps)
        corrections = composed(true, inverse(poses))

        def write(topic, message, stamp, only=None):
            for i, bag in enumerate(self.bags):
                if only is None or only == i:
                    bag.write(topic, message, stamp)

        def odometry_until(stamp_s):
            while self._at < len(stamps) and stamps[self._at] <= stamp_s:
                k, self._at = self._at, self._at + 1
                stamp = time(stamps[k])
                message = Odometry()
                message.header.seq, message.header.stamp = k, stamp
                message.header.frame_id, message.child_frame_id = "odom", "base_link"
                message.pose.pose.position.x, message.pose.pose.position.y = (float(v) for v in poses[k, :2])
                message.pose.pose.orientation = rotation(poses[k, 2])
                unused = 1e6  # z, roll and pitch
                message.pose.covariance = np.diag((variances[k], variances[k], unused, unused, unused,
                                                   yaw_variances[k])).ravel().tolist()
                message.twist.twist.linear.x, message.twist.twist.angular.z = (float(v) for v in speeds[k])
                message.twist.covariance = np.diag((1e-4, 1e-6, unused, unused, unused, 1e-4)).ravel().tolist()
                write("/odom", message, stamp)
                own = transform(stamp, "odom", "base_link", poses[k])
                write("/tf", TFMessage([own]), stamp, 0)
                write("/tf", TFMessage([transform(stamp, "map", "odom", corrections[k]), own]), stamp, 1)

        first = time(BEGIN_S)
        mount = transform(first, "base_link", "laser", self.simulation.world.mount, 0.3)
        write("/tf_static", TFMessage([mount]), first)
        for stamp_s, _, scan in self.simulation.scans():
            odometry_until(stamp_s)
            message = LaserScan()
            message.header.seq, message.header.stamp, message.header.frame_id = self._sequence, time(stamp_s), "laser"
            self._sequence += 1
            message.angle_min, message.angle_increment = ANGLE_MIN_RAD, ANGLE_INCREMENT_RAD
            message.angle_max = ANGLE_MIN_RAD + ANGLE_INCREMENT_RAD * (BEAMS - 1)
            message.time_increment, message.scan_time = self.simulation.time_increment_s, SCAN_PERIOD_S
            message.range_min, message.range_max = RANGE_MIN_M, RANGE_MAX_M
            message.ranges, message.intensities = scan.range_m.tolist(), scan.intensity.tolist()
            write("/scan", message, message.header.stamp)
        odometry_until(math.inf)

    def close(self):
        for bag in self.bags:
            bag.close()


def write_odometry_bag(directory, name):
    """NAME_odometry.bag of NAME_tf.bag: in each transit map -> odom stays as it is at the beginning."""
    import rosbag

    spans = json.loads((directory / f"{name}.truth.json").read_text())["transits"]
    begins_s, at, held = [begin_s for begin_s, _ in spans[1:]], 0, None
    written = directory / f"{name}_odometry.bag.part"
    with rosbag.Bag(str(directory / f"{name}_tf.bag")) as source, rosbag.Bag(str(written), "w") as bag:
        for topic, raw, stamp in source.read_messages(raw=True):
            if topic != "/tf":
                bag.write(topic, raw, stamp, raw=True)
                continue
            message = raw[4]()
            message.deserialize(raw[1])
            (map_to_odom,) = (own for own in message.transforms if own.header.frame_id == "map")
            while at < len(begins_s) and map_to_odom.header.stamp.to_sec() >= begins_s[at]:
                at, held = at + 1, None
            held = held or map_to_odom.transform
            map_to_odom.transform = held
            bag.write(topic, message, stamp)
    written.rename(directory / f"{name}_odometry.bag")


def name_of(world, seed, sweep=False, with_initial_pose=True, picked=None):
    return (f"{world}_{seed}{'_sweep' if sweep else ''}{'' if with_initial_pose else '_lost'}"
            f"{'_' + ''.join(map(str, picked)) if picked else ''}")


def write_world(directory, world, seed, sweep=False, with_initial_pose=True, transits=TRANSITS, picked=None):
    """Its files; the name of them. `picked`: the numbers of some of the transits."""
    directory = pathlib.Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    name = name_of(world, seed, sweep, with_initial_pose, picked)
    made = make_world(world, seed, transits)
    simulation = Simulation(only_transits(made, picked) if picked else made, sweep, with_initial_pose)
    writer = BagWriter(simulation, directory / f"{name}.bag", directory / f"{name}_tf.bag")
    try:
        writer.write_all()
    finally:
        writer.close()
    lines = [f"  - {{x: {x:.4f}, y: {y:.4f}, radius_m: {radius:g}}}" for x, y, radius in simulation.world.reflectors]
    (directory / f"{name}.reflectors.yaml").write_text("reflectors:\n" + "\n".join(lines) + "\n")
    (directory / f"{name}.truth.json").write_text(json.dumps(simulation.truth(), separators=(",", ":")))
    return name


CHOICES = {"off": (False,), "on": (True,), "both": (False, True)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directory", type=pathlib.Path)
    parser.add_argument("--worlds", nargs="+", choices=WORLDS, default=list(WORLDS))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2])
    parser.add_argument("--sweep", choices=CHOICES, default="off", help="beams at their own times")
    parser.add_argument("--initial-pose", choices=CHOICES, default="on")
    parser.add_argument("--transits", type=int, default=TRANSITS)
    arguments = parser.parse_args()
    for world in arguments.worlds:
        for seed in arguments.seeds:
            for sweep in CHOICES[arguments.sweep]:
                for initial in CHOICES[arguments.initial_pose]:
                    name = write_world(arguments.directory, world, seed, sweep, initial, arguments.transits)
                    print(arguments.directory / name, file=sys.stderr)


if __name__ == "__main__":
    main()
