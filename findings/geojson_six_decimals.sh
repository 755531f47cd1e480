#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: a place in degrees keeps its digits through GeoJSON and WKT, as both write numbers as text.
#
# Seen with geojson 3.3.0: whatever becomes one of its objects, made or loaded, is rounded to 6 decimals, in latitude
# by up to 5.6 cm. So a map that is only loaded and written again loses its centimetres, while those in metres stay. Of
# shapely 2.2.0 `to_wkt` does the same by default, `.wkt` and `to_geojson` do not. Nothing is said. Remedy:
# `geojson.geometry.DEFAULT_PRECISION = 12`, and `rounding_precision=-1`.
#
# Output, of 48.9876544321 N, by how much it is off in the end:
#     geojson made 0.048 m, loaded 0.048 m, with DEFAULT_PRECISION 0.000 m
#     shapely to_wkt 0.048 m, .wkt 0.000 m, to_geojson 0.000 m
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q geojson==3.3.0 shapely==2.2.0 numpy==2.4.6
"$folder/bin/python" - <<'P'
import json

import geojson
import shapely

latitude = 48.9876544321

def off_m(read):
    return abs(read - latitude) * 111.2e3

text = json.dumps({"type": "Point", "coordinates": [11.0, latitude]})
made = off_m(json.loads(geojson.dumps(geojson.Point((11.0, latitude))))["coordinates"][1])
loaded = off_m(json.loads(geojson.dumps(geojson.loads(text)))["coordinates"][1])
geojson.geometry.DEFAULT_PRECISION = 12
kept = off_m(geojson.loads(text)["coordinates"][1])
print(f"geojson made {made:.3f} m, loaded {loaded:.3f} m, with DEFAULT_PRECISION {kept:.3f} m")
point = shapely.Point(11.0, latitude)
function, member = (off_m(shapely.from_wkt(wkt).y) for wkt in (shapely.to_wkt(point), point.wkt))
as_geojson = off_m(json.loads(shapely.to_geojson(point))["coordinates"][1])
print(f"shapely to_wkt {function:.3f} m, .wkt {member:.3f} m, to_geojson {as_geojson:.3f} m")
assert all(0.045 < off < 0.05 for off in (made, loaded, function)) and max(kept, member, as_geojson) < 1e-6
P
