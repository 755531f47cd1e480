#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: svgpathtools' `transform` moves an arc as it moves points, or raises, as `scaled` does of what it cannot do.
#
# Seen with svgpathtools 1.8.0: of circles, and of ellipses along the axes, it is right. A turned ellipse that is
# mirrored keeps its angle, which would have to change its sign, so that it is another ellipse between the right ends;
# one that is stretched along an axis is another one, too. Nothing is said. To turn a drawing, whose y is down, into a
# map, whose y is up, is such a mirroring. Remedy: sample points first, and transform them.
#
# Output, how far points of an arc are from the transformed arc:
#     circle: turned 0.000, mirrored 0.000, stretched 0.000
#     ellipse: turned 0.000, mirrored 0.000, stretched 0.000
#     turned ellipse: turned 0.000, mirrored 2.000, stretched 1.774
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q svgpathtools==1.8.0 numpy==2.4.6 scipy==1.16.3
"$folder/bin/python" -W ignore - <<'P'
import numpy as np
from svgpathtools import parse_path
from svgpathtools.path import transform

matrices = {"turned": [[0, -1, 0], [1, 0, 0], [0, 0, 1]], "mirrored": np.diag([1, -1, 1]),
            "stretched": np.diag([2, 1, 1])}
arcs = {"circle": ("M 0 0 A 1 1 0 0 1 2 0", (0, 0, 0)), "ellipse": ("M 0 0 A 3 1 0 0 1 4 0", (0, 0, 0)),
        "turned ellipse": ("M 0 0 A 3 1 30 0 1 4 0", (0, 2.0, 1.774))}

def off(path, matrix):
    """The greatest distance from transformed points of the path to the transformed path."""
    points = np.array([path.point(t) for t in np.linspace(0, 1, 9)])
    x, y, _ = matrix @ np.array([points.real, points.imag, np.ones(len(points))])
    transformed = transform(path, matrix)
    near = np.array([transformed.point(t) for t in np.linspace(0, 1, 801)])
    return max(np.abs(near - point).min() for point in x + 1j * y)

for name, (text, expected) in arcs.items():
    seen = {how: off(parse_path(text), np.array(matrix, float)) for how, matrix in matrices.items()}
    print(name + ": " + ", ".join(f"{how} {distance:.3f}" for how, distance in seen.items()))
    assert np.allclose(list(seen.values()), expected, atol=2e-3), seen
P
