#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: rasterio reads heights in the unit of the file; a copy that is written with the file's `profile` has the same
# heights; and tiles are merged as heights.
#
# Seen with rasterio 1.4.4: `read` and `sample` give the stored numbers, whatever scale and offset the band has. The
# profile has neither of them, nor the unit: a copy of decimetres is a model ten times as high, for every reader.
# `merge` puts the stored numbers of tiles with different scales beside each other. Nothing is said.
# `rasterio.shutil.copy` keeps all. Remedy: apply `scales` and `offsets`, and hand them on.
#
# Output, of ground at 545 m, in decimetres with a scale of 0.1, and in metres:
#     read 5450, sampled 5450, scale 0.1
#     copied by the profile: 5450 m, shutil.copy: 545 m
#     merged: 5450 beside 545
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q rasterio==1.4.4 numpy==2.4.6
"$folder/bin/python" - "$folder" <<'P'
import sys

import numpy as np
import rasterio
import rasterio.merge
import rasterio.shutil

def write(name, stored, left, scale=None):
    path = f"{sys.argv[1]}/{name}.tif"
    with rasterio.open(path, "w", driver="GTiff", width=4, height=4, count=1, dtype="int16", crs="EPSG:32632",
                       transform=rasterio.transform.from_origin(left, 4.0, 1.0, 1.0)) as file:
        file.write(np.full((4, 4), stored, np.int16), 1)
        if scale is not None:
            file.scales, file.units = (scale,), ("metre",)
    return path

def height(path):
    with rasterio.open(path) as file:
        return round(float(file.read(1)[0, 0] * file.scales[0] + file.offsets[0]), 6)

decimetres, metres = write("decimetres", 5450, 0.0, 0.1), write("metres", 545, 4.0)
copies = [f"{sys.argv[1]}/{name}.tif" for name in ("by_profile", "by_shutil")]
rasterio.shutil.copy(decimetres, copies[1], driver="GTiff")
with rasterio.open(decimetres) as file, rasterio.open(metres) as other:
    read, sampled, scale = file.read(1)[0, 0], next(file.sample([(1.5, 1.5)]))[0], file.scales[0]
    with rasterio.open(copies[0], "w", **file.profile) as copy:
        copy.write(file.read())
    merged = rasterio.merge.merge([file, other])[0][0, 0]
print(f"read {read}, sampled {sampled}, scale {scale}")
assert (read, sampled, scale) == (5450, 5450, 0.1)
by_profile, by_shutil = (height(copy) for copy in copies)
print(f"copied by the profile: {by_profile:g} m, shutil.copy: {by_shutil:g} m")
assert (height(decimetres), by_profile, by_shutil) == (545, 5450, 545)
print(f"merged: {merged[0]} beside {merged[-1]}")
assert merged.tolist() == [5450] * 4 + [545] * 4
P
