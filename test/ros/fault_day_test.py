#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Each kind of fault of a day twice, and each end of a process once: every fault has its expected outcome, the map is
back within 2 s, and every scan is accounted for. scripts/evaluate reliability runs the whole day."""
import json
import pathlib
import subprocess
import tempfile
import unittest

import rostest


class FaultDayTest(unittest.TestCase):
    def test_each_fault(self):
        with tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder) / "day.jsonl"
            code = subprocess.run(["rosrun", "situation_awareness", "fault_day", "--out", str(out), "--rounds", "2",
                                   "--fault-every-s", "6", "--under-way", "1"], timeout=220, check=False).returncode
            result = json.loads(out.read_text().splitlines()[-1])
        self.assertEqual(result["accounts"], [])
        for fault in (fault for fault in result["faults"] if fault["in_day"]):
            with self.subTest(fault["name"]):
                self.assertEqual(fault["count"], 1 if fault["death"] else 2)
                self.assertEqual(fault["failures"], [])
                self.assertLessEqual(max(fault["back_s"]), 2.0)
        self.assertEqual(code, 0)


if __name__ == "__main__":
    rostest.rosrun("situation_awareness", "fault_day_test", FaultDayTest)
