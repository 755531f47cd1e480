#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: points of a LIDAR that the camera cannot see are projected to places outside the picture; and undistortPoints
# inverts projectPoints, for a lens of which that is possible.
#
# Seen with OpenCV 4.6.0 (Debian 12) and 5.0.0:
# - what is behind the camera is projected into the picture, mirrored;
# - so is what is at 63 degrees before a camera that sees 48 in its corners: the polynomial of the lens, which was
#   fitted to what it sees, turns back beyond. Clouds get colours from the wrong half of the picture.
# - undistortPoints stops after five steps: near the corners it is off by pixels, without a word.
# Remedy: leave out what is not before the camera and within the angle of the picture's corner; undistortPointsIter
# (OpenCV 4), or a criterion of 100 steps (OpenCV 5).
#
# Output of each version, of a camera of 640 x 480 with f = 500 and (k1, k2, k3) = (-0.35, 0.12, -0.02):
#     behind: u 300 v 250
#     along x at 35 degrees: u 619, at 50: 730, at 63: 604, at 65: 302
#     undistortPoints of a corner: off by 4.84 px, after 100 steps by 0.00 px
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/project.py" <<'P'
import cv2
import numpy as np

f, centre = 500.0, np.array([320.0, 240.0])
K, k = np.array([[f, 0, centre[0]], [0, f, centre[1]], [0, 0, 1]]), np.array([-0.35, 0.12, 0, 0, -0.02])

def project(points):
    return cv2.projectPoints(np.asarray(points, float), np.zeros(3), np.zeros(3), K, k)[0].reshape(-1, 2)

def in_picture(u_v):
    return bool((u_v >= 0).all() and (u_v < 2 * centre).all())

behind, = project([[0.2, -0.1, -5]])
print("behind: u {:.0f} v {:.0f}".format(*behind))
assert in_picture(behind)
angles = [35, 50, 63, 65]
seen = project([[np.sin(np.radians(a)), 0, np.cos(np.radians(a))] for a in angles])
print("along x at 35 degrees: u {:.0f}, at 50: {:.0f}, at 63: {:.0f}, at 65: {:.0f}".format(*seen[:, 0]))
assert [in_picture(u_v) for u_v in seen] == [True, False, True, True]
corner, radii = 2 * centre - 1, np.linspace(0, 1.5, 1500001)
distorted = radii + radii**3 * (k[0] + radii**2 * (k[1] + radii**2 * k[4]))
assert (np.diff(distorted) > 0).all()  # the lens can be inverted in the picture
truth = np.interp(np.linalg.norm(corner - centre) / f, distorted, radii)

def off_px(*how):
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-9)
    if how and hasattr(cv2, "undistortPointsIter"):
        found = cv2.undistortPointsIter(corner.reshape(1, 1, 2), K, k, np.eye(3), np.eye(3), criteria)
    elif how:
        found = cv2.undistortPoints(corner.reshape(1, 1, 2), K, k, criteria=criteria)
    else:
        found = cv2.undistortPoints(corner.reshape(1, 1, 2), K, k)
    return abs(np.linalg.norm(found) - truth) * f

five, hundred = off_px(), off_px("many steps")
print(f"undistortPoints of a corner: off by {five:.2f} px, after 100 steps by {hundred:.2f} px")
assert abs(five - 4.84) < 0.1 and hundred < 0.01
P
for version in 4.6.0.66 5.0.0.93; do
  python3 -m venv --clear "$folder/venv"
  "$folder/venv/bin/pip" install -q "opencv-python-headless==$version" \
    "numpy==$([ $version = 5.0.0.93 ] && echo 2.4.6 || echo 1.26.4)"
  echo "OpenCV $version"
  "$folder/venv/bin/python" "$folder/project.py"
done
