#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""record_reflectors end to end, on simulated drives through the corridor and the hall: no roscore."""
import json
import math
import pathlib
import sys
import unittest

import yaml

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from bag_tools import BagToolTest, run_program  # noqa: E402


def centres(path):
    return [(one["x"], one["y"]) for one in yaml.safe_load(path.read_text())["reflectors"]]


class RecordReflectorsTest(BagToolTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.worlds = {}
        for world, radius in (("corridor", 0.05), ("hall", 0.06)):
            bag, _ = cls.drive(world, transits=2)
            cls.worlds[world] = (bag, radius, json.loads(bag.with_suffix(".truth.json").read_text()))

    def test_distances_are_those_of_the_truth(self):
        for world, (bag, radius, truth) in self.worlds.items():
            out = self.path / f"{world}.yaml"
            first = [truth["scans"][key][0] for key in ("x", "y", "yaw")]
            done = run_program("record_reflectors", bag, "--radius", radius, "--out", out,
                       f"--initial-pose={first[0]},{first[1]},{first[2]}")
            self.assertEqual(done.returncode, 0, done.stdout)
            found, known = centres(out), centres(bag.with_suffix(".reflectors.yaml"))
            self.assertEqual(len(found), len(known), done.stdout)
            same = [min(known, key=lambda place: math.dist(place, centre)) for centre in found]
            self.assertEqual(len(set(same)), len(known), done.stdout)
            for a, place in enumerate(found):
                # Of the first pose the yaw is exact, and seen from there to some mrad.
                self.assertLess(math.dist(place, same[a]), 0.05)
                for b in range(a):
                    error = math.dist(place, found[b]) - math.dist(same[a], same[b])
                    self.assertLess(abs(error), 0.01, f"{world}: of {same[a]} from {same[b]}")
            if world == "corridor":
                continue
            self.assertIn("not always bright", done.stdout, "the glossy pillar")

    def test_what_was_recorded_localises(self):
        bag, radius, truth = self.worlds["corridor"]
        out = self.path / "origin.yaml"
        done = run_program("record_reflectors", bag, "--radius", radius, "--out", out)
        self.assertEqual(done.returncode, 0, done.stdout)
        lines = self.path / "out.jsonl"
        done = run_program("polygons_bag", bag, "--reflectors", out, "--out", lines)
        self.assertEqual(done.returncode, 0, done.stdout)
        first, *_, last = [json.loads(line)["pose"] for line in lines.read_text().splitlines()]
        self.assertLess(math.hypot(first["x"], first["y"]), 0.05)  # the origin is the first pose
        x, y = truth["scans"]["x"], truth["scans"]["y"]
        self.assertAlmostEqual(math.hypot(last["x"] - first["x"], last["y"] - first["y"]),
                               math.hypot(x[-1] - x[0], y[-1] - y[0]), delta=0.05)

    def test_says_in_a_sentence_why_there_is_no_file(self):
        bag, radius, _ = self.worlds["hall"]
        out = self.path / "none.yaml"
        for args, status, fact in ((["--odom-topic", "/none"], 1, "/none"), (["--radius", "7"], 2, "0.001 to 1"),
                                   (["--min-sightings", "5000"], 1, "5000 scans"),
                                   (["--max-distance-sigma", "0.001"], 1, "standard deviation of 0.00"),
                                   (["--initial-pose", "1,2"], 2, "1,2 is not X,Y,YAW")):
            done = run_program("record_reflectors", bag, "--radius", radius, *args, "--out", out)
            self.assertEqual(done.returncode, status, done.stdout)
            self.assertIn(fact, done.stdout)
            self.assertFalse(out.exists())


if __name__ == "__main__":
    unittest.main()
