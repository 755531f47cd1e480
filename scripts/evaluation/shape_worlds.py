# SPDX-License-Identifier: BSD-3-Clause
"""The worlds of `scripts/evaluate shapes`: things that are no ellipses, and persons by their legs. Everything follows
from the experiment's name and the seed.

    python3 scripts/evaluation/shape_worlds.py DIR [EXPERIMENT ...]    writes the worlds, to look at or to fly by hand

The robot drives straight on without acceleration, or stands, so that its scanner stays level.
"""

import dataclasses
import math
import random

import numpy as np

from worlds import (Flight, NoPlace, Path, Placement, circle, direction, line, loop, main, stand, straight,
                    until_placed, world)

ROOM_M = (5.5, 4.5)  # half its length and width
WALL_M = 0.1  # half its thickness
DURATION_S, PERSONS_DURATION_S = 20.0, 30.0
TIMES = np.arange(0.0, PERSONS_DURATION_S, 0.05)
SEEDS = (1, 2)
COLORS = {False: "0.80 0.25 0.20 1", True: "0.18 0.40 0.78 1"}


# --- things


@dataclasses.dataclass
class Part:
    """An upright prism, an elliptic cylinder or a box of half sizes, at (x, y) in the axes of its thing."""

    name: str
    outline: tuple = ()  # corners of a prism, counter-clockwise, all of it in sight from the first
    radii: tuple = ()
    half: tuple = ()
    x: float = 0.0
    y: float = 0.0
    bottom_m: float = 0.0
    top_m: float = 1.5
    walks: str = ""  # for a leg: the rest of its path

    def geom(self, thing, moves):
        middle = 0.5 * (self.top_m - self.bottom_m)
        if self.outline:
            kind = f'type="mesh" mesh="{thing}{self.name}"'
        elif self.radii:
            kind = f'type="ellipsoid" size="{self.radii[0]:.4f} {self.radii[1]:.4f} {middle:.4f}"'
        else:
            kind = f'type="box" size="{self.half[0]:.4f} {self.half[1]:.4f} {middle:.4f}"'
        return f'<geom {kind} group="1" rgba="{COLORS[moves]}"/>'

    def asset(self, thing):
        n, middle = len(self.outline), 0.5 * (self.top_m - self.bottom_m)
        vertices = [f"{x:.4f} {y:.4f} {z:.4f}" for z in (-middle, middle) for x, y in self.outline]
        faces = [f"0 {i + 1} {i}  {n} {n + i} {n + i + 1}" for i in range(1, n - 1)]
        for i in range(n):
            j = (i + 1) % n
            faces.append(f"{i} {j} {n + j}  {i} {n + j} {n + i}")
        return f'<mesh name="{thing}{self.name}" vertex="{"  ".join(vertices)}" face="{"  ".join(faces)}"/>'


@dataclasses.dataclass
class Thing:
    """A part without a name is the thing; those with a name are carried by it."""

    name: str
    path: Path
    yaw: float
    parts: tuple
    reach: float  # from its origin
    moves: bool = False

    def texts(self):
        own = self.path.text or ("" if self.is_one else "stand")
        return [(self.name, own)] * bool(own) + [
            (self.name + part.name, f"with {self.name} at {part.x:.4f} {part.y:.4f} {part.walks}".strip())
            for part in self.parts if part.name]

    @property
    def is_one(self):
        return not self.parts[0].name

    def assets(self):
        return [part.asset(self.name) for part in self.parts if part.outline]

    def bodies(self):
        x, y = self.path.at(np.zeros(1))[0]
        pose = f'pos="{x:.4f} {y:.4f} {{:.4f}}" euler="0 0 {self.yaw:.5f}"'
        middle = [0.5 * (part.bottom_m + part.top_m) for part in self.parts]
        if self.is_one:
            mocap = ' mocap="true"' if self.path.text else ""
            return [f'<body name="{self.name}"{mocap} {pose.format(middle[0])}> '
                    f'{self.parts[0].geom(self.name, self.moves)} </body>']
        return [f'<body name="{self.name}" mocap="true" {pose.format(0.0)}/>'] + [
            f'<body name="{self.name}{part.name}" mocap="true" pos="0 0 {z:.4f}"> '
            f'{part.geom(self.name, self.moves)} </body>' for part, z in zip(self.parts, middle)]


def box(name, path, yaw, length, width, moves=False, **height):
    return Thing(name, path, yaw, (Part("", half=(length / 2, width / 2), **height),), math.hypot(length, width) / 2,
                 moves)


def post(name, path, radius):
    return Thing(name, path, 0.0, (Part("", radii=(radius, radius)),), radius)


def l_shape(name, path, yaw, length, width, thickness, moves=False):
    """An L, its origin in the middle of the rectangle about it."""
    x, y, t = length / 2, width / 2, thickness
    outline = ((t - x, t - y), (t - x, y), (-x, y), (-x, -y), (x, -y), (x, t - y))
    return Thing(name, path, yaw, (Part("", outline=outline),), math.hypot(x, y), moves)


def four_legs(name, path, yaw, length, width, thickness, height_m):
    x, y, half = (length - thickness) / 2, (width - thickness) / 2, thickness / 2
    parts = tuple(Part(f"/leg_{i + 1}", half=(half, half), x=at[0], y=at[1], top_m=height_m)
                  for i, at in enumerate(((x, y), (-x, y), (-x, -y), (x, -y))))
    return Thing(name, path, yaw, parts, math.hypot(length, width) / 2)


def table(name, path, yaw, length, width, thickness):
    """Its top is above all scanners."""
    return four_legs(name, path, yaw, length, width, thickness, 0.72)


def chair(name, path, yaw, size, thickness):
    """A seat on four legs."""
    legs = four_legs(name, path, yaw, size, size, thickness, 0.43)
    seat = Part("/seat", half=(size / 2, size / 2), bottom_m=0.43, top_m=0.49)
    return dataclasses.replace(legs, parts=(*legs.parts, seat))


def pallet(name, path, yaw, load_m):
    """Of 1.2 m x 0.8 m, on nine blocks; its boards and its load are above them."""
    blocks = tuple(Part(f"/block_{3 * i + j + 1}", half=(0.0725, 0.06), x=(i - 1) * 0.5275, y=(j - 1) * 0.34,
                        bottom_m=0.02, top_m=0.12) for i in range(3) for j in range(3))
    load = Part("/load", half=(0.6, 0.4), bottom_m=0.12, top_m=load_m)
    return Thing(name, path, yaw, (*blocks, load), math.hypot(0.6, 0.4))


def car(name, path, yaw, length, width, moves=False):
    """Its corners are cut off by 0.35 m."""
    x, y, c = length / 2, width / 2, 0.35
    outline = ((x, y - c), (x - c, y), (c - x, y), (-x, y - c), (-x, c - y), (c - x, -y), (x - c, -y), (x, c - y))
    return Thing(name, path, yaw, (Part("", outline=outline),), math.hypot(x, y), moves)


def person_of_legs(name, path, yaw, chance, period_s):
    """Two legs that walk, one after the other; hips move along the path."""
    radius, apart, phase = chance.uniform(0.05, 0.07), chance.uniform(0.09, 0.12), chance.uniform(0, 6.28)
    parts = tuple(Part(f"/{side}_leg", radii=(radius, radius), y=y,
                       walks=f"steps {period_s:.3f} phase {ahead:.4f}")
                  for side, y, ahead in (("left", apart, phase), ("right", -apart, phase + math.pi)))
    return Thing(name, path, yaw, parts, 0.45, bool(path.text))


def person_of_torso(name, path, yaw, chance, period_s):
    """A torso across the way, and arms that swing along it."""
    phase = chance.uniform(0, 6.28)
    rx, ry = chance.uniform(0.10, 0.14), chance.uniform(0.18, 0.24)
    swing_m = 0.2 if path.text else 0.0
    arms = tuple(Part(f"/{side}_arm", radii=(0.06, 0.05), y=sign * (ry + 0.09),
                      walks=f"swing {swing_m} period {period_s:.3f} phase {ahead:.4f}")
                 for side, sign, ahead in (("left", 1, phase), ("right", -1, phase + math.pi)))
    return Thing(name, path, yaw, (Part("/torso", radii=(rx, ry)), *arms), 0.45, bool(path.text))


# --- worlds


def walls():
    half_x, half_y = ROOM_M
    return ((half_x + WALL_M, 0, WALL_M, half_y + 2 * WALL_M), (-half_x - WALL_M, 0, WALL_M, half_y + 2 * WALL_M),
            (0, half_y + WALL_M, half_x, WALL_M), (0, -half_y - WALL_M, half_x, WALL_M))


@dataclasses.dataclass
class Scene:
    things: list
    height_m: float  # of the scanner
    robot: Path = dataclasses.field(default_factory=lambda: stand(0.0, 0.0))
    walls: tuple = dataclasses.field(default_factory=walls)
    duration_s: float = DURATION_S


def drive(chance):
    """Through the middle of the room at constant velocity, 3.5 to 4.5 m in all."""
    heading, length = chance.uniform(0, 6.28), chance.uniform(3.5, 4.5)
    velocity = length / DURATION_S * direction(heading)
    return straight(*(-0.5 * DURATION_S * velocity), *velocity)


def in_room(chance):
    half_x, half_y = ROOM_M
    return chance.uniform(-half_x, half_x), chance.uniform(-half_y, half_y)


def ring(chance, middle, size):
    """The points of a round about a place."""
    start, turn = chance.uniform(0, 6.28), chance.choice((-1, 1))
    return [middle + size * chance.uniform(0.8, 1.2) * direction(start + turn * 2 * math.pi * i / 6) for i in range(6)]


def placed(chance, placement, make, clearance_m=0.4):
    """Adds what `make` makes of a place."""
    until_placed(lambda: placement.add(make(in_room(chance)), clearance_m), 500)


def placement_about(robot, room_walls):
    placement = Placement(TIMES, room_walls)
    placement.keep_clear_of(robot, 0.6)
    return placement


def boxes(chance):
    """Six that stand, from 0.2 to 1.5 m long, and three that drive: on a circle, on a loop, and back and forth."""
    scene = Scene([], 0.5, drive(chance))
    placement = placement_about(scene.robot, scene.walls)
    lengths = [chance.uniform(low, high) for low, high in ((0.2, 0.4), (0.4, 0.6), (0.6, 0.9), (0.6, 0.9), (0.9, 1.2),
                                                            (1.2, 1.5))]
    driven = [chance.uniform(low, high) for low, high in ((0.2, 0.5), (0.5, 0.9), (0.9, 1.5))]
    kinds = chance.sample(("circle", "loop", "line"), 3)

    def width_of(length):
        return max(0.12, length / chance.uniform(1.0, 3.0))

    def driver(i, place):
        length, speed = driven[i], chance.uniform(0.3, 1.0)
        size = chance.uniform(0.7, 1.1)
        yaw = 0.0  # ahead along its path
        if kinds[i] == "circle":
            rate = chance.choice((-1, 1)) * speed / size
            path = circle(*place, size, rate, suffix="tangent")
        elif kinds[i] == "loop":
            path = loop(speed, ring(chance, place, size), "tangent")
        else:
            yaw = chance.uniform(-3.14, 3.14)
            half = chance.uniform(0.7, 1.3) * direction(yaw)
            path = line(*(place - half), *(place + half), 4.0 * np.hypot(*half) / speed, chance.uniform(0, 6.28))
        return box(f"box_{len(lengths) + i + 1}", path, yaw, length, width_of(length), True, top_m=1.0)

    for i in range(len(driven)):
        placed(chance, placement, lambda place: driver(i, np.array(place)), 0.35)
    for i in reversed(range(len(lengths))):
        placed(chance, placement, lambda place: box(f"box_{i + 1}", stand(*place), chance.uniform(-1.57, 1.57),
                                                    lengths[i], width_of(lengths[i]), top_m=1.0))
    scene.things = sorted(placement.things, key=lambda thing: thing.name)
    return scene


def furniture(chance, height_m):
    scene = Scene([], height_m, drive(chance))
    placement = placement_about(scene.robot, scene.walls)
    makers = {
        "table": lambda *at: table(*at, chance.uniform(1.0, 1.6), chance.uniform(0.6, 0.9), chance.uniform(0.04, 0.07)),
        "pallet": lambda *at: pallet(*at, chance.uniform(0.8, 1.4)),
        "l_shape": lambda *at: l_shape(*at, chance.uniform(0.5, 1.1), chance.uniform(0.5, 1.1),
                                       chance.uniform(0.12, 0.3)),
        "chair": lambda *at: chair(*at, chance.uniform(0.38, 0.48), chance.uniform(0.03, 0.05)),
    }
    for kind, count in (("table", 2), ("pallet", 1), ("l_shape", 3), ("chair", 3)):
        for i in range(count):
            placed(chance, placement, lambda place: makers[kind](f"{kind}_{i + 1}", stand(*place),
                                                                 chance.uniform(-3.14, 3.14)), 0.35)
    scene.things = placement.things
    return scene


def low_furniture(chance):
    """Tables and chairs by their legs, pallets by their blocks, L-shapes."""
    return furniture(chance, 0.1)


def seats(chance):
    """The same where the scanner meets the chairs' seats and the pallets' load."""
    return furniture(chance, 0.46)


def parking(chance):
    """Four parked cars, and one that drives along between them."""
    things = []
    for i, (x, y) in enumerate(((-5.0, 4.2), (1.5, 4.2), (-2.0, -4.2), (5.0, -4.2))):
        place = stand(x + chance.uniform(-0.5, 0.5), y + chance.uniform(-0.3, 0.3))
        things.append(car(f"car_{i + 1}", place, chance.uniform(-0.1, 0.1), chance.uniform(3.8, 4.6),
                          chance.uniform(1.7, 1.85)))
    speed = chance.uniform(0.8, 2.0)
    things.append(car("car_5", straight(-12.0, 1.8, speed, 0.0), 0.0, 4.2, 1.75, True))
    return Scene(things, 0.5, straight(-1.0, -1.0, 0.07, 0.0), ())


def persons(chance, height_m, make):
    """Two that cross each other again and again, one farther away than the other, 0.8 m apart; one on a loop; one that
    comes near and goes; and one that stands. All within 5 m of a standing robot."""
    scene = Scene([], height_m, stand(-2.3, 0.0), duration_s=PERSONS_DURATION_S)
    placement = placement_about(scene.robot, scene.walls)
    things = []

    def add(path, yaw, speed):
        period_s = 1.4 - 0.3 * speed
        thing = make(f"person_{len(things) + 1}", path, yaw, chance, period_s)
        things.append(thing)
        return thing

    # The mean speed of a path back and forth is 0.5 to 0.95 m/s, the largest, in the middle, pi/2 times that.
    half = chance.uniform(1.4, 1.9)
    near, speed = chance.uniform(-1.2, -0.8), chance.uniform(0.5, 0.95)
    period = 4.0 * half / speed
    for x, sign in ((near, 1), (near + 0.8, -1)):
        path = line(x, -sign * half, x, sign * half, period, 0.2 * sign)
        placement.keep_clear_of(path, 0.5)
        add(path, sign * math.pi / 2, speed)

    def walk():
        middle, size = np.array((chance.uniform(1.2, 2.0), chance.uniform(-2.0, 2.0))), chance.uniform(0.7, 1.1)
        speed = chance.uniform(0.7, 1.4)
        path = loop(speed, ring(chance, middle, size), "tangent")
        return placement.add(Thing("", path, 0.0, (), 0.45), 0.2) and add(path, 0.0, speed)

    def come_and_go():
        side, speed = chance.choice((-1, 1)), chance.uniform(0.5, 0.95)
        x, y = chance.uniform(-2.0, -1.4), side * chance.uniform(2.2, 3.4)
        to_x, to_y = x + chance.uniform(2.0, 3.0), y + chance.uniform(-0.3, 0.3)
        path = line(x, y, to_x, to_y, 2.0 * math.hypot(to_x - x, to_y - y) / speed, chance.uniform(0, 6.28))
        return placement.add(Thing("", path, 0.0, (), 0.45), 0.2) and add(path, math.atan2(to_y - y, to_x - x), speed)

    def wait():
        path = stand(chance.uniform(-2.0, 1.5), chance.uniform(-3.0, 3.0))
        return placement.add(Thing("", path, 0.0, (), 0.45), 0.2) and add(path, chance.uniform(-3.1, 3.1), 0.0)

    for what in (walk, come_and_go, wait):
        until_placed(what, 500)
    scene.things = things
    return scene


def legs(chance):
    return persons(chance, 0.3, person_of_legs)


def torsos(chance):
    return persons(chance, 1.3, person_of_torso)


def clutter(chance):
    """Boxes, posts and L-shapes along the walls, at most 0.25 m from them."""
    scene = Scene([], 0.3, drive(chance))
    half_x, half_y = ROOM_M
    for length, half, at in ((2 * half_x, half_y, lambda s, d: (s, half_y - d)),
                             (2 * half_x, half_y, lambda s, d: (s, d - half_y)),
                             (2 * half_y, half_x, lambda s, d: (half_x - d, s)),
                             (2 * half_y, half_x, lambda s, d: (d - half_x, s))):
        along = 0.8 - length / 2 + chance.uniform(0.0, 0.5)
        across = length < 2 * half_x  # a wall along y
        while along < length / 2 - 0.8:
            name, gap = f"clutter_{len(scene.things) + 1}", chance.choice((0.0, chance.uniform(0.02, 0.25)))
            kind = chance.choice(("box", "box", "post", "l_shape"))
            if kind == "post":
                radius = chance.uniform(0.1, 0.25)
                scene.things.append(post(name, stand(*at(along, gap + radius)), radius))
            else:
                size, depth = chance.uniform(0.2, 0.7), chance.uniform(0.15, 0.5)
                place = stand(*at(along, gap + depth / 2))
                length_x, length_y = (depth, size) if across else (size, depth)
                if kind == "box":
                    scene.things.append(box(name, place, 0.0, length_x, length_y))
                else:
                    scene.things.append(l_shape(name, place, 0.0, length_x, length_y, 0.08))
            along += chance.uniform(1.2, 2.0)
    return scene


SCENES = {"boxes": boxes, "furniture": low_furniture, "seats": seats, "parking": parking, "legs": legs,
          "torsos": torsos, "clutter": clutter}


def scene_of(experiment, seed):
    for attempt in range(200):
        chance = random.Random(f"{experiment} {seed} {attempt}")
        try:
            return SCENES[experiment](chance)
        except NoPlace:
            continue
    raise NoPlace(f"{experiment} {seed}")


def flights_of(experiment):
    for seed in SEEDS:
        scene = scene_of(experiment, seed)
        robot = tuple(scene.robot.at(np.zeros(1))[0])
        name = f"{experiment}_{seed}"
        xml = world(name, scene.things, robot, scene.robot.text, scene.height_m, scene.walls, drag_1_s=0.0)
        yield Flight(experiment, experiment, name, xml, (seed,), scene.duration_s, walls=scene.walls)


EXPERIMENTS = {name: (lambda name=name: flights_of(name)) for name in SCENES}


if __name__ == "__main__":
    main(__doc__, EXPERIMENTS)
