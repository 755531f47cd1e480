#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""splinegons_bag end to end, on a simulated flight around an ellipse: no roscore."""
import json
import math
import pathlib
import sys
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from bag_tools import BagToolTest, ROOT, run_program  # noqa: E402
import splinegons  # noqa: E402


class SplinegonsBagTest(BagToolTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.bag, cls.tf_bag = cls.round(2)
        cls.truth = json.loads(cls.bag.with_suffix(".truth.json").read_text())

    def lines_of(self, *args, says=""):
        out = self.path / "out.jsonl"
        done = run_program("splinegons_bag", *args, "--lidar-frame", "laser", "--base-frame", "base_link", "--out", out)
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertIn(says, done.stdout)
        return [json.loads(line) for line in out.read_text().splitlines()]

    def check_lines(self, lines):
        """Format of each line; position errors (m) and NEES of x, y against the truth."""
        scans = self.truth["scans"]
        places = {round(stamp, 3): (x, y) for stamp, x, y in zip(scans["stamp"], scans["x"], scans["y"])}
        before_s, errors_m = -math.inf, []
        for line in lines:
            self.assertEqual(list(line), ["stamp", "pose", "boundaries"])
            self.assertGreater(line["stamp"], before_s)
            before_s = line["stamp"]
            self.assertEqual(list(line["pose"]), ["x", "y", "z", "roll", "pitch", "yaw", "covariance"])
            covariance = np.array(line["pose"]["covariance"]).reshape(6, 6)
            self.assertTrue(np.allclose(covariance, covariance.T))
            self.assertGreater(np.linalg.eigvalsh(covariance)[0], 0.0)
            for boundary in line["boundaries"]:
                self.assertEqual(list(boundary), ["id", "closed", "vertices", "sigma_m"])
                self.assertEqual(len(boundary["vertices"]), len(boundary["sigma_m"]))
                self.assertGreater(min(boundary["sigma_m"]), 0.0)
            x, y = places[round(line["stamp"], 3)]
            errors_m.append(math.hypot(line["pose"]["x"] - x, line["pose"]["y"] - y))
        return errors_m

    def test_poses_of_tf(self):
        lines = self.lines_of(self.tf_bag, "--localization", "tf", "--world-frame", "world")
        self.assertEqual(len(lines), len(self.truth["scans"]["stamp"]))
        self.assertLess(max(self.check_lines(lines)), 0.005)
        [boundary] = splinegons.boundaries_of(lines[-1])
        self.assertTrue(boundary.closed)
        area_m2 = splinegons.area_m2(boundary)
        self.assertAlmostEqual(area_m2 / (math.pi * 60.0), 1.0, delta=0.003)

    def test_poses_by_gps_and_ins(self):
        origin = ",".join(map(str, self.truth["origin"]))
        config = self.path / "offset.yaml"  # of scans from poses by TF, which there are none of
        config.write_text((ROOT / "cfg" / "splinegons.yaml").read_text() + "scan_pose_offset_s: 0.3\n")
        lines = self.lines_of(self.bag, "--origin", origin, "--config", config, says="scan_pose_offset_s is not used")
        self.assertGreater(len(lines), 0.3 * len(self.truth["scans"]["stamp"]))  # after it has begun to turn
        self.assertLess(max(self.check_lines(lines)), 8.0)
        self.assertGreater(len(lines[-1]["boundaries"]), 0)

    def test_an_origin_that_cannot_be_read(self):
        done = run_program("splinegons_bag", self.bag, "--origin", "47.3,8.5", "--out", "/dev/null")
        self.assertEqual(done.returncode, 2)
        self.assertIn("47.3,8.5", done.stdout)

    def test_says_in_a_sentence_what_is_missing(self):
        for args, fact in ((["--imu-topic", "/none"], "/none"), (["--fix-topic", "/none"], "/none"),
                           (["--scan-topic", "/none"], "/none")):
            done = run_program("splinegons_bag", self.bag, *args, "--out", self.path / "out.jsonl")
            self.assertEqual(done.returncode, 1, done.stdout)
            self.assertIn(fact, done.stdout)


if __name__ == "__main__":
    unittest.main()
