#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""check_live while a scanner is driven: the page about what is published, and the line that starts the map."""
import math
import subprocess
import threading
import unittest

import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import LaserScan


class CheckLiveTest(unittest.TestCase):
    def setUp(self):
        self.scans = rospy.Publisher("/front/scan", LaserScan, queue_size=10)
        self.transforms = tf2_ros.TransformBroadcaster()
        self.stop = threading.Event()
        self.driver = threading.Thread(target=self.drive)
        self.driver.start()

    def tearDown(self):
        self.stop.set()
        self.driver.join()

    def drive(self):
        rate = rospy.Rate(20.0)
        while not self.stop.is_set():
            pose = TransformStamped()
            pose.header.stamp, pose.header.frame_id, pose.child_frame_id = rospy.Time.now(), "odom", "laser"
            pose.transform.rotation.w = 1.0
            self.transforms.sendTransform(pose)
            scan = LaserScan()
            scan.header.stamp, scan.header.frame_id = pose.header.stamp, "laser"
            scan.angle_min, scan.angle_increment = -math.pi, math.radians(1.0)
            scan.range_min, scan.range_max = 0.1, 10.0
            scan.ranges = [2.0] * 180 + [0.0] * 180
            self.scans.publish(scan)
            rate.sleep()

    def test_page_of_what_is_published(self):
        done = subprocess.run(["rosrun", "situation_awareness", "check_live", "--seconds", "4"], timeout=100, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertIn("/front/scan  sensor_msgs/LaserScan", done.stdout)
        self.assertIn("scan/no_return to zero", done.stdout)
        self.assertIn("roslaunch situation_awareness map.launch scan:=/front/scan world_frame:=odom", done.stdout)
        self.assertNotIn("map_bag", done.stdout)


if __name__ == "__main__":
    rospy.init_node("check_live_test")
    rostest.rosrun("situation_awareness", "check_live", CheckLiveTest)
