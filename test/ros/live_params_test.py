#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Thresholds changed while the graph runs: they apply to the next scan, invalid ones are refused, and a restarted
nodelet keeps them."""
import math
import os
import pathlib
import signal
import sys
import time
import unittest

import rospy
import rostest
from dynamic_reconfigure.client import Client
from rosgraph_msgs.msg import Log

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Latest, Robot, comes_true, pid_of, scan_msg, wait_until  # noqa: E402
from situation_awareness.msg import DetectionArray, MappedObjectArray, SegmentArray  # noqa: E402

CIRCLE = ((3.0, 0.5, 0.25),)


class LiveParamsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.logs = Latest("/rosout", Log)
        cls.segments = Latest("segments", SegmentArray)
        cls.detections = Latest("detections", DetectionArray)
        cls.map = Latest("objects", MappedObjectArray)
        cls.robot = Robot(transforms=False)
        wait_until(lambda: cls.map.subscriber.get_num_connections() > 0, 60.0, "the mapping nodelet")
        wait_until(lambda: cls.detections.subscriber.get_num_connections() > 0, 60.0, "the detection nodelet")
        wait_until(lambda: cls.segments.subscriber.get_num_connections() > 0, 60.0, "the segmentation nodelet")
        cls.live = {stage: Client(f"{stage}/live", timeout=30) for stage in ("segmentation", "detection", "mapping")}
        time.sleep(1.0)

    def set(self, stage, **values):
        """The values in effect after requesting `values`."""
        return self.live[stage].update_configuration(values)

    def of_next_scan(self, topic, **scan):
        """The message of a topic for a scan sent now."""
        msg = scan_msg(rospy.Time.now(), circles=CIRCLE, **scan)
        self.robot.publish(msg)
        wait_until(lambda: msg.header.stamp in topic.stamps(), 5.0, "the scan to come through")
        return next(message for message in topic.messages if message.header.stamp == msg.header.stamp)

    def said(self, *facts, level=Log.INFO):
        """One line of the log at this level has them all."""
        wait_until(lambda: any(all(fact in log.msg for fact in facts) and log.level == level
                               for log in self.logs.messages), 5.0, str(facts))

    def test_1_start_values_are_those_of_the_yaml(self):
        for stage, section, name in (("segmentation", "scan", "max_range_m"), ("mapping", "objects", "max_unseen_s"),
                                     ("detection", "detections", "min_p_ellipse")):
            yaml = rospy.get_param(f"{stage}/{section}/{name}")
            self.assertEqual(rospy.get_param(f"{stage}/live/{name}"), yaml)
            self.assertEqual(self.set(stage)[name], yaml)

    def test_1_servers_describe_themselves(self):
        """As clients read it: rqt_reconfigure, dynparam."""
        rows = {row["name"]: row for row in self.live["segmentation"].get_parameter_descriptions(timeout=10)}
        self.assertEqual([rows["min_points"][key] for key in ("type", "min", "max")], ["int", 2, 1000])
        self.assertEqual([rows["max_range_m"][key] for key in ("type", "min", "max")], ["double", 0.0, 1000.0])
        self.assertEqual([rows["volume"][key] for key in ("type", "default")], ["str", "[]"])
        self.assertIn("[m]", rows["max_gap_m"]["description"])
        self.assertEqual(self.live["segmentation"].get_group_descriptions(timeout=10)["name"], "Default")
        values = self.live["segmentation"].get_configuration(timeout=10)
        self.assertEqual(set(rows), set(values) - {"groups"})
        self.assertTrue(values["groups"]["state"])

    def test_2_the_range_counts_from_the_next_scan_on(self):
        self.assertEqual(len(self.of_next_scan(self.segments).segments), 1)
        self.assertEqual(self.set("segmentation", max_range_m=2.0)["max_range_m"], 2.0)
        self.assertEqual(len(self.of_next_scan(self.segments).segments), 0)
        self.said("/segmentation", "max_range_m", "2", "9")
        self.set("segmentation", max_range_m=9.0)
        self.assertEqual(len(self.of_next_scan(self.segments).segments), 1)

    def test_3_the_volume_too(self):
        answer = self.set("segmentation", volume="[[1.0, 0, 0, 2.0]]")
        self.assertEqual(answer["volume"], "[[1, 0, 0, 2]]")
        self.assertEqual(len(self.of_next_scan(self.segments).segments), 0)
        self.set("segmentation", volume="[]")
        self.assertEqual(len(self.of_next_scan(self.segments).segments), 1)

    def test_4_what_cannot_be_is_refused(self):
        before = self.set("segmentation")
        for values, facts in (({"min_range_m": 11.0}, ("scan.min_range_m", "scan.max_range_m")),
                              ({"volume": "a room"}, ("volume", "[nx, ny, nz, offset_m]")),
                              ({"volume": "[[1, 0, 0]]"}, ("volume", "[nx, ny, nz, offset_m]")),
                              ({"volume": "[[0, 0, 0, 1]]"}, ("volume", "normal")),
                              ({"volume": "[[1, 0, 0, .nan]]"}, ("volume", "normal")),
                              ({"max_gap_m": math.nan}, ("segments.max_gap_m",))):
            self.logs.messages.clear()
            answer = self.set("segmentation", **values)
            self.assertEqual({name: answer[name] for name in before if name != "groups"},
                             {name: before[name] for name in before if name != "groups"}, values)
            self.said(*facts, level=Log.WARN)
        for name in ("min_range_m", "volume", "max_gap_m"):
            self.assertEqual(rospy.get_param(f"segmentation/live/{name}"), before[name])
        self.assertEqual(len(self.of_next_scan(self.segments).segments), 1)

    def test_5_beyond_a_bound_is_at_the_bound(self):
        self.assertEqual(self.set("segmentation", max_range_m=1e9)["max_range_m"], 1000.0)
        self.set("segmentation", max_range_m=9.0)

    def test_6_detection(self):
        self.assertEqual(len(self.of_next_scan(self.detections).detections), 1)
        self.set("detection", max_residual_m=0.001)
        noisy = [value + 0.01 * (-1) ** i for i, value in enumerate(scan_msg(rospy.Time.now()).ranges)]
        self.assertEqual(len(self.of_next_scan(self.detections, ranges=noisy).detections), 0)
        self.set("detection", max_residual_m=0.06)
        self.assertEqual(len(self.of_next_scan(self.detections, ranges=noisy).detections), 1)

    def test_7_the_map_keeps_its_elements(self):
        for _ in range(10):
            ids = [ellipse.id for ellipse in self.of_next_scan(self.map).objects]
        self.assertEqual(len(ids), 1)
        hidden = [float("nan")] * len(scan_msg(rospy.Time.now()).ranges)
        until = rospy.Time.now() + rospy.Duration(0.6)  # then it is lost
        while rospy.Time.now() < until:
            self.of_next_scan(self.map, ranges=hidden)
        self.set("mapping", max_position_sigma_m=0.001)
        self.assertEqual(self.of_next_scan(self.map, ranges=hidden).objects, [], "remembered, not shown")
        self.set("mapping", max_position_sigma_m=0.24)
        self.assertEqual([ellipse.id for ellipse in self.of_next_scan(self.map).objects], ids)

    def test_8_a_respawn_keeps_live_values(self):
        self.set("segmentation", max_range_m=2.5)
        self.set("mapping", max_unseen_s=7.0)
        os.kill(pid_of("/map_manager"), signal.SIGKILL)

        def back():
            msg = scan_msg(rospy.Time.now(), circles=CIRCLE)
            self.robot.publish(msg)
            return comes_true(lambda: msg.header.stamp in self.map.stamps(), 0.5)
        wait_until(back, 60.0, "the graph to come back")
        self.assertEqual(len(self.of_next_scan(self.segments).segments), 0, "the object is beyond 2.5 m")
        wait_until(lambda: rospy.get_param("segmentation/live/max_range_m") == 2.5, 5.0, "the live value")
        self.assertEqual(Client("mapping/live", timeout=30).get_configuration(timeout=10)["max_unseen_s"], 7.0)
        client = Client("segmentation/live", timeout=30)
        client.update_configuration({"max_range_m": 9.0})
        self.assertEqual(len(self.of_next_scan(self.segments).segments), 1)


if __name__ == "__main__":
    rospy.init_node("live_params_test")
    rostest.rosrun("situation_awareness", "live_params_test", LiveParamsTest)
