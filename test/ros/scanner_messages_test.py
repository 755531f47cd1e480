#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Drivers whose messages are not as sensor_msgs/LaserScan and REP-117 say: what they send for "nothing there", arrays
that run against time, and stamps at other beams than the first. The maps are those of the ideal messages; where a
parameter is needed, the tool names it. No roscore."""
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import small_bags as bags  # noqa: E402
from bag_tools import run_program  # noqa: E402

POSTS = [(2.0, 1.6, 0.20), (-2.2, 2.4, 0.15), (3.0, -2.0, 0.30), (-3.4, -1.6, 0.25), (0.4, -3.0, 0.18)]
RANGE_MAX_M = 8.0
BY_TF = ["--localization", "tf"]
TOOLS = {"polygons_bag": BY_TF, "splinegons_bag": BY_TF, "objects_bag": [], "map_bag": []}
# "Nothing there": inf is the ideal; those that simulators and drivers for costmaps send need no parameter.
BY_THEMSELVES = {"range_max": RANGE_MAX_M, "above": RANGE_MAX_M + 1.0, "below": RANGE_MAX_M - 1e-4,
                 "in_float32": float(np.float32(0.001) * np.float32(8000))}
BY_PARAMETER = {"zero": 0.0, "nan": math.nan}


def distance(p):
    """From what stands in the open."""
    return min(abs(math.hypot(p[0] - x, p[1] - y) - radius) for x, y, radius in POSTS)


class ScannerTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)
        cls.made = {}

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def bag(self, name, *arguments, **changes):
        if name not in self.made:
            self.made[name] = bags.write(self.path / f"{name}.bag", bags.turning(*arguments, **changes))
        return self.made[name]

    def run_tool(self, tool, bag, *options, beside="", **scan):
        """What it writes, and says on stderr. `beside`: other parameters than those of a scan, as YAML."""
        config = self.path / "config.yaml"
        scan = json.dumps({"max_range_m": 10.0, **scan})
        config.write_text(f"detections: {{detector: least_squares}}\nscan: {scan}\n{beside}\n")
        out = self.path / "out"
        done = run_program(tool, bag, "--world-frame", "odom", "--config", config, *TOOLS[tool], *options, "--out", out,
                           stderr=subprocess.PIPE)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return out.read_text(), done.stderr


class NothingThereTest(ScannerTest):
    """A robot among posts in the open."""

    def posts(self, name, value):
        nothing = value if callable(value) or value is None else lambda random, beams: value
        return self.bag(name, 6.5, posts=POSTS, range_max=RANGE_MAX_M, nothing=nothing)

    def ideal(self, tool):
        return self.run_tool(tool, self.posts("inf", None))[0]

    def test_needs_no_parameter_where_it_is_range_max(self):
        for tool in TOOLS:
            ideal = self.ideal(tool)
            self.assertGreater(len(ideal.splitlines()), 50)
            for name, value in BY_THEMSELVES.items() if tool == "polygons_bag" else [("range_max", RANGE_MAX_M)]:
                with self.subTest(tool=tool, sent=name):
                    written, said = self.run_tool(tool, self.posts(name, value))
                    self.assertEqual(written, ideal)
                    self.assertNotIn("no_return", said)

    def test_is_a_parameter_where_it_may_be_invalid(self):
        for tool in TOOLS:
            ideal = self.ideal(tool)
            for name, value in BY_PARAMETER.items() if tool == "polygons_bag" else [("zero", 0.0)]:
                with self.subTest(tool=tool, sent=name):
                    bag = self.posts(name, value)
                    written, said = self.run_tool(tool, bag, no_return=name)
                    self.assertEqual(written, ideal)
                    self.assertNotIn("no_return", said)
                    _, said = self.run_tool(tool, bag)
                    self.assertIn(f"set scan/no_return to {name}", said)

    def test_is_no_surface_where_it_is_noisy(self):
        """As of gazebo-classic e0bc65c, RaySensor.cc."""
        def noise(random, beams):
            return np.minimum(RANGE_MAX_M, RANGE_MAX_M + random.normal(0, 0.01, beams))
        written, _ = self.run_tool("polygons_bag", self.posts("noisy", noise))
        points = [p for polyline in json.loads(written.splitlines()[-1])["polylines"] for p in polyline["points"]]
        self.assertGreater(len(points), 20)
        self.assertLess(max(map(distance, points)), 0.25)

    def test_may_be_inf_alone(self):
        """Then what is at range_max is a surface."""
        written, _ = self.run_tool("polygons_bag", self.posts("range_max", RANGE_MAX_M), no_return="inf")
        points = [p for polyline in json.loads(written.splitlines()[-1])["polylines"] for p in polyline["points"]]
        self.assertGreater(max(map(distance, points)), 1.0)

    def test_has_no_other_names(self):
        config = self.path / "wrong.yaml"
        config.write_text("scan: {no_return: nothing}\n")
        done = run_program("polygons_bag", self.posts("inf", None), "--localization", "tf", "--config", config, "--out",
                           self.path / "out")
        self.assertEqual(done.returncode, 1)
        self.assertIn("scan.no_return = nothing is unknown, known are: inf, nan, range_max, zero", done.stdout)


class TimesOfBeamsTest(ScannerTest):
    """A robot that turns to both sides for 15 s in a room."""

    def room(self, order, stamp_part, **changes):
        name = f"{order}_{stamp_part}_{changes}"
        return self.bag(name, 15.0, bags.ROOM, POSTS, order=order, stamp_part=stamp_part, **changes)

    def error(self, written):
        """RMS distance of the map's points from posts and walls."""
        e = []
        for polyline in json.loads(written.splitlines()[-1])["polylines"]:
            for p in polyline["points"]:
                walls = []
                for a, b in zip(bags.ROOM, bags.ROOM[1:] + bags.ROOM[:1]):
                    along = np.subtract(b, a)
                    part = np.clip(np.subtract(p, a) @ along / (along @ along), 0, 1)
                    walls.append(np.linalg.norm(np.subtract(p, a) - part * along))
                e.append(min(distance(p), *walls))
        return math.sqrt(np.mean(np.square(e)))

    def test_are_found_and_set(self):
        written, said = self.run_tool("polygons_bag", self.room(1, 0.0))
        self.assertNotIn("warning", said)
        ideal = self.error(written)
        for order, stamp_part, scan in [(-1, 0.0, {"beam_order": "backward"}), (1, 1.0, {"stamp_at": "last"}),
                                        (1, 0.5, {"stamp_at": "middle"}),
                                        (-1, 1.0, {"beam_order": "backward", "stamp_at": "last"})]:
            with self.subTest(**scan):
                bag = self.room(order, stamp_part)
                written, said = self.run_tool("polygons_bag", bag)
                self.assertGreater(self.error(written), 1.5 * ideal)
                for name in ("beam_order", "stamp_at"):
                    self.assertEqual(f"set scan/{name} to {scan.get(name)}" in said, name in scan, said)
                    self.assertEqual(f"scan/{name}" in said, name in scan, said)
                written, said = self.run_tool("polygons_bag", bag, **scan)
                self.assertNotIn("warning", said)
                self.assertLess(self.error(written), 1.2 * ideal)

    def test_are_found_by_each_tool(self):
        bag = self.room(-1, 1.0)
        for tool in TOOLS:
            with self.subTest(tool=tool):
                _, said = self.run_tool(tool, bag)
                self.assertIn("set scan/beam_order to backward", said)
                self.assertIn("set scan/stamp_at to last", said)

    def test_are_asked_for_as_they_are(self):
        """A parameter that does not hold is found as well."""
        _, said = self.run_tool("polygons_bag", self.room(1, 0.0), beam_order="backward", stamp_at="last")
        self.assertIn("set scan/beam_order to forward", said)
        self.assertIn("set scan/stamp_at to first", said)

    def test_pose_offset_is_found_in_15_s(self):
        for late_s in (0.0, 0.03, 0.2):
            with self.subTest(late_s=late_s):
                bag = self.room(1, 0.0, late_s=late_s)
                out = self.path / "out"
                config = self.path / "config.yaml"
                config.write_text("detections: {detector: least_squares}\n")
                done = run_program("objects_bag", bag, "--world-frame", "odom", "--config", config, "--out", out)
                line = [line for line in done.stdout.splitlines() if line.startswith("scan_pose_offset_s: ")][-1]
                self.assertAlmostEqual(float(line.split()[1]), late_s, delta=0.015, msg=line)

    def test_pose_offset_is_used_by_each_tool(self):
        """Poses are 0.2 s late: those of the lines are then as where they are in time."""
        in_time, late = self.room(1, 0.0), self.room(1, 0.0, late_s=0.2)
        for tool in TOOLS:
            with self.subTest(tool=tool):
                _, said = self.run_tool(tool, late)
                self.assertIn("scans and poses are out of step: scan_pose_offset_s should be", said)
                written, said = self.run_tool(tool, late, beside="scan_pose_offset_s: 0.2")
                self.assertNotIn("warning", said)
                ideal, _ = self.run_tool(tool, in_time)
                expected = {line["stamp"]: line.get("pose") for line in map(json.loads, ideal.splitlines())}
                lines = list(map(json.loads, written.splitlines()))
                self.assertGreater(len(lines), 0.9 * len(expected))
                for line in lines if tool != "objects_bag" else []:
                    for coordinate in ("x", "y", "yaw"):
                        self.assertAlmostEqual(line["pose"][coordinate], expected[line["stamp"]][coordinate], delta=2e-3)


if __name__ == "__main__":
    unittest.main()
