#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The robot of the world `site` has a scanner, a camera, an IMU and a receiver: all are published, and fit together."""
import math
import pathlib
import sys
import unittest

import numpy as np
import rospy
import rostest
import tf2_ros
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, Image, Imu, LaserScan, NavSatFix

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Latest, wait_until  # noqa: E402

BLOCK_PX = 8
SIGMA_M = math.hypot(0.6, 0.3)  # of a fix in each direction
LATITUDE_DEG, LONGITUDE_DEG = 47.3769, 8.5417  # of the world's origin
M_PER_DEG = 111200.0  # of latitude there


class SiteTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.odometry, cls.scans = Latest("odometry", Odometry), Latest("scan", LaserScan)
        cls.imu, cls.fixes = Latest("imu", Imu), Latest("fix", NavSatFix)
        cls.classes, cls.labels = Latest("label_camera/classes", Image), Latest("label_camera/labels", Image)
        cls.infos = Latest("label_camera/labels_info", CameraInfo)
        cls.tf = tf2_ros.Buffer()
        cls.listener = tf2_ros.TransformListener(cls.tf)
        wait_until(lambda: all(len(latest.messages) >= 10 for latest in (cls.scans, cls.fixes, cls.labels)), 90.0,
                   "scans, fixes and labels")

    def test_1_fixes_and_imu_fit_the_true_motion(self):
        by_stamp = {m.header.stamp: m.pose.pose.position for m in self.odometry.messages}
        common = [m for m in self.fixes.messages if m.header.stamp in by_stamp]
        self.assertGreaterEqual(len(common), 5)
        for fix in common:
            place = by_stamp[fix.header.stamp]
            east_m = (fix.longitude - LONGITUDE_DEG) * M_PER_DEG * math.cos(math.radians(LATITUDE_DEG))
            north_m = (fix.latitude - LATITUDE_DEG) * M_PER_DEG
            self.assertLess(math.hypot(east_m - place.x, north_m - place.y), 6.0 * SIGMA_M)
        force = np.mean([(m.linear_acceleration.x, m.linear_acceleration.y, m.linear_acceleration.z)
                         for m in self.imu.messages[-200:]], axis=0)
        self.assertAlmostEqual(float(np.linalg.norm(force)), 9.81, delta=0.5)

    def test_2_the_frames_are_known(self):
        for latest in (self.scans, self.imu, self.fixes, self.labels):
            frame = latest.messages[-1].header.frame_id
            self.assertTrue(self.tf.can_transform("world", frame, rospy.Time(0), rospy.Duration(5)), frame)

    def share_of(self, classes, number):
        image = np.frombuffer(classes.data, dtype="<u2").reshape(classes.height, classes.width) == number
        rows, columns = classes.height // BLOCK_PX, classes.width // BLOCK_PX
        return image.reshape(rows, BLOCK_PX, columns, BLOCK_PX).mean(axis=(1, 3))

    def test_3_labels_are_the_share_of_cars(self):
        def with_cars():
            return [m for m in list(self.labels.messages) if np.frombuffer(m.data, dtype="<f4").max() > 0.9]
        wait_until(lambda: len(with_cars()) >= 5, 90.0, "cars in sight")
        images = {m.header.stamp: m for m in self.classes.messages}
        seen = [m for m in with_cars() if m.header.stamp in images]
        self.assertTrue(seen)
        numbers = set()
        for msg in seen:
            self.assertEqual((msg.encoding, msg.width, msg.height), ("32FC1", 448 // BLOCK_PX, 336 // BLOCK_PX))
            labels = np.frombuffer(msg.data, dtype="<f4").reshape(msg.height, msg.width)
            classes = images[msg.header.stamp]
            present = np.unique(np.frombuffer(classes.data, dtype="<u2"))
            numbers.add(tuple(n for n in present if np.allclose(self.share_of(classes, n), labels, atol=1e-5)))
        self.assertEqual(len(numbers), 1, "it is one class in all images")
        self.assertEqual(len(numbers.pop()), 1)
        info = self.infos.messages[-1]
        self.assertEqual((info.width, info.height), (448 // BLOCK_PX, 336 // BLOCK_PX))


if __name__ == "__main__":
    rospy.init_node("site_test")
    rostest.rosrun("situation_awareness", "site_test", SiteTest)
