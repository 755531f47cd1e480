#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Guess: the arcs and lines that ezdxf makes of a polyline with bulges follow one another as its vertices do, and the
# coordinates of what it makes of a block are those of the drawing.
#
# Seen with ezdxf 1.4.5: an arc of DXF always turns against the clock, so one of a bulge below 0 goes from the later
# vertex to the earlier: joining ends to begins, the outline falls apart there. Of a block that is inserted mirrored,
# the polyline has the extrusion (0, 0, -1) and its x the other sign: read without `ocs()` a wall is on the other side
# of the origin. Scaled unevenly a polyline becomes ellipses. Remedy: turn an arc where its begin is not the end before,
# and transform what has an extrusion.
#
# Output, of (0, 0), half a circle with the clock to (2, 0), and a line to (2, 2):
#     arc from 2 0 to 0 0, line from 2 0
#     mirrored at x = 10: x -10 -8 as read, 10 8 in the drawing
#     twice as wide: ELLIPSE
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install -q ezdxf==1.4.5 numpy==2.4.6
"$folder/bin/python" - <<'P'
import ezdxf

drawing = ezdxf.new()
space = drawing.modelspace()
arc, line = space.add_lwpolyline([(0, 0, -1), (2, 0, 0), (2, 2, 0)], format="xyb").virtual_entities()
ends = [(round(p.x, 9), round(p.y, 9)) for p in (arc.start_point, arc.end_point)]
(x0, y0), (x1, y1), begin = *ends, line.dxf.start
print(f"arc from {x0:g} {y0:g} to {x1:g} {y1:g}, line from {begin.x:g} {begin.y:g}")
assert ends == [(2, 0), (0, 0)] and line.dxf.start.isclose((2, 0, 0))
drawing.blocks.new("block").add_lwpolyline([(0, 0, 1), (2, 0, 0)], format="xyb")
insert = space.add_blockref("block", (10, 0), dxfattribs={"xscale": -1})
mirrored, = insert.virtual_entities()
as_read = [float(x) for x, _, _ in mirrored.get_points("xyb")]
drawn = [mirrored.ocs().to_wcs((x, 0, 0)).x for x in as_read]
print("mirrored at x = 10: x", *(f"{x:g}" for x in as_read), "as read,", *(f"{x:g}" for x in drawn), "in the drawing")
assert as_read == [-10, -8] and drawn == [10, 8]
insert.dxf.xscale = 2
wide, = insert.virtual_entities()
print("twice as wide:", wide.dxftype())
assert wide.dxftype() == "ELLIPSE"
P
