#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""map_flights end to end: consistency of its lines, and refusals."""
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

TOOL = pathlib.Path(sys.argv.pop(1))
SOURCE = pathlib.Path(__file__).resolve().parent.parent.parent
TIMES = ("cpu_ms_per_scan", "latency_ms")  # all others are the same in every run


THINGS = """<mujoco><compiler angle="radian"/>
<custom><text name="crate_12" data="straight from 2 0 velocity 0.6 0"/> <text name="person_1" data="stand"/>
        <text name="person_1/leg" data="with person_1 at 0 0.2 steps 1"/></custom>
<worldbody>
  <body name="crate_12" mocap="true" pos="2 0 1" euler="0 0 0.5"><geom type="box" group="1" size="0.4 0.25 1"/></body>
  <body name="person_1" mocap="true" pos="-2 0.5 0"/>
  <body name="person_1/leg" mocap="true" pos="0 0 1"><geom type="ellipsoid" group="1" size="0.1 0.1 1"/></body>
  <body name="robot" mocap="true" pos="0 0 1"><site name="lidar" euler="0 0 0.6"/></body>
</worldbody></mujoco>"""


def run(*options, world="demo"):
    return subprocess.run(
        [TOOL, "--world", SOURCE / "models/worlds" / f"{world}.xml", "--config", SOURCE / "cfg/objects.yaml",
         "--models", SOURCE / "models", "--duration", "3", *options], capture_output=True, text=True)


def fly(*options, world="demo"):
    """The lines of a run without what depends on the machine."""
    result = run(*options, world=world)
    assert result.returncode == 0, result.stderr
    lines = [json.loads(line) for line in result.stdout.splitlines()]
    return [{key: value for key, value in line.items() if key not in TIMES} for line in lines]


class MapFlights(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def written(self, text):
        path = self.folder / "set.yaml"
        path.write_text(text)
        return path

    def test_a_seed_gives_its_own_numbers_in_any_company(self):
        noise = ["--pose-sigma-m", "0.02", "--pose-sigma-rad", "0.01"]
        both = fly("--seeds", "4-5", *noise)
        self.assertEqual([line["seed"] for line in both], [4, 5])
        self.assertEqual(fly("--seeds", "5", *noise), both[1:])
        self.assertNotEqual(both[0]["gospa_m"], both[1]["gospa_m"])

    def test_the_trace_adds_up_to_the_line(self):
        path = self.folder / "trace.jsonl"
        line, other = fly("--seeds", "1-2", "--trace", path, "--trace-points")
        trace = [json.loads(text) for text in path.read_text().splitlines()]
        self.assertEqual(line["scans"], 60)
        self.assertEqual([round(scan["t"], 9) for scan in trace], [i * 50 / 1000 for i in range(60)])
        self.assertAlmostEqual(sum(scan["gospa_m"] for scan in trace) / 60, line["gospa_m"], places=12)
        self.assertAlmostEqual(sum(scan["false"] for scan in trace) / 60, line["false_per_scan"], places=12)
        self.assertEqual(trace[-1]["id_switches"], line["id_switches"])
        visible = sum(truth["visible_scans"] for truth in line["objects"])
        self.assertAlmostEqual(1 - sum(scan["missed"] for scan in trace) / visible, line["recall"], places=12)
        for truth in line["objects"]:
            beams = [t["beams"] for scan in trace for t in scan["truth"] if t["name"] == truth["name"]]
            self.assertEqual(sum(count >= 5 for count in beams), truth["visible_scans"])
        for element in trace[-1]["map"]:
            self.assertEqual((element["shape"], element["class"]), ("ellipse", "unknown"))
            for x, y in element["outline"]:
                c, s = math.cos(element["psi"]), math.sin(element["psi"])
                dx, dy = x - element["x"], y - element["y"]
                place = math.hypot((c * dx + s * dy) / element["rx"], (c * dy - s * dx) / element["ry"])
                self.assertAlmostEqual(place, 1.0, delta=2e-3)
        hits = sum(truth["beams"] for truth in trace[0]["truth"])
        self.assertGreaterEqual(len(trace[0]["points"]), hits)

    def test_the_trace_has_the_truth_of_every_thing(self):
        path, world = self.folder / "trace.jsonl", self.folder / "things.xml"
        world.write_text(THINGS)
        fly("--trace", path, "--range-sigma-m", "0.1", world=world.with_suffix(""))
        scans = [json.loads(text) for text in path.read_text().splitlines()]
        self.assertEqual(len(scans), 60)
        hits = 0
        for scan in scans:
            self.assertEqual(scan["truth"][0]["name"], "person_1/leg")  # the only ellipse
            crate, person = scan["things"]
            self.assertEqual([crate["name"], crate["kind"], person["name"], person["kind"]],
                             ["crate_12", "crate", "person_1", "person"])
            for key, value in (("length", 0.8), ("width", 0.5), ("yaw", 0.5), ("vx", 0.6), ("vy", 0.0),
                               ("x", 2.0 + 0.6 * scan["t"])):
                self.assertAlmostEqual(crate[key], value, places=3)
            for key, value in (("x", -2.0), ("y", 0.5), ("length", 0.2), ("width", 0.2)):
                self.assertAlmostEqual(person[key], value, places=3)
            (leg,), (box,) = person["parts"], crate["parts"]
            for x, y in leg["hits"]:
                self.assertAlmostEqual(math.hypot(x + 2.0, y - 0.7), 0.1, places=3)
            self.assertEqual(len(leg["hits"]), scan["truth"][0]["beams"])
            for x, y in box["outline"] + box["hits"]:
                c, s = math.cos(0.5), math.sin(0.5)
                dx, dy = x - crate["x"], y - crate["y"]
                self.assertAlmostEqual(max(abs(c * dx + s * dy) - 0.4, abs(c * dy - s * dx) - 0.25), 0.0, places=3)
            hits += len(box["hits"])
        self.assertGreater(hits, 60 * 20)

    def test_standing_and_moving_objects_are_all_objects(self):
        (line,) = fly()
        for moves, name in ((False, "standing"), (True, "moving")):
            objects = [truth for truth in line["objects"] if truth["moves"] == moves]
            self.assertEqual(line[name]["scans"], sum(truth["mapped_scans"] for truth in objects))
        self.assertEqual({truth["name"] for truth in line["objects"] if truth["moves"]},
                         {"walker", "patrol", "cart", "visitor"})

    def test_noise_of_the_pose_and_a_sweep_reach_the_map(self):
        (exact,) = fly(world="single")
        for option, value in (("--pose-sigma-m", "0.05"), ("--pose-sigma-rad", "0.02"), ("--range-sigma-m", "0.03")):
            (disturbed,) = fly(option, value, world="single")
            self.assertGreater(disturbed["gospa_m"], exact["gospa_m"], option)
        # Beams are taken at their own time: a sweep changes the numbers, but not how good they are.
        (swept,) = fly("--sweep-s", "0.04", world="single")
        self.assertNotEqual(swept["gospa_m"], exact["gospa_m"])
        self.assertAlmostEqual(swept["gospa_m"], exact["gospa_m"], delta=0.2 * exact["gospa_m"])

    def test_a_scanner_by_preset_or_file(self):
        (line,) = fly("--scanner", "rplidar_a2", world="single")
        self.assertEqual(line["scans"], round(3 * 12.9))
        exact = self.written("range_sigma_m: 0.0")
        self.assertEqual(fly("--scanner", exact), fly("--range-sigma-m", "0"))
        self.assertEqual(fly("--scanner", exact, "--range-sigma-m", "0.01", "--sweep-s", "0.04"),
                         fly("--sweep-s", "0.04"))
        for scanner, facts in (("none", ["none.yaml"]),
                               (self.written("missing_fraction: 1.5"), ["set.yaml", "missing_fraction", "1.5"])):
            result = run("--scanner", scanner)
            self.assertEqual(result.returncode, 1)
            for fact in facts:
                self.assertIn(fact, result.stderr)

    def test_set_overrides_the_configuration(self):
        (line,) = fly("--set", self.written("scan: {max_range_m: 0.5}"))
        self.assertEqual(line["recall"], 0.0)
        self.assertEqual(fly("--set", self.written("")), fly())
        unknown = run("--set", self.written("objects: {nonsense: 1}"))
        self.assertEqual(unknown.returncode, 0)
        for fact in ("set.yaml", "objects.nonsense"):
            self.assertIn(fact, unknown.stderr)

    def test_it_refuses_what_it_cannot_use(self):
        for options, facts in ((["--hop", "1"], ["--hop"]), (["--seeds", "3-2"], ["--seeds"]),
                               (["--seeds", "x"], ["--seeds", "x"]), (["--duration", "-1"], ["--duration", "-1"]),
                               (["--duration"], ["--duration"])):
            result = run(*options)
            self.assertEqual(result.returncode, 2)
            for fact in facts:
                self.assertIn(fact, re.split(r"[\s:]+", result.stderr))
        result = run("--sweep-s", "0.05")
        self.assertEqual(result.returncode, 1)
        for fact in ("scanner.sweep_s", "scanner.rate_hz"):
            self.assertIn(fact, result.stderr)
        self.assertEqual(run(world="missing").returncode, 1)


if __name__ == "__main__":
    unittest.main()
