#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A simulated drive through the corridor, live: each pose is the one of polygons_bag, and TF says the same."""
import json
import math
import os
import pathlib
import subprocess
import sys
import time
import unittest

import rosbag
import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
sys.path.insert(0, str(HERE.parents[1] / "scripts" / "evaluation"))
import polygon_worlds  # noqa: E402
from ros_support import Diagnostics, Latest, wait_until, yaw_of  # noqa: E402

LAST_BEAM = rospy.Duration(0.029)  # after a scan's stamp


class ReflectorDriveTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = pathlib.Path(os.environ["ROS_HOME"]) / "drive"
        folder.mkdir(parents=True, exist_ok=True)
        polygon_worlds.write_world(folder, "corridor", 1, sweep=True, with_initial_pose=True, transits=1)
        cls.bag = next(path for path in folder.glob("*.bag") if not path.stem.endswith("_tf"))
        known = cls.bag.with_suffix(".reflectors.yaml")
        truth = json.loads(cls.bag.with_suffix(".truth.json").read_text())
        initial = ",".join(map(str, truth["initial_pose"]))
        out = folder / "out.jsonl"
        subprocess.run(["rosrun", "situation_awareness", "polygons_bag", cls.bag, "--reflectors", known,
                        f"--initial-pose={initial}", "--world-frame", "map", "--out", out], check=True)
        cls.offline = [json.loads(line) for line in out.read_text().splitlines()]
        rospy.set_param("reflector_localization/initial_pose", initial)
        file = pathlib.Path(rospy.get_param("reflector_localization/reflector_file"))
        file.write_text(known.read_text())  # the nodelet has waited for it

    def test_live_poses_are_those_of_the_tool(self):
        poses = Latest("pose", PoseWithCovarianceStamped)
        diagnostics = Diagnostics()
        buffer = tf2_ros.Buffer(rospy.Duration(1000.0))
        listener = tf2_ros.TransformListener(buffer)  # noqa: F841
        publishers = {"/scan": rospy.Publisher("scan", LaserScan, queue_size=1000),
                      "/odom": rospy.Publisher("odom", Odometry, queue_size=1000),
                      "/tf": rospy.Publisher("/tf", TFMessage, queue_size=1000),
                      "/tf_static": rospy.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)}
        wait_until(lambda: all(p.get_num_connections() > 0 for p in publishers.values()), 60.0, "the nodelet")
        sent = 0
        with rosbag.Bag(str(self.bag)) as bag:
            for topic, message, _ in bag.read_messages():
                if topic not in publishers:
                    continue
                publishers[topic].publish(message)
                if topic == "/tf_static":
                    time.sleep(0.5)
                if topic != "/scan":
                    continue
                sent += 1
                # A few scans wait for their odometry.
                wait_until(lambda: len(poses.messages) >= sent - 5, 10.0, f"the pose of scan {sent}")
        wait_until(lambda: len(poses.messages) >= len(self.offline), 10.0, "the last pose")

        self.assertEqual(len(poses.messages), len(self.offline))
        self.assertGreater(len(self.offline), 500)
        for message, line in zip(poses.messages, self.offline):
            self.assertAlmostEqual(message.header.stamp.to_sec(), line["stamp"], delta=1e-6)
            pose = message.pose.pose
            for live, offline in ((pose.position.x, line["pose"]["x"]), (pose.position.y, line["pose"]["y"]),
                                  (yaw_of(pose.orientation), line["pose"]["yaw"])):
                self.assertAlmostEqual(live, offline, delta=1e-9)
            rows = [message.pose.covariance[6 * i + k] for i in (0, 1, 5) for k in (0, 1, 5)]
            for live, offline in zip(rows, line["pose"]["covariance"]):
                self.assertAlmostEqual(live, offline, delta=1e-9)
        self.assertEqual(diagnostics.count("reflector_localization", "dropped: pose not known"), 0)

        # At the times of the first and last beams TF has the poses of that scan: no extrapolation, no other scan's.
        compared = poses.messages[5:-5]
        wait_until(lambda: buffer.can_transform("map", "base_link", compared[-1].header.stamp + LAST_BEAM), 5.0, "TF")
        worst_m = 0.0
        for message in compared:
            transform = buffer.lookup_transform("map", "base_link", message.header.stamp).transform
            pose = message.pose.pose
            worst_m = max(worst_m, math.hypot(transform.translation.x - pose.position.x,
                                              transform.translation.y - pose.position.y))
            self.assertAlmostEqual(yaw_of(transform.rotation), yaw_of(pose.orientation), delta=1e-6)
            now = buffer.lookup_transform("map", "odom", message.header.stamp).transform
            then = buffer.lookup_transform("map", "odom", message.header.stamp + LAST_BEAM).transform
            self.assertAlmostEqual(now.translation.x, then.translation.x, delta=1e-9)
        self.assertLess(worst_m, 1e-6)


if __name__ == "__main__":
    rospy.init_node("reflector_drive_test")
    rostest.rosrun("situation_awareness", "reflector_drive_test", ReflectorDriveTest)
