#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: two tracks that exchange their ids are two switches for motmetrics, and cost accuracy.
#
# Seen with motmetrics 1.4.0: a pair of object and track stays a pair as long as their distance is a number, however far
# they are apart and whatever else is nearer. Of plain distances, as its `norm2squared_matrix` gives them by default, an
# exchange over 10 m is no switch, and MOTA and IDF1 are 1. Only MOTP, a mean distance (smaller is better), shows it.
# Remedy: NaN beyond the greatest distance of a match (`max_d2`, in m^2).
#
# Output, of two objects 10 m apart whose ids are exchanged after half of the time:
#     without a limit: switches 0 MOTA 1.00 IDF1 1.00 MOTP 50.0
#     max_d2 1: switches 2 MOTA 0.90 IDF1 0.50 MOTP 0.0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q motmetrics==1.4.0 numpy==1.26.4 pandas==2.3.3 scipy==1.16.3
"$folder/bin/python" - <<'P'
import motmetrics
import numpy as np

places_m = np.array([[0.0, 0.0], [10.0, 0.0]])
for name, limit, expected in (("without a limit", {}, (0, 1.0, 1.0, 50.0)),
                              ("max_d2 1", {"max_d2": 1.0}, (2, 0.9, 0.5, 0.0))):
    record = motmetrics.MOTAccumulator(auto_id=True)
    for time in range(10):
        tracks_m = places_m if time < 5 else places_m[::-1]
        record.update([1, 2], [1, 2], motmetrics.distances.norm2squared_matrix(places_m, tracks_m, **limit))
    measures = ["num_switches", "mota", "idf1", "motp"]
    seen = motmetrics.metrics.create().compute(record, metrics=measures).iloc[0].to_numpy(float)
    print(name + ": switches {:.0f} MOTA {:.2f} IDF1 {:.2f} MOTP {:.1f}".format(*seen))
    assert np.allclose(seen, expected), seen
P
