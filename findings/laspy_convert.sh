#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: laspy.convert keeps what both point formats have, and a scan angle is in degrees in each of them.
#
# Seen with laspy 2.7.0: from formats 0 to 5 to formats 6 to 10 all scan angles become 0 (straight down), as the field
# has another name and type there, and back again, too. In the newer formats `scan_angle` is the file's whole number, of
# 0.006 degrees each: 15 written is 0.09 degrees. A new point is return 0 of 0, not 1 of 1, so that who takes first
# returns has none; intensities from 0 to 1 are cut to 0 and 1. Nothing is said. Remedy: set these fields by hand.
#
# Output, of -10, 0 and 15 degrees:
#     format 1 to 6: scan_angle 0 0 0, classification 2 6 9, returns 1 1 1
#     format 6 to 1: scan_angle_rank 0 0 0
#     new points: return 0 of 0, first returns 0 of 3
#     intensity 0.5 is 0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q laspy==2.7.0 numpy==2.4.6
"$folder/bin/python" -W error - <<'P'
import laspy
import numpy as np

def created(point_format):
    points = laspy.create(point_format=point_format)
    points.x = points.y = points.z = np.arange(3.0)
    return points

degrees = np.array([-10, 0, 15])
old = created(1)
old.scan_angle_rank, old.classification = degrees, [2, 6, 9]
old.return_number = old.number_of_returns = np.ones(3, np.uint8)
converted = laspy.convert(old, point_format_id=6)
fields = [np.asarray(field) for field in (converted.scan_angle, converted.classification, converted.return_number)]
print("format 1 to 6: scan_angle", *fields[0], end="")
print(", classification", *fields[1], end="")
print(", returns", *fields[2])
assert [field.tolist() for field in fields] == [[0, 0, 0], [2, 6, 9], [1, 1, 1]]
new = created(6)
new.scan_angle = np.round(degrees / 0.006)
back = np.asarray(laspy.convert(new, point_format_id=1).scan_angle_rank)
print("format 6 to 1: scan_angle_rank", *back)
assert np.asarray(new.scan_angle).tolist() == [-1667, 0, 2500] and back.tolist() == [0, 0, 0]
number, of = np.asarray(new.return_number), np.asarray(new.number_of_returns)
print(f"new points: return {number[0]} of {of[0]}, first returns {(number == 1).sum()} of 3")
assert not number.any() and not of.any()
new.intensity = np.array([0.0, 0.5, 1.0])
print("intensity 0.5 is", new.intensity[1])
assert np.asarray(new.intensity).tolist() == [0, 0, 1]
P
