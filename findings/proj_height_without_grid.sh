#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: asked for heights above sea level (EGM96 or EGM2008) of ellipsoidal ones, pyproj converts them, or, where the
# grid of the geoid is not installed, raises or answers inf.
#
# Seen with pyproj 3.7.2 (PROJ 9.5.1), whose wheel has no grid: it answers the height that it was given, without a
# warning. In Germany that is wrong by 47 m. The only sign is an accuracy of -1, and "ballpark" in the description. The
# network, off by default, would fetch the grid. `allow_ballpark=False` does what one expects: it raises. The other way
# round, from sea level to the ellipsoid, is the same.
#
# Output, of 300 m at 50 N 10 E:
#     EPSG:4979 -> EPSG:4326+5773 300.0 accuracy -1.0 ballpark True
#     EPSG:4979 -> EPSG:4326+3855 300.0 accuracy -1.0 ballpark True
#     EPSG:9518 -> EPSG:4979 300.0 accuracy -1.0 ballpark True
#     without ballpark: ProjError
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q pyproj==3.7.2
PROJ_NETWORK=OFF PROJ_DATA='' "$folder/bin/python" -W error - <<'P'
import pyproj

for one, other in (("EPSG:4979", "EPSG:4326+5773"), ("EPSG:4979", "EPSG:4326+3855"), ("EPSG:9518", "EPSG:4979")):
    transformer = pyproj.Transformer.from_crs(one, other, always_xy=True)
    height_m, is_ballpark = transformer.transform(10.0, 50.0, 300.0)[2], "ballpark" in transformer.description
    print(one, "->", other, height_m, "accuracy", transformer.accuracy, "ballpark", is_ballpark)
    assert height_m == 300.0 and transformer.accuracy == -1.0 and is_ballpark
try:
    strict = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4326+5773", always_xy=True, allow_ballpark=False)
    strict.transform(10.0, 50.0, 300.0, errcheck=True)
    raise AssertionError("converted without a grid")
except pyproj.exceptions.ProjError as error:
    print("without ballpark:", type(error).__name__)
P
