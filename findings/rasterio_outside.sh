#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: asked for heights of places that an elevation model does not have, rasterio raises, or answers NaN.
#
# Seen with rasterio 1.4.4: `sample` answers the file's number for no data, and 0 where the file names none, which is
# sea level: a drone that asks beside the model is told to fly at 0 m. What is inside is the pixel's number, not one
# between pixels. The upper edge is inside, the right one is not. Remedy: compare the place with `bounds` first, or ask
# for a mask (`masked=True`).
#
# Output, of a model of 5 m x 5 m with heights 101 to 125 m:
#     no number for no data: outside 0, left of a pixel's middle 113, right of it 113, right edge 0, upper edge 103
#     with -9999: outside -9999
#     masked: outside True
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q rasterio==1.4.4 numpy==2.4.6
"$folder/bin/python" - "$folder/heights.tif" <<'P'
import sys

import numpy as np
import rasterio

def heights(places, no_data=None, **how):
    profile = dict(driver="GTiff", width=5, height=5, count=1, dtype="float32", crs="EPSG:32632", nodata=no_data,
                   transform=rasterio.transform.from_origin(0.0, 5.0, 1.0, 1.0))
    with rasterio.open(sys.argv[1], "w", **profile) as file:
        file.write(np.arange(101, 126, dtype=np.float32).reshape(5, 5), 1)
    with rasterio.open(sys.argv[1]) as file:
        return [value[0] for value in file.sample(places, **how)]

outside, left, right, right_edge, upper_edge = heights([(-3, 2.5), (2.2, 2.5), (2.8, 2.5), (5, 2.5), (2.5, 5)])
print(f"no number for no data: outside {outside:g}, left of a pixel's middle {left:g}, right of it {right:g}, "
      f"right edge {right_edge:g}, upper edge {upper_edge:g}")
assert (outside, left, right, right_edge, upper_edge) == (0, 113, 113, 0, 103)
named, = heights([(-3, 2.5)], -9999.0)
print(f"with -9999: outside {named:g}")
assert named == -9999
masked, = heights([(-3, 2.5)], masked=True)
print("masked: outside", np.ma.is_masked(masked))
assert np.ma.is_masked(masked)
P
