#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: points that are written as LAS with laspy come back as they were, but for the last digits of a double.
#
# Seen with laspy 2.7.0: a new file keeps whole centimetres, as its default scale is 0.01, and says nothing. Two
# millimetres of a reflector's place are gone, and places of a scanner with 3 mm of noise become layers. Remedy: set
# `header.scales` and `header.offsets` before the coordinates.
#
# Output, of 571666.447504 and 571666.452 m, by default and with a scale of 0.0001 m:
#     default 571666.450 571666.450
#     finer   571666.4475 571666.4520
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q laspy==2.7.0 numpy==2.4.6
"$folder/bin/python" - "$folder/points.las" <<'P'
import sys

import laspy
import numpy as np

given = np.array([571666.447504, 571666.452])

def written(scale_m=None):
    points = laspy.create()
    if scale_m is not None:
        points.header.scales, points.header.offsets = [scale_m] * 3, [571000.0, 0.0, 0.0]
    points.x, points.y, points.z = given, np.zeros(2), np.zeros(2)
    points.write(sys.argv[1])
    return laspy.read(sys.argv[1]).x

default, finer = written(), written(0.0001)
print("default", *(f"{x:.3f}" for x in default))
print("finer  ", *(f"{x:.4f}" for x in finer))
assert abs(default[0] - 571666.45) < 1e-6 and abs(default[1] - 571666.45) < 1e-6, default
assert np.abs(finer - given).max() < 6e-5, finer
P
