#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: evo makes each pose of the truth, and each of the estimate, part of one pair at most.
#
# Seen with evo 1.38.1: it goes over the trajectory with fewer poses and gives each its nearest, also one that has been
# given: five estimates within 40 ms are compared with one true pose, and count five times. Remedy: count different
# stamps of the pairs, and keep `max_diff` below half of the estimate's period.
#
# Output, of a truth at 10 Hz and an estimate with five poses around 0.5 s:
#     max_diff 0.05 s: 5 pairs, of 1 true pose
#     max_diff 0.005 s: 1 pair, of 1 true pose
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q evo==1.38.1 numpy==2.4.6
"$folder/bin/python" - <<'P'
import numpy as np
from evo.core import sync, trajectory

def straight(stamps_s):
    stamps_s = np.asarray(stamps_s, dtype=float)
    return trajectory.PoseTrajectory3D(positions_xyz=np.outer(stamps_s, [1, 0, 0]), timestamps=stamps_s,
                                       orientations_quat_wxyz=np.tile([1.0, 0, 0, 0], (len(stamps_s), 1)))

for max_diff_s, expected in ((0.05, 5), (0.005, 1)):
    truth, estimate = straight(np.arange(0, 2, 0.1)), straight(0.5 + 0.01 * np.arange(-2, 3))
    truth, estimate = sync.associate_trajectories(truth, estimate, max_diff=max_diff_s)
    different = len(set(truth.timestamps))
    print(f"max_diff {max_diff_s} s: {estimate.num_poses} pair{'s' * (expected > 1)}, of {different} true pose")
    assert (estimate.num_poses, different) == (expected, 1)
P
