#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: the columns of an Ouster scan turn as the beams of a LaserScan do, against the clock, and a range is the
# distance of the point from the sensor's origin.
#
# Seen with ouster-sdk 1.0.1, of the OS-1-64 that it makes by default: columns turn with the clock, by .3516 degrees at
# 1,024 of them, and begin behind the sensor; the sensor's frame is turned by half a turn against the lidar's and 36 mm
# below it, so that of points with a range of 1 m none is 1 m away from the sensor's origin above or below the middle:
# .990 to 1.010 m. About the lidar's axis the rays begin 16 mm out, so there, too, it is not 1 m. A range of 0 is no
# return, and its point is exactly at 0, not at 16 mm.
#
# Output:
#     azimuth of columns 0, 1, 256: 176.9 176.5 86.9 degrees
#     |xyz| of a range of 1 m: 1.0101 highest, 1.0005 middle, 0.9898 lowest
#     from the lidar's middle: 0.9993 1.0000 0.9993
#     of a range of 0: 0.0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q ouster-sdk==1.0.1 numpy==2.4.6
"$folder/bin/python" - <<'P'
import numpy as np
from ouster.sdk import core

info = core.SensorInfo.from_default(core.LidarMode(1024, 10))
points_of = core.XYZLut(info)
shape = info.format.pixels_per_column, info.format.columns_per_frame
points_m = points_of(np.full(shape, 1000, np.uint32))
azimuth_deg = np.degrees(np.arctan2(points_m[32, [0, 1, 256], 1], points_m[32, [0, 1, 256], 0]))
print("azimuth of columns 0, 1, 256:", *azimuth_deg.round(1), "degrees")
assert np.allclose(np.diff(azimuth_deg)[0], -360 / 1024, atol=1e-3) and azimuth_deg[0] > 170.0
rows = points_m[[0, 32, 63], 0]
away_m = np.linalg.norm(rows, axis=1)
print("|xyz| of a range of 1 m: {:.4f} highest, {:.4f} middle, {:.4f} lowest".format(*away_m))
assert np.allclose(away_m, [1.0101, 1.0005, 0.9898], atol=1e-4)
from_lidar_m = np.linalg.norm(rows - info.lidar_to_sensor_transform[:3, 3] / 1000.0, axis=1)
print("from the lidar's middle:", *(f"{m:.4f}" for m in from_lidar_m))
assert np.allclose(from_lidar_m, [0.9993, 1.0, 0.9993], atol=1e-4)
none_m = np.abs(points_of(np.zeros(shape, np.uint32))).max()
print("of a range of 0:", none_m)
assert none_m == 0.0
P
