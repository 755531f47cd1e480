#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: the filters of ahrs give one heading of the same rates, forces and magnetic fields, and its two classes for
# rotations make the same of roll, pitch and yaw.
#
# Seen with ahrs 0.4.0, of an IMU at rest as ROS has it (x ahead, z up, force +9.81 upwards):
# - Madgwick's yaw is 0 at magnetic north, Mahony's at east: 90 degrees apart;
# - AQUA gives the inverse rotation: yaw and roll have the other sign, with a magnetometer and without;
# - Complementary without a magnetometer does not turn at all: gravity's yaw of 0 takes back what the gyroscope adds;
# - DCM(rpy=...) turns about the axes in the other order and direction than Quaternion(rpy=...).
# Nothing is said. Remedy: turn by a known angle first.
#
# Output, in degrees:
#     28.6 from east to north: Madgwick -61.4, Mahony 28.6, AQUA 61.4
#     57.3 turned without a magnetometer: Madgwick 57.2, Mahony 57.2, AQUA -57.2, Complementary 0.0
#     rolled by 17.2: Madgwick 17.2, Mahony 17.2, AQUA -17.2, Complementary 17.2
#     roll, pitch, yaw of 17, 29, 69: Quaternion right True, DCM right False
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q ahrs==0.4.0 scipy==1.16.3 numpy==2.3.5
"$folder/bin/python" - <<'P'
import ahrs
import numpy as np
from scipy.spatial.transform import Rotation

def last(name, axis, measured, count=3000):
    """Angle in degrees about x or z after the measurements."""
    data = {kind: np.tile(value, (count, 1)) for kind, value in measured.items()}
    found = getattr(ahrs.filters, name)(frequency=100.0, **data).Q[-1]
    yaw, _, roll = Rotation.from_quat(np.roll(found, -1)).as_euler("ZYX", degrees=True)
    return roll if axis == "x" else yaw

def compare(text, names, expected, *how):
    seen = [last(name, *how) for name in names]
    print(text, ", ".join(f"{name} {angle + 0.0:.1f}" for name, angle in zip(names, seen)).replace("-0.0", "0.0"))
    assert np.allclose(seen, expected, atol=0.2), seen

names = ["Madgwick", "Mahony", "AQUA", "Complementary"]
up, field, still = np.array([0, 0, 9.81]), np.array([0, 20.0, -40.0]), np.zeros(3)  # east, north, up
to_body = Rotation.from_euler("Z", 0.5).inv()
compare("28.6 from east to north:", names[:3], [28.65 - 90, 28.65, 90 - 28.65], "z",
        dict(gyr=still, acc=up, mag=to_body.apply(field)))
compare("57.3 turned without a magnetometer:", names, [57.2, 57.2, -57.2, 0.0], "z",
        dict(gyr=np.array([0, 0, 0.1]), acc=up), 1000)
compare("rolled by 17.2:", names, [17.2, 17.2, -17.2, 17.2], "x",
        dict(gyr=still, acc=Rotation.from_euler("X", 0.3).inv().apply(up)))
angles = [0.3, 0.5, 1.2]
truth = Rotation.from_euler("ZYX", angles[::-1])
right = [bool(np.allclose(made, truth.as_matrix()))
         for made in (ahrs.Quaternion(rpy=np.array(angles)).to_DCM(), np.asarray(ahrs.DCM(rpy=angles)))]
print("roll, pitch, yaw of 17, 29, 69: Quaternion right {}, DCM right {}".format(*right))
assert right == [True, False]
P
