# SPDX-License-Identifier: BSD-3-Clause
"""The worlds of `scripts/evaluate map`: for each experiment its flights, each a world (models/worlds/README.md), seeds,
a duration and options of map_flights. Everything follows from the experiment's name and the seed.

    python3 scripts/evaluation/worlds.py DIR [EXPERIMENT ...]        writes the worlds, to look at or to fly by hand

The papers do not specify their objects' paths. This project's choice is given at each experiment below. Clearances are
those between the circles about two ellipses, so they are lower bounds.
"""

import argparse
import dataclasses
import math
import pathlib
import random
import sys

import numpy as np
from scipy.interpolate import make_interp_spline

RATE_HZ = 20.0
BEAM_RAD, FIRST_BEAM_RAD, BEAMS = math.radians(0.25), math.radians(-135.0), 1081
RANGE_M = 10.0
SWEEP_S = "0.01875"  # a UTM-30LX takes 25 ms for a turn, and three quarters of that for its 270 degrees
TURN_RAD_S = "1.0472"
COLORS = {"standing": "0.80 0.25 0.20 1", "moving": "0.18 0.40 0.78 1"}


@dataclasses.dataclass
class Flight:
    experiment: str
    row: str  # of the experiment's table
    name: str  # of the file
    xml: str
    seeds: tuple
    duration_s: float
    options: tuple = ()
    settings: str = ""  # YAML for --set
    walls: tuple = ()  # boxes (x, y, half x, half y), to draw


# --- paths


@dataclasses.dataclass
class Path:
    """The text that the simulator reads, and the same path in Python: times in s -> positions in m, one row each."""

    text: str
    at: object
    mean_speed_m_s: float = 0.0


def stand(x, y):
    return Path("", lambda t: np.tile((x, y), (len(t), 1)))


def circle(x, y, radius, rate, phase=0.0, suffix=""):
    text = f"circle center {x:.4f} {y:.4f} radius {radius:.4f} rate {rate:.4f} phase {phase:.4f}"
    return Path(f"{text} {suffix}".strip(), lambda t: np.column_stack(
        (x + radius * np.cos(rate * t + phase), y + radius * np.sin(rate * t + phase))), abs(radius * rate))


def line(x, y, to_x, to_y, period, phase=0.0, suffix=""):
    text = f"line from {x:.4f} {y:.4f} to {to_x:.4f} {to_y:.4f} period {period:.4f} phase {phase:.4f}"
    start, end = np.array((x, y)), np.array((to_x, to_y))

    def at(t):
        part = 0.5 * (1.0 - np.cos(2.0 * math.pi * t / period + phase))
        return start + part[:, None] * (end - start)

    return Path(f"{text} {suffix}".strip(), at, 2.0 * np.linalg.norm(end - start) / period)


def straight(x, y, velocity_x, velocity_y):
    return Path(f"straight from {x:.5f} {y:.5f} velocity {velocity_x:.5f} {velocity_y:.5f}",
                lambda t: np.column_stack((x + velocity_x * t, y + velocity_y * t)), math.hypot(velocity_x, velocity_y))


def loop(speed, points, suffix=""):
    """The simulator's periodic quintic spline (src/sim/periodic_spline.cpp)."""
    points = np.asarray(points, float)
    n = len(points)
    place = make_interp_spline(np.arange(n + 1), np.vstack((points, points[:1])), k=5, bc_type="periodic")
    fine = place(np.linspace(0.0, n, 64 * n + 1))
    rate = n * speed / np.linalg.norm(np.diff(fine, axis=0), axis=1).sum()
    text = f"loop speed {speed:.4f} {suffix} points " + "; ".join(f"{x:.4f} {y:.4f}" for x, y in points)
    return Path(text.replace("  ", " "), lambda t: place(rate * t), speed)


# --- worlds


@dataclasses.dataclass
class Thing:
    """An object: an upright elliptic cylinder."""

    name: str
    path: Path
    rx: float
    ry: float
    yaw: float = 0.0
    moves: bool = False

    @property
    def reach(self):
        return max(self.rx, self.ry)

    def texts(self):
        """(name of a body, its path)"""
        return [(self.name, self.path.text)] if self.path.text else []

    def assets(self):
        return []

    def bodies(self):
        x, y = self.path.at(np.zeros(1))[0]
        mocap = ' mocap="true"' if self.path.text else ""
        return [f'<body name="{self.name}"{mocap} pos="{x:.4f} {y:.4f} 0.9" euler="0 0 {self.yaw:.5f}"> '
                f'<geom type="ellipsoid" group="1" size="{self.rx:.5f} {self.ry:.5f} 0.9" '
                f'rgba="{COLORS["moving" if self.moves else "standing"]}"/> </body>']


def world(name, things, robot=(0.0, 0.0), robot_path="", height_m=1.8, walls=(), fixtures=(), floor=False,
          drag_1_s=0.3):
    lines = [f'<mujoco model="{name}">', '  <compiler angle="radian"/>', "  <custom>",
             f'    <numeric name="robot_drag" data="{drag_1_s:g}"/>']
    if robot_path:
        lines.append(f'    <text name="robot" data="{robot_path}"/>')
    lines += [f'    <text name="{body}" data="{text}"/>' for thing in things for body, text in thing.texts()]
    lines.append("  </custom>")
    assets = [asset for thing in things for asset in thing.assets()]
    if assets:
        lines += ["  <asset>", *(f"    {asset}" for asset in assets), "  </asset>"]
    lines += ["  <worldbody>", '    <light pos="0 0 9" dir="0 0 -1" directional="true"/>']
    if floor:
        lines.append('    <geom type="plane" size="20 20 1" rgba="0.78 0.78 0.76 1"/>')
    labels = [""] * len(walls) + [f'name="fixture/{k + 1}" ' for k in range(len(fixtures))]
    for label, (x, y, half_x, half_y) in zip(labels, (*walls, *fixtures)):
        lines.append(f'    <geom {label}type="box" pos="{x:.4f} {y:.4f} 3" size="{half_x:.4f} {half_y:.4f} 3" '
                     'rgba="0.86 0.84 0.79 1"/>')
    lines += [f"    {body}" for thing in things for body in thing.bodies()]
    lines += [f'    <body name="robot" mocap="true" pos="{robot[0]:.4f} {robot[1]:.4f} {height_m}">',
              '      <site name="lidar" size="0.01"/>',
              '      <geom group="2" type="box" size="0.2 0.2 0.04" rgba="0.15 0.15 0.17 1"/>', "    </body>",
              "  </worldbody>", "</mujoco>", ""]
    return "\n".join(lines)


def moving_ellipse(rx, ratio, psi_deg, path):
    return Thing("ellipse", path, rx, rx / ratio, math.radians(psi_deg), moves=True)


# --- visibility


def azimuths(centers, rx, ry, yaw):
    """First and last azimuth of an ellipse about each of the centers, seen from the origin: the tangents, from
    (n . c)^2 = n' A n for the normals n of the rays through the origin."""
    middle = np.arctan2(centers[:, 1], centers[:, 0])
    distance = np.hypot(centers[:, 0], centers[:, 1])
    turned = yaw - middle
    xx = (rx * np.cos(turned)) ** 2 + (ry * np.sin(turned)) ** 2
    yy = (rx * np.sin(turned)) ** 2 + (ry * np.cos(turned)) ** 2
    xy = (rx**2 - ry**2) * np.sin(turned) * np.cos(turned)
    scale = distance**2 - xx
    root = np.sqrt(xy**2 + scale * yy)
    return middle + np.arctan((-xy - root) / scale), middle + np.arctan((-xy + root) / scale)


def beams_of(things, times):
    """The number of beams of a level scanner at the origin, facing x, that hit each object first: one row per object."""
    azimuth = FIRST_BEAM_RAD + BEAM_RAD * np.arange(BEAMS)
    direction = np.column_stack((np.cos(azimuth), np.sin(azimuth)))
    nearest, which = np.full((len(times), BEAMS), RANGE_M), np.full((len(times), BEAMS), -1)
    for i, thing in enumerate(things):
        turn = np.array(((math.cos(thing.yaw), math.sin(thing.yaw)), (-math.sin(thing.yaw), math.cos(thing.yaw))))
        scale = np.array((thing.rx, thing.ry))
        center = (thing.path.at(times) @ turn.T) / scale
        ray = (direction @ turn.T) / scale
        a, b = (ray**2).sum(1), center @ ray.T
        root = b**2 - a * ((center**2).sum(1) - 1.0)[:, None]
        distance = np.where(root >= 0.0, (b - np.sqrt(np.maximum(root, 0.0))) / a, np.inf)
        hit = (distance > 0.1) & (distance < nearest)
        nearest[hit], which[hit] = distance[hit], i
    return np.stack([(which == i).sum(1) for i in range(len(things))])


def scan_times(duration_s):
    return np.arange(int(round(duration_s * RATE_HZ))) / RATE_HZ


# --- table VI to IX


CIRCLE_IN_FRONT = (2.5, 0.0, 0.8, 0.5)  # centre x, y, radius, rate; the other two are the same beside the robot
ELLIPSE_TRAJECTORIES = {1: CIRCLE_IN_FRONT, 2: (0.0, -2.5, 0.8, 0.5), 3: (0.0, 2.5, 0.8, 0.5)}
BASELINE = {"psi": 45, "rx": 0.35, "ratio": 2, "trajectory": 1}
ELLIPSE_TABLES = {
    "table_6": ("psi", (0, 30, -30, 45, -45, 60, -60, 90)),
    "table_7": ("rx", (0.1, 0.2, 0.3, 0.35, 0.4, 0.5)),
    "table_8": ("ratio", (1, 2, 3, 4, 5)),
    "table_9": ("trajectory", (1, 2, 3)),
}


def ellipse_tables():
    """One moving ellipse before a robot that hovers at the origin and faces x. It keeps its angle in the world."""
    for experiment, (changed, values) in ELLIPSE_TABLES.items():
        for value in values:
            p = {**BASELINE, changed: value}
            name = f"ellipse_psi{p['psi']}_rx{p['rx']}_ratio{p['ratio']}_trajectory{p['trajectory']}"
            thing = moving_ellipse(p["rx"], p["ratio"], p["psi"], circle(*ELLIPSE_TRAJECTORIES[p["trajectory"]]))
            yield Flight(experiment, str(value), name, world(name, [thing]), tuple(range(1, 6)), 60.0)


CIRCLE_TRAJECTORIES = {
    1: circle(*CIRCLE_IN_FRONT),
    2: circle(3.0, 0.0, 1.2, -0.4),
    3: line(2.5, -1.5, 2.5, 1.5, 12.0),
    4: circle(*ELLIPSE_TRAJECTORIES[2]),
    5: circle(*ELLIPSE_TRAJECTORIES[3]),
}
CIRCLE_TABLES = {
    "table_4": [(str(r), r, 2) for r in (0.1, 0.15, 0.3, 0.45, 0.6)],
    "table_5": [(str(trajectory), 0.3, trajectory) for trajectory in (1, 2, 3, 4, 5)],
}
# The same for all rows. Without the wider limits an object of 1.2 m across is structure, and its radius beyond belief.
CIRCLE_SETTINGS = """\
segments: {max_object_extent_m: 1.5}
detections: {detector: least_squares, boxes: false, fit: {radius_difference_sigma_m: 0.001, max_radius_m: 1.0}}
objects: {shape: circle}
"""


def circle_tables():
    for experiment, rows in CIRCLE_TABLES.items():
        for row, r, trajectory in rows:
            name = f"circle_r{r}_trajectory{trajectory}"
            xml = world(name, [moving_ellipse(r, 1, 0, CIRCLE_TRAJECTORIES[trajectory])])
            yield Flight(experiment, row, name, xml, tuple(range(1, 6)), 60.0, settings=CIRCLE_SETTINGS)


# --- many objects


class Placement:
    """Objects so far, walls, and the robot, with their positions at each of the times; new ones must keep clear."""

    def __init__(self, times, walls=()):
        self.times, self.walls, self.things, self.places, self.kept = times, walls, [], [], []

    def keep_clear_of(self, path, distance_m):
        """Of a robot on this path, by this distance at least."""
        self.kept.append((path.at(self.times), distance_m))

    def add(self, thing, clearance_m, wall_clearance_m=None):
        """Adds the object and returns true if it is clear of everything at all times."""
        place = thing.path.at(self.times)
        reach = thing.reach
        for x, y, half_x, half_y in self.walls:
            beyond = np.maximum(np.abs(place - (x, y)) - (half_x, half_y), 0.0)
            if np.hypot(*beyond.T).min() < reach + (wall_clearance_m or clearance_m):
                return False
        others = [(p, other.reach + clearance_m) for p, other in zip(self.places, self.things)] + self.kept
        for other, distance in others:
            if np.hypot(*(place - other).T).min() < reach + distance:
                return False
        self.things.append(thing)
        self.places.append(place)
        return True


class NoPlace(Exception):
    pass


def until_placed(what, tries=3000):
    for _ in range(tries):
        if what():
            return
    raise NoPlace


def radii(chance, low=0.1, high=0.45):
    rx = chance.uniform(low, high)
    return rx, rx / chance.uniform(1.0, 2.5)


def direction(angle):
    return np.array((math.cos(angle), math.sin(angle)))


def random_mover(chance, kind, center, speed, acceleration_m_s2):
    """A path about a centre, at most at `acceleration_m_s2` in its tightest turn, and a yaw for the object on it."""
    x, y = center
    tightest = max(0.4, speed**2 / acceleration_m_s2)
    people = chance.random() < 0.6
    if kind == "circle":
        radius = chance.uniform(tightest, tightest + 0.8)
        rate = chance.choice((-1, 1)) * speed / radius
        return circle(x, y, radius, rate, chance.uniform(0, 6.28), "tangent" if people else ""), people
    if kind == "line":  # its largest acceleration, at the ends, is 2 speed^2 / length
        half = 0.5 * max(2.0 * tightest, chance.uniform(1.5, 4.0)) * direction(chance.uniform(0, 3.14))
        period = math.pi * 2.0 * np.hypot(*half) / speed
        return line(x - half[0], y - half[1], x + half[0], y + half[1], period, chance.uniform(0, 6.28)), False
    count, start = chance.choice((5, 6, 7)), chance.uniform(0, 6.28)
    size = chance.uniform(1.3, 2.2) * tightest
    points = [np.array((x, y)) + size * chance.uniform(0.8, 1.2) * direction(start + 2 * math.pi * i / count)
              for i in range(count)]
    if chance.random() < 0.5:
        points.reverse()
    return loop(speed, points, "tangent" if people else ""), people


def mover_thing(chance, name, path, people, largest=0.45):
    """People are broader than deep: their longer axis lies across the way."""
    rx, ry = radii(chance, 0.15 if people else 0.1, 0.3 if people else largest)
    yaw = math.pi / 2 if people else chance.uniform(-1.57, 1.57)
    return Thing(name, path, rx, ry, yaw, moves=True)


def crowd(seed, manoeuvring=False):
    """Six standing and six moving objects within 8 m of a hovering robot, so many of them hide one another. Two movers
    go round something that stands, two pass behind across the view, two go where they like, all as in the walled room.
    Or eight that manoeuvre, at 0.8 to 1.2 m/s in turns of up to 3 m/s^2, and nothing that stands."""
    for attempt in range(100):
        chance = random.Random(f"crowd {seed} {manoeuvring} {attempt}")
        try:
            return crowd_of(chance, manoeuvring)
        except NoPlace:
            continue
    raise NoPlace(f"crowd {seed}")


def crowd_of(chance, manoeuvring):
    placement = Placement(np.arange(0.0, 60.0, 0.05))
    placement.keep_clear_of(stand(0.0, 0.0), 0.8)

    def in_view(thing):
        place = thing.path.at(placement.times)
        distance, angle = np.hypot(*place.T), np.abs(np.arctan2(place[:, 1], place[:, 0]))
        return distance.max() < 8.0 and angle.max() < math.radians(125)

    def somewhere(low, high, angle=math.radians(115)):
        return chance.uniform(low, high) * direction(chance.uniform(-angle, angle))

    speeds, acceleration = ((0.8, 1.2), 3.0) if manoeuvring else ((0.3, 1.2), 1.0)

    def standing(i):
        place = somewhere(1.8, 4.0) if i < 4 else somewhere(4.0, 6.5)
        thing = Thing(f"standing_{i + 1}", stand(*place), *radii(chance), chance.uniform(-1.57, 1.57))
        return placement.add(thing, 0.4)

    def moving(i):
        speed = chance.uniform(*speeds)
        if i < 2 and not manoeuvring:
            middle = chance.choice(placement.things[:6])
            path, people = random_mover(chance, "circle", middle.path.at(np.zeros(1))[0], speed, acceleration)
        elif i < 4:
            start = somewhere(4.5, 7.0)
            across = direction(math.atan2(start[1], start[0]) + math.pi / 2 + chance.uniform(-0.3, 0.3))
            end = start + (chance.uniform(2.0, 4.0) if manoeuvring else chance.uniform(3.0, 6.0)) * across
            period = math.pi * np.hypot(*(end - start)) / speed
            path, people = line(*start, *end, period, chance.uniform(0, 6.28)), False
        else:
            path, people = random_mover(chance, chance.choice(("circle", "loop")), somewhere(2.5, 7.0), speed,
                                        acceleration)
        thing = mover_thing(chance, f"moving_{i + 1}", path, people)
        return in_view(thing) and placement.add(thing, 0.35)

    for i in range(0 if manoeuvring else 6):
        until_placed(lambda: standing(i), 300)
    for i in range(8 if manoeuvring else 6):
        until_placed(lambda: moving(i), 300)
    return placement.things


def crowd_flights():
    """Fig. 8; the same with a scanner twice as noisy as the map believes; and with manoeuvring objects."""
    for seed in range(1, 11):
        name = f"crowd_{seed}"
        xml = world(name, crowd(seed))
        yield Flight("crowd", "crowd", name, xml, (seed,), 60.0)
        yield Flight("noise", "crowd", name, xml, (seed,), 60.0, ("--range-sigma-m", "0.02"))
        name = f"manoeuvres_{seed}"
        yield Flight("manoeuvres", "crowd", name, world(name, crowd(seed, True)), (seed,), 60.0)


# --- persons, barrel


# The arena of the papers' laboratory, which their range limiter cuts out: 5 m x 6 m. The laboratory's walls are 1 m
# farther out.
ARENA_SETTINGS = """\
scan: {volume: [[1, 0, 0, 2.5], [-1, 0, 0, 2.5], [0, 1, 0, 3.0], [0, -1, 0, 3.0]]}
"""
ARENA_WALLS = ((3.6, 0, 0.1, 4.2), (-3.6, 0, 0.1, 4.2), (0, 4.1, 3.5, 0.1), (0, -4.1, 3.5, 0.1))
ARM_M, ARM_SWING_M, ARM_PERIOD_S = 0.32, 0.2, 1.1


def person(name, path, phase):
    """Torso across the way, and two arms that swing along it, one ahead while the other is behind."""
    things = [Thing(f"{name}/torso", path, 0.12, 0.20, 0.0, moves=True)]
    for side, sign, ahead in (("left", 1, phase), ("right", -1, phase + math.pi)):
        text = f"with {name}/torso at 0 {sign * ARM_M} swing {ARM_SWING_M} period {ARM_PERIOD_S} phase {ahead:.4f}"
        things.append(Thing(f"{name}/{side}_arm", Path(text, path.at), 0.06, 0.05, 0.0, moves=True))
    return things


def people(seed):
    """A barrel of 0.29 m radius and two persons on loops at 0.8 m/s; the robot hovers at the arena's edge."""
    for attempt in range(200):
        chance = random.Random(f"people {seed} {attempt}")
        placement = Placement(np.arange(0.0, 60.0, 0.05))
        placement.keep_clear_of(stand(-2.2, 0.0), 0.7)
        barrel = Thing("barrel", stand(chance.uniform(-0.8, 1.6), chance.uniform(-1.8, 1.8)), 0.29, 0.29)
        try:
            until_placed(lambda: placement.add(barrel, 0.35))
            persons = []
            for name in ("person", "visitor"):

                def walk():
                    count, start = chance.choice((5, 6)), chance.uniform(0, 6.28)
                    middle = (chance.uniform(-0.9, 1.0), chance.uniform(-1.6, 1.6))
                    size_x, size_y = chance.uniform(0.6, 1.4), chance.uniform(0.6, 1.6)
                    angles = start + chance.choice((-1, 1)) * 2 * math.pi * np.arange(count) / count
                    points = np.column_stack((middle[0] + size_x * np.cos(angles), middle[1] + size_y * np.sin(angles)))
                    path = loop(0.8, points, "tangent")
                    place = path.at(placement.times)
                    body = Thing(name, path, ARM_M + 0.06, ARM_M + 0.06)  # with its arms
                    inside = np.abs(place).max(0) < (2.5 - 0.45, 3.0 - 0.45)
                    if not inside.all() or not placement.add(body, 0.2):
                        return False
                    persons.extend(person(name, path, chance.uniform(0, 6.28)))
                    return True

                until_placed(walk, 200)
            return [barrel, *persons]
        except NoPlace:
            continue
    raise NoPlace(f"people {seed}")


def people_flights():
    for seed in range(1, 21):
        name = f"people_{seed}"
        xml = world(name, people(seed), robot=(-2.2, 0.0), walls=ARENA_WALLS, height_m=1.5)
        yield Flight("people", "people", name, xml, (seed,), 60.0, settings=ARENA_SETTINGS, walls=ARENA_WALLS)


# --- walled room


def room_walls(chance):
    """Four walls, then fixtures: a cabinet in the middle of one, and in every second room a closet in a corner."""
    half_x, half_y = chance.uniform(5.6, 6.4), chance.uniform(4.6, 5.4)
    walls = [(half_x + 0.1, 0, 0.1, half_y + 0.2), (-half_x - 0.1, 0, 0.1, half_y + 0.2),
             (0, half_y + 0.1, half_x, 0.1), (0, -half_y - 0.1, half_x, 0.1)]
    width, depth = chance.uniform(0.8, 1.2), chance.uniform(0.35, 0.5)
    side, along = chance.randrange(4), chance.uniform(-0.4, 0.4)
    x, y = along * half_x, along * half_y
    walls.append([(half_x - depth, y, depth, width), (-half_x + depth, y, depth, width),
                  (x, half_y - depth, width, depth), (x, -half_y + depth, width, depth)][side])
    if chance.random() < 0.5:
        width, depth = chance.uniform(0.7, 0.9), chance.uniform(0.6, 0.8)
        sign_x, sign_y = chance.choice((-1, 1)), chance.choice((-1, 1))
        walls.append((sign_x * (half_x - width), sign_y * (half_y - depth), width, depth))
    return half_x, half_y, tuple(walls)


@dataclasses.dataclass
class Room:
    walls: tuple
    things: list
    robot: tuple  # where it hovers
    cruise: list  # the points of its round


def room(seed):
    """About 12 m x 10 m with six standing and five moving objects. The robot's round at 1 m/s begins where it hovers
    and turns, so one room serves all modes: clear of everything by 0.6 m, whether it flies or not."""
    for attempt in range(200):
        chance = random.Random(f"room {seed} {attempt}")
        try:
            return room_of(chance)
        except NoPlace:
            continue
    raise NoPlace(f"room {seed}")


def room_of(chance):
    half_x, half_y, walls = room_walls(chance)
    count, start, sense = 8, chance.uniform(0, 6.28), chance.choice((-1, 1))
    size_x, size_y = chance.uniform(0.30, 0.45) * half_x, chance.uniform(0.30, 0.45) * half_y
    middle = (chance.uniform(-0.2, 0.2) * half_x, chance.uniform(-0.2, 0.2) * half_y)
    cruise = []
    for i in range(count):
        angle, size = start + sense * 2 * math.pi * i / count, chance.uniform(0.85, 1.15)
        cruise.append((middle[0] + size * size_x * math.cos(angle), middle[1] + size * size_y * math.sin(angle)))

    times = np.arange(0.0, 40.0, 0.05)
    placement = Placement(times, walls)
    flown = loop(1.0, cruise)
    placement.keep_clear_of(stand(*cruise[0]), 0.6)
    placement.keep_clear_of(flown, 0.6)

    def somewhere():
        return chance.uniform(-half_x, half_x), chance.uniform(-half_y, half_y)

    def standing(i):
        thing = Thing(f"standing_{i + 1}", stand(*somewhere()), *radii(chance), chance.uniform(-1.57, 1.57))
        return placement.add(thing, 0.4)

    def moving(i):
        kind = chance.choice(("circle", "line", "loop"))
        path, walks = random_mover(chance, kind, somewhere(), chance.uniform(0.3, 1.2), 1.0)
        return placement.add(mover_thing(chance, f"moving_{i + 1}", path, walks), 0.35)

    for i in range(5):
        until_placed(lambda: moving(i), 400)
    for i in range(6):
        until_placed(lambda: standing(i), 400)
    return Room(walls, sorted(placement.things, key=lambda thing: thing.moves), tuple(cruise[0]), cruise)


ROOM_MODES = {  # the robot's path, and options of map_flights
    "still": (lambda r: "", ()),
    "cruising": (lambda r: loop(1.0, r.cruise, "tangent").text, ("--sweep-s", SWEEP_S)),
    "turning": (lambda r: f"stand spin {TURN_RAD_S}", ("--sweep-s", SWEEP_S)),
    "cruising and turning": (lambda r: loop(1.0, r.cruise, f"spin {TURN_RAD_S}").text, ("--sweep-s", SWEEP_S)),
}


def room_flights():
    for seed in range(1, 51):
        built = room(seed)
        for mode, (robot_path, options) in ROOM_MODES.items():
            name = f"room_{seed}_{mode.replace(' ', '_')}"
            xml = world(name, built.things, built.robot, robot_path(built), walls=built.walls[:4],
                        fixtures=built.walls[4:], floor=True)
            yield Flight("room", mode, name, xml, (seed,), 40.0, options, walls=built.walls)


# --- tilt


def standing_room(seed):
    """Eight standing objects, beside a ring of 2 m radius on which the robot flies."""
    for attempt in range(200):
        chance = random.Random(f"tilt {seed} {attempt}")
        half_x, half_y, walls = room_walls(chance)
        placement = Placement(np.arange(0.0, 6.0, 0.05), walls)
        placement.keep_clear_of(circle(0.0, 0.0, 2.0, 1.147), 0.6)

        def standing(i):
            place = chance.uniform(-half_x, half_x), chance.uniform(-half_y, half_y)
            thing = Thing(f"standing_{i + 1}", stand(*place), *radii(chance), chance.uniform(-1.57, 1.57))
            ring = abs(math.hypot(*place) - 2.0) > 0.6 + thing.reach
            return ring and placement.add(thing, 0.4)

        try:
            for i in range(8):
                until_placed(lambda: standing(i), 400)
            return walls, placement.things
        except NoPlace:
            continue
    raise NoPlace(f"tilt {seed}")


def tilt_flights():
    """A ring of 2 m radius at 2.3 m/s takes 2.6 m/s^2 and so a tilt of 15 degrees; 60 deg/s of yaw on top."""
    for seed in range(1, 11):
        walls, things = standing_room(seed)
        for row, robot, path in (("hovering", (2.0, 0.0), ""),
                                 ("tilted and turning", (2.0, 0.0), "circle center 0 0 radius 2 rate 1.147 spin "
                                  + TURN_RAD_S)):
            name = f"tilt_{seed}_{row.replace(' ', '_')}"
            xml = world(name, things, robot, path, walls=walls[:4], fixtures=walls[4:], floor=True)
            yield Flight("tilt", row, name, xml, (seed,), 30.0, ("--sweep-s", SWEEP_S), walls=walls)


# --- occlusion


def hidden_along(mover, times, hider):
    """Of a mover's places at the times, where a hider, at its own, covers all its azimuths."""
    first, last = azimuths(mover.path.at(times), mover.rx, mover.ry, mover.yaw)
    hider_first, hider_last = azimuths(hider.path.at(times), hider.rx, hider.ry, hider.yaw)
    return (first > hider_first) & (last < hider_last)


def single_run(flags):
    """First index and one behind the last of the only run of true values, or none."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(int), [0]))))
    return (edges[0], edges[1]) if len(edges) == 2 else None


def seen_as_wanted(things, hidden, duration_s, low_s, high_s):
    """True if the scanner's beams say so too: `hidden` is hit by none for low to high seconds, once, is whole for 2 s
    at both ends and in sight for 2.5 s; the other is always in sight."""
    times = scan_times(duration_s)
    beams = beams_of(things, times)
    alone = beams_of([things[hidden]], times)[0]
    run = single_run(beams[hidden] == 0)
    if run is None or not low_s <= (run[1] - run[0]) / RATE_HZ <= high_s:
        return False
    whole = beams[hidden] >= np.maximum(alone - 1, 4)
    n = int(2.0 * RATE_HZ)
    in_sight = min(run[0], len(times) - run[1]) >= 2.5 * RATE_HZ
    return in_sight and whole[:n].all() and whole[-n:].all() and beams[1 - hidden].min() >= 4


def hidden_mover(seed):
    """Something at a constant 0.35 to 0.8 m/s passes behind something that stands, hidden for 2.8 to 3.2 s. Sizes,
    ranges and direction are drawn; the speed is what makes it 3 s."""
    chance = random.Random(f"hidden mover {seed}")
    while True:
        azimuth = chance.uniform(-1.6, 1.6)
        ahead = direction(azimuth)
        hider_range, range_m = chance.uniform(1.2, 3.0), chance.uniform(2.6, 6.5)
        hider_rx = chance.uniform(0.25, 0.5)
        hider = Thing("hider", stand(*(hider_range * ahead)), hider_rx, hider_rx / chance.uniform(1.0, 1.6),
                      chance.uniform(-1.57, 1.57))
        heading = azimuth + chance.choice((-1, 1)) * (math.pi / 2 + chance.uniform(-0.5, 0.5))
        rx = chance.uniform(0.12, 0.32)
        unit = Thing("mover", straight(*(range_m * ahead - 6.0 * direction(heading)), *direction(heading)), rx,
                     rx / chance.uniform(1.0, 2.0), chance.uniform(-1.57, 1.57), moves=True)
        if range_m - hider_range < 0.35 + rx + hider_rx:
            continue
        metres = np.linspace(0.0, 12.0, 2401)  # at unit speed a time is a length
        run = single_run(hidden_along(unit, metres, hider))
        if run is None:
            continue
        begin, length = metres[run[0]], metres[run[1] - 1] - metres[run[0]]
        speed = length / chance.uniform(2.85, 3.1)
        if not 0.35 <= speed <= 0.8:
            continue
        partly_s = 2.2 * rx / speed
        before_s = max(3.0, 2.1 + partly_s)
        start = unit.path.at(np.array([begin - before_s * speed]))[0]
        duration_s = math.ceil(20 * (2 * before_s + length / speed + 0.1)) / 20
        mover = dataclasses.replace(unit, path=straight(*start, *(speed * direction(heading))))
        place = mover.path.at(scan_times(duration_s))
        clear = np.hypot(*(place - hider_range * ahead).T).min() > 0.35 + rx + hider_rx
        far = np.hypot(*place.T)
        bearing = np.abs(np.arctan2(place[:, 1], place[:, 0]))
        things = [hider, mover]
        if (clear and far.min() > 0.8 and far.max() < 8.0 and bearing.max() < math.radians(125) and duration_s <= 10.0
                and seen_as_wanted(things, 1, duration_s, 2.8, 3.2)):
            return things, duration_s


def hidden_standing(seed):
    """Something that moves slowly passes before something that stands and hides it for 9.3 to 10 s."""
    chance = random.Random(f"hidden standing {seed}")
    while True:
        azimuth = chance.uniform(-1.6, 1.6)
        ahead = direction(azimuth)
        hider_range, range_m = chance.uniform(1.2, 2.4), chance.uniform(2.6, 6.5)
        hider_rx, rx = chance.uniform(0.3, 0.5), chance.uniform(0.12, 0.35)
        if range_m - hider_range < 0.4 + rx + hider_rx:
            continue
        target = Thing("target", stand(*(range_m * ahead)), rx, rx / chance.uniform(1.0, 2.0),
                       chance.uniform(-1.57, 1.57))
        heading = azimuth + chance.choice((-1, 1)) * (math.pi / 2 + chance.uniform(-0.3, 0.3))
        start = hider_range * ahead - 3.0 * direction(heading)
        unit = Thing("hider", straight(*start, *direction(heading)), hider_rx, hider_rx / chance.uniform(1.0, 1.4),
                     chance.uniform(-1.57, 1.57), moves=True)
        metres = np.linspace(0.0, 6.0, 2401)
        run = single_run(hidden_along(target, metres, unit))
        if run is None:
            continue
        begin, length = metres[run[0]], metres[run[1] - 1] - metres[run[0]]
        speed = length / chance.uniform(9.5, 9.9)
        partly_s = 2.2 * rx * hider_range / range_m / speed
        before_s = max(3.0, 2.2 + partly_s)
        duration_s = math.ceil(20 * (2 * before_s + length / speed + 0.1)) / 20
        if speed < 0.03 or duration_s > 22.0:
            continue
        start = unit.path.at(np.array([begin - before_s * speed]))[0]
        things = [target, dataclasses.replace(unit, path=straight(*start, *(speed * direction(heading))))]
        if seen_as_wanted(things, 0, duration_s, 9.3, 10.0):
            return things, duration_s


def hidden_flights(experiment, build):
    for seed in range(1, 201):
        things, duration_s = build(seed)
        name = f"{experiment}_{seed}"
        yield Flight(experiment, experiment, name, world(name, things), (seed,), duration_s)


def hidden_mover_flights():
    return hidden_flights("hidden_mover", hidden_mover)


def hidden_standing_flights():
    return hidden_flights("hidden_standing", hidden_standing)


# --- all


EXPERIMENTS = {
    **{name: ellipse_tables for name in ELLIPSE_TABLES},
    **{name: circle_tables for name in CIRCLE_TABLES},
    "crowd": crowd_flights, "noise": crowd_flights, "manoeuvres": crowd_flights,
    "people": people_flights, "room": room_flights, "tilt": tilt_flights,
    "hidden_mover": hidden_mover_flights, "hidden_standing": hidden_standing_flights,
}


def flights(only=(), experiments=EXPERIMENTS):
    """Of the named experiments, or of all."""
    wanted = [name for name in experiments if not only or name in only]
    for maker in dict.fromkeys(experiments[name] for name in wanted):
        for flight in maker():
            if flight.experiment in wanted:
                yield flight


def main(doc, experiments):
    """Of a script that writes the worlds of experiments."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directory", type=pathlib.Path)
    parser.add_argument("experiments", nargs="*", metavar="EXPERIMENT", help=" ".join(experiments))
    arguments = parser.parse_args()
    unknown = set(arguments.experiments) - set(experiments)
    if unknown:
        parser.error(f"no experiment {sorted(unknown)}; there are {' '.join(experiments)}")
    arguments.directory.mkdir(parents=True, exist_ok=True)
    count = 0
    for count, flight in enumerate(flights(arguments.experiments, experiments), 1):
        (arguments.directory / f"{flight.name}.xml").write_text(flight.xml)
        if flight.settings:
            (arguments.directory / f"{flight.name}.yaml").write_text(flight.settings)
    print(f"{count} worlds in {arguments.directory}", file=sys.stderr)


if __name__ == "__main__":
    main(__doc__, EXPERIMENTS)
