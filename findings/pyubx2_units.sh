#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: pyubx2, which says that it scales what a u-blox receiver sends, gives metres, metres per second and degrees.
#
# Seen with pyubx2 1.4.0: what has a power of ten as its scale in the protocol is scaled, so latitude and heading are in
# degrees; what has a unit instead stays in it, so of the same message heights and accuracies are in mm, velocities in
# mm/s. A covariance of hAcc squared is a million times too large, and a filter that takes height as it is climbs to
# half a million metres. Relative positions (NAV-RELPOSNED) are in cm instead, with their last digit added.
#
# Output, of 545.4 m, 1.5 m, 2.5 m/s and 12.5 degrees:
#     height 545400 hAcc 1500 gSpeed 2500 headMot 12.5
#     relPosN 123.04 for 1.2304 m
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q pyubx2==1.4.0
"$folder/bin/python" - <<'P'
import struct

from pyubx2 import UBXReader

def message(kind, payload):
    """As a receiver sends it: class NAV, with its checksum."""
    body = bytes([0x01, kind]) + struct.pack("<H", len(payload)) + payload
    a = b = 0
    for byte in body:
        a = (a + byte) & 255
        b = (b + a) & 255
    return UBXReader.parse(b"\xb5\x62" + body + bytes([a, b]))

# NAV-PVT: at 24 lon, lat, height, hMSL, hAcc, vAcc; at 48 velN, velE, velD, gSpeed, headMot.
payload = bytearray(92)
struct.pack_into("<iiiiII", payload, 24, 111000000, 481234567, 545400, 500000, 1500, 2000)
struct.pack_into("<iiiii", payload, 48, 2500, 0, 0, 2500, 1250000)
pvt = message(0x07, bytes(payload))
print("height", pvt.height, "hAcc", pvt.hAcc, "gSpeed", pvt.gSpeed, "headMot", pvt.headMot)
assert abs(pvt.lat - 48.1234567) < 1e-9
assert (pvt.height, pvt.hAcc, pvt.gSpeed, pvt.headMot) == (545400, 1500, 2500, 12.5)
# NAV-RELPOSNED, version 1: at 8 north, east and down in cm, at 32 their last digits in 0.1 mm.
payload = bytearray(64)
payload[0] = 1
struct.pack_into("<iii", payload, 8, 123, 0, 0)
struct.pack_into("<bbb", payload, 32, 4, 0, 0)
relative = message(0x3C, bytes(payload))
print("relPosN", relative.relPosN, "for 1.2304 m")
assert abs(relative.relPosN - 123.04) < 1e-9
P
