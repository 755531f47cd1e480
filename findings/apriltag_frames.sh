#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: a tag36h11 that OpenCV draws is the AprilTag of that number, so that OpenCV and the AprilTag library give the
# same corners and the same pose of it.
#
# Seen with OpenCV 5.0.0 and pupil-apriltags 1.0.4.post11: the number is the same. OpenCV's picture is upside down for
# AprilTag. The corners turn with the clock from upper left in OpenCV, the other way from there in the library. The axis
# z comes out of the tag towards the camera in OpenCV's usual order of corners (SOLVEPNP_IPPE_SQUARE), and goes into the
# tag in the library. A robot that docks by one, with a pose of the dock that was surveyed by the other, is turned by
# half a turn about the tag's y axis. Remedy: swap the library's corners, and turn its pose.
#
# Output, of tag 7 upright, straight before the camera:
#     first corners: OpenCV upper left, upper right; AprilTag upper right, upper left
#     x and z of the tag in the camera's frame: OpenCV 1 0 0, 0 0 -1; AprilTag -1 0 0, 0 0 1
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q opencv-contrib-python-headless==5.0.0.93 pupil-apriltags==1.0.4.post11 numpy==2.4.6
"$folder/bin/python" - <<'P'
import cv2
import numpy as np
import pupil_apriltags

tags = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
picture = np.full((400, 400), 255, np.uint8)
picture[100:300, 100:300] = cv2.aruco.generateImageMarker(tags, 7, 200)
corners, (number,), _ = cv2.aruco.ArucoDetector(tags).detectMarkers(picture)
found, = pupil_apriltags.Detector(families="tag36h11").detect(picture, estimate_tag_pose=True, tag_size=1.0,
                                                              camera_params=(400.0, 400.0, 200.0, 200.0))
assert int(np.ravel(number)[0]) == found.tag_id == 7

def where(corner):
    return f"{'upper' if corner[1] < 200 else 'lower'} {'left' if corner[0] < 200 else 'right'}"

orders = [[where(corner) for corner in all_four] for all_four in (corners[0].reshape(4, 2), found.corners)]
print("first corners: OpenCV {}, {}; AprilTag {}, {}".format(*orders[0][:2], *orders[1][:2]))
assert orders == [["upper left", "upper right", "lower right", "lower left"],
                  ["upper right", "upper left", "lower left", "lower right"]]
tag = np.array([[-0.5, 0.5, 0], [0.5, 0.5, 0], [0.5, -0.5, 0], [-0.5, -0.5, 0]])
camera = np.array([[400.0, 0, 200], [0, 400, 200], [0, 0, 1]])
_, turn, _ = cv2.solvePnP(tag, corners[0].reshape(4, 2), camera, None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
axes = [np.round(R, 1).astype(int)[:, [0, 2]].T.tolist() for R in (cv2.Rodrigues(turn)[0], found.pose_R)]
text = ["{}, {}".format(*(" ".join(map(str, axis)) for axis in two)) for two in axes]
print(f"x and z of the tag in the camera's frame: OpenCV {text[0]}; AprilTag {text[1]}")
assert axes == [[[1, 0, 0], [0, 0, -1]], [[-1, 0, 0], [0, 0, 1]]]
P
