#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""launch/fleet.launch: two robots under one master, each with a map and frames of its own."""
import os
import pathlib
import signal
import subprocess
import sys
import time
import unittest

import rosgraph
import rospy
import rostest
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from restart_test import pid_of  # noqa: E402
from ros_support import Latest, wait_until  # noqa: E402
from situation_awareness.msg import MappedObjectArray  # noqa: E402

ROBOTS = ("alpha", "bravo")
SHARED = {"/tf", "/tf_static", "/rosout", "/diagnostics"}


class FleetTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.maps = {robot: Latest(f"/{robot}/objects", MappedObjectArray) for robot in ROBOTS}
        cls.parents = {}
        cls.tf = [rospy.Subscriber(topic, TFMessage, cls.on_tf, queue_size=100) for topic in ("/tf", "/tf_static")]

    @classmethod
    def on_tf(cls, message):
        for transform in message.transforms:
            cls.parents.setdefault(transform.child_frame_id, set()).add(transform.header.frame_id)

    def test_1_each_robot_has_a_map(self):
        for robot, maps in self.maps.items():
            wait_until(lambda maps=maps: len(maps.messages) > 40, 90.0, f"40 maps of {robot}")
            newest = maps.messages[-1]
            self.assertGreaterEqual(len(newest.objects), 3)
            self.assertEqual(newest.header.frame_id, f"{robot}/world")
            self.assertLess(abs(newest.header.stamp.to_sec() - time.time()), 30.0, "stamps of the wall clock")

    def test_2_no_topic_is_another_robots(self):
        seen = {}
        for part in rosgraph.Master("fleet_test").getSystemState():
            for name, nodes in part:
                for node in nodes:
                    seen.setdefault(node, set()).add(name)
        for robot in ROBOTS:
            nodes = [node for node in seen if node.startswith(f"/{robot}/")]
            self.assertIn(f"/{robot}/map_manager", nodes)
            for node in nodes:
                foreign = [name for name in seen[node] - SHARED if not name.startswith(f"/{robot}/")]
                self.assertEqual(foreign, [], f"of {node}")

    def test_3_diagnostics_name_the_robot(self):
        names = set()

        def on_diagnostics(message):
            names.update(status.name for status in message.status)
        subscriber = rospy.Subscriber("/diagnostics", DiagnosticArray, on_diagnostics, queue_size=100)
        stages = [f"{robot}/{stage}" for robot in ROBOTS for stage in ("segmentation", "detection", "mapping")]
        wait_until(lambda: all(any(stage in name for name in names) for stage in stages), 10.0,
                   f"all of {stages}")
        subscriber.unregister()

    def test_4_frames_have_the_robots_name(self):
        wanted = {}
        for robot in ROBOTS:
            wanted.update({f"{robot}/lidar": {f"{robot}/robot"}, f"{robot}/robot": {f"{robot}/world"},
                           f"{robot}/world": {"world"}})
            scan = rospy.wait_for_message(f"/{robot}/scan", LaserScan, timeout=10.0)
            self.assertEqual(scan.header.frame_id, f"{robot}/lidar")
        wait_until(lambda: len(self.parents) >= len(wanted), 10.0, "all frames")
        self.assertEqual(self.parents, wanted)

    def test_5_a_robot_without_its_manager_leaves_the_other_alone(self):
        alpha, bravo = self.maps["alpha"], self.maps["bravo"]
        before = len(bravo.messages)
        pid = pid_of("/alpha/map_manager")
        os.kill(pid, signal.SIGKILL)
        killed = time.time()
        wait_until(lambda: alpha.messages[-1].header.stamp.to_sec() > killed + 1.0
                   and len(bravo.messages) > before + 20, 60.0, "alpha's map to come back, and 20 of bravo's")
        self.assertNotEqual(pid_of("/alpha/map_manager"), pid)
        stamps = [stamp.to_sec() for stamp in bravo.stamps()[before:]]
        self.assertLess(max(later - earlier for earlier, later in zip(stamps, stamps[1:])), 1.0, "bravo's map stopped")

    def rviz_topics(self, *arguments):
        """The initially enabled displays of rviz, by group."""
        config = pathlib.Path(__file__).resolve().parents[2] / "cfg/rviz/map.rviz"
        shown = yaml.safe_load(subprocess.run(
            ["rosrun", "situation_awareness", "fleet_rviz", "--print", "--config", config, *arguments],
            capture_output=True, text=True, timeout=30, check=True).stdout)
        groups = [display for display in shown["Visualization Manager"]["Displays"] if display["Class"] == "rviz/Group"]
        return {group["Name"]: [value for member in group["Displays"] if member["Enabled"]
                                for key, value in member.items() if key.endswith("Topic")] for group in groups}

    def test_6_rviz_shows_the_topics_of_each(self):
        topics = self.rviz_topics(*ROBOTS)
        self.assertEqual(set(topics), set(ROBOTS))
        for robot in ROBOTS:
            self.assertLessEqual({f"/{robot}/scan", f"/{robot}/semantic_map/updates"}, set(topics[robot]))
            self.assertTrue(all(topic.startswith(f"/{robot}/") for topic in topics[robot]), topics)
        on_ground = {topic for part in self.rviz_topics("--ground", *ROBOTS).values() for topic in part}
        self.assertLessEqual({"/alpha/ground/semantic_map/updates", "/bravo/ground/semantic_map/updates"}, on_ground)
        self.assertTrue(all("/ground/" in topic for topic in on_ground), on_ground)
        self.assertIn("ground/semantic_map/updates", self.rviz_topics("--ground", "none")["none"])


if __name__ == "__main__":
    rospy.init_node("fleet_test")
    rostest.rosrun("situation_awareness", "fleet_test", FleetTest)
