#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: of a sentence without a fix, whose fields are empty, pynmea2 gives no latitude and longitude: None or NaN.
#
# Seen with pynmea2 1.19.0: both are 0.0, a place in the Gulf of Guinea, while altitude is None. A filter that takes
# what is finite begins there. GGA, RMC and GLL do the same. Remedy: look at `is_valid`, or at the text in `lat`.
#
# Output:
#     GGA 0.0 0.0 altitude None valid False
#     RMC 0.0 0.0 altitude None valid False
#     GLL 0.0 0.0 altitude None valid False
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q pynmea2==1.19.0
"$folder/bin/python" - <<'P'
import functools

import pynmea2

for text in ("GPGGA,123519.00,,,,,0,00,99.99,,,,,,", "GPRMC,123519.00,V,,,,,,,230394,,,N", "GPGLL,,,,,123519.00,V,N"):
    sentence = pynmea2.parse(f"${text}*{functools.reduce(lambda a, b: a ^ b, text.encode()):02X}")
    altitude = getattr(sentence, "altitude", None)
    print(text[2:5], sentence.latitude, sentence.longitude, "altitude", altitude, "valid", sentence.is_valid)
    assert (sentence.latitude, sentence.longitude, altitude, sentence.is_valid) == (0.0, 0.0, None, False)
P
