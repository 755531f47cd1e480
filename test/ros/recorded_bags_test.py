#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""objects_bag on recordings of real scanners, where they are at hand: ../shared/data, else skipped (exit code 77)."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"
CONFIG = pathlib.Path(__file__).resolve().parent / "objects_without_model.yaml"


class RecordedBagsTest(unittest.TestCase):
    def objects_bag(self, bag, topic):
        with tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder) / "out.jsonl"
            result = subprocess.run(["rosrun", "situation_awareness", "objects_bag", str(DATA / bag), "--scan-topic", topic,
                                     "--static-sensor", "--config", str(CONFIG), "--out", str(out)],
                                    capture_output=True, text=True, timeout=120, check=False)
            self.assertEqual(result.returncode, 0, result.stderr)
            return [json.loads(line) for line in out.read_text().splitlines()]

    def test_walking_person(self):
        lines = self.objects_bag("leg_tracker_walking_person.bag", "/scan")
        self.assertEqual(len(lines), 1265)
        mapped = sum(bool(line["objects"]) for line in lines)
        self.assertGreater(mapped, 1200)

    def test_two_scanners(self):
        for topic, scans in (("/front_scan", 331), ("/rear_scan", 330)):
            lines = self.objects_bag("obstacle_detector_two_scanners.bag", topic)
            self.assertEqual(len(lines), scans)


if __name__ == "__main__":
    if not DATA.is_dir():
        print(f"skipped: {DATA} is not there")
        sys.exit(77)
    unittest.main()
