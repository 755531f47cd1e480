#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""/diagnostics: each key has a plausible value, every input is accounted for, every drop has its reason."""
import hashlib
import math
import pathlib
import sys
import time
import unittest

import rospkg
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticStatus

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Diagnostics, Latest, Robot, scan_msg, wait_until  # noqa: E402
from situation_awareness.msg import MappedObjectArray  # noqa: E402

STAGES = ("segmentation", "detection", "mapping")
CIRCLE = ((3.0, 0.5, 0.25),)


class DiagnosticsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.map = Latest("objects", MappedObjectArray)
        cls.diagnostics = Diagnostics()
        wait_until(lambda: set(STAGES) <= set(cls.diagnostics.stages), 60.0, "all stages to speak")
        cls.before_input = {stage: dict(cls.diagnostics.stages[stage]) for stage in STAGES}
        cls.robot = Robot()
        wait_until(lambda: cls.map.subscriber.get_num_connections() > 0, 60.0, "the mapping nodelet")
        time.sleep(1.0)
        cls.robot.run(40, circles=CIRCLE)
        time.sleep(1.2)

    def value(self, stage, key):
        self.assertIn(key, self.diagnostics.stages[stage])
        return self.diagnostics.stages[stage][key]

    def number(self, stage, key):
        return float(self.value(stage, key))

    def wait_for(self, stage, condition, what):
        wait_until(lambda: condition(self.diagnostics.stages[stage]), 6.0, what)

    def test_1_missing_input_is_reported(self):
        for stage in STAGES:
            self.assertIn("no input", self.before_input[stage]["summary"])
        self.assertIn("/scan", self.before_input["segmentation"]["summary"])
        self.wait_for("segmentation", lambda status: "no input" in status["summary"], "no input")

    def test_2_an_unknown_parameter_is_shown(self):
        for stage in STAGES:
            self.assertIn("segments.max_gap", self.value(stage, "summary"))
            self.assertEqual(self.value(stage, "level"), DiagnosticStatus.WARN)
            self.assertIn("max_gap_m", self.value(stage, "unknown parameter segments.max_gap"))

    def test_3_rates_and_times(self):
        self.robot.run(60, circles=CIRCLE)
        for stage in STAGES:
            self.assertGreater(self.number(stage, "rate [Hz]"), 2.0)
            self.assertGreater(self.number(stage, "input rate [Hz]"), 2.0)
            for key in ("latency p50 [ms]", "latency p99 [ms]", "processing p50 [ms]", "processing p99 [ms]",
                        "age p50 [ms]", "age p99 [ms]"):
                self.assertTrue(0.0 <= self.number(stage, key) < 5e3, key)
        self.assertTrue(0.0 <= self.number("segmentation", "TF age p50 [ms]") < 1e3)
        self.assertTrue(0.0 <= self.number("segmentation", "wait for TF p99 [ms]") < 500.0)

    def test_4_the_model_is_named_with_its_hash(self):
        model = pathlib.Path(self.value("detection", "model"))
        self.assertEqual(model, pathlib.Path(rospkg.RosPack().get_path("situation_awareness")) / "models/ellipse.onnx")
        self.assertEqual(self.value("detection", "model SHA-256"), hashlib.sha256(model.read_bytes()).hexdigest())
        self.assertEqual(self.value("detection", "detector"), "network")

    def test_5_the_map_in_numbers(self):
        self.robot.run(40, circles=CIRCLE)
        self.wait_for("mapping", lambda status: status["elements"] == "1" and status["on the map"] == "1", "one element")
        self.assertEqual(self.value("mapping", "moving"), "0")
        self.assertGreater(self.number("mapping", "NIS matches"), 5)
        self.assertTrue(0.0 <= self.number("mapping", "NIS mean") < 3.0)
        self.wait_for("detection", lambda status: status["compact segments on no map"] == "0"
                      and float(status["compact segment on no map for [s]"]) == 0.0, "nothing on no map")
        self.assertGreaterEqual(self.number("detection", "compact segment on no map for, since the start [s]"), 0.0)
        low, high = (float(text) for text in self.value("mapping", "NIS 95 % bounds").split(" to "))
        self.assertTrue(0.0 < low < 1.0 < high)

    def test_6_drops_have_their_reasons(self):
        self.robot.run(10, circles=CIRCLE + ((2.0, -2.0, 0.01),))
        self.wait_for("segmentation", lambda status: int(status.get("segment refused: too few points", 0)) >= 10,
                      "a refused segment")
        self.robot.run(10, circles=((3.0, 0.5, 0.5),))
        self.wait_for("mapping", lambda status: int(status.get("match rejected: outside the gate", 0)) >= 1,
                      "a rejected match")
        self.robot.run(60, circles=())
        self.wait_for("mapping", lambda status: status["elements"] == "0", "an empty map")
        self.assertGreaterEqual(self.diagnostics.count("mapping", "seen through"), 1)

    def test_7_a_missing_transform_is_named(self):
        for _ in range(60):
            self.robot.publish(scan_msg(rospy.Time.now(), circles=CIRCLE, frame="camera"))
        summaries = [status["summary"] for stage, status in self.diagnostics.history if stage == "segmentation"]
        self.assertTrue(any(all(fact in text for fact in ("no transform", "world", "camera")) for text in summaries),
                        summaries[-5:])

    def test_8_every_input_is_accounted_for(self):
        """Also with waiting messages."""
        def account(status):
            dropped = sum(int(value) for key, value in status.items()
                          if key.startswith("dropped: ") and key != "dropped: bad map")
            return int(status["processed"]) + dropped + int(status["waiting"])
        begin = len(self.diagnostics.history)
        for i in range(60):
            self.robot.publish(scan_msg(rospy.Time.now(), circles=CIRCLE), transforms=i % 3 != 0)
        time.sleep(1.5)
        for stage, status in self.diagnostics.history[begin:]:
            self.assertEqual(int(status["received"]), account(status), (stage, status))
        self.assertGreater(max(int(status["waiting"]) for stage, status in self.diagnostics.history), 0)
        self.assertTrue(all(math.isfinite(float(status["rate [Hz]"])) for _, status in self.diagnostics.history))


if __name__ == "__main__":
    rospy.init_node("diagnostics_test")
    rostest.rosrun("situation_awareness", "diagnostics_test", DiagnosticsTest)
