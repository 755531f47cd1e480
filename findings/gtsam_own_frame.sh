#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: the covariance that gtsam's Marginals gives of a pose is in the frame of the map, as that of a
# PoseWithCovariance is, and a Pose3 has its translation first, as a Pose2 has.
#
# Seen with gtsam 4.3.0: it is in the frame of the pose itself. Of a robot that faces north and whose place is unsure
# towards east, the y of Pose2 is unsure, not the x; published as it is, a filter trusts the wrong direction. A Pose3
# has the rotation first, a Pose2 last. Remedy: turn the blocks by the pose's rotation, and swap those of Pose3.
#
# Output, of a place with a sigma of 0.5 m towards east and 0.01 m towards north:
#     Pose2 facing east: 0.500 0.010 0.001, north: 0.010 0.500 0.001
#     Pose3 facing north: 0.001 0.001 0.001 0.010 0.500 0.020
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q gtsam==4.3.0 numpy==2.4.6
"$folder/bin/python" - <<'P'
import gtsam
import numpy as np

def sigmas(pose, *factors):
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for factor in factors:
        graph.add(factor)
    values.insert(1, pose)
    return np.sqrt(np.diag(gtsam.Marginals(graph, values).marginalCovariance(1)))

def known_to(*sigma):
    return gtsam.noiseModel.Diagonal.Sigmas(np.array(sigma))

def planar(heading):
    pose = gtsam.Pose2(3, 4, heading)
    return sigmas(pose, gtsam.PoseTranslationPrior2D(1, pose.translation(), known_to(0.5, 0.01)),
                  gtsam.PoseRotationPrior2D(1, pose, known_to(0.001)))

def text(values):
    return " ".join(f"{value:.3f}" for value in values)

east, north = planar(0.0), planar(np.pi / 2)
print(f"Pose2 facing east: {text(east)}, north: {text(north)}")
assert np.allclose(east, [0.5, 0.01, 0.001]) and np.allclose(north, [0.01, 0.5, 0.001])
pose = gtsam.Pose3(gtsam.Rot3.Rz(np.pi / 2), np.array([3.0, 4.0, 0.0]))
spatial = sigmas(pose, gtsam.GPSFactor(1, pose.translation(), known_to(0.5, 0.01, 0.02)),
                 gtsam.PriorFactorPose3(1, pose, known_to(*[0.001] * 3, *[100.0] * 3)))
print(f"Pose3 facing north: {text(spatial)}")
assert np.allclose(spatial, [0.001] * 3 + [0.01, 0.5, 0.02], rtol=1e-3)
P
