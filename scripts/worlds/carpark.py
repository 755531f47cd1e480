#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Make models/worlds/carpark.xml, its hills (parts/carpark.png) and an elevation model of them with errors
(carpark.dem.tif): 200 m x 200 m with cars, trees and houses.

    scripts/worlds/carpark.py [--seed N] [--folder DIR]
"""
import argparse
import math
import pathlib
import random
import struct

import matplotlib.image
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
HALF_M = 130.0  # of the ground; the region is 200 m x 200 m
PIXELS = 131  # of the hills' picture: 2 m each
HIGHEST_M = 9.0
DEM_PIXEL_M = 2.0
DEM_BIAS_M = 0.6
DEM_NOISE_M = 0.3
CAMERA_PITCH_DEG = -25.0
ABOVE_M = 25.0  # of the flight over the highest ground
SPEED_M_S = 8.0
BEGIN_M = 95.0  # from the middle, towards the south-west
CARS = 14
TREES = 45
COLORS = {"red": "0.75 0.12 0.1", "white": "0.92 0.92 0.9", "black": "0.08 0.08 0.1", "silver": "0.62 0.64 0.66",
          "blue": "0.12 0.25 0.6", "yellow": "0.9 0.75 0.1"}


def smooth_height_m(x, y):
    """Of the hills, before they are made a picture."""
    hills = 6.5 * np.exp(-((x - 45) ** 2 + (y - 30) ** 2) / (2 * 32.0 ** 2))
    hills += 4.0 * np.exp(-((x + 60) ** 2 + (y + 45) ** 2) / (2 * 28.0 ** 2))
    return np.clip(hills + 0.012 * (x + HALF_M), 0.0, HIGHEST_M)


class Ground:
    """The hills as their picture has them: 256 heights, bilinear in between."""

    def __init__(self):
        axis = np.linspace(-HALF_M, HALF_M, PIXELS)
        x, y = np.meshgrid(axis, axis)
        self.levels = np.round(smooth_height_m(x, y) / HIGHEST_M * 255).astype(np.uint8)  # rows from the south
        self.levels[0, 0], self.levels[0, -1] = 0, 255  # MuJoCo scales them to 0 ... 1; both out of sight

    def save(self, path):
        grey = np.repeat(self.levels[::-1, :, None], 3, axis=2)  # pictures begin in the north
        matplotlib.image.imsave(path, grey)

    def height_m(self, x, y):
        u, v = ((np.asarray(c) + HALF_M) / (2 * HALF_M) * (PIXELS - 1) for c in (x, y))
        i, j = (np.clip(np.floor(c).astype(int), 0, PIXELS - 2) for c in (u, v))
        a, b, z = u - i, v - j, self.levels * (HIGHEST_M / 255)
        return ((1 - a) * (1 - b) * z[j, i] + a * (1 - b) * z[j, i + 1] + (1 - a) * b * z[j + 1, i]
                + a * b * z[j + 1, i + 1])


def write_geotiff(path, heights, pixel_m, west_m, north_m):
    """One band of 32-bit floats, rows from the north."""
    data = heights.astype("<f4").tobytes()
    scale = struct.pack("<3d", pixel_m, pixel_m, 0.0)
    tie = struct.pack("<6d", 0.0, 0.0, 0.0, west_m, north_m, 0.0)
    keys = struct.pack("<12H", 1, 1, 0, 2, 1024, 0, 1, 1, 1025, 0, 1, 1)  # projected, pixel is area
    extra = scale + tie + keys
    entries = [(256, 4, 1, heights.shape[1]), (257, 4, 1, heights.shape[0]), (258, 3, 1, 32), (259, 3, 1, 1),
               (262, 3, 1, 1), (273, 4, 1, 0), (277, 3, 1, 1), (278, 4, 1, heights.shape[0]), (279, 4, 1, len(data)),
               (339, 3, 1, 3), (33550, 12, 3, 0), (33922, 12, 6, 0), (34735, 3, 12, 0)]
    begin = 8 + 2 + 12 * len(entries) + 4
    places = {33550: begin, 33922: begin + len(scale), 34735: begin + len(scale) + len(tie), 273: begin + len(extra)}
    directory = b"".join(struct.pack("<HHI", tag, kind, count) +
                         (struct.pack("<HH", value, 0) if kind == 3 and tag not in places else
                          struct.pack("<I", places.get(tag, value))) for tag, kind, count, value in entries)
    path.write_bytes(struct.pack("<2sHI", b"II", 42, 8) + struct.pack("<H", len(entries)) + directory +
                     struct.pack("<I", 0) + extra + data)


def write_dem(path, ground, seed):
    """The heights of the ground with a common error, and one that is as wide as a few pixels."""
    pixels = int(2 * HALF_M / DEM_PIXEL_M)
    middles = -HALF_M + DEM_PIXEL_M * (np.arange(pixels) + 0.5)
    x, y = np.meshgrid(middles, middles[::-1])
    noise = np.random.default_rng(seed).normal(size=(pixels, pixels))
    wide = sum(np.roll(noise, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)) / 3.0
    write_geotiff(path, ground.height_m(x, y) + DEM_BIAS_M + DEM_NOISE_M * wide, DEM_PIXEL_M, -HALF_M, HALF_M)


def car(rng, number, x, y, z, yaw):
    """A body and a cabin on four wheels, of some size and colour."""
    length, width, height = rng.uniform(3.9, 4.9), rng.uniform(1.7, 1.9), rng.uniform(1.42, 1.6)
    material = f"car_{rng.choice(sorted(COLORS))}"
    hood = 0.58 * height
    cabin = rng.uniform(0.5, 0.62) * length
    shift = rng.uniform(-0.1, -0.02) * length
    wheels = "".join(
        f'\n      <geom class="tyre" pos="{0.31 * length * i:.2f} {0.46 * width * j:.2f} {0.31 - 0.5 * hood:.2f}"/>'
        for i in (-1, 1) for j in (-1, 1))
    return f"""
    <body name="car_{number}" pos="{x:.2f} {y:.2f} {z + 0.5 * hood:.2f}" euler="0 0 {yaw:.2f}">
      <geom type="box" group="1" size="{0.5 * length:.2f} {0.5 * width:.2f} {0.5 * hood - 0.08:.2f}" material="{material}"/>
      <geom class="decoration" size="{0.5 * cabin:.2f} {0.45 * width:.2f} {0.5 * (height - hood):.2f}" pos="{shift:.2f} 0 {0.5 * height:.2f}" material="car_glass"/>
      <geom class="decoration" size="{0.44 * cabin:.2f} {0.44 * width:.2f} 0.03" pos="{shift:.2f} 0 {height - 0.5 * hood:.2f}" material="{material}"/>{wheels}
    </body>"""


def tree(rng, x, y, z):
    height, radius = rng.uniform(4.0, 8.0), rng.uniform(1.5, 3.0)
    return (f'\n    <geom class="trunk" pos="{x:.1f} {y:.1f} {z + 0.5 * height:.1f}" size="0.18 {0.5 * height:.1f}"/>'
            f'\n    <geom class="crown" pos="{x:.1f} {y:.1f} {z + height:.1f}" '
            f'size="{radius:.1f} {radius:.1f} {rng.uniform(0.7, 1.1) * radius:.1f}"/>')


def house(rng, x, y, z):
    a, b, h = rng.uniform(4, 8), rng.uniform(3, 5), rng.uniform(2.5, 4)
    yaw = rng.uniform(0, math.pi)
    return (f'\n    <geom type="box" material="wall" pos="{x:.1f} {y:.1f} {z + h - 0.5:.1f}" euler="0 0 {yaw:.2f}" '
            f'size="{a:.1f} {b:.1f} {h:.1f}"/>'
            f'\n    <geom type="box" material="roof" pos="{x:.1f} {y:.1f} {z + 2 * h - 0.3:.1f}" euler="0 0 {yaw:.2f}" '
            f'size="{a + 0.4:.1f} {b + 0.4:.1f} 0.25"/>')


def places(rng, count, taken, apart_m, half_m=92.0):
    """Places that are apart from each other and from those that are taken: (x, y, radius)."""
    found = []
    while len(found) < count:
        x, y = rng.uniform(-half_m, half_m), rng.uniform(-half_m, half_m)
        if all(math.hypot(x - a, y - b) > apart_m + r for a, b, r in taken + found):
            found.append((x, y, apart_m))
    return found


def world(seed):
    rng, ground = random.Random(seed), Ground()
    houses = places(rng, 5, [], 14.0)
    cars = places(rng, CARS, houses, 6.0)
    trees = places(rng, TREES, [(x, y, 12.0) for x, y, _ in houses] + [(x, y, 3.0) for x, y, _ in cars], 2.5, 97.0)
    z = lambda x, y: float(ground.height_m(x, y))
    height = HIGHEST_M + ABOVE_M - 4.0
    materials = "".join(f'\n    <material name="car_{name}" rgba="{rgb} 1" specular="0.4"/>'
                        for name, rgb in COLORS.items())
    pitch = math.radians(CAMERA_PITCH_DEG)
    return ground, f"""<!-- SPDX-License-Identifier: BSD-3-Clause
     Made by scripts/worlds/carpark.py. Cars, trees and houses on hills, 200 m x 200 m, over which a multirotor with a
     camera flies; carpark.dem.tif beside it is the ground's elevation with errors: {DEM_BIAS_M} m too high, and
     {DEM_NOISE_M} m of noise. -->
<mujoco model="carpark">
  <compiler angle="radian" texturedir="parts" meshdir="parts"/>
  <include file="parts/scene.xml"/>

  <statistic center="0 0 0" extent="150"/>
  <visual> <map znear="0.002" zfar="8"/> </visual>

  <asset>
    <hfield name="hills" file="carpark.png" size="{HALF_M:.0f} {HALF_M:.0f} {HIGHEST_M} 1"/>
    <material name="meadow" rgba="0.47 0.58 0.34 1"/>
    <material name="roof" rgba="0.55 0.28 0.22 1"/>
    <material name="crown" rgba="0.2 0.38 0.17 1"/>
    <material name="car_glass" rgba="0.15 0.18 0.22 1" specular="0.5"/>
    <material name="car_tyre" rgba="0.06 0.06 0.06 1"/>{materials}
  </asset>

  <default>
    <default class="trunk"> <geom type="cylinder" material="bark"/> </default>
    <default class="crown"> <geom type="ellipsoid" material="crown"/> </default>
    <default class="tyre"> <geom type="sphere" group="2" size="0.31" material="car_tyre"/> </default>
  </default>

  <custom>
    <text name="robot" data="multirotor max_speed_m_s {SPEED_M_S}"/>
    <text name="camera_optical" data="label_camera rate_hz 2 width 448 height 336 fovy_rad 0.8194 color 1"/>
    <text name="gnss" data="gnss rate_hz 5 correlated_sigma_m 0.6 correlation_s 30 white_sigma_m 0.3 vertical_ratio 1.5"/>
    <text name="imu" data="imu rate_hz 200"/>
    <numeric name="world_origin" data="47.3769 8.5417 408"/>
  </custom>

  <worldbody>
    <light pos="-60 -80 120" dir="0.4 0.5 -0.8" directional="true" diffuse="0.5 0.5 0.48" specular="0.1 0.1 0.1"/>
    <camera name="overview" pos="-20 -190 130" xyaxes="1 0 0 0 0.57 0.82" fovy="46"/>
    <camera name="top" pos="0 0 260" xyaxes="1 0 0 0 1 0" fovy="46"/>
    <geom name="ground" type="hfield" hfield="hills" material="meadow"/>
{"".join(house(rng, x, y, z(x, y)) for x, y, _ in houses)}
{"".join(tree(rng, x, y, z(x, y)) for x, y, _ in trees)}
{"".join(car(rng, k + 1, x, y, z(x, y), rng.uniform(-math.pi, math.pi)) for k, (x, y, _) in enumerate(cars))}

    <body name="robot" mocap="true" pos="{-BEGIN_M:.1f} {-BEGIN_M:.1f} {height:.1f}">
      <site name="gnss" pos="0 0 0.1" size="0.01"/>
      <site name="imu" size="0.01"/>
      <site name="camera_optical" pos="0.15 0 -0.05" xyaxes="0 -1 0 {math.sin(pitch):.6f} 0 {-math.cos(pitch):.6f}"/>
      <geom group="2" type="box" size="0.12 0.12 0.05" rgba="0.15 0.15 0.17 1"/>
      <geom group="2" type="box" size="0.35 0.02 0.01" pos="0 0 0.05" euler="0 0 0.785" rgba="0.8 0.2 0.1 1"/>
      <geom group="2" type="box" size="0.35 0.02 0.01" pos="0 0 0.05" euler="0 0 -0.785" rgba="0.8 0.2 0.1 1"/>
    </body>
  </worldbody>
</mujoco>
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=pathlib.Path, default=ROOT / "models/worlds")
    arguments = parser.parse_args()
    ground, xml = world(arguments.seed)
    (arguments.folder / "parts").mkdir(parents=True, exist_ok=True)
    ground.save(arguments.folder / "parts/carpark.png")
    (arguments.folder / "carpark.xml").write_text(xml)
    write_dem(arguments.folder / "carpark.dem.tif", ground, arguments.seed)


if __name__ == "__main__":
    main()
