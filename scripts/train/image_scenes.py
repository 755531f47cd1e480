# SPDX-License-Identifier: BSD-3-Clause
"""Draw images of cars from the air, with labels, for the networks of image/ (docs/math/labels.md).

    python scripts/train/image_scenes.py --domain town --scenes 200 --seed 1 --output training/images/town

A scene is a MuJoCo world of 160 m by 160 m: painted ground, houses, trees and things of the size of cars that are none,
and cars of many shapes and colours under a light from any side. The two domains differ in ground, density, things and
light: `town` has streets with kerbs, parking places and houses, `field` has grass, tracks, bushes and barns. Each scene
is drawn from several poses: most from 10 to 40 m at pitches of -15 to -30 deg, some steeper, some straight down from up
to 120 m. Files: NUMBER_POSE.ppm, the image, and NUMBER_POSE.pgm, 255 where it shows a car. The same arguments give
the same files.
"""

import argparse
import concurrent.futures
import pathlib
import subprocess
import tempfile
from dataclasses import dataclass, field

import numpy as np

SIZE_M = 160.0  # of the painted ground, square about the origin
TILES = 5  # along each side: the picture of the ground goes on around the scene
GROUND_PX = 1024
IMAGE_PX = 512
DOMAINS = ("town", "field")


# --- ground ---------------------------------------------------------------------------------------------------------
def noise(random, octaves, roughness=0.6):
    """Smooth noise of several scales, about 0 and within about 1, GROUND_PX square."""
    total = np.zeros((GROUND_PX, GROUND_PX))
    weight = 1.0
    for octave in octaves:
        cells = 2**octave
        grid = random.normal(0.0, 0.5, (cells + 1, cells + 1))
        at = np.linspace(0, cells, GROUND_PX, endpoint=False)
        low = at.astype(int)
        share = at - low
        rows = grid[low] * (1 - share)[:, None] + grid[low + 1] * share[:, None]
        total += weight * (rows[:, low] * (1 - share) + rows[:, low + 1] * share)
        weight *= roughness
    return total


class Ground:
    """A picture of the ground, row 0 at the largest y."""

    def __init__(self, random, color, contrast):
        self.random = random
        grain = random.normal(0.0, 0.03, (GROUND_PX, GROUND_PX, 1))
        waves = contrast * noise(random, range(3, 9))[..., None]
        tint = 0.3 * contrast * np.stack([noise(random, range(2, 6)) for _ in range(3)], axis=-1)
        self.rgb = np.array(color) * (1 + waves) + tint * np.array(color) + grain
        axis = (np.arange(GROUND_PX) + 0.5) / GROUND_PX * SIZE_M - SIZE_M / 2
        self.x, self.y = np.meshgrid(axis, -axis)

    def window(self, low, high):
        """Slices of rows and columns that hold a box of the world."""
        columns = [int((value + SIZE_M / 2) / SIZE_M * GROUND_PX) for value in (low[0], high[0])]
        rows = [int((SIZE_M / 2 - value) / SIZE_M * GROUND_PX) for value in (high[1], low[1])]
        return tuple(slice(max(0, a - 1), max(0, b + 2)) for a, b in (rows, columns))

    def paint(self, window, mask, color, cover=1.0, contrast=0.06):
        waves = 1 + contrast * self.random.normal(0.0, 1.0, (mask.sum(), 1))
        part = self.rgb[window]
        part[mask] = (1 - cover) * part[mask] + cover * np.array(color) * waves

    def rectangle(self, center, size, yaw, color, **how):
        cos, sin = np.cos(yaw), np.sin(yaw)
        reach = 0.5 * np.array((abs(cos) * size[0] + abs(sin) * size[1], abs(sin) * size[0] + abs(cos) * size[1]))
        window = self.window(np.array(center) - reach, np.array(center) + reach)
        along = cos * (self.x[window] - center[0]) + sin * (self.y[window] - center[1])
        across = -sin * (self.x[window] - center[0]) + cos * (self.y[window] - center[1])
        self.paint(window, (abs(along) < size[0] / 2) & (abs(across) < size[1] / 2), color, **how)

    def track(self, points, width, color, **how):
        """A band along a polyline."""
        near = np.full(self.x.shape, np.inf)
        for start, end in zip(points[:-1], points[1:]):
            window = self.window(np.minimum(start, end) - width, np.maximum(start, end) + width)
            (x0, y0), (dx, dy) = start, end - start
            x, y = self.x[window] - x0, self.y[window] - y0
            t = np.clip((x * dx + y * dy) / (dx * dx + dy * dy), 0, 1)
            near[window] = np.minimum(near[window], np.hypot(x - t * dx, y - t * dy))
        self.paint((slice(None), slice(None)), near < width / 2, color, **how)

    def write(self, path):
        from matplotlib import image

        image.imsave(path, (255 * np.clip(self.rgb, 0, 1)).astype(np.uint8))


# --- things ---------------------------------------------------------------------------------------------------------
@dataclass
class Scene:
    random: np.random.Generator
    assets: list = field(default_factory=list)
    bodies: list = field(default_factory=list)
    cars: list = field(default_factory=list)  # x, y
    taken: list = field(default_factory=list)  # x, y, radius

    def material(self, name, color, specular=0.1, shininess=0.3):
        rgb = " ".join(f"{value:.3f}" for value in np.clip(color, 0, 1))
        self.assets.append(
            f'<material name="{name}" rgba="{rgb} 1" specular="{specular:.2f}" shininess="{shininess:.2f}"/>'
        )
        return name

    def hull(self, corners):
        """A mesh: the convex hull of points."""
        name = f"hull{len(self.assets)}"
        self.assets.append(f'<mesh name="{name}" vertex="{numbers(np.ravel(corners))}"/>')
        return name

    def place(self, radius, area=0.46 * SIZE_M, tries=20):
        """A free place, or None."""
        for _ in range(tries):
            x, y = self.random.uniform(-area, area, 2)
            if self.claim(x, y, radius):
                return x, y
        return None

    def claim(self, x, y, radius):
        if any(np.hypot(x - a, y - b) < radius + r for a, b, r in self.taken):
            return False
        self.taken.append((x, y, radius))
        return True

    def body(self, x, y, yaw, geoms, z=0.0):
        text = "".join(f'<geom group="2" contype="0" conaffinity="0" {geom}/>' for geom in geoms)
        self.bodies.append(f'<body pos="{x:.3f} {y:.3f} {z:.3f}" euler="0 0 {yaw:.4f}">{text}</body>')


def numbers(values):
    return " ".join(f"{value:.3f}" for value in values)


def box(center, size, material):
    return f'type="box" pos="{numbers(center)}" size="{numbers(np.array(size) / 2)}" material="{material}"'


def prism(bottom, top, z0, z1, width_bottom, width_top):
    """Corners of a body with a trapezoid as its side: [rear, front] at the bottom and at the top."""
    return [
        (x, side * width / 2, z)
        for z, (rear, front), width in ((z0, bottom, width_bottom), (z1, top, width_top))
        for x in (rear, front)
        for side in (-1, 1)
    ]


PAINTS = (  # colour, share: what is seen on streets
    ((0.92, 0.92, 0.92), 0.22), ((0.66, 0.68, 0.70), 0.18), ((0.36, 0.38, 0.40), 0.16), ((0.05, 0.05, 0.06), 0.18),
    ((0.60, 0.06, 0.06), 0.08), ((0.08, 0.16, 0.42), 0.09), ((0.10, 0.28, 0.16), 0.03), ((0.72, 0.66, 0.52), 0.03),
    ((0.85, 0.62, 0.10), 0.02), ((0.35, 0.18, 0.10), 0.01),
)
# length, height, bottom of the windows, [rear, front] of the cabin at its bottom and at its top, as parts of the length
# from the rear
SHAPES = {
    "hatchback": (3.9, 1.50, 0.92, (0.02, 0.74), (0.12, 0.52)),
    "saloon": (4.6, 1.45, 0.92, (0.14, 0.74), (0.28, 0.54)),
    "estate": (4.7, 1.50, 0.94, (0.02, 0.74), (0.08, 0.54)),
    "suv": (4.6, 1.72, 1.08, (0.02, 0.74), (0.08, 0.56)),
    "van": (4.9, 1.95, 1.12, (0.01, 0.88), (0.04, 0.68)),
    "pickup": (5.2, 1.80, 1.08, (0.34, 0.74), (0.38, 0.58)),
    "coupe": (4.4, 1.30, 0.86, (0.10, 0.70), (0.32, 0.50)),
}


def add_car(scene, x, y, yaw):
    random = scene.random
    number = len(scene.cars)
    length, height, sill, cabin, roof = SHAPES[random.choice(list(SHAPES))]
    length *= random.uniform(0.93, 1.07)
    height *= random.uniform(0.95, 1.05)
    width = random.uniform(1.65, 1.95)
    shares = np.array([share for _, share in PAINTS])
    color = np.array(PAINTS[random.choice(len(PAINTS), p=shares / shares.sum())][0]) * random.uniform(0.8, 1.15)
    paint = scene.material(f"car/{number}/paint", color + random.normal(0, 0.03, 3), random.uniform(0.1, 0.8), 0.7)
    glass = scene.material(f"car/{number}/glass", np.array((0.10, 0.12, 0.14)) * random.uniform(0.5, 2.2), 0.8, 0.9)

    def at(parts):
        return [(part - 0.5) * length for part in parts]

    hood = sill - random.uniform(0.02, 0.14)
    floor = random.uniform(0.18, 0.28)
    lower = scene.hull(
        prism(at((0.0, 1.0)), at((0.01, 0.98)), floor, 0.62, width * 0.96, width)
        + prism(at((0.0, 0.99)), at((0.015, 0.95)), 0.62, hood, width, width * 0.93)
        + [(at((cabin[1],))[0], side * width * 0.45, sill) for side in (-1, 1)]
    )
    upper = scene.hull(prism(at(cabin), at(roof), hood - 0.02, height - 0.04, width * 0.92, width * 0.76))
    top = at(roof)
    geoms = [
        f'type="mesh" mesh="{lower}" material="{paint}"',
        f'type="mesh" mesh="{upper}" material="{glass}"',
        box((sum(top) / 2, 0, height - 0.03), (top[1] - top[0] + 0.08, width * 0.77, 0.07), paint),
    ]
    for part in (0.19, 0.81):
        for side in (-1, 1):
            geoms.append(
                f'type="cylinder" size="0.31 0.11" pos="{numbers((at((part,))[0], side * (width / 2 - 0.1), 0.31))}" '
                'euler="1.5708 0 0" material="car/tyre"'
            )
    for end, name in ((0.985, "car/headlight"), (0.008, "car/tail_light")):
        for side in (-1, 1):
            geoms.append(box((at((end,))[0], side * width * 0.36, 0.68), (0.08, 0.32, 0.14), name))
    if random.random() < 0.6:  # pillars, beside the windows
        post = at(((cabin[0] + cabin[1]) / 2 - 0.05,))[0]
        for side in (-1, 1):
            center = (post, side * width * 0.425, (hood + height) / 2)
            geoms.append(box(center, (0.1, 0.06, height - hood - 0.08), paint))
    if random.random() < 0.1:
        geoms.append(box((sum(top) / 2, 0, height + 0.15), (1.4, 0.8, 0.3), "car/tyre"))
    scene.body(x, y, yaw, geoms)
    scene.cars.append((x, y))


def add_tree(scene, x, y, bush=False):
    random = scene.random
    height = random.uniform(0.6, 1.8) if bush else random.uniform(3.0, 9.0)
    leaf = f"leaf/{random.integers(6)}"
    if not bush and random.random() < 0.3:  # a conifer
        width = 0.22 * height
        sides = [(width * np.cos(a), width * np.sin(a), 0.12 * height) for a in np.arange(8) * np.pi / 4]
        geoms = [f'type="mesh" mesh="{scene.hull(sides + [(0, 0, height)])}" material="{leaf}"']
    else:
        geoms = []
        for _ in range(random.integers(2, 6)):
            center = random.normal(0, 0.14 * height, 3) + (0, 0, (0.45 if bush else 0.66) * height)
            size = height * random.uniform(0.16, 0.30, 3)
            geoms.append(f'type="ellipsoid" pos="{numbers(center)}" size="{numbers(size)}" material="{leaf}"')
    if not bush:
        geoms.append(f'type="cylinder" size="{0.02 * height + 0.05:.2f} {0.3 * height:.2f}" '
                     f'pos="0 0 {0.3 * height:.2f}" material="bark"')
    scene.body(x, y, random.uniform(0, 6.3), geoms)


def add_house(scene, x, y, yaw, size, height, colors):
    random = scene.random
    number = len(scene.bodies)
    wall = scene.material(f"wall/{number}", np.array(colors["wall"][random.integers(len(colors["wall"]))])
                          * random.uniform(0.8, 1.1))
    roof = scene.material(f"roof/{number}", np.array(colors["roof"][random.integers(len(colors["roof"]))])
                          * random.uniform(0.7, 1.15))
    geoms = [box((0, 0, height / 2), (*size, height), wall)]
    if random.random() < colors["gable"]:
        over = 0.4
        ridge = (0.5 * size[0] + over) * random.choice((1.0, 0.6))
        top = height + random.uniform(0.25, 0.5) * size[1]
        corners = [(a * (size[0] / 2 + over), b * (size[1] / 2 + over), height) for a in (-1, 1) for b in (-1, 1)]
        mesh = scene.hull(corners + [(-ridge, 0, top), (ridge, 0, top)])
        geoms.append(f'type="mesh" mesh="{mesh}" material="{roof}"')
    else:
        geoms.append(box((0, 0, height + 0.1), (size[0] + 0.2, size[1] + 0.2, 0.2), roof))
        for _ in range(random.integers(0, 5)):  # what stands on flat roofs
            center = random.uniform(-0.35, 0.35, 2) * size
            geoms.append(box((*center, height + 0.6), random.uniform(0.6, 2.6, 3) * (1, 1, 0.4), "thing/grey"))
    step = random.uniform(2.0, 3.5)
    for z in np.arange(1.5, height - 0.8, 2.8):  # windows
        for a in np.arange(-size[0] / 2 + 1.2, size[0] / 2 - 0.8, step):
            for side in (-1, 1):
                geoms.append(box((a, side * size[1] / 2, z), (1.1, 0.06, 1.3), "window"))
    scene.body(x, y, yaw, geoms)


def add_thing(scene, x, y, yaw):
    """Something of a car's size or smaller that is none."""
    random = scene.random
    color = f"thing/{random.choice(('red', 'blue', 'white', 'green', 'grey', 'brown', 'dark'))}"
    kind = random.integers(7)
    if kind == 0:  # container
        geoms = [box((0, 0, 1.3), (random.uniform(3, 6.5), 2.4, 2.6), color)]
    elif kind == 1:  # bins
        geoms = [box((1.1 * i, 0, 0.6), (0.8, 0.7, 1.2), color) for i in range(random.integers(1, 5))]
    elif kind == 2:  # bench or table
        geoms = [box((0, 0, 0.45), (1.9, 0.6, 0.1), color), box((0, 0.3, 0.7), (1.9, 0.06, 0.5), color)]
    elif kind == 3:  # lamp post
        geoms = [f'type="cylinder" size="0.08 3" pos="0 0 3" material="thing/grey"',
                 box((0.6, 0, 6), (1.4, 0.25, 0.12), "thing/grey")]
    elif kind == 4:  # stack
        geoms = [box((0, 0, 0.4), (2.4, 1.3, 0.8), color), box((0.2, 0.1, 1.1), (1.6, 1.1, 0.6), color)]
    elif kind == 5:  # hut or stand
        geoms = [box((0, 0, 1.1), (2.6, 2.2, 2.2), color), box((0, 0, 2.3), (3.2, 2.8, 0.15), "thing/white")]
    else:  # rock or hay bale
        geoms = [f'type="ellipsoid" size="{numbers(random.uniform(0.4, 1.4, 3))}" pos="0 0 0.3" material="thing/brown"']
    scene.body(x, y, yaw, geoms)


# --- domains --------------------------------------------------------------------------------------------------------
def lay_town(scene):
    random = scene.random
    ground = Ground(random, random.uniform((0.42, 0.42, 0.40), (0.62, 0.60, 0.56)), random.uniform(0.05, 0.15))
    grass = random.uniform((0.18, 0.28, 0.10), (0.32, 0.42, 0.18))
    for _ in range(random.integers(4, 12)):
        ground.rectangle(random.uniform(-70, 70, 2), random.uniform(8, 35, 2), 0.0, grass, contrast=0.15)
    asphalt = np.array((1.0, 1.0, 1.03)) * random.uniform(0.20, 0.42)
    white = np.full(3, random.uniform(0.7, 0.95))
    width = random.uniform(6, 10)
    streets = [(axis, at) for axis in (0, 1)
               for at in random.choice(np.arange(-60, 61, 20), random.integers(1, 4), False)]
    for axis, at in streets:
        yaw = axis * np.pi / 2
        center = (0, at) if axis == 0 else (-at, 0)
        ground.rectangle(center, (SIZE_M, width + 5), yaw, asphalt * 1.5)
    for axis, at in streets:
        yaw = axis * np.pi / 2
        center = np.array((0, at) if axis == 0 else (-at, 0), dtype=float)
        ground.rectangle(center, (SIZE_M, width), yaw, asphalt)
        along = np.array((np.cos(yaw), np.sin(yaw)))
        across = np.array((-np.sin(yaw), np.cos(yaw)))
        for s in np.arange(-SIZE_M / 2, SIZE_M / 2, 6.0):
            ground.rectangle(center + s * along, (3.0, 0.3), yaw, white, cover=0.8)
        for s in np.arange(-SIZE_M / 2, SIZE_M / 2, 8.0):
            scene.taken.append((*(center + s * along), width / 2 + 0.5))
        for s in np.arange(-74, 74, 6.2):  # parked at the kerbs and driving
            for side in (-1, 1):
                if random.random() < 0.25:
                    add_car(scene, *(center + s * along + side * (width / 2 - 1.1) * across),
                            yaw + random.normal(0, 0.04) + (np.pi if side > 0 else 0))
                elif random.random() < 0.10:
                    add_car(scene, *(center + s * along + side * 0.22 * width * across),
                            yaw + random.normal(0, 0.03) + (np.pi if side > 0 else 0))
                if random.random() < 0.15:
                    spot = center + s * along + side * (width / 2 + 1.8) * across
                    if random.random() < 0.6:
                        add_tree(scene, *spot)
                    else:
                        add_thing(scene, *spot, yaw)
    for _ in range(random.integers(1, 4)):  # car parks
        lot = scene.place(14)
        if lot is None:
            continue
        yaw = random.choice((0, np.pi / 2)) + random.choice((0.0, random.uniform(-0.5, 0.5)))
        ground.rectangle(lot, (22, 17), yaw, asphalt * random.uniform(0.8, 1.5))
        along, across = np.array((np.cos(yaw), np.sin(yaw))), np.array((-np.sin(yaw), np.cos(yaw)))
        full = random.uniform(0.2, 0.95)
        for row in (-5.5, 5.5):
            for s in np.arange(-9, 9.1, 2.6):
                ground.rectangle(lot + (s + 1.3) * along + row * across, (0.2, 5.0), yaw, white, cover=0.8)
                if random.random() < full:
                    add_car(scene, *(lot + s * along + row * across),
                            yaw + np.pi / 2 * random.choice((-1, 1)) + random.normal(0, 0.04))
    colors = {
        "wall": ((0.80, 0.76, 0.66), (0.66, 0.44, 0.34), (0.84, 0.84, 0.82), (0.60, 0.60, 0.58), (0.78, 0.64, 0.40)),
        "roof": ((0.46, 0.20, 0.14), (0.30, 0.28, 0.28), (0.50, 0.48, 0.46), (0.36, 0.24, 0.18)), "gable": 0.6,
    }
    for _ in range(random.integers(8, 22)):
        size = random.uniform((8, 7), (20, 12))
        spot = scene.place(0.5 * np.hypot(*size))
        if spot is not None:
            add_house(scene, *spot, random.choice((0, np.pi / 2)), size, random.uniform(3, 8.5), colors)
    return ground, (random.integers(10, 40), random.integers(5, 25), random.integers(5, 20))


def lay_field(scene):
    random = scene.random
    kind = random.integers(3)
    low, high = (((0.22, 0.30, 0.08), (0.36, 0.44, 0.18)), ((0.48, 0.42, 0.22), (0.66, 0.58, 0.34)),
                 ((0.36, 0.27, 0.18), (0.52, 0.42, 0.30)))[kind]  # green, dry, earth
    ground = Ground(random, random.uniform(low, high), random.uniform(0.12, 0.3))
    yaw = random.uniform(0, np.pi)
    for _ in range(random.integers(0, 4)):  # fields with furrows
        center, size = random.uniform(-60, 60, 2), random.uniform(25, 70, 2)
        ground.rectangle(center, size, yaw, random.uniform(low, high), cover=0.7, contrast=0.12)
        for s in np.arange(-size[0] / 2, size[0] / 2, 3.0) if random.random() < 0.5 else ():
            ground.rectangle(center + s * np.array((np.cos(yaw), np.sin(yaw))), (0.5, size[1]), yaw,
                             np.array(low) * 0.8, cover=0.4)
    dirt = random.uniform((0.50, 0.42, 0.32), (0.70, 0.62, 0.50))
    parked = []
    for _ in range(random.integers(1, 4)):
        points = np.stack((np.linspace(-85, 85, 9), np.cumsum(random.normal(0, 9, 9))), axis=1)
        turn = random.uniform(0, 2 * np.pi)
        points = points @ np.array(((np.cos(turn), np.sin(turn)), (-np.sin(turn), np.cos(turn))))
        wide = random.uniform(2.5, 6)
        ground.track(points, wide, dirt, cover=random.uniform(0.5, 1.0), contrast=0.1)
        for start, end in zip(points[:-1], points[1:]):
            heading = np.arctan2(*(end - start)[::-1])
            scene.taken.append((*(start + end) / 2, wide))
            for share in (0.2, 0.7):
                if random.random() < 0.25:
                    parked.append((*(start + share * (end - start)), heading + random.normal(0, 0.15)))
    for x, y, heading in parked:
        add_car(scene, x, y, heading)
    for _ in range(random.integers(2, 14)):  # cars on the grass, alone or in groups
        spot = scene.place(4)
        if spot is not None:
            heading = random.uniform(0, 2 * np.pi)
            for i in range(random.choice((1, 1, 1, 2, 3, 5))):
                offset = 2.9 * i * np.array((-np.sin(heading), np.cos(heading)))
                if i == 0 or scene.claim(*(spot + offset), 1.0):
                    add_car(scene, *(spot + offset), heading + random.normal(0, 0.08))
    colors = {
        "wall": ((0.42, 0.30, 0.20), (0.62, 0.58, 0.50), (0.50, 0.16, 0.12)),
        "roof": ((0.55, 0.56, 0.56), (0.40, 0.18, 0.14), (0.32, 0.30, 0.26)), "gable": 0.85,
    }
    for _ in range(random.integers(0, 5)):
        size = random.uniform((8, 6), (24, 12))
        spot = scene.place(0.5 * np.hypot(*size))
        if spot is not None:
            add_house(scene, *spot, random.uniform(0, np.pi), size, random.uniform(2.5, 6), colors)
    return ground, (random.integers(5, 60), random.integers(10, 60), random.integers(2, 16))


def make_scene(domain, random):
    """(MJCF text, ground picture, cars): the text names the picture ground.png."""
    scene = Scene(random)
    scene.material("car/tyre", (0.05, 0.05, 0.05))
    scene.material("car/headlight", (0.85, 0.85, 0.8), 0.8)
    scene.material("car/tail_light", (0.5, 0.03, 0.03), 0.5)
    scene.material("bark", (0.28, 0.2, 0.14))
    scene.material("window", np.array((0.2, 0.24, 0.28)) * random.uniform(0.6, 1.5), 0.6)
    for name, color in (("red", (0.6, 0.12, 0.1)), ("blue", (0.12, 0.25, 0.5)), ("white", (0.85, 0.85, 0.82)),
                        ("green", (0.12, 0.35, 0.18)), ("grey", (0.5, 0.5, 0.5)), ("brown", (0.45, 0.36, 0.25)),
                        ("dark", (0.12, 0.12, 0.13))):
        scene.material(f"thing/{name}", np.array(color) * random.uniform(0.8, 1.2))
    season = random.uniform((0.10, 0.20, 0.05), (0.34, 0.36, 0.14))
    for i in range(6):
        scene.material(f"leaf/{i}", season * random.uniform(0.6, 1.3) + random.normal(0, 0.02, 3))
    ground, (trees, bushes, things) = {"town": lay_town, "field": lay_field}[domain](scene)
    for count, radius, add in ((trees, 1.6, add_tree), (bushes, 0.8, lambda s, x, y: add_tree(s, x, y, bush=True)),
                               (things, 2.0, lambda s, x, y: add_thing(s, x, y, random.uniform(0, 6.3)))):
        for _ in range(count):
            spot = scene.place(radius)
            if spot is not None:
                add(scene, *spot)
    # Sun: between low and overhead, or none; sky light the weaker, the stronger the sun.
    azimuth, elevation = random.uniform(0, 2 * np.pi), random.uniform(0.4, 1.4)
    toward = -np.array((np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)))
    overcast = random.random() < (0.3 if domain == "town" else 0.15)
    sun = random.uniform(0.0, 0.2) if overcast else random.uniform(0.45, 0.8)
    sky = random.uniform(0.55, 0.8) if overcast else random.uniform(0.25, 0.45)
    warm = np.array((1.0, 0.97, 0.92) if domain == "town" else (1.0, 0.93, 0.82))
    haze = random.uniform((0.6, 0.66, 0.72), (0.85, 0.88, 0.92))
    text = f"""\
<mujoco>
  <compiler angle="radian" eulerseq="XYZ"/>
  <size nconmax="1" njmax="1"/>
  <statistic center="0 0 0" extent="100"/>
  <visual>
    <headlight ambient="{sky:.3f} {sky:.3f} {sky:.3f}" diffuse="0.12 0.12 0.12" specular="0 0 0"/>
    <quality shadowsize="4096"/> <map znear="0.01" zfar="8" shadowclip="1.0"/>
  </visual>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1="{numbers(haze * (0.7, 0.8, 1))}" rgb2="{numbers(haze)}"
             width="128" height="128"/>
    <texture name="ground" type="2d" file="ground.png"/>
    <material name="ground" texture="ground" texrepeat="{TILES} {TILES}" specular="0"/>
    {"".join(scene.assets)}
  </asset>
  <worldbody>
    <light directional="true" castshadow="true" pos="{numbers(-100 * toward)}" dir="{numbers(toward)}"
           diffuse="{numbers(sun * warm)}" specular="0.3 0.3 0.3"/>
    <geom name="ground" group="2" type="plane" size="{TILES * SIZE_M / 2} {TILES * SIZE_M / 2} 1" material="ground"/>
    <body name="robot" mocap="true" pos="0 0 60"> <site name="lidar" size="0.01"/> </body>
    {"".join(scene.bodies)}
  </worldbody>
</mujoco>
"""
    return text, ground, scene.cars


def draw_poses(random, cars, count):
    """(field of view from edge to edge, poses x y z yaw pitch roll): most look to where a car is."""
    down = random.random() < 0.25
    fov = random.uniform(0.45, 1.1) if down else random.uniform(0.8, 1.15)
    poses = []
    for _ in range(count):
        yaw = random.uniform(-np.pi, np.pi)
        at_car = cars and random.random() < 0.8
        aim = np.array(cars[random.integers(len(cars))]) if at_car else random.uniform(-60, 60, 2)
        aim = aim + random.normal(0, 4, 2)
        if down:
            pitch = -np.pi / 2 + abs(random.normal(0, 0.06))
            height = min(120.0, random.uniform(22, 75) / np.tan(fov / 2) / 1.2)
        else:
            pitch = -np.radians(random.uniform(15, 30) if random.random() < 0.75 else random.uniform(30, 65))
            height = random.uniform(10, 40)
        # The aim is anywhere in the middle of the image's height, so that near and far cars are as frequent.
        slope = np.clip(-pitch + random.uniform(-0.35, 0.35) * fov, 0.12, np.pi / 2)
        reach = min(height / np.tan(slope), 140.0)
        x, y = aim - reach * np.array((np.cos(yaw), np.sin(yaw)))
        poses.append((x, y, height, yaw, pitch, random.normal(0, 0.05)))
    return fov, poses


def draw_scene(program, domain, seed, number, poses, output):
    random = np.random.default_rng((seed, DOMAINS.index(domain), number))
    text, ground, cars = make_scene(domain, random)
    fov, lines = draw_poses(random, cars, poses)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        ground.write(folder / "ground.png")
        (folder / "scene.xml").write_text(text)
        (folder / "poses").write_text("".join(" ".join(f"{value:.6f}" for value in line) + "\n" for line in lines))
        subprocess.run(
            [program, "--world", folder / "scene.xml", "--poses", folder / "poses", "--fovy", f"{fov:.4f}",
             "--width", str(IMAGE_PX), "--height", str(IMAGE_PX), "--out", output / f"{number:05d}_"], check=True,
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--domain", choices=DOMAINS, required=True)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--poses", type=int, default=6, help="of each scene")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="scenes at a time")
    parser.add_argument("--program", type=pathlib.Path, default=pathlib.Path("build/image_samples"))
    parser.add_argument("--output", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    program = arguments.program.resolve()
    with concurrent.futures.ProcessPoolExecutor(arguments.jobs) as pool:
        done = [pool.submit(draw_scene, program, arguments.domain, arguments.seed, number, arguments.poses,
                            arguments.output) for number in range(arguments.scenes)]
        for task in done:
            task.result()


if __name__ == "__main__":
    main()
