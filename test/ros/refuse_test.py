#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A nodelet with invalid parameters refuses to start with one message, and its manager keeps running."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

import rosnode
import rospy
import rostest
from rosgraph_msgs.msg import Log

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Diagnostics, wait_until  # noqa: E402

LEAST_SQUARES = {"detections": {"detector": "least_squares", "boxes": False}}  # needs no model


class RefuseTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.logs = []
        cls.subscriber = rospy.Subscriber("/rosout", Log, cls.logs.append, queue_size=1000)
        cls.diagnostics = Diagnostics()
        cls.loads = 0

    def load(self, nodelet, params):
        """Start the loader as a launch file does; it stays as long as its nodelet lives."""
        RefuseTest.loads += 1
        name = f"{nodelet}_{self.loads}"
        rospy.set_param(name, params)
        return name, subprocess.Popen(["rosrun", "nodelet", "nodelet", "load", f"situation_awareness/{nodelet}",
                                       "manager", f"__name:={name}"])

    def assert_refused(self, nodelet, params, *parts):
        name, loader = self.load(nodelet, params)
        self.assertNotEqual(loader.wait(timeout=30), 0)

        def sentences():
            return [log.msg for log in self.logs if log.level == Log.FATAL and f"/{name} " in log.msg]
        wait_until(sentences, 5.0, "the sentence")
        for part in parts:
            self.assertIn(part, sentences()[0])
        self.assertEqual(len(sentences()), 1)
        self.assertEqual(sentences()[0].strip().count("\n"), 0, sentences()[0])
        self.assertTrue(rosnode.rosnode_ping("/manager", max_count=1), "the manager lives")

    def assert_starts(self, nodelet, params, *warnings):
        """It does, and says each of `warnings` once in the log and always on /diagnostics."""
        name, loader = self.load(nodelet, params)
        try:
            wait_until(lambda: f"/{name}" in rosnode.get_node_names(), 20.0, f"{name} to start")
            with self.assertRaises(subprocess.TimeoutExpired):
                loader.wait(timeout=2)
            for warning in warnings:
                wait_until(lambda: [log for log in self.logs if log.level == Log.WARN and f"/{name}: " in log.msg
                                    and warning in log.msg], 5.0, warning)
                wait_until(lambda: warning in self.diagnostics.stages.get(name, {}).get("summary", ""), 5.0, warning)
        finally:
            loader.terminate()
            loader.wait(timeout=20)

    def test_missing_model(self):
        self.assert_refused("detection", {"detections": {"model": "/no/such/model.onnx"}}, "/no/such/model.onnx")
        self.assert_refused("detection", {"model_folder": "/no/such", "detections": {"model": "net.onnx"}},
                            "/no/such/net.onnx")

    def test_unknown_detector(self):
        self.assert_refused("detection", {"detections": {"detector": "magic"}}, "detections.detector", "magic",
                            "least_squares", "network")

    def test_a_key_that_the_file_has_twice(self):
        twice = "scan:\n  max_range_m: 5.0\n  max_range_m: 6.0\n"
        self.assert_refused("segmentation", {"config_yaml": twice, "scan": {"max_range_m": 6.0}},
                            "scan.max_range_m is given twice")

    def test_damaged_model(self):
        with tempfile.TemporaryDirectory() as folder:
            model = pathlib.Path(folder) / "damaged.onnx"
            model.write_bytes(b"\x08\x07garbage" * 100)
            self.assert_refused("detection", {"detections": {"model": str(model)}}, str(folder))

    def test_an_unknown_parameter_is_warned_of(self):
        for nodelet in ("segmentation", "detection", "mapping"):
            self.assert_starts(nodelet, {**LEAST_SQUARES, "segments": {"max_gapp_m": 0.1}, "tf_timeouts": 0.1},
                               "segments.max_gapp_m", "tf_timeouts")

    def test_out_of_range(self):
        self.assert_refused("segmentation", {**LEAST_SQUARES, "scan": {"max_range_m": -1.0}},
                            "scan", "max_range_m", "-1", "1000")
        self.assert_refused("segmentation", {**LEAST_SQUARES, "tf_timeout_s": 1000}, "tf_timeout_s", "60")
        self.assert_refused("segmentation", {**LEAST_SQUARES, "queue_size": 0}, "queue_size", "1")
        self.assert_refused("mapping", {**LEAST_SQUARES, "objects": {"gate_probability": 7}}, "gate_probability", "0.5")

    def test_wrong_type(self):
        self.assert_refused("mapping", {**LEAST_SQUARES, "objects": {"max_unseen_s": "many"}}, "max_unseen_s")
        self.assert_refused("mapping", {"objects": 3}, "objects")
        self.assert_refused("segmentation", {"world_frame": 3}, "world_frame")

    def test_the_same_manager_still_takes_good_ones(self):
        self.assert_refused("mapping", {"objects": {"max_unseen_s": -1}}, "max_unseen_s")
        for nodelet in ("segmentation", "detection", "mapping"):
            self.assert_starts(nodelet, LEAST_SQUARES)


if __name__ == "__main__":
    rospy.init_node("refuse_test")
    rostest.rosrun("situation_awareness", "refuse_test", RefuseTest)
