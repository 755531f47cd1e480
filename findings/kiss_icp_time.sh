#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: a pose that KISS-ICP gives for a scan with times of points is that of the scan's stamp, which drivers take from
# the first point; or, as other odometries do it, of the middle of the sweep.
#
# Seen with kiss-icp 1.3.0: pose and deskewed cloud are of the last point, once the motion is known; the first scan is
# left as it is. With the stamps of the first points these poses put the sensor ahead by a sweep: at 5 m/s and 10 Hz by
# half a metre. Remedy: add the sweep's duration to the stamp.
#
# Output: of a sensor that moves straight at 5 m/s, the time in the sweep of 0.1 s to which the deskewed points belong:
#     scan 0 from 0.000 to 0.100 s
#     scan 19 from 0.100 to 0.100 s
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q kiss-icp==1.3.0 numpy==2.4.6
"$folder/bin/python" - <<'P'
import numpy as np
from kiss_icp.config import KISSConfig
from kiss_icp.kiss_icp import KissICP

config = KISSConfig()
config.mapping.voxel_size = 0.5
config.data.min_range = 0.0
odometry = KissICP(config)
random = np.random.default_rng(1)
velocity_m_s, sweep_s = np.array([5.0, 0.0, 0.0]), 0.1
x = lambda count: random.uniform(-30.0, 80.0, count)
walls = np.c_[x(20000), random.choice([-8.0, 8.0], 20000) + random.normal(0, 0.3, 20000), random.uniform(-1, 4, 20000)]
floor = np.c_[x(6000), random.uniform(-8, 8, 6000), np.full(6000, -1.0)]
posts = np.c_[random.choice(np.arange(-30.0, 80.0, 5.0), 6000), random.choice([-5.0, 5.0], 6000),
              random.uniform(-1, 4, 6000)]
world_m = np.vstack([walls, floor, posts + random.normal(0, 0.05, posts.shape) * [1, 1, 0]])
for scan in range(20):
    begin_s = sweep_s * scan
    seen_m = world_m[np.abs(world_m[:, 0] - begin_s * velocity_m_s[0]) < 30.0]
    part = np.sort(random.uniform(0, 1, len(seen_m)))
    deskewed_m, _ = odometry.register_frame(seen_m - np.outer(begin_s + sweep_s * part, velocity_m_s), part)
    of_s = (seen_m - deskewed_m)[:, 0] / velocity_m_s[0] - begin_s
    if scan in (0, 19):
        print(f"scan {scan} from {of_s.min():.3f} to {of_s.max():.3f} s")
    if scan == 0:
        assert np.allclose(of_s, sweep_s * part), of_s
assert np.allclose(of_s, sweep_s, atol=0.002), of_s
P
