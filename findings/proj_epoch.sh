#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: pyproj knows that Europe drifts: between WGS 84 or ITRF, in which a receiver without corrections (or with PPP)
# measures, and ETRS89, in which maps and correction services are, it asks for the time, or takes that of today.
#
# Seen with pyproj 3.7.2 (PROJ 9.5.1): WGS 84 is ETRS89, whatever time is given. ITRF2014 without a time is transformed
# as if it were 2015. Only ITRF with a time as the fourth coordinate comes out right. So a fix by PPP is 0.9 m beside a
# map of ETRS89 if its CRS is written as EPSG:4326, and 0.3 m if the time is forgotten. Remedy: name the ITRF that the
# service names, and give the time of the fix.
#
# Output, of 50 N 10 E in UTM zone 32 of ETRS89; "rotation" is the plate's since 1989, by its rates in ITRF2014:
#     WGS 84 without a time: moved by 0.00 m, 2026.9: 0.00 m
#     ITRF2014 without a time: moved by 0.64 m, 2015.0: 0.64 m, 2026.9: 0.93 m
#     rotation until 2026.9: 0.95 m
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q pyproj==3.7.2 numpy==2.4.6
PROJ_NETWORK=OFF PROJ_DATA='' "$folder/bin/python" - <<'P'
import numpy as np
import pyproj

place = 10.0, 50.0, 300.0
base = np.array(pyproj.Transformer.from_crs("EPSG:4258", "EPSG:25832", always_xy=True).transform(*place[:2]))

def moved_m(crs, *time):
    there = pyproj.Transformer.from_crs(crs, "EPSG:25832", always_xy=True).transform(*place, *time)
    return float(np.linalg.norm(np.array(there[:2]) - base))

wgs84 = moved_m("EPSG:4326"), moved_m("EPSG:4326", 2026.9)
print("WGS 84 without a time: moved by {:.2f} m, 2026.9: {:.2f} m".format(*wgs84))
itrf = moved_m("EPSG:9000"), moved_m("EPSG:9000", 2015.0), moved_m("EPSG:9000", 2026.9)
print("ITRF2014 without a time: moved by {:.2f} m, 2015.0: {:.2f} m, 2026.9: {:.2f} m".format(*itrf))
mas = np.radians(1.0 / 3600e3)
per_year = np.array([0.085, 0.531, -0.770]) * mas
geocentric = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True).transform(*place)
rotation = float(np.linalg.norm(np.cross(per_year, geocentric)) * (2026.9 - 1989.0))
print(f"rotation until 2026.9: {rotation:.2f} m")
assert wgs84 == (0.0, 0.0) and abs(itrf[0] - itrf[1]) < 0.01 and abs(itrf[0] - 0.64) < 0.02
assert abs(itrf[2] - rotation) < 0.05 and itrf[2] - itrf[0] > 0.25
P
