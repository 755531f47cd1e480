#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: `yaw_pitch_roll` of a pyquaternion, which says that it follows z-y'-x'', is yaw, pitch and roll as ROS has
# them; and `as_euler_angles` of numpy-quaternion is in that order, too.
#
# Seen with pyquaternion 0.9.9: the angles are those of x-y'-z'' (R = Rx Ry Rz). While a robot is level they are right,
# as yaw is alone then; on a slope, or of a drone in a turn, all three are wrong. Its rotation matrix is right.
# numpy-quaternion 2024.0.13 gives angles about z, y and z again; their first is not the yaw. rowan 1.3.2 and
# spatialmath-python 1.1.18 are right, in opposite orders. Remedy: take the angles from the matrix.
#
# Output, of roll 0.3, pitch 0.5, yaw 1.2:
#     pyquaternion roll -0.364 pitch 0.457 yaw 1.209, level: yaw 1.200
#     as Rx Ry Rz it gives the rotation back True, as Rz Ry Rx False
#     numpy-quaternion 0.627 0.576 0.496, as Rz Ry Rz it gives the rotation back True
#     rowan yaw, pitch, roll 1.200 0.500 0.300, spatialmath roll, pitch, yaw 0.300 0.500 1.200
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q pyquaternion==0.9.9 numpy-quaternion==2024.0.13 rowan==1.3.2 \
  spatialmath-python==1.1.18 scipy==1.16.3 numpy==2.3.5
"$folder/bin/python" -W ignore - <<'P'
import numpy as np
import quaternion
import rowan
from pyquaternion import Quaternion
from scipy.spatial.transform import Rotation
from spatialmath import UnitQuaternion

roll, pitch, yaw = 0.3, 0.5, 1.2

def wxyz(rotation):
    return np.roll(rotation.as_quat(), 1)

def gives_back(order, angles):
    return bool(np.allclose(Rotation.from_euler(order, angles).as_matrix(), truth.as_matrix()))

truth = Rotation.from_euler("ZYX", [yaw, pitch, roll])
assert np.allclose(Quaternion(*wxyz(truth)).rotation_matrix, truth.as_matrix())
y, p, r = Quaternion(*wxyz(truth)).yaw_pitch_roll
level = Quaternion(*wxyz(Rotation.from_euler("Z", yaw))).yaw_pitch_roll[0]
print(f"pyquaternion roll {r:.3f} pitch {p:.3f} yaw {y:.3f}, level: yaw {level:.3f}")
xyz, zyx = gives_back("XYZ", [r, p, y]), gives_back("ZYX", [y, p, r])
print(f"as Rx Ry Rz it gives the rotation back {xyz}, as Rz Ry Rx {zyx}")
assert xyz and not zyx and abs(r - roll) > 0.6 and abs(level - yaw) < 1e-9
angles = quaternion.as_euler_angles(np.quaternion(*wxyz(truth)))
zyz = gives_back("ZYZ", angles)
print("numpy-quaternion", *(f"{angle:.3f}" for angle in angles), end="")
print(f", as Rz Ry Rz it gives the rotation back {zyz}")
assert zyz
of_rowan, of_spatialmath = rowan.to_euler(wxyz(truth)), UnitQuaternion(list(wxyz(truth))).rpy()
print("rowan yaw, pitch, roll {:.3f} {:.3f} {:.3f}, ".format(*of_rowan), end="")
print("spatialmath roll, pitch, yaw {:.3f} {:.3f} {:.3f}".format(*of_spatialmath))
assert np.allclose(of_rowan, [yaw, pitch, roll]) and np.allclose(of_spatialmath, [roll, pitch, yaw])
P
