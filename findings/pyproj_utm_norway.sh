#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: the UTM zone that pyproj proposes for a place is the one that receivers, grids and other libraries use.
#
# Seen with pyproj 3.7.2: `query_utm_crs_info` goes by the zones' 6 degrees, so western Norway, which is in zone 32 by
# the definition of the grid, gets 31. utm 0.9.0 and mgrs 1.6.0 say 32. A map whose CRS was asked of pyproj and a fix
# that utm converted are 330 km apart in easting. At Longyearbyen all three agree. Remedy: take the zone from one
# library everywhere.
#
# Output:
#     Bergen: pyproj 31 easting 627860, utm 32 easting 297230, mgrs 32
#     Longyearbyen: pyproj 33 easting 513697, utm 33 easting 513697, mgrs 33
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q pyproj==3.7.2 utm==0.9.0 mgrs==1.6.0 numpy==2.4.6
PROJ_DATA='' "$folder/bin/python" - <<'P'
import mgrs
import pyproj
import utm
from pyproj.aoi import AreaOfInterest
from pyproj.database import query_utm_crs_info

for name, latitude, longitude, expected in (("Bergen", 60.39, 5.32, (31, 32, 32)),
                                            ("Longyearbyen", 78.2, 15.6, (33, 33, 33))):
    found, = query_utm_crs_info(datum_name="WGS 84",
                                area_of_interest=AreaOfInterest(longitude, latitude, longitude, latitude))
    zone = int(found.code) - 32600
    to_utm = pyproj.Transformer.from_crs("EPSG:4326", f"EPSG:{found.code}", always_xy=True)
    by_pyproj_m = to_utm.transform(longitude, latitude)[0]
    by_utm_m, _, utm_zone, _ = utm.from_latlon(latitude, longitude)
    mgrs_zone = int(mgrs.MGRS().toMGRS(latitude, longitude)[:2])
    print(f"{name}: pyproj {zone} easting {by_pyproj_m:.0f}, utm {utm_zone} easting {by_utm_m:.0f}, mgrs {mgrs_zone}")
    assert (zone, utm_zone, mgrs_zone) == expected
    assert (abs(by_pyproj_m - by_utm_m) < 0.1) == (zone == utm_zone)
P
