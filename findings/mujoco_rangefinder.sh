#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: a rangefinder of MuJoCo sees what a robot can hit: where a floor carries it there is a floor to see, colour
# does not matter, and a mesh is for the sensor what it is for contacts. `cutoff` makes farther hits no hits.
#
# Seen with mujoco 2.3.7 and 4.0.0, the same in both:
# - a plane carries without end, but is seen within its `size` alone, which is meant for drawing;
# - a geom with alpha 0 is not seen; one with alpha 0.01 is;
# - a geom without contacts (contype = conaffinity = 0) is seen;
# - a concave mesh is seen as it is, but hit as its convex hull: a robot collides with a notch that the sensor sees
#   free;
# - a hit beyond `cutoff` reads as a hit at `cutoff`, no hit as -1.
#
# Output of each version:
#     floor of 5 m at 20 m: seen at -1.00, carries True
#     box of alpha 0: seen at -1.00; of alpha 0.01: 2.50; without contacts: 2.50
#     notch: free for 0.80 m, contacts 1
#     cutoff 2, hit at 2.5: 2.00; without hit: -1.00
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/see.py" <<'P'
import mujoco

def sees(things, position="0 0 0", along="1 0 0", sensor="", joint="", steps=0):
    """Range of a sensor, contacts at the begin, and height after some steps."""
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>{things}<worldbody><body pos="{position}">{joint}
        <geom size=".05" mass="1"/><site name="s" zaxis="{along}"/></body></worldbody>
        <sensor><rangefinder site="s" {sensor}/></sensor></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    result = data.sensordata[0], data.ncon
    for _ in range(steps):
        mujoco.mj_step(model, data)
    return (*result, data.xpos[-1, 2])

def box(attributes):
    return f'<worldbody><geom type="box" pos="3 0 0" size=".5 1 1" {attributes}/></worldbody>'

floor = '<worldbody><geom type="plane" size="5 5 .1"/></worldbody>'
seen, _, height = sees(floor, "20 0 1", "0 0 -1", joint="<freejoint/>", steps=3000)
print(f"floor of 5 m at 20 m: seen at {seen:.2f}, carries {height > 0.0}")
assert seen == -1.0 and height > 0.0
clear, faint, free = (sees(box(a))[0] for a in ('rgba="1 1 1 0"', 'rgba="1 1 1 .01"', 'contype="0" conaffinity="0"'))
print(f"box of alpha 0: seen at {clear:.2f}; of alpha 0.01: {faint:.2f}; without contacts: {free:.2f}")
assert (clear, faint, free) == (-1.0, 2.5, 2.5)
corners = [(0, 0), (2, 0), (2, 0.2), (0.2, 0.2), (0.2, 2), (0, 2)]
vertices = " ".join(f"{x} {y} {z}" for z in (0, 1) for x, y in corners)
faces = "0 2 1 0 3 2 0 4 3 0 5 4 6 7 8 6 8 9 6 9 10 6 10 11 " + " ".join(
    f"{i} {(i + 1) % 6} {(i + 1) % 6 + 6} {i} {(i + 1) % 6 + 6} {i + 6}" for i in range(6))
angle = (f'<asset><mesh name="m" vertex="{vertices}" face="{faces}"/></asset>'
         '<worldbody><geom type="mesh" mesh="m"/></worldbody>')
seen, contacts, _ = sees(angle, "1 1 .5", "0 -1 0", joint="<freejoint/>")
print(f"notch: free for {seen:.2f} m, contacts {contacts}")
assert abs(seen - 0.8) < 1e-6 and contacts > 0
beyond, none = sees(box(""), sensor='cutoff="2"')[0], sees("", sensor='cutoff="2"')[0]
print(f"cutoff 2, hit at 2.5: {beyond:.2f}; without hit: {none:.2f}")
assert (beyond, none) == (2.0, -1.0)
P
for version in 2.3.7 4.0.0; do
  python3 -m venv --clear "$folder/$version"
  "$folder/$version/bin/pip" install -q "mujoco==$version"
  echo "mujoco $version"
  "$folder/$version/bin/python" "$folder/see.py"
done
