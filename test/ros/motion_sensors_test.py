#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The simulator publishes IMU, GNSS and wheel odometry that the world's file asks for: what simulate_bag records at the
same seed, stamp by stamp (motion_sensors_test.cpp compares that with the core's samples), and their frames."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

import rosbag
import rospy
import rostest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, LaserScan, NavSatFix
from tf2_msgs.msg import TFMessage

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Latest, wait_until  # noqa: E402

WORLD = pathlib.Path(__file__).resolve().parent / "motion.xml"
TOPICS = {"/imu": Imu, "/second_imu/imu": Imu, "/fix": NavSatFix, "/wheel_odometry": Odometry}
SECONDS = 3


def text_of(msg):
    """All fields but the sequence number: messages of a bag are of classes of their own, which equal no others."""
    msg.header.seq = 0
    return str(msg)


class MotionSensorsTest(unittest.TestCase):
    def test_topics_have_what_the_bag_has(self):
        topics = {topic: Latest(topic, kind) for topic, kind in TOPICS.items()}
        static = Latest("/tf_static", TFMessage)
        scans = Latest("scan", LaserScan)  # the simulation waits for someone to see it
        wait_until(lambda: len(topics["/fix"].messages) >= 5 * (SECONDS - 1), 60.0, "fixes")
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "motion.bag"
            subprocess.run(["rosrun", "situation_awareness", "simulate_bag", "--world", WORLD, "--out", path,
                            "--duration", str(SECONDS), "--rate", "10", "--seed", "7"], check=True, timeout=60)
            with rosbag.Bag(str(path)) as bag:
                recorded = {topic: {msg.header.stamp: text_of(msg) for _, msg, _ in bag.read_messages([topic])}
                            for topic in TOPICS}
        for topic, latest in topics.items():
            common = [msg for msg in list(latest.messages) if msg.header.stamp in recorded[topic]]
            self.assertGreaterEqual(len(common), (SECONDS - 2) * len(recorded[topic]) // SECONDS, topic)
            for msg in common:
                self.assertEqual(text_of(msg), recorded[topic][msg.header.stamp], topic)
        self.assertTrue(scans.messages)
        frames = {t.child_frame_id: t.header.frame_id for msg in static.messages for t in msg.transforms}
        for frame in ("imu", "second_imu", "antenna", "base", "lidar"):
            self.assertEqual(frames.get(frame), "robot", frame)
        names = [name for name, _ in rospy.get_published_topics()]
        self.assertFalse([name for name in names if "label_camera" in name], "the world has no label camera")


if __name__ == "__main__":
    rospy.init_node("motion_sensors_test")
    rostest.rosrun("situation_awareness", "motion_sensors_test", MotionSensorsTest)
