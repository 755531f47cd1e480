#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: utm.from_latlon converts an array as it converts its numbers one by one, or refuses one that is in two zones.
#
# Seen with utm 0.9.0: all of an array is in the zone of its first place. So a track that is converted at once goes on
# beyond the border of a zone, and is right in that zone; the same track one by one, or in pieces, jumps by hundreds of
# km there, and a last fix that is converted alone is not where the track ends. Places on both sides of the equator are
# refused instead. Remedy: give `force_zone_number`, by the first fix.
#
# Output, of two places 149 m apart at 12 degrees east, where zones 32 and 33 meet:
#     at once 723701.3 723850.5 zone 32
#     one by one 723701.3 zone 32, 276298.7 zone 33
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q utm==0.9.0 numpy==2.4.6
"$folder/bin/python" - <<'P'
import numpy as np
import utm

latitudes, longitudes = np.array([48.0, 48.0]), np.array([11.999, 12.001])
east_m, _, zone, _ = utm.from_latlon(latitudes, longitudes)
print("at once", *np.round(east_m, 1), "zone", zone)
alone = [utm.from_latlon(*place)[0:3:2] for place in zip(latitudes, longitudes)]
print("one by one", ", ".join(f"{east:.1f} zone {number}" for east, number in alone))
assert zone == 32 and 100.0 < east_m[1] - east_m[0] < 200.0
assert [number for _, number in alone] == [32, 33] and alone[1][0] < alone[0][0] - 400e3
try:
    utm.from_latlon(np.array([0.001, -0.001]), longitudes[:1].repeat(2))
    raise AssertionError("taken on both sides of the equator")
except ValueError as error:
    print("beside the equator:", error)
P
