# SPDX-License-Identifier: BSD-3-Clause
"""The one map of a site against its exact truth, over many seeds (docs/benchmarks/site.md): each seed is another scene
of a hall and a yard with parked and driving cars, walkers, poles, crates and a large round building. simulate_bag flies
it, map_bag maps it, and the map is compared with the outlines and motions that the scene was made of. Run by
scripts/evaluate.

    python3 scripts/evaluation/site.py --write-world FILE [--first-seed N]      writes one scene, to look at or to fly
"""

import collections
import concurrent.futures
import dataclasses
import importlib.util
import json
import math
import os
import pathlib
import random
import subprocess
import sys
import tempfile
import textwrap
import time

import numpy as np
import yaml
from matplotlib import patches
from scipy.interpolate import make_interp_spline
from scipy.spatial import cKDTree

from pictures import images_folder, pyplot, save
from report import (ROOT, arguments_parser, facts, introduction, output_folder, print_progress, prose, section, table,
                    targets_section, write)
from worlds import NoPlace, until_placed

# The flight.
RATE_HZ, DURATION_S, START_S = 10.0, 140.0, 1000.0  # simulate_bag's first stamp
SCAN_TOPIC, TF_TOPIC, WORLD_FRAME = "/scan", "/tf", "world"
BEAMS, BEAM_RAD = 1081, math.radians(0.25)
ROBOT_HEIGHT_M, LIDAR_ABOVE_M = 0.9, 0.1
ROBOT_M_S, ROBOT_RADIUS_M, CLEARANCE_M = 1.35, 0.5, 0.4  # its mean speed
HALL_SLOWNESS = 2.0
DRAG_1_S = 0.1  # the multirotor tilts by 1 degree at its speed, so that beams stay below a car's roof
MORE_SENSORS = {  # site and text of those that only a world of models/worlds has: a camera 20 deg down, IMU, receiver
    '<site name="camera_optical" pos="0.2 0 -0.05" xyaxes="0 -1 0 -0.342020 0 -0.939693" size="0.01"/>':
        '<text name="camera_optical" data="label_camera rate_hz 2 width 448 height 336 fovy_rad 0.8194"/>',
    '<site name="imu" size="0.01"/>': '<text name="imu" data="imu rate_hz 200"/>',
    '<site name="gnss" pos="0 0 0.05" size="0.01"/>':
        '<text name="gnss" data="gnss rate_hz 5 correlated_sigma_m 0.6 correlation_s 30 white_sigma_m 0.3 '
        'vertical_ratio 1.5"/>\n    <numeric name="world_origin" data="47.3769 8.5417 408"/>'}
SEEDS, QUICK_SEEDS = 50, 3
CONFIG = ROOT / "cfg/map_outdoor.yaml"
MOST_RANGE_M = 20.0

# These bounds and names say what is compared.
ON_M = 0.3  # an outline is on another one that is so near
HIT_M = 0.1  # a hit is of the thing whose outline is so near
VISIBLE_HITS = 5
MOVED_M = 0.3  # a thing that has moved by more since it was seen is expected to be there no more
SPACING_M = 0.05  # of samples along outlines
PIECE_M = 1.0  # of a wall or building: each piece is a thing that a robot could hit
PART_GAP_M = 1.0  # parts of an outline that were seen are apart by more
OUT_OF_SIGHT_S = 0.5
COUNT_EVERY = 10  # scans
STANDS_S = 1.0  # what has not moved for so long stands
ANSWER_S = 5.0  # in sight: then what has appeared is on the map, and what has gone is off it
HOLDS = 10  # scans in turn after which an id has a thing
BODIES = ("ellipse", "box")
MOVABLE = ("car", "person", "crate")
KINDS = ("car", "person", "crate", "pole", "building", "hall")

TARGETS = {"kept": 0.99, "per_truth": (0.98, 1.02), "on_no_map_s": 0.5, "object_f1": 0.97, "event_f1": 0.9,
           "times": 0.95}
PICTURE_S = 58.0
KIND_COLORS = {"ellipse": "#c8553d", "box": "#b07d12", "polyline": "#3d5a80", "boundary": "#0b6e4f",
               "target": "#8a5a83"}


# --- motions: the text that the simulator reads, and the same motion in Python


@dataclasses.dataclass
class Motion:
    """Times in s -> rows of x, y, yaw. The text is empty for what stands."""

    text: str
    at: object
    legs: tuple = ()  # of stops: (from, to) in s, in which it moves


def standing(x, y, yaw=0.0):
    return Motion("", lambda t: np.tile((x, y, yaw), (len(t), 1)))


def wrapped(angle):
    return math.remainder(angle, 2.0 * math.pi)


def stops(places):
    """src/sim/path.cpp: at rest at each (x, y, yaw, time), the straight way in between."""
    places = [tuple(round(number, 4) for number in place) for place in places]
    text = "stops places " + "; ".join(" ".join(f"{number:.4f}" for number in place) for place in places)
    turned = [places[0][2]]
    for before, place in zip(places, places[1:]):
        turned.append(turned[-1] + wrapped(place[2] - before[2]))
    rows = np.array([(x, y, yaw, when) for (x, y, _, when), yaw in zip(places, turned)])

    def at(t):
        t = np.asarray(t, float)
        to = np.clip(np.searchsorted(rows[:, 3], t, side="right"), 1, len(rows) - 1)
        s = np.clip((t - rows[to - 1, 3]) / (rows[to, 3] - rows[to - 1, 3]), 0.0, 1.0)
        part = s**4 * (35.0 + s * (-84.0 + s * (70.0 - 20.0 * s)))
        return rows[to - 1, :3] + part[:, None] * (rows[to, :3] - rows[to - 1, :3])

    legs = tuple((before[3], place[3]) for before, place in zip(places, places[1:]) if before[:3] != place[:3])
    return Motion(text, at, legs)


def with_tangent(place):
    """Adds the direction of motion to positions that are smooth in time."""
    step_s = 1e-4

    def at(t):
        t = np.asarray(t, float)
        way = place(t + step_s) - place(t - step_s)
        return np.column_stack((place(t), np.arctan2(way[:, 1], way[:, 0])))

    return at


def loop(speed, points):
    """src/sim/periodic_spline.cpp, facing its direction of motion."""
    points, speed = np.round(np.asarray(points, float), 4), round(speed, 4)
    n = len(points)
    place = make_interp_spline(np.arange(n + 1), np.vstack((points, points[:1])), k=5, bc_type="periodic")
    fine = place(np.linspace(0.0, n, 256 * n + 1))
    rate = n * speed / np.linalg.norm(np.diff(fine, axis=0), axis=1).sum()
    text = f"loop speed {speed:.4f} tangent points " + "; ".join(f"{x:.4f} {y:.4f}" for x, y in points)
    return Motion(text, with_tangent(lambda t: place(np.mod(rate * np.asarray(t), n))))


def resampled(points, count, slowness=None):
    """Evenly along the closed spline through the points, and its length; with `slowness` of places in steps that are
    shorter where that is greater."""
    points = np.asarray(points, float)
    n = len(points)
    place = make_interp_spline(np.arange(n + 1), np.vstack((points, points[:1])), k=5, bc_type="periodic")
    fine = place(np.linspace(0.0, n, 400 * n + 1))
    steps = np.hypot(*np.diff(fine, axis=0).T)
    weights = slowness(fine[1:]) if slowness else 1.0
    along = np.concatenate(([0.0], np.cumsum(steps * weights)))
    at = np.arange(count) * along[-1] / count
    return np.column_stack([np.interp(at, along, fine[:, axis]) for axis in (0, 1)]), steps.sum()


# --- outlines


def sampled(points, closed=True, spacing_m=SPACING_M):
    """Evenly along the edges, each by its own step."""
    points = np.asarray(points, float)
    ends = np.roll(points, -1, axis=0) if closed else points[1:]
    begins = points if closed else points[:-1]
    if not len(begins):
        return points
    counts = np.maximum(1, np.ceil(np.hypot(*(ends - begins).T) / spacing_m).astype(int))
    first = np.repeat(np.cumsum(counts) - counts, counts)
    part = (np.arange(counts.sum()) - first + 0.5) / np.repeat(counts, counts)
    return np.repeat(begins, counts, axis=0) + part[:, None] * np.repeat(ends - begins, counts, axis=0)


def rectangle(a, b):
    return np.array(((a, b), (-a, b), (-a, -b), (a, -b)))


def ellipse_points(a, b, spacing_m=SPACING_M):
    n = max(16, math.ceil(2.0 * math.pi * max(a, b) / spacing_m))
    angle = 2.0 * math.pi * np.arange(n) / n
    return np.column_stack((a * np.cos(angle), b * np.sin(angle)))


def placed(points, pose):
    x, y, yaw = pose
    c, s = math.cos(yaw), math.sin(yaw)
    return points @ np.array(((c, s), (-s, c))) + (x, y)


def is_within(points, outline):
    """Which points are inside a polygon."""
    begins, ends = outline, np.roll(outline, -1, axis=0)
    inside = np.zeros(len(points), bool)
    for (x1, y1), (x2, y2) in zip(begins, ends):
        crosses = (y1 > points[:, 1]) != (y2 > points[:, 1])
        if y1 != y2:
            inside ^= crosses & (points[:, 0] < (x2 - x1) * (points[:, 1] - y1) / (y2 - y1) + x1)
    return inside


@dataclasses.dataclass
class Thing:
    """A true thing. Its outline is in its own frame; of the hall, whose pose is zero, in the world."""

    name: str
    kind: str
    outline: np.ndarray
    motion: Motion
    xml: str = ""  # of its geom
    appears_s: float = -math.inf
    goes_s: float = math.inf
    leaves_s: float = math.nan  # when what had stood drives off
    circles: tuple = ()  # (ahead, radius) that cover it
    height_m: float = 0.0  # of its middle above the floor

    def is_there(self, t):
        return self.appears_s <= t < self.goes_s

    def is_static(self):
        return not self.motion.text and math.isinf(self.appears_s) and math.isinf(self.goes_s)

    def samples(self):
        return sampled(self.outline)

    def text(self):
        words = self.motion.text or ("stand" if not self.is_static() else "")
        if not math.isinf(self.appears_s):
            words += f" appears {self.appears_s:.4f}"
        if not math.isinf(self.goes_s):
            words += f" goes {self.goes_s:.4f}"
        return words

    def body(self, with_decoration):
        """Its lines."""
        x, y, yaw = self.motion.at(np.zeros(1))[0]
        mocap = ' mocap="true"' if self.motion.text else ""
        shown = [self.xml, *(DECORATION if with_decoration and self.kind == "person" else ())]
        if with_decoration and self.kind == "car":  # what the camera of that world tells from the rest
            shown = [self.xml.replace(f'rgba="{COLORS["car"]}"', 'material="car"')]
        return [f'    <body name="{self.name}"{mocap} pos="{x:.4f} {y:.4f} {self.height_m:g}" euler="0 0 {yaw:.4f}">',
                *(f"      {geom}" for geom in shown), "    </body>"]


DECORATION = ('<geom class="head"/>', '<geom class="leg" fromto="0 0.1 -0.36 0 0.1 -1.08"/>',
              '<geom class="leg" fromto="0 -0.1 -0.36 0 -0.1 -1.08"/>')  # of parts/scene.xml, for persons
COLORS = {"car": "0.25 0.36 0.52 1", "crate": "0.62 0.45 0.30 1", "person": "0.18 0.40 0.78 1",
          "pole": "0.80 0.25 0.20 1", "building": "0.78 0.72 0.62 1"}


def box_thing(name, kind, half_x, half_y, half_z, motion, **more):
    half_x, half_y = round(half_x, 4), round(half_y, 4)
    long_m, wide_m = max(half_x, half_y), min(half_x, half_y)
    count = max(1, math.ceil(2.0 * long_m / wide_m))
    step = long_m / count
    along = half_x >= half_y
    centres = [(2 * i + 1) * step - long_m for i in range(count)]
    circles = tuple((c if along else 0.0, 0.0 if along else c, math.hypot(step, wide_m)) for c in centres)
    xml = (f'<geom type="box" group="1" size="{half_x:.4f} {half_y:.4f} {half_z:.4f}" rgba="{COLORS[kind]}"/>')
    return Thing(name, kind, rectangle(half_x, half_y), motion, xml, circles=circles, height_m=half_z, **more)


def ellipse_thing(name, kind, rx, ry, motion, half_z=0.9, height_m=0.9, **more):
    rx, ry = round(rx, 4), round(ry, 4)
    xml = f'<geom type="ellipsoid" group="1" size="{rx:.4f} {ry:.4f} {half_z:.4f}" rgba="{COLORS[kind]}"/>'
    return Thing(name, kind, ellipse_points(rx, ry), motion, xml, circles=((0.0, 0.0, max(rx, ry)),),
                 height_m=height_m, **more)


# --- scenes


CAR_M = (4.2, 1.8, 1.5)
WALL_M = 0.3
FAR_X_M = -34.0  # where cars come from, and go to: out of sight of the robot everywhere
CAR_M_S, TURN_S, PARK_S = 1.8, 5.0, 6.0  # mean speeds and times of driving
WALK_M_S = 0.65
YARD = (-1.0, 17.0, -7.3, 7.3)  # where walkers, poles and crates may be


class Scene:
    """All of a seed's scene."""

    def __init__(self, seed):
        self.seed = seed
        for attempt in range(100):
            self.chance = random.Random(1000 * seed + attempt)
            self.times = np.arange(0.0, DURATION_S + 0.1, 0.1)
            self.things, self.covers = [], []
            try:
                self.make()
                return
            except NoPlace:
                continue
        raise NoPlace(f"no scene for seed {seed}")

    def make(self):
        self.add_hall()
        self.add_building()
        self.add_robot()
        self.add_cars()
        self.add_crowd()
        self.add_crates()
        self.add_poles()
        self.add_walkers()

    def uniform(self, low, high):
        return round(self.chance.uniform(low, high), 3)

    # Clearances: circles that cover each thing, at all times.

    def cover(self, thing):
        pose = thing.motion.at(self.times if thing.motion.text else self.times[:1])
        c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
        there = (self.times >= thing.appears_s) & (self.times < thing.goes_s)
        return [(np.column_stack((pose[:, 0] + c * ahead - s * left, pose[:, 1] + s * ahead + c * left)), radius)
                for ahead, left, radius in thing.circles], there

    def is_clear(self, thing, clearance_m=CLEARANCE_M):
        circles, there = self.cover(thing)
        if not there.any():
            return True
        for place, radius in circles:
            for x, y, half_x, half_y in self.walls:
                beyond = np.maximum(np.abs(place - (x, y)) - (half_x, half_y), 0.0)
                if np.hypot(*beyond.T).min() < radius + clearance_m:
                    return False
            for others, other_there in [*self.covers, ([(self.robot_places, ROBOT_RADIUS_M)], there)]:
                both = there & other_there
                if not both.any():
                    continue
                for other, other_radius in others:
                    way = (place if len(place) == 1 else place[both]) - (other if len(other) == 1 else other[both])
                    if np.hypot(*way.T).min() < radius + other_radius + clearance_m:
                        return False
        return True

    def add(self, thing):
        self.things.append(thing)
        self.covers.append(self.cover(thing))

    def place(self, make, clearance_m=CLEARANCE_M, tries=600):
        """Adds what `make` makes once it is clear of everything."""

        def attempt():
            thing = make()
            if thing is None or not self.is_clear(thing, clearance_m):
                return False
            self.add(thing)
            return True

        until_placed(attempt, tries)

    # The things of the scene.

    def add_hall(self):
        x0, x1 = self.uniform(-20.5, -19.5), -4.0
        y0, y1 = self.uniform(-6.5, -5.7), self.uniform(5.7, 6.5)
        middle, half = self.uniform(-0.3, 0.3), self.uniform(3.2, 3.8)
        o0, o1, w = round(middle - half, 3), round(middle + half, 3), WALL_M
        outline = np.array(((x1 + w, o1), (x1 + w, y1 + w), (x0 - w, y1 + w), (x0 - w, y0 - w), (x1 + w, y0 - w),
                            (x1 + w, o0), (x1, o0), (x1, y0), (x0, y0), (x0, y1), (x1, y1), (x1, o1)))
        self.walls = [((x0 + x1) / 2, y1 + w / 2, (x1 - x0) / 2 + w, w / 2),
                      ((x0 + x1) / 2, y0 - w / 2, (x1 - x0) / 2 + w, w / 2),
                      (x0 - w / 2, (y0 + y1) / 2, w / 2, (y1 - y0) / 2),
                      (x1 + w / 2, (o1 + y1) / 2, w / 2, (y1 - o1) / 2),
                      (x1 + w / 2, (y0 + o0) / 2, w / 2, (o0 - y0) / 2)]
        self.hall = (x0, x1, y0, y1)
        self.things.append(Thing("hall", "hall", outline, standing(0.0, 0.0)))

    def add_building(self):
        rx = self.uniform(4.6, 5.4)
        motion = standing(self.uniform(23.5, 24.5), self.uniform(-0.5, 0.5), self.uniform(0.0, 3.0))
        self.robot_places = np.full((1, 2), 1e6)  # until there is one
        self.add(ellipse_thing("building", "building", rx, rx * self.uniform(0.93, 1.0), motion, 2.0, 2.0))

    def add_robot(self):
        """Through the hall and around the building, beside the rows of cars; slower in the hall, where its turn is
        tight, so that the tilted beams meet no floor."""
        x0 = self.hall[0]
        points = [(-4.0, -1.6), (-8.5, -2.7), (-12.5, -3.1), (x0 + 4.4, -1.8), (x0 + 4.4, 1.8), (-12.5, 3.1),
                  (-8.5, 2.7), (-4.0, 1.6), (1.0, 2.6), (6.0, 4.9), (11.0, 5.6), (17.0, 7.4), (24.0, 9.0), (30.5, 6.6),
                  (33.2, 0.0), (30.5, -6.6), (24.0, -9.0), (17.0, -7.4), (11.0, -5.6), (6.0, -4.9), (1.0, -2.6)]
        in_yard = [x > 0.0 for x, _ in points]
        points = [(x + yard * self.uniform(-0.3, 0.3), y + yard * self.uniform(-0.3, 0.3))
                  for (x, y), yard in zip(points, in_yard)]
        if self.chance.random() < 0.5:
            points.reverse()
        points, length_m = resampled(points, 32, lambda p: 1.0 + (HALL_SLOWNESS - 1.0) / (1.0 + np.exp(p[:, 0] + 6.0)))
        points = np.roll(points, self.chance.randrange(len(points)), axis=0)
        self.robot = loop(ROBOT_M_S, points)
        self.lap_s = length_m / ROBOT_M_S
        self.robot_places = self.robot.at(self.times)[:, :2]
        probe = Thing("robot", "robot", np.zeros((1, 2)), self.robot, circles=((0.0, 0.0, ROBOT_RADIUS_M),))
        places, self.robot_places = self.robot_places, np.full((1, 2), 1e6)
        if not self.is_clear(probe):
            raise NoPlace
        self.robot_places = places

    def car(self, name, motion, **more):
        long_m, wide_m, high_m = CAR_M
        return box_thing(name, "car", long_m / 2 + self.uniform(-0.1, 0.1), wide_m / 2 + self.uniform(-0.04, 0.03),
                         high_m / 2, motion, **more)

    def drive_in(self, x, side, begin_s):
        """Places of a car that parks at x in the row of that side (-1 is south), with its nose ahead."""
        lane, near, spot = side * 9.6, side * 12.0, side * 16.3
        at_s = begin_s + (x - 2.4 - FAR_X_M) / CAR_M_S
        yaw = side * math.pi / 2
        return [(FAR_X_M, lane, 0.0, begin_s), (x - 2.4, lane, 0.0, at_s), (x, near, yaw, at_s + TURN_S),
                (x, spot, yaw, at_s + TURN_S + PARK_S)]

    def drive_off(self, x, side, begin_s):
        """It backs out, and drives off to where it came from."""
        lane, near, spot = side * 9.6, side * 12.0, side * 16.3
        yaw, away = side * math.pi / 2, side * math.pi
        back_s = begin_s + PARK_S
        return [(x, spot, yaw, begin_s), (x, near, yaw, back_s), (x + 2.4, lane, away, back_s + TURN_S),
                (FAR_X_M, lane, away, back_s + TURN_S + (x + 2.4 - FAR_X_M) / CAR_M_S)]

    def add_cars(self):
        """A row of cars in the south and one in the north. In the south one drives in, stands between two others and
        leaves; another one, of either row, stood from the beginning and drives off."""
        pitch, first = self.uniform(2.65, 2.9), self.uniform(0.6, 1.4)
        south = [round(first + pitch * k, 3) for k in range(5)]
        north_pitch, north_first = self.uniform(2.65, 3.4), self.uniform(0.6, 2.5)
        north = [round(north_first + north_pitch * k, 3) for k in range(3)]
        at = self.chance.randrange(1, 4)
        taken = [(x, -1) for k, x in enumerate(south)
                 if k != at and (abs(k - at) == 1 or self.chance.random() < 0.7)]
        taken += [(x, 1) for x in north if self.chance.random() < 0.8]
        leaving = self.chance.choice(taken)
        for k, (x, side) in enumerate(taken):
            if (x, side) != leaving:
                self.add(self.car(f"car_{k + 1}", standing(x, side * 16.3, round(side * math.pi / 2, 4))))

        def leaver():
            places = self.drive_off(*leaving, self.uniform(30.0, 70.0))
            return self.car("car_leaver", stops(places), leaves_s=places[0][3], goes_s=round(places[-1][3] + 0.5, 3))

        def visitor():
            x = south[at]
            places = self.drive_in(x, -1, self.uniform(1.0, 12.0))
            away = self.drive_off(x, -1, round(places[-1][3] + self.uniform(32.0, 45.0), 3))
            return self.car("car_visitor", stops([*places, *away]), leaves_s=away[0][3],
                            goes_s=round(away[-1][3] + 0.5, 3))

        self.place(leaver)
        self.place(visitor)

    def in_yard(self, margin_m=0.0):
        low_x, high_x, low_y, high_y = YARD
        return self.uniform(low_x + margin_m, high_x - margin_m), self.uniform(low_y + margin_m, high_y - margin_m)

    def crate(self, name, place, **more):
        return box_thing(name, "crate", self.uniform(0.3, 0.5), self.uniform(0.25, 0.4), 0.7,
                         standing(*place, self.uniform(-1.5, 1.5)), **more)

    def add_crates(self):
        x0, x1, y0, y1 = self.hall
        for k in range(2):
            self.place(lambda k=k: self.crate(f"crate_{k + 1}", (self.uniform(x0 + 1.2, x1 - 1.2),
                                                                self.uniform(y0 + 1.2, y1 - 1.2))))
        self.place(lambda: self.crate("crate_3", self.in_yard()))
        for k in range(2):
            self.place(lambda k=k: self.crate(f"crate_new_{k + 1}", self.in_yard(),
                                              appears_s=self.uniform(25.0, 80.0)))
            self.place(lambda k=k: self.crate(f"crate_old_{k + 1}", self.in_yard(), goes_s=self.uniform(35.0, 90.0)))

    def add_poles(self):
        for k in range(5):
            self.place(lambda k=k: ellipse_thing(f"pole_{k + 1}", "pole", *[self.uniform(0.07, 0.15)] * 2,
                                                 standing(*self.in_yard()), 1.5, 1.5))

    def person(self, name, motion):
        return ellipse_thing(name, "person", self.uniform(0.13, 0.17), self.uniform(0.21, 0.27), motion, 0.4, 1.15)

    def add_crowd(self):
        """Four who walk about one place, all with the same period, so that their distances repeat."""
        centre, period_s = (self.uniform(5.5, 11.0), self.uniform(-1.0, 1.0)), self.uniform(11.0, 15.0)

        def walker(name):
            n = self.chance.randrange(5, 8)
            x, y = (c + self.uniform(-1.2, 1.2) for c in centre)
            radius, begin = self.uniform(1.0, 2.2), self.uniform(0.0, 6.28)
            turn = self.chance.choice((-1.0, 1.0))
            radii = [radius * self.uniform(0.8, 1.2) for _ in range(n)]
            angles = [begin + turn * 2.0 * math.pi * k / n for k in range(n)]
            points, length_m = resampled([(x + r * math.cos(a), y + r * math.sin(a)) for r, a in zip(radii, angles)], n)
            speed_m_s = length_m / period_s
            return self.person(name, loop(speed_m_s, points)) if 0.4 <= speed_m_s <= 1.1 else None

        for k in range(4):
            self.place(lambda k=k: walker(f"walker_{k + 1}"), tries=300)

    def add_walkers(self):
        """One stands for 3 s at each place, one for 30 s."""

        def leg(rows, stand_s):
            """The next place of the way and how long it stands there, clear of everything; nothing if none is found."""
            x, y, before, now_s = rows[-1]
            for _ in range(60):
                to = self.in_yard()
                if not 4.0 <= math.dist(to, (x, y)) <= 10.0:
                    continue
                yaw = round(math.atan2(to[1] - y, to[0] - x), 4)
                set_off_s = round(now_s + stand_s, 3)
                there_s = round(set_off_s + math.dist(to, (x, y)) / WALK_M_S, 3)
                turns = (x, y, before, round(set_off_s - 1.0, 3)), (x, y, yaw, set_off_s)
                longer = [*rows, *(turns if set_off_s - 1.0 > now_s else turns[1:]), (*to, yaw, there_s)]
                probe = ellipse_thing("probe", "person", 0.27, 0.27, stops(longer), appears_s=now_s,
                                      goes_s=there_s + stand_s)
                if self.is_clear(probe):
                    return longer
            return None

        def walker(name, stand_s):
            rows = [(*self.in_yard(), 0.0, 0.0)]
            first_s = self.uniform(1.0, 8.0)
            while rows is not None and rows[-1][3] < DURATION_S - 5.0:
                rows = leg(rows, stand_s if len(rows) > 1 else first_s)
            return None if rows is None else self.person(name, stops(rows))

        for name, stand_s in (("walker_short", 3.0), ("walker_long", 30.0)):
            self.place(lambda name=name, stand_s=stand_s: walker(name, stand_s), tries=40)

    # As a world.

    def xml(self, parts=False):
        """`parts`: with light and colours of parts/scene.xml, for a world of models/worlds."""
        lines = []
        if parts:
            about = ("A hall with a wide opening and a yard with parked cars: one drives in, parks between others and "
                     "leaves, one drives off. Walkers stop for a while, a crowd walks about, crates appear and go; a "
                     "multirotor flies through the hall and around a large round building, a lap in "
                     f"{self.lap_s:.0f} s. Made by scripts/evaluation/site.py --write-world, seed {self.seed}. -->")
            indent = " " * 5
            lines += ["<!-- SPDX-License-Identifier: BSD-3-Clause",
                      *textwrap.wrap(about, 120, initial_indent=indent, subsequent_indent=indent)]
        lines += ['<mujoco model="site">', '  <compiler angle="radian"/>']
        if parts:
            lines += ['  <include file="parts/scene.xml"/>', "", '  <statistic center="7 0 1" extent="24"/>', "",
                      f'  <asset> <material name="car" rgba="{COLORS["car"]}"/> </asset>', ""]
        lines += ["  <custom>", f'    <numeric name="robot_drag" data="{DRAG_1_S:g}"/>',
                  f'    <text name="lidar" data="scanner {self.scanner_words()}"/>',
                  *(f'    {text}' for text in MORE_SENSORS.values() if parts), *wrapped_text("robot", self.robot.text)]
        for thing in self.things:
            if thing.text():
                lines += wrapped_text(thing.name, thing.text())
        lines += ["  </custom>", "", "  <worldbody>"]
        if parts:
            lines += ['    <light pos="2 -4 9" dir="-0.2 0.4 -0.9" directional="true" diffuse="0.4 0.4 0.4" '
                      'specular="0.1 0.1 0.1"/>',
                      '    <camera name="overview" pos="7 -38 30" xyaxes="1 0 0 0 0.64 0.77" fovy="46"/>',
                      '    <camera name="top" pos="7 0 90" xyaxes="1 0 0 0 1 0" fovy="26"/>']
        else:
            lines.append('    <light pos="0 0 9" dir="0 0 -1" directional="true"/>')
        floor = 'material="concrete"' if parts else 'rgba="0.78 0.78 0.76 1"'
        lines.append(f'    <geom name="ground" type="plane" size="60 40 1" {floor}/>')
        for name, (x, y, half_x, half_y) in zip(("north", "south", "west", "east_1", "east_2"), self.walls):
            lines.append(f'    <geom name="{name}" type="box" pos="{x:.4f} {y:.4f} 1.5" size="{half_x:.4f} '
                         f'{half_y:.4f} 1.5" rgba="0.86 0.84 0.79 1"/>')
        lines += [line for thing in self.things if thing.xml for line in thing.body(parts)]
        x, y, _ = self.robot.at(np.zeros(1))[0]
        lines += [f'    <body name="robot" mocap="true" pos="{x:.4f} {y:.4f} {ROBOT_HEIGHT_M}">',
                  f'      <site name="lidar" pos="0 0 {LIDAR_ABOVE_M}" size="0.01"/>',
                  *(f'      {site}' for site in MORE_SENSORS if parts),
                  '      <geom group="2" type="box" size="0.2 0.2 0.04" rgba="0.15 0.15 0.17 1"/>', "    </body>",
                  "  </worldbody>", "</mujoco>", ""]
        return "\n".join(lines)

    @staticmethod
    def scanner_words():
        return f"beams {BEAMS} rate_hz {RATE_HZ:g} range_max_m 20"

    def poses_at(self, t):
        return np.vstack([thing.motion.at(np.array([t])) for thing in self.things])


def wrapped_text(name, words):
    """A <text> in lines of at most 120 columns."""
    begin = f'    <text name="{name}" data="'
    lines, line = [], begin
    for word in words.split():
        if len(line) + len(word) + 4 > 120:
            lines.append(line.rstrip())
            line = " " * len(begin)
        line += word + " "
    return [*lines, line.rstrip() + '"/>']


# --- running


class Failed(Exception):
    """A program did not do its work."""


def run(command):
    result = subprocess.run(list(map(str, command)), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                            check=False)
    if result.returncode:
        raise Failed(f"{pathlib.Path(command[0]).name} ended with code {result.returncode}:\n{result.stderr}")


def simulate(options, scene, folder):
    world, scanner, bag = folder / "site.xml", folder / "scanner.yaml", folder / "site.bag"
    world.write_text(scene.xml())
    scanner.write_text(f"beams: {BEAMS}\nangle_min_rad: {-0.5 * (BEAMS - 1) * BEAM_RAD!r}\nangle_increment_rad: "
                       f"{BEAM_RAD!r}\nrate_hz: {RATE_HZ}\nrange_max_m: {options.range_m}\n")
    run([options.simulate, "--world", world, "--scanner", scanner, "--duration", DURATION_S, "--seed", scene.seed,
         "--out", bag])
    return bag


def map_of(options, bag, folder):
    """The lines of map_bag."""
    out = folder / "map.jsonl"
    run([options.tool, bag, "--scan-topic", SCAN_TOPIC, "--world-frame", WORLD_FRAME, "--config", options.config,
         "--model-folder", ROOT / "models", "--full-every", 1, "--out", out])
    with out.open(encoding="utf-8") as lines:
        for text in lines:
            yield json.loads(text)


@dataclasses.dataclass
class Look:
    """A scan in the world: where the scanner is, and the end of each beam, of `reach` where it hit nothing."""

    t: float
    origin: np.ndarray
    ends: np.ndarray
    hits: np.ndarray


def looks_of(bag_file, reach_m):
    import rosbag

    poses, looks = {}, []
    with rosbag.Bag(str(bag_file)) as bag:
        for topic, message, _ in bag.read_messages(topics=[SCAN_TOPIC, TF_TOPIC]):
            if topic == TF_TOPIC:
                for transform in message.transforms:
                    poses[transform.header.stamp.to_nsec()] = transform.transform
                continue
            stamp = message.header.stamp
            pose = poses[stamp.to_nsec()]
            q, p = pose.rotation, pose.translation
            turn = np.array((
                (1 - 2 * (q.y**2 + q.z**2), 2 * (q.x * q.y - q.z * q.w)),
                (2 * (q.x * q.y + q.z * q.w), 1 - 2 * (q.x**2 + q.z**2))))
            ranges = np.array(message.ranges, float)
            angle = message.angle_min + np.arange(len(ranges)) * message.angle_increment
            is_hit = (ranges >= message.range_min) & (ranges <= message.range_max)
            lengths = np.where(is_hit, ranges, reach_m)
            ends = (lengths[:, None] * np.column_stack((np.cos(angle), np.sin(angle)))) @ turn.T + (p.x, p.y)
            looks.append(Look(stamp.to_sec() - START_S, np.array((p.x, p.y)), ends, is_hit))
    return looks


# --- features


class Feature:
    """Of the map, with samples along its outline."""

    def __init__(self, told):
        self.told = told
        self.id, self.kind = told["id"], told["kind"]
        self.points = outline_points(told)
        self.samples = sampled(self.points, told["closed"])
        self.static_m = self.static_thing = None  # of the samples, once they are compared

    @property
    def group(self):
        return "body" if self.kind in BODIES else self.kind

    def encloses(self, points):
        """Of what is solid inside."""
        solid = self.kind in BODIES or (self.kind == "boundary" and self.told["closed"] and area(self.points) > 0.0)
        low, high = self.samples.min(0), self.samples.max(0)
        if not solid or not ((points >= low) & (points <= high)).all(1).any():
            return np.zeros(len(points), bool)
        return is_within(points, self.points)


def area(points):
    x, y = points.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def outline_points(told):
    """The outline with its arcs as short edges; a bulge is tan(angle / 4), positive to the left of the chord."""
    outline, closed = told["outline"], told["closed"]
    points = []
    for k, vertex in enumerate(outline):
        points.append(vertex[:2])
        bulge = vertex[2] if len(vertex) > 2 else 0.0
        if not bulge or (k + 1 == len(outline) and not closed):
            continue
        (x1, y1), (x2, y2) = vertex[:2], outline[(k + 1) % len(outline)][:2]
        chord = math.hypot(x2 - x1, y2 - y1)
        if chord < 1e-9:
            continue
        angle = 4.0 * math.atan(bulge)
        radius = chord / (2.0 * math.sin(angle / 2.0))
        # The middle is to the left of the way for a counter-clockwise arc.
        middle_x = (x1 + x2) / 2 - (y2 - y1) / chord * radius * math.cos(angle / 2)
        middle_y = (y1 + y2) / 2 + (x2 - x1) / chord * radius * math.cos(angle / 2)
        begin = math.atan2(y1 - middle_y, x1 - middle_x)
        n = max(2, math.ceil(abs(angle * radius) / 0.1))
        for i in range(1, n):
            at = begin + angle * i / n
            points.append((middle_x + abs(radius) * math.cos(at), middle_y + abs(radius) * math.sin(at)))
    return np.array(points, float)


# --- comparison


@dataclasses.dataclass
class Followed:
    """A true thing over time."""

    first_seen_s: float = math.inf
    last_seen_s: float = -math.inf
    seen_pose: np.ndarray = None  # when it was last seen
    stood: bool = False  # when it was last seen
    seen_scans: int = 0
    pose: np.ndarray = None
    stands_since_s: float = -math.inf
    has: tuple = None  # (id, group) of the feature that it last had for its own
    has_pose: np.ndarray = None  # where it had that
    unseen: int = 0  # scans since then in which it was out of sight
    in_several: bool = False  # since then it was part of a feature of several things
    own: tuple = ()  # ids of features that are its own, now
    spanned: bool = False  # whether it is part of a feature of several things, now
    seen_free: bool = False  # whether the place where it was last seen was seen to be free since
    seen_pieces: np.ndarray = None  # samples of its outline that were hit, of what stands
    ids_there: tuple = ()  # of its features before it went
    spanned_there: bool = False  # whether it was part of a feature of several things then
    event: dict = None  # of its appearing or going


class Score:
    """Of one seed."""

    def __init__(self, seed):
        self.seed = seed
        self.counts = collections.Counter()
        self.ratios, self.ratios_of_parts = [], []
        self.longest_s, self.longest_of = 0.0, ""
        self.times_inside, self.times_told = 0, 0
        self.failures = []  # {seed, t, what, thing, says}
        self.picture = None

    def fail(self, t, what, thing, says):
        self.failures.append({"seed": self.seed, "t": round(t, 2), "stamp": round(t + START_S, 2), "what": what,
                              "thing": thing, "says": says})


def rays_through(thing, pose, look):
    """Which beams pass through the whole of a thing's place, and end behind it."""
    local = placed_back(np.vstack((look.origin, look.ends)), pose)
    origin, way = local[0], local[1:] - local[0]
    a, b = np.abs(thing.outline).max(0)
    if thing.kind in ("car", "crate"):
        with np.errstate(divide="ignore", invalid="ignore"):
            first, second = (np.array((-a, -b)) - origin) / way, (np.array((a, b)) - origin) / way
        enter, leave = np.nanmax(np.minimum(first, second), 1), np.nanmin(np.maximum(first, second), 1)
        return (enter < leave) & (enter > 0.0) & (leave * np.hypot(*way.T) + 0.1 < np.hypot(*way.T))
    scaled, from_ = way / (a, b), origin / (a, b)
    square, half, rest = (scaled**2).sum(1), scaled @ from_, (from_**2).sum() - 1.0
    root = half**2 - square * rest
    leave = (-half + np.sqrt(np.maximum(root, 0.0))) / square
    return (root > 0.0) & (half < 0.0) & (leave * np.hypot(*way.T) + 0.1 < np.hypot(*way.T))


def placed_back(points, pose):
    x, y, yaw = pose
    c, s = math.cos(yaw), math.sin(yaw)
    return (points - (x, y)) @ np.array(((c, -s), (s, c)))


def moved_m(thing, pose, other):
    """At most, of any point of its outline."""
    reach = np.abs(thing.outline).max(0)
    corners = rectangle(*reach)
    return float(np.hypot(*(placed(corners, pose) - placed(corners, other)).T).max())


class Comparison:
    """Follows the map and the truth of one seed, scan by scan."""

    def __init__(self, scene, picture_s=None):
        self.scene, self.picture_s = scene, picture_s
        self.score = Score(scene.seed)
        self.things = scene.things
        self.followed = [Followed() for _ in self.things]
        self.features, self.version, self.map_name = {}, None, None
        self.ever, self.ended = {}, {}  # ids: when first on the map; why gone
        self.owner_before = {}  # of an id: the thing that it was of, and for how many scans in turn
        self.holder = {}  # of an id: the thing that it has had for HOLDS scans
        self.off_since = {}  # of a place on no map: [since, last, most hits]
        self.last_told = {}  # of an id: its feature as it was last on the map, and what was told when it was gone
        self.judged_false = set()  # ids of false appearances
        self.lasting = {}  # of what was noted: when it was last so
        self.of, self.spans, self.parts, self.before = {}, {}, {}, {}
        self.static = [i for i, thing in enumerate(self.things) if thing.is_static()]
        self.dynamic = [i for i, thing in enumerate(self.things) if not thing.is_static()]
        self.samples = [thing.samples() for thing in self.things]
        self.pieces = []
        for thing, samples in zip(self.things, self.samples):
            along = np.arange(len(samples)) * SPACING_M
            large = thing.kind in ("hall", "building")
            self.pieces.append((along // PIECE_M).astype(int) if large else np.zeros(len(samples), int))
        poses = scene.poses_at(0.0)
        self.static_tree = cKDTree(np.vstack([placed(self.samples[i], poses[i]) for i in self.static]))
        self.static_of = np.repeat(self.static, [len(self.samples[i]) for i in self.static])
        self.static_sample = np.concatenate([np.arange(len(self.samples[i])) for i in self.static])
        for i in self.static:
            if self.things[i].kind in ("hall", "building"):
                self.followed[i].seen_pieces = np.zeros(len(self.samples[i]), bool)

    # A scan and its line.

    def add(self, look, line):
        t = look.t
        self.t = t
        self.poses = self.scene.poses_at(t)
        self.there = np.array([thing.is_there(t) for thing in self.things])
        self.make_dynamic_tree()
        self.see(look)
        self.update_free(look)
        gone = self.take(line)
        self.assign()
        self.check_gone(gone)
        self.follow_ids()
        self.check_events(look)
        self.check_hits()
        if round(t * RATE_HZ) % COUNT_EVERY == 0:
            self.count()
        if self.picture_s is not None and self.score.picture is None and t >= self.picture_s - 1e-6:
            self.keep_picture(look)

    def make_dynamic_tree(self):
        present = [i for i in self.dynamic if self.there[i]]
        self.dynamic_of = np.repeat(present, [len(self.samples[i]) for i in present])
        self.dynamic_tree = cKDTree(np.vstack([placed(self.samples[i], self.poses[i]) for i in present]))

    def nearest(self, points, most_m):
        """Distance to the nearest true outline, its thing and sample; infinite and -1 beyond."""
        away, at = self.static_tree.query(points, distance_upper_bound=most_m)
        found = np.isfinite(away)
        thing, sample = np.full(len(points), -1), np.full(len(points), -1)
        thing[found], sample[found] = self.static_of[at[found]], self.static_sample[at[found]]
        other, at = self.dynamic_tree.query(points, distance_upper_bound=most_m)
        nearer = other < away
        thing[nearer], sample[nearer] = self.dynamic_of[at[nearer]], 0
        return np.where(nearer, other, away), thing, sample

    def see(self, look):
        points = look.ends[look.hits]
        _, self.hit_thing, self.hit_sample = self.nearest(points, HIT_M)
        self.hit_points = points
        self.score.counts["hits"] += len(points)
        self.score.counts["hits of nothing"] += int((self.hit_thing < 0).sum())
        self.beams = np.bincount(self.hit_thing[self.hit_thing >= 0], minlength=len(self.things))
        for i, (thing, followed) in enumerate(zip(self.things, self.followed)):
            pose = self.poses[i]
            if followed.pose is not None and np.hypot(*(pose - followed.pose)[:2]) > 1e-4:
                followed.stands_since_s = self.t
            if followed.pose is not None and abs(pose[2] - followed.pose[2]) > 1e-4:
                followed.stands_since_s = self.t
            followed.pose = pose
            if self.beams[i] < VISIBLE_HITS:
                followed.unseen += 1
                continue
            followed.first_seen_s = min(followed.first_seen_s, self.t)
            followed.last_seen_s, followed.seen_pose, followed.stood = self.t, pose, self.stands(i)
            followed.seen_scans += 1
            if followed.seen_pieces is not None:
                followed.seen_pieces[self.hit_sample[self.hit_thing == i]] = True

    def take(self, line):
        """The map after a line; returns what has gone, as [(id, reason, into)]."""
        counts = self.score.counts
        if self.map_name not in (None, line["map"]):
            self.score.fail(self.t, "another map began", "", line["map"])
        self.map_name = line["map"]
        if self.version is not None and line["base"] != self.version:
            self.score.fail(self.t, "an update was missed", "", f"base {line['base']} after {self.version}")
        self.version = line["version"]
        gone = [(element["id"], element["reason"], element.get("into"), element) for element in line["gone"]]
        before = self.features
        ids = [told["id"] for told in line["changed"]]
        twice = [found for found, n in collections.Counter(ids).items() if n > 1]
        for found in twice:
            counts["ids twice on one map"] += 1
            self.score.fail(self.t, "an id is twice on the map", "", str(found))
        if line["full"]:
            after = {}
            for told in line["changed"]:
                known = before.get(told["id"])
                after[told["id"]] = known if known is not None and known.told == told else Feature(told)
            untold = set(before) - {found for found, *_ in gone} - set(after)
            if untold:
                counts["gone without being told"] += len(untold)
                self.score.fail(self.t, "gone without being told", "", str(sorted(untold)))
        else:
            after = dict(before)
            for found, *_ in gone:
                after.pop(found, None)
            for told in line["changed"]:
                after[told["id"]] = Feature(told)
        for found in after:
            if found in before:
                continue
            if found not in self.ever:
                self.ever[found] = self.t
            elif self.ended.get(found) != "merged":
                counts["ids again after gone"] += 1
                self.score.fail(self.t, "an id is there again after it was gone", self.name_of(self.holder.get(found)),
                                f"id {found}, was gone as {self.ended.get(found)}")
            else:
                counts["ids again after merged"] += 1
        for told in line["changed"]:
            self.last_told[told["id"]] = told
        for found, reason, _, element in gone:
            self.ended[found] = reason
            self.last_told[found] = {**self.last_told.get(found, {}), **element}
        self.gone_features = {found: before.get(found) for found, *_ in gone}
        self.features = after
        return gone

    def name_of(self, thing):
        return self.things[thing].name if thing is not None and thing >= 0 else ""

    def parts_of(self, feature):
        """{thing: part of its length}, of things that it is on."""
        if feature.static_m is None:
            away, at = self.static_tree.query(feature.samples, distance_upper_bound=ON_M)
            found = np.isfinite(away)
            feature.static_m = away
            feature.static_thing = np.full(len(away), -1)
            feature.static_thing[found] = self.static_of[at[found]]
        other, at = self.dynamic_tree.query(feature.samples, distance_upper_bound=ON_M)
        thing = feature.static_thing
        nearer = other < feature.static_m
        if nearer.any():
            thing = thing.copy()
            thing[nearer] = self.dynamic_of[at[nearer]]
        n = np.bincount(thing + 1, minlength=len(self.things) + 1)[1:]
        return {int(i): n[i] / len(thing) for i in np.flatnonzero(n)}

    def assign(self):
        """Of each feature the thing that it is of, those that it spans, or none."""
        self.before = self.of
        self.of, self.spans, self.parts = {}, {}, {}
        for found, feature in self.features.items():
            parts = self.parts[found] = self.parts_of(feature)
            most = max(parts, key=parts.get, default=None)
            if most is not None and parts[most] > 0.5:
                self.of[found] = most
            elif sum(parts.values()) > 0.5:
                self.spans[found] = tuple(parts)
        own = collections.defaultdict(list)
        for found, thing in self.of.items():
            own[thing].append(found)
        spanned = {thing for things in self.spans.values() for thing in things}
        for i, followed in enumerate(self.followed):
            followed.own = tuple(own.get(i, ()))
            followed.spanned = i in spanned
        for found in self.features:
            thing = self.of.get(found)
            before, scans = self.owner_before.get(found, (None, 0))
            scans = scans + 1 if before == thing else 1
            self.owner_before[found] = (thing, scans)
            if thing is None or scans < HOLDS:
                continue
            holder = self.holder.get(found)
            if holder is not None and holder != thing:
                self.score.counts["ids that went to another thing"] += 1
                self.score.fail(self.t, "an id went to another thing", self.name_of(thing),
                                f"id {found} was of {self.name_of(holder)}")
            self.holder[found] = thing

    def length_on(self, found, thing):
        return self.parts[found].get(thing, 0.0) * len(self.features[found].samples) * SPACING_M

    def stands(self, thing):
        return self.there[thing] and self.t - self.followed[thing].stands_since_s >= STANDS_S

    def check_gone(self, gone):
        counts = self.score.counts
        for found, reason, into, _ in gone:
            thing = self.before.get(found)
            if reason == "merged":
                if thing is None or not self.there[thing]:
                    counts["merged, of nothing"] += 1
                    continue
                right = into in self.features and self.length_on(into, thing) > 0.0 and (
                    self.of.get(into) == thing or thing in self.spans.get(into, ()))
                counts["merged, led to its thing" if right else "merged, led elsewhere"] += 1
                if not right:
                    self.score.fail(self.t, "merged into what has not the thing", self.name_of(thing),
                                    f"id {found} into {into}, of {self.name_of(self.of.get(into)) or 'nothing'}")
                continue
            if thing is None:
                counts["gone, of nothing"] += 1
            elif not self.there[thing]:
                counts["gone, of what is gone"] += 1
            elif self.stands(thing):
                counts["falsely gone"] += 1
                counts[f"falsely gone, {self.things[thing].kind}"] += 1
                feature = self.gone_features[found]
                self.score.fail(self.t, f"falsely gone ({reason}), {self.things[thing].kind}", self.name_of(thing),
                                f"id {found}, {feature.kind if feature else ''}; "
                                f"{len(self.followed[thing].own)} others on it, {self.beams[thing]} hits")
            else:
                counts["gone, of what moves"] += 1

    def follow_ids(self):
        """Whether the ids of things stay, through changes of kind and else."""
        counts = self.score.counts
        for i, followed in enumerate(self.followed):
            thing = self.things[i]
            if not self.there[i] or math.isinf(followed.first_seen_s):
                continue
            if not followed.own:
                followed.in_several |= followed.spanned
                continue
            if followed.has and followed.has[0] in followed.own:
                main = followed.has[0]
            else:
                main = max(followed.own, key=lambda found: self.length_on(found, i))
            group = self.features[main].group
            before = followed.has
            if before is None:
                self.has_now(i, main, group)
                continue
            if (main, group) == before:
                self.has_now(i, main, group)
                continue
            kept = main == before[0]
            way = f"{before[1]} to {group}"
            hidden = followed.unseen >= OUT_OF_SIGHT_S * RATE_HZ
            if hidden and moved_m(thing, followed.has_pose, self.poses[i]) > MOVED_M:
                counts["found elsewhere after it was out of sight"] += 1
                counts["of these elsewhere under its id"] += kept
                self.has_now(i, main, group)
                continue
            if followed.in_several:
                counts["back from a feature of several things"] += 1
                counts["of these under its id"] += kept
                if not kept:
                    self.score.fail(self.t, f"another id after a feature of several things, {thing.kind}", thing.name,
                                    f"{before[0]} to {main}, {way}")
            elif before[1] != group:
                counts["changes of kind"] += 1
                counts["changes of kind, id kept"] += kept
                counts[f"changes of kind, {thing.kind}"] += 1
                counts[f"changes of kind, id kept, {thing.kind}"] += kept
                if not kept:
                    self.score.fail(self.t, f"id lost with a change of kind, {thing.kind}, {way}", thing.name,
                                    self.says_of_change(before[0], main))
            if not kept and not followed.in_several:
                counts["ids lost without a change of kind"] += before[1] == group
                if before[1] == group:
                    self.score.fail(self.t, f"id lost without a change of kind, {thing.kind}, {group}", thing.name,
                                    self.says_of_change(before[0], main))
                told_merged = self.ended.get(before[0]) == "merged" and before[0] not in self.features
                if self.stands(i) and not told_merged and self.ever[main] > self.ever[before[0]]:
                    counts["falsely appeared"] += 1
                    counts[f"falsely appeared, {thing.kind}"] += 1
                    self.judged_false.add(main)
            self.has_now(i, main, group)

    def has_now(self, i, main, group):
        followed = self.followed[i]
        followed.has, followed.has_pose = (main, group), self.poses[i]
        followed.unseen, followed.in_several = 0, False

    def says_of_change(self, before, after):
        was = "still on the map" if before in self.features else f"gone as {self.ended.get(before)}"
        return f"{before} ({was}) to {after} (on the map since {self.ever[after]:.1f} s)"

    # Appearing and going.

    def check_events(self, look):
        t, counts = self.t, self.score.counts
        for i, (thing, followed) in enumerate(zip(self.things, self.followed)):
            if not math.isinf(thing.appears_s):
                self.check_appearance(i, thing, followed)
            leaves_s = thing.leaves_s if not math.isnan(thing.leaves_s) else thing.goes_s
            if math.isinf(leaves_s):
                continue
            event = followed.event
            if event is None:
                if t < leaves_s:
                    followed.ids_there, followed.spanned_there = followed.own, followed.spanned
                    continue
                event = followed.event = {
                    "ids": followed.ids_there, "in_sight": 0, "done": False,
                    "pose": thing.motion.at(np.array([leaves_s - 1e-3]))[0]}
                if followed.seen_scans == 0:
                    event["done"] = True
                    counts["goings of what was not seen"] += 1
                elif not followed.ids_there and not followed.spanned_there:
                    event["done"] = True
                    counts["goings missed"] += 1
                    self.score.fail(t, f"a going was not told, {thing.kind}", thing.name, "it was not on the map")
            if event["done"]:
                continue
            event["in_sight"] += rays_through(thing, event["pose"], look).sum() >= VISIBLE_HITS
            if event["in_sight"] == 0:
                continue
            why = self.why_not_gone(i, thing, event)
            if not why:
                event["done"] = True
                event["found"] = True
                counts["goings found"] += 1
            elif event["in_sight"] > ANSWER_S * RATE_HZ:
                event["done"] = True
                counts["goings missed"] += 1
                self.score.fail(t, f"a going was not told, {thing.kind}", thing.name, why)

    def why_not_gone(self, i, thing, event):
        """What is wrong with the map after a thing has gone from its place; empty if nothing is."""
        outline = placed(self.samples[i], event["pose"])
        tree = cKDTree(outline)
        for found, feature in self.features.items():
            if found in self.of:
                continue  # of another thing, or of this one where it is now
            near = np.isfinite(tree.query(feature.samples, distance_upper_bound=ON_M)[0])
            if near.mean() > 0.5:
                return f"id {found}, {feature.kind}, is still there"
        for found in event["ids"]:
            if found in self.features and self.of.get(found) != i:
                return f"its id {found} is now of {self.name_of(self.of.get(found)) or 'nothing'}"
        return ""

    def judge_time(self, when_s, from_s, to_s, what, thing):
        """Whether a time is in the interval that the map tells; without one it is not told."""
        if from_s is None or to_s is None:
            self.score.counts[f"time of {what} not told"] += 1
            return
        self.score.times_told += 1
        inside = from_s - START_S - 1e-6 <= when_s <= to_s - START_S + 1e-6
        self.score.times_inside += inside
        if not inside:
            self.score.fail(self.t, f"the time of {what} is outside", thing,
                            f"{when_s:.2f} s is not in {from_s - START_S:.2f} to {to_s - START_S:.2f} s")

    def judge_times(self):
        """Of what appeared and went, by what the map told at last."""
        for thing, followed in zip(self.things, self.followed):
            event = followed.event or {}
            if "new" in event:
                told = self.last_told[event["new"]]
                self.judge_time(thing.appears_s, told.get("last_absent"), told.get("first_seen"), "appearing",
                                thing.name)
            if not event.get("found"):
                continue
            # A thing that drives off under its id tells nothing of its former place.
            place = cKDTree(placed(thing.samples(), event["pose"]))
            gone = [found for found in event["ids"] if self.ended.get(found) in ("seen through", "left")]
            told = [told for told in (self.last_told[found] for found in gone) if np.isfinite(
                place.query(Feature(told).samples, distance_upper_bound=ON_M)[0]).mean() > 0.5]
            if event["ids"] and not told:
                self.score.counts["time of going not to be told"] += 1
                continue
            told = told[-1] if told else {}
            leaves_s = thing.leaves_s if not math.isnan(thing.leaves_s) else thing.goes_s
            self.judge_time(leaves_s, told.get("last_seen"), told.get("first_absent"), "going", thing.name)

    def check_appearance(self, i, thing, followed):
        t, counts = self.t, self.score.counts
        if t < thing.appears_s or (followed.event or {}).get("done"):
            return
        if followed.seen_scans == 0:
            return
        event = followed.event = followed.event or {"done": False}
        new = [found for found in followed.own if self.ever[found] >= thing.appears_s]
        if new:
            event["done"] = True
            counts["appearances found"] += 1
            event["new"] = new[0]
        elif followed.seen_scans > ANSWER_S * RATE_HZ:
            event["done"] = True
            counts["appearances missed"] += 1
            self.score.fail(t, f"an appearance was not told, {thing.kind}", thing.name,
                            f"its features {followed.own}, {self.beams[i]} hits")

    # What a robot could hit.

    def check_hits(self):
        t = self.t
        of = self.hit_thing >= 0
        things, samples, points = self.hit_thing[of], self.hit_sample[of], self.hit_points[of]
        keys = things * 10000 + np.array([self.pieces[i][s] for i, s in zip(things, samples)], int)
        if self.features:
            tree = cKDTree(np.vstack([feature.samples for feature in self.features.values()]))
            on = np.isfinite(tree.query(points, distance_upper_bound=ON_M)[0])
        else:
            on = np.zeros(len(points), bool)
        seen = set()
        order = np.argsort(keys, kind="stable")
        unique, begins = np.unique(keys[order], return_index=True)
        for key, part in zip(unique, np.split(order, begins[1:])):
            if len(part) < VISIBLE_HITS:
                continue
            key = int(key)
            seen.add(key)
            self.score.counts["places seen"] += 1
            if on[part].any() or self.is_enclosed(points[part]):
                self.end_run(key)
                continue
            self.score.counts["places on no map"] += 1
            run = self.off_since.setdefault(key, [t, t, len(part)])
            run[1], run[2] = t, max(run[2], len(part))
        for key, run in list(self.off_since.items()):
            if key not in seen and t - run[1] > OUT_OF_SIGHT_S:
                self.end_run(key)

    def end_run(self, key):
        run = self.off_since.pop(key, None)
        if run is None:
            return
        since, last, hits = run
        thing = self.things[key // 10000]
        if last - since > self.score.longest_s:
            self.score.longest_s, self.score.longest_of = last - since, thing.name
        if last - since > TARGETS["on_no_map_s"] + 1e-6:
            self.score.counts[f"longer on no map, {thing.kind}"] += 1
            self.score.fail(last, f"on no map for long, {thing.kind}", thing.name,
                            f"{last - since:.1f} s, since {since:.1f} s, up to {hits} hits in a scan")

    def is_enclosed(self, points):
        return any(feature.encloses(points).any() for feature in self.features.values())

    # Counting.

    def expected(self):
        """Things that exist and are in sight, or stood when they were last seen and do still; besides those that moved
        out of sight, but have a feature of their own all the same."""
        return [i for i, followed in enumerate(self.followed) if self.there[i] and followed.seen_pose is not None
                and (self.beams[i] >= VISIBLE_HITS or followed.own or (
                    followed.stood and moved_m(self.things[i], followed.seen_pose, self.poses[i]) <= MOVED_M))]

    def is_excused(self, feature):
        """A feature where a thing was when it was last seen, which nobody has seen to be elsewhere."""
        for i in self.dynamic:
            followed = self.followed[i]
            if followed.seen_pose is None:
                continue
            if self.there[i] and moved_m(self.things[i], followed.seen_pose, self.poses[i]) <= MOVED_M:
                continue
            tree = cKDTree(placed(self.samples[i], followed.seen_pose))
            near = np.isfinite(tree.query(feature.samples, distance_upper_bound=ON_M)[0])
            if near.mean() > 0.5 and not followed.seen_free:
                return True
        return False

    def update_free(self, look):
        """Whether the place where a thing was last seen was seen to be free since."""
        for i in self.dynamic:
            followed = self.followed[i]
            if followed.seen_pose is None:
                continue
            if followed.last_seen_s == self.t:
                followed.seen_free = False
            elif not followed.seen_free:
                followed.seen_free = rays_through(self.things[i], followed.seen_pose, look).sum() >= VISIBLE_HITS

    def seen_parts(self, i):
        """Number of the parts of its outline that were seen."""
        seen = self.followed[i].seen_pieces
        at = np.flatnonzero(seen)
        if not len(at):
            return 0
        gap = PART_GAP_M / SPACING_M
        parts = 1 + int((np.diff(at) > gap).sum())
        if parts > 1 and at[0] + len(seen) - at[-1] <= gap:
            parts -= 1
        return parts

    def count(self):
        counts, score = self.score.counts, self.score
        expected = self.expected()
        counts["lines"] += 1
        counts["expected"] += len(expected)
        nothing, excused = [], 0
        for found, feature in self.features.items():
            if found in self.of or found in self.spans:
                continue
            if self.is_excused(feature):
                excused += 1
            else:
                nothing.append(found)
        known = sum(there and followed.seen_pose is not None for there, followed in zip(self.there, self.followed))
        counts["things that moved out of sight, not expected"] += known - len(expected)
        features = len(self.features) - excused
        counts["features"] += features
        counts["features, excused"] += excused
        counts["features on nothing"] += len(nothing)
        counts["features of several things"] += len(self.spans)
        for found in nothing:
            self.note_nothing(found)
        parts = 0
        for i in expected:
            followed, kind = self.followed[i], self.things[i].kind
            n = len(followed.own)
            counts[f"expected, {kind}"] += 1
            counts[f"features, {kind}"] += n
            parts += max(1, self.seen_parts(i)) if followed.seen_pieces is not None else 1
            if n > 1:
                counts["things with several"] += 1
                counts[f"things with several, {kind}"] += 1
                self.note("things with several", i, f"{kind}", self.says_of(followed.own))
            elif n == 0:
                counts["things with none"] += 1
                counts[f"things with none, {kind}"] += 1
                counts["things with none, in one of several things"] += followed.spanned
                self.note("things with none", i, f"{kind}" + (", in a feature of several things" if followed.spanned
                                                              else ""), f"{self.beams[i]} hits")
        if expected:
            score.ratios.append(features / len(expected))
            score.ratios_of_parts.append(features / parts)
        # Objects.
        for i in expected:
            if self.things[i].kind not in MOVABLE:
                continue
            n = len(self.followed[i].own)
            counts["objects found" if n else "objects missed"] += 1
            counts["false objects, doubles"] += max(0, n - 1)
        for found, feature in self.features.items():
            if feature.kind not in BODIES:
                continue
            thing = self.of.get(found)
            if thing is not None and self.things[thing].kind in ("hall", "building"):
                counts["false objects, on walls"] += 1
                self.note("an object on a wall", thing, "", self.says_of([found]))
        counts["false objects, on nothing"] += sum(self.features[found].kind in BODIES for found in nothing)

    def says_of(self, ids):
        texts = []
        for found in ids:
            told = self.features[found].told
            texts.append(f"{found} {told['kind']} {told['class']} {told['motion']} "
                         f"{len(self.features[found].samples) * SPACING_M:.1f} m")
        return "; ".join(texts)

    def note(self, what, thing, more, says):
        """The beginning of what lasts for some time."""
        key = (what, thing, more)
        last = self.lasting.get(key)
        self.lasting[key] = self.t
        if last is None or self.t - last > 1.5 * COUNT_EVERY / RATE_HZ:
            self.score.fail(self.t, f"{what}, {more}" if more else what, self.name_of(thing), says)

    def note_nothing(self, found):
        feature = self.features[found]
        counts = self.score.counts
        counts[f"features on nothing, {feature.kind}"] += 1
        within = [i for i, thing in enumerate(self.things) if self.there[i] and thing.kind != "hall" and
                  (is_within(feature.samples, placed(thing.outline, self.poses[i]))
                   | (self.static_or_near(feature, i))).mean() > 0.5]
        if within:
            counts["features on nothing, within a thing"] += 1
        place = f"({feature.told['x']:.1f}, {feature.told['y']:.1f})"
        told = feature.told
        best = max(self.parts[found].items(), key=lambda item: item[1], default=(None, 0.0))
        near = f", {100 * best[1]:.0f} % on {self.name_of(best[0])}" if best[0] is not None else ""
        key = ("nothing", found)
        if key not in self.lasting:
            self.lasting[key] = self.t
            self.score.fail(self.t, f"a feature on nothing, {feature.kind}"
                            + (", within a thing" if within else ""), self.name_of(within[0]) if within else "",
                            f"id {found} at {place}, {told['class']} {told['motion']}, "
                            f"{len(feature.samples) * SPACING_M:.1f} m, since {self.ever[found]:.1f} s{near}")

    def static_or_near(self, feature, i):
        outline = placed(self.samples[i], self.poses[i])
        return np.isfinite(cKDTree(outline).query(feature.samples, distance_upper_bound=ON_M)[0])

    def keep_picture(self, look):
        self.score.picture = {
            "t": self.t, "robot": look.origin, "hits": self.hit_points,
            "truth": [placed(thing.outline, self.poses[i]) for i, thing in enumerate(self.things) if self.there[i]],
            "features": [(f.id, f.kind, f.points, f.told["closed"], f.told["x"], f.told["y"])
                         for f in self.features.values()]}

    def finish(self):
        for key in list(self.off_since):
            self.end_run(key)
        self.judge_times()
        for found, told in self.last_told.items():
            thing = self.holder.get(found)
            if "last_absent" not in told or thing not in self.static or found in self.judged_false:
                continue
            self.score.counts["falsely appeared"] += 1
            self.score.counts["falsely appeared, told of what stood from the beginning"] += 1
            self.score.fail(told["first_seen"] - START_S, "told to have appeared, but stood from the beginning",
                            self.name_of(thing), f"id {found}, {told['kind']}")
        for thing, followed in zip(self.things, self.followed):
            if math.isinf(followed.first_seen_s):
                self.score.counts["things never seen"] += 1
            event = followed.event
            if not math.isinf(thing.appears_s) and not (event or {}).get("done"):
                self.score.counts["appearances not in sight"] += 1
            leaves = not math.isnan(thing.leaves_s) or not math.isinf(thing.goes_s)
            if leaves and not (event or {}).get("done"):
                self.score.counts["goings not in sight"] += 1
        return self.score


def evaluate(options, seed, picture_s=None):
    """The score of one seed; the text of what failed, if a program did."""
    try:
        scene = Scene(seed)
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            bag = simulate(options, scene, folder)
            looks = {round(look.t * RATE_HZ): look for look in looks_of(bag, options.range_m)}
            comparison = Comparison(scene, picture_s)
            lines = 0
            for line in map_of(options, bag, folder):
                look = looks.get(round((line["stamp"] - START_S) * RATE_HZ))
                if look is None:
                    raise Failed(f"a line of map_bag has the stamp {line['stamp']}, which no scan has")
                comparison.add(look, line)
                lines += 1
            score = comparison.finish()
            score.counts["scans"], score.counts["scans with a line"] = len(looks), lines
            return score
    except (Failed, NoPlace, KeyError) as error:
        return f"seed {seed}: {error!r}" if isinstance(error, KeyError) else f"seed {seed}: {error}"


# --- numbers


def ratio(part, whole):
    return part / whole if whole else math.nan


def f1(found, missed, false):
    return ratio(2.0 * found, 2.0 * found + missed + false)


def total_of(scores):
    counts = collections.Counter()
    for score in scores:
        counts.update(score.counts)
    return counts


def numbers_of(scores):
    c = total_of(scores)
    false_objects = sum(c[f"false objects, {what}"] for what in ("doubles", "on walls", "on nothing"))
    worst = max(scores, key=lambda score: score.longest_s)
    told = sum(score.times_told for score in scores)
    merged = c["merged, led to its thing"] + c["merged, led elsewhere"]
    return {
        "kept": ratio(c["changes of kind, id kept"], c["changes of kind"]),
        "per_truth": float(np.mean([value for score in scores for value in score.ratios])),
        "per_part": float(np.mean([value for score in scores for value in score.ratios_of_parts])),
        "on_no_map_s": worst.longest_s, "on_no_map_of": f"{worst.longest_of}, seed {worst.seed}",
        "object_f1": f1(c["objects found"], c["objects missed"], false_objects),
        "object_recall": ratio(c["objects found"], c["objects found"] + c["objects missed"]),
        "object_precision": ratio(c["objects found"], c["objects found"] + false_objects),
        "event_f1": f1(c["appearances found"] + c["goings found"], c["appearances missed"] + c["goings missed"],
                       c["falsely appeared"] + c["falsely gone"]),
        "appeared_f1": f1(c["appearances found"], c["appearances missed"], c["falsely appeared"]),
        "gone_f1": f1(c["goings found"], c["goings missed"], c["falsely gone"]),
        "times": ratio(sum(score.times_inside for score in scores), told), "told": told,
        "not_told": c["time of appearing not told"] + c["time of going not told"],
        "twice": c["ids twice on one map"] + c["ids again after gone"],
        "merged": ratio(c["merged, led to its thing"], merged),
        "elsewhere": c["merged, led elsewhere"], "merges": merged,
    }


def targets(n):
    """(sentence, figure, met)"""
    low, high = TARGETS["per_truth"]
    yield (f"ids kept through at least {TARGETS['kept']:g} of the changes of kind", f"{n['kept']:.3f}",
           n["kept"] >= TARGETS["kept"])
    yield f"{low:g} to {high:g} features per true thing", f"{n['per_truth']:.3f}", low <= n["per_truth"] <= high
    yield (f"nothing that {VISIBLE_HITS} beams hit on no map for more than {TARGETS['on_no_map_s']:g} s",
           f"{n['on_no_map_s']:.1f} s ({n['on_no_map_of']})", n["on_no_map_s"] <= TARGETS["on_no_map_s"] + 1e-6)
    yield (f"F1 of what moves, or may, at least {TARGETS['object_f1']:g}", f"{n['object_f1']:.3f}",
           n["object_f1"] >= TARGETS["object_f1"])
    yield (f"F1 of what appeared and what went at least {TARGETS['event_f1']:g}", f"{n['event_f1']:.3f}",
           n["event_f1"] >= TARGETS["event_f1"])
    figure = f"{n['times']:.3f} of {n['told']}, not told of {n['not_told']}" if n["told"] else \
        f"not told of {n['not_told']}"
    yield (f"times of these inside the interval that the map tells in {100 * TARGETS['times']:.0f} %", figure,
           n["told"] > 0 and n["times"] >= TARGETS["times"])
    yield "no id given twice", str(n["twice"]), n["twice"] == 0
    yield ("all merged ids lead to the id that has the thing", f"{n['elsewhere']} of {n['merges']} do not",
           n["elsewhere"] == 0)


# --- tables


def figure_of(value, digits=3):
    return "" if value is None or math.isnan(value) else f"{value:.{digits}f}"


def ids_table(c):
    rows = []
    for kind in KINDS:
        changes = c[f"changes of kind, {kind}"]
        if changes:
            kept = c[f"changes of kind, id kept, {kind}"]
            rows.append((kind, str(changes), str(kept), figure_of(ratio(kept, changes))))
    rows.append(("all", str(c["changes of kind"]), str(c["changes of kind, id kept"]),
                 figure_of(ratio(c["changes of kind, id kept"], c["changes of kind"]))))
    return table(("true thing", "changes of kind", "id kept", "part"), rows)


def other_ids_table(c):
    keys = ("ids lost without a change of kind", "found elsewhere after it was out of sight",
            "of these elsewhere under its id", "back from a feature of several things", "of these under its id",
            "ids that went to another thing", "ids twice on one map", "ids again after gone", "ids again after merged",
            "gone without being told", "merged, led to its thing", "merged, led elsewhere", "merged, of nothing")
    return table(("ids", "number"), [(key, str(c[key])) for key in keys])


def features_table(c):
    lines = max(c["lines"], 1)
    rows = []
    for kind in KINDS:
        expected = c[f"expected, {kind}"]
        rows.append((kind, figure_of(expected / lines, 2), figure_of(c[f"features, {kind}"] / lines, 2),
                     figure_of(ratio(c[f"features, {kind}"], expected)),
                     figure_of(ratio(c[f"things with several, {kind}"], expected)),
                     figure_of(ratio(c[f"things with none, {kind}"], expected))))
    return table(("true thing", "expected per line", "features of their own per line", "features per thing",
                  "part with several", "part with none"), rows)


def others_table(c):
    lines = max(c["lines"], 1)
    keys = ("features", "features on nothing", *(f"features on nothing, {kind}" for kind in KIND_COLORS),
            "features on nothing, within a thing", "features of several things", "features, excused", "expected",
            "things that moved out of sight, not expected", "things with several", "things with none",
            "things with none, in one of several things")
    return table(("per line", "mean"), [(key, figure_of(c[key] / lines)) for key in keys])


def off_table(c, scores):
    rows = [(kind, str(c[f"longer on no map, {kind}"])) for kind in KINDS]
    longest = sorted((score.longest_s for score in scores), reverse=True)
    rows += [("all places, part of the scans in which they are seen", figure_of(
        ratio(c["places on no map"], c["places seen"]), 5)),
             ("longest time of a seed, median, s", figure_of(float(np.median(longest)), 2)),
             ("longest time of a seed, most, s", figure_of(longest[0], 2))]
    return table((f"longer than {TARGETS['on_no_map_s']:g} s on no map", "number"), rows)


def objects_table(c, n):
    return table(("objects", ""), [
        ("recall", figure_of(n["object_recall"])), ("precision", figure_of(n["object_precision"])),
        ("F1", figure_of(n["object_f1"])), ("found", str(c["objects found"])), ("missed", str(c["objects missed"])),
        *((f"false, {what}", str(c[f"false objects, {what}"])) for what in ("doubles", "on walls", "on nothing"))])


def events_table(c, n):
    rows = [("appeared", c["appearances found"], c["appearances missed"], c["falsely appeared"],
             figure_of(n["appeared_f1"]), c["appearances not in sight"], c["time of appearing not told"]),
            ("gone", c["goings found"], c["goings missed"], c["falsely gone"], figure_of(n["gone_f1"]),
             c["goings not in sight"] + c["goings of what was not seen"], c["time of going not told"])]
    return table(("things that", "found", "missed", "false", "F1", "not in sight, not counted", "time not told"),
                 [tuple(map(str, row)) for row in rows])


def false_events_table(c):
    rows = [(kind, str(c[f"falsely appeared, {kind}"]), str(c[f"falsely gone, {kind}"])) for kind in KINDS]
    told = c["falsely appeared, told of what stood from the beginning"]
    rows += [("told of what stood from the beginning", str(told), ""),
             ("of what moves, not counted", "", str(c["gone, of what moves"])),
             ("of nothing, not counted", "", str(c["gone, of nothing"]))]
    return table(("false, of", "appeared", "gone"), rows)


def failures_table(scores, most=40):
    """The kinds of failure by their number, each with its first one."""
    by_what = collections.defaultdict(list)
    for score in scores:
        for failure in score.failures:
            by_what[failure["what"]].append(failure)
    rows = []
    for what, found in sorted(by_what.items(), key=lambda item: -len(item[1]))[:most]:
        first = found[0]
        rows.append((what, str(len(found)), str(len({failure["seed"] for failure in found})),
                     f"seed {first['seed']}, {first['t']:.1f} s, {first['thing']}: {first['says']}"))
    return table(("failure", "number", "seeds", "the first"), rows)


# --- picture


def draw(score, path):
    shown = score.picture
    figure, ax = pyplot.subplots(figsize=(17, 11.5), layout="constrained")
    ax.plot(*shown["hits"].T, ".", color="0.45", ms=3, zorder=4)
    for outline in shown["truth"]:
        ax.add_patch(patches.Polygon(outline, closed=True, fill=False, ec="black", lw=0.9, zorder=2))
    for found, kind, points, closed, x, y in shown["features"]:
        line = np.vstack((points, points[:1])) if closed else points
        ax.plot(*line.T, color=KIND_COLORS[kind], lw=2.2, alpha=0.85, zorder=3)
        ax.annotate(str(found), (x, y), xytext=(5, 5), textcoords="offset points", color=KIND_COLORS[kind], fontsize=8,
                    zorder=5)
    ax.plot(*shown["robot"], "k^", ms=9, zorder=6)
    ax.set(xlim=(-22.0, 36.0), ylim=(-19.5, 19.5), aspect="equal", xlabel="x, m", ylabel="y, m")
    ax.set_title(f"seed {score.seed}, t = {shown['t']:.1f} s", fontsize=11)
    save(figure, path, [pyplot.Line2D([], [], color="black", lw=0.9, label="truth"),
                        *(pyplot.Line2D([], [], color=color, lw=2.2, label=kind)
                          for kind, color in KIND_COLORS.items() if kind != "target"),
                        pyplot.Line2D([], [], marker=".", ls="", color="0.45", label="hits"),
                        pyplot.Line2D([], [], marker="^", ls="", color="black", label="robot")])


# --- report


INTRODUCTION = """
`map_bag` with {config} on {seeds} scenes of the kind of [site.xml](../../models/worlds/site.xml), {duration:.0f} s at
{rate:.0f} Hz each: {scans:,} scans. A multirotor flies through a hall and around a building on laps of 85 s, among
parked cars of which one drives off, one that drives in, parks between others and leaves, walkers that stop for 3 s and
for 30 s, four who walk about, poles, and crates of which two appear and two go. The scanner has {beams} beams over
270°, up to {range_m:g} m, with 1 cm of white noise; poses are exact. Places, sizes, times and the way are of the seed.
Parameters are those of `cfg/map_outdoor.yaml` unless others are named: with `cfg/map.yaml`, whose objects are at most
1.6 m across and whose elements are 4 cm apart, a car in motion is no object, and its sides seen from 10 to 20 m, where
hits are as far apart as its elements may be, are many chains.
"""
ASSIGNED = """
A feature is of the thing on whose outline, at that time, more than half of its length is: within {on:g} m of it, and of
no other outline that is nearer. Where the outlines of several things together have more than half of it, but none has,
it is a feature of several things, and no thing's own. Any other one is on nothing; it is *within a thing* where more
than half of it is inside a footprint or near its outline. The connected walls of the hall are one thing with one
outline. Lines are those of each second, from the first on.
"""
IDS = """
A thing has the id of that of its own features that it had before; if that is its own no more, of the one with the most
length on it. A change of kind is one between ellipse or box, polyline and boundary, also after a time on no map.
Counted apart are things that were part of a feature of several things in the meantime, and those that were out of sight
for {out:g} s and have moved by more than {moved:g} m since they had a feature. *Again after gone* are ids told as gone
for another reason than that they were merged, *after merged* is as it should be. A merged id leads to its thing if the
feature that it was merged into is the thing's own, or one of several things of which it is one.
"""
FEATURES = """
Features per true thing: the number of features over that of the things that are expected, averaged over the lines.
Expected are things that exist and are in sight ({hits} hits in this scan), or stood for {stands:g} s when they were
last in sight and have not moved by more than {moved:g} m since; besides things that moved out of sight, but have a
feature of their own all the same. Not counted are features at the place where a thing was when last seen, if it has
moved or gone since, until {hits} beams of a scan have passed through that place: nobody can know (*excused*). By parts
of things, where the hall and the building are as many as the parts of them that were seen and are {gap:g} m apart:
{per_part:.3f} features per part.
"""
OFF = """
A place is a thing, or of hall and building a piece of {piece:g} m of the outline. It is on no map in a scan in which at
least {hits} hits are of it, if none of these is within {on:g} m of a feature or within a closed one. Its time is from
the first such scan to the last, until it is on the map or not seen for {out:g} s.
"""
OBJECTS = """
Cars, persons and crates that are expected, in each line: found with a feature of its own of any kind, missed without.
False are further features of one, and ellipses and boxes on walls, on the building or on nothing.
"""
EVENTS = """
Appeared: a crate that comes to be where nothing was, found if it has a feature of its own with an id that was not there
before, before it has been in sight for more than {answer:g} s, in all. Gone: a crate that goes, or a car that drives
off, found if no feature is at its place, and the ids that it had are off the map or still on it where it is now, before
{hits} beams of a scan have passed through its place for more than {answer:g} s, in all. False are a new id for a thing
that has stood for {stands:g} s and had another, which was not told as merged into it; what is told to have appeared but
stood from the beginning; and a feature that is told as seen through or left though its thing stands there. Of these the
hall and all others count. The times are inside if the appearing is between `last_absent` and `first_seen`, the going
between `last_seen` and `first_absent`.
"""
FAILURES = """
Each failure once when it begins, by kind; `--failures FILE` writes all of them, with seed and stamp.
"""


def report_of(options, measured, scores, failed):
    c, n = total_of(scores), numbers_of(scores)
    words = {"on": ON_M, "hits": VISIBLE_HITS, "moved": MOVED_M, "gap": PART_GAP_M, "piece": PIECE_M,
             "out": OUT_OF_SIGHT_S, "answer": ANSWER_S, "stands": STANDS_S, "per_part": n["per_part"]}
    about = INTRODUCTION.format(config=options.config_name, seeds=len(scores), duration=DURATION_S, rate=RATE_HZ,
                                scans=c["scans"], beams=BEAMS, range_m=options.range_m)
    counted = (f"{c['scans'] - c['scans with a line']} scans have no line; {c['hits of nothing']:,} of {c['hits']:,} "
               f"hits are farther than {HIT_M:g} m from any outline, of the floor, say; {c['things never seen']} "
               "things were never seen.")
    if failed:
        counted += f" Seeds without a result: {'; '.join(failed)}."
    return "\n".join((
        "# The one map of a site\n", introduction(measured, about), prose(counted),
        targets_section(list(targets(n))),
        section("What is compared", prose(ASSIGNED.format(**words))),
        section("Picture", "![Truth and map of one scene](images/site.png)\n"),
        section("Ids", prose(IDS.format(**words)), ids_table(c), other_ids_table(c)),
        section("Features per true thing", prose(FEATURES.format(**words)), features_table(c), others_table(c)),
        section("On no map", prose(OFF.format(**words)), off_table(c, scores)),
        section("What moves, or may", prose(OBJECTS.format(**words)), objects_table(c, n)),
        section("What appeared and what went", prose(EVENTS.format(**words)), events_table(c, n),
                false_events_table(c)),
        section("Failures", prose(FAILURES.format(**words)), failures_table(scores)),
    ))


def evaluate_all(options, seeds):
    """Scores by seed, and the texts of failed programs."""
    scores, failed, begin_s = {}, [], time.monotonic()
    with concurrent.futures.ProcessPoolExecutor(options.jobs) as pool:
        waiting = {pool.submit(evaluate, options, seed, options.picture_s if seed == seeds[0] else None): seed
                   for seed in seeds}
        try:
            for done, future in enumerate(concurrent.futures.as_completed(waiting), 1):
                result = future.result()
                if isinstance(result, str):
                    failed.append(result)
                else:
                    scores[waiting[future]] = result
                print_progress(done / len(seeds), begin_s, f"{done} of {len(seeds)} seeds")
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    print()
    return [scores[seed] for seed in seeds if seed in scores], failed


@dataclasses.dataclass
class Options:
    """What the processes get."""

    tool: pathlib.Path
    simulate: pathlib.Path
    config: pathlib.Path
    config_name: str
    range_m: float
    jobs: int
    picture_s: float


def options_of(arguments, parser):
    config = arguments.config
    if not config.is_file():
        parser.error(f"--config: there is no file {config}")
    try:
        values = yaml.safe_load(config.read_text(encoding="utf-8"))
        range_m = float(((values or {}).get("scan") or {}).get("max_range_m", 10.0))
    except (yaml.YAMLError, AttributeError, TypeError, ValueError) as error:
        parser.error(f"--config: {config} is not a file of parameters: {' '.join(str(error).split())}")
    tool = arguments.tool
    simulator = tool.parent / "simulate_bag"
    for program in (tool, simulator):
        if not os.access(program, os.X_OK):
            parser.error(f"there is no program {program}: --tool names map_bag, simulate_bag is beside it")
    shown = config.relative_to(ROOT) if config.is_relative_to(ROOT) else config.name
    default = config == CONFIG
    return Options(tool, simulator, config, f"the shipped `{shown}`" if default else f"`{shown}`",
                   min(range_m, MOST_RANGE_M), arguments.jobs, arguments.picture_time)


def main():
    parser = arguments_parser(__doc__.split("\n\n")[0], "docs/benchmarks", "other seeds or parameters")
    parser.add_argument("--tool", type=pathlib.Path, help="map_bag; simulate_bag is beside it")
    parser.add_argument("--programs", type=pathlib.Path, help="the build's folder, which is not used")
    parser.add_argument("--config", type=pathlib.Path, default=CONFIG, help="cfg/map_outdoor.yaml")
    parser.add_argument("--seeds", type=int, default=SEEDS, metavar="N", help=f"number of scenes: {SEEDS}")
    parser.add_argument("--first-seed", type=int, default=0, metavar="N", help="the first of them: 0")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK_SEEDS} seeds")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), metavar="N", help="processes: one for each core")
    parser.add_argument("--picture-time", type=float, default=PICTURE_S, metavar="S",
                        help=f"of the first seed: {PICTURE_S:g}")
    parser.add_argument("--failures", type=pathlib.Path, metavar="FILE", help="all failures, a line of JSON for each")
    parser.add_argument("--write-world", type=pathlib.Path, metavar="FILE",
                        help="write the scene of --first-seed, and end")
    arguments = parser.parse_args()
    if arguments.first_seed < 0:
        parser.error("--first-seed must be at least 0")
    for option, path in (("--failures", arguments.failures), ("--write-world", arguments.write_world)):
        if path and not path.absolute().parent.is_dir():
            parser.error(f"{option}: there is no folder {path.absolute().parent}")
    if arguments.write_world:
        arguments.write_world.write_text(Scene(arguments.first_seed).xml(parts=True))
        return
    if not arguments.tool:
        parser.error("--tool is missing: scripts/evaluate site gives it")
    if arguments.quick:
        arguments.seeds = QUICK_SEEDS
    if arguments.seeds < 1:
        parser.error("--seeds must be at least 1")
    if arguments.jobs < 1:
        parser.error("--jobs must be at least 1")
    if not 0.0 <= arguments.picture_time < DURATION_S:
        parser.error(f"--picture-time must be at least 0 and below {DURATION_S:g}")
    if not importlib.util.find_spec("rosbag"):
        parser.error("there is no module rosbag: scripts/install_dependencies use")
    options = options_of(arguments, parser)
    whole = (arguments.seeds == SEEDS and arguments.first_seed == 0 and options.config == CONFIG)
    output = output_folder(arguments, whole)
    measured = facts(arguments, {"--output": "DIR", "--failures": "FILE"})
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    scores, failed = evaluate_all(options, seeds)
    for text in failed:
        print(text, file=sys.stderr)
    if not scores:
        sys.exit("no seed has a result")
    if arguments.failures:
        arguments.failures.write_text("".join(json.dumps(failure) + "\n" for score in scores
                                              for failure in score.failures))
    if scores[0].picture:
        draw(scores[0], images_folder(output) / "site.png")
    write(output, "site.md", report_of(options, measured, scores, failed))
    if failed:
        sys.exit(1)


if __name__ == "__main__":
    main()
