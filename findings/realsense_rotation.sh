#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: the nine numbers of a RealSense's extrinsics are a rotation matrix, row by row; and decimated depth is depth
# that was measured.
#
# Seen with pyrealsense2 2.59.1.11053: `rotation` is column by column, so that `np.reshape(rotation, (3, 3))` is the
# rotation of the way back. Between a depth and a colour camera, turned by a few tenths of a degree, that looks like a
# bad calibration. The decimation filter takes the median up to a factor of 3; from 4 on the mean, and so it puts points
# into the air between an object and the wall behind it. Remedy: transpose; thresholds of depth, or factors up to 3.
#
# Output:
#     x by rs2_transform_point_to_point: 0 1 0, by rotation reshaped: 0 -1 0
#     of 1 m before 5 m, by 2: 1.0 5.0, by 4: 1.0 3.0 5.0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q pyrealsense2==2.59.1.11053 numpy==2.4.6
"$folder/bin/python" - <<'P'
import numpy as np
import pyrealsense2 as rs

turned = rs.extrinsics()
turned.rotation, turned.translation = [0.0, 1, 0, -1, 0, 0, 0, 0, 1], [0.0, 0, 0]
right = [round(x) for x in rs.rs2_transform_point_to_point(turned, [1.0, 0.0, 0.0])]
reshaped = [round(float(x)) for x in np.reshape(turned.rotation, (3, 3)) @ [1, 0, 0]]
print("x by rs2_transform_point_to_point:", *right, end="")
print(", by rotation reshaped:", *reshaped)
assert (right, reshaped) == ([0, 1, 0], [0, -1, 0])

width, height = 64, 48
camera = rs.intrinsics()
camera.width, camera.height, camera.ppx, camera.ppy, camera.fx, camera.fy = width, height, 32, 24, 60, 60
camera.model, camera.coeffs = rs.distortion.none, [0.0] * 5
stream = rs.video_stream()
stream.type, stream.index, stream.uid, stream.fmt = rs.stream.depth, 0, 1, rs.format.z16
stream.width, stream.height, stream.fps, stream.bpp, stream.intrinsics = width, height, 30, 2, camera
device = rs.software_device()
sensor = device.add_sensor("depth")
profile = sensor.add_video_stream(stream)
sensor.add_read_only_option(rs.option.depth_units, 0.001)
queue = rs.frame_queue(1)
sensor.open(profile)
sensor.start(queue)
depth_mm = np.full((height, width), 1000, np.uint16)
depth_mm[:, 30:] = 5000
frame = rs.software_video_frame()
frame.pixels, frame.stride, frame.bpp, frame.depth_units = depth_mm, 2 * width, 2, 0.001
frame.timestamp, frame.frame_number, frame.domain = 1.0, 1, rs.timestamp_domain.system_time
frame.profile = profile.as_video_stream_profile()
sensor.on_video_frame(frame)
seen = queue.wait_for_frame()
depths_m = {}
for factor in (2, 4):
    decimation = rs.decimation_filter()
    decimation.set_option(rs.option.filter_magnitude, factor)
    depths_m[factor] = (np.unique(np.asanyarray(decimation.process(seen).get_data())) / 1000).tolist()
print("of 1 m before 5 m", *(f"by {factor}: " + " ".join(map(str, m)) for factor, m in depths_m.items()), sep=", ")
assert depths_m == {2: [1.0, 5.0], 4: [1.0, 3.0, 5.0]}
sensor.stop()
sensor.close()
P
