#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""map.launch cloud:=TOPIC: clouds of a depth camera and of a 3D scanner in, a map out; what cannot be used is
counted."""
import math
import pathlib
import sys
import time
import unittest

import numpy as np
import rosnode
import rospy
import rostest
from sensor_msgs.msg import LaserScan, PointCloud2, PointField
from tf2_msgs.msg import TFMessage

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import PERIOD_S, Diagnostics, Latest, transform_msg, wait_until  # noqa: E402
from situation_awareness.msg import MappedObjectArray  # noqa: E402

HEIGHT_M = 1.2  # of the sensor above the floor
POSTS = ((2.5, 0.4, 0.25), (3.5, -0.6, 0.2))  # x, y, radius
TILT = math.radians(8)

# Columns are the axes of a sensor at the origin of the world: a camera, tilted down, and a scanner, tilted forwards.
CAMERA = np.array([[0, -math.sin(TILT), math.cos(TILT)], [-1, 0, 0], [0, -math.cos(TILT), -math.sin(TILT)]])
SCANNER = np.array([[math.cos(TILT), 0, math.sin(TILT)], [0, 1, 0], [-math.sin(TILT), 0, math.cos(TILT)]])


def ranges_to_scene(rays_world):
    """Along rays of length 1 to posts without an end and a floor, inf where there is none of them."""
    x, y, z = rays_world
    with np.errstate(divide="ignore", invalid="ignore"):
        nearest = np.where(z < 0, -HEIGHT_M / z, np.inf)
        level = np.hypot(x, y)
        for post_x, post_y, radius in POSTS:
            along = (x * post_x + y * post_y) / level
            aside = (x * post_y - y * post_x) / level
            hit = (along > 0) & (np.abs(aside) < radius)
            ranges = (along - np.sqrt(np.maximum(radius ** 2 - aside ** 2, 0))) / level
            nearest = np.where(hit, np.minimum(nearest, ranges), nearest)
    return nearest


def measure(rays_sensor, axes, reach_m):
    """Points in the sensor's frame, NaN where nothing is within its reach."""
    rays = rays_sensor / np.linalg.norm(rays_sensor, axis=0)
    ranges = ranges_to_scene(np.tensordot(axes, rays, 1))
    ranges[ranges > reach_m] = np.nan
    return np.moveaxis(rays * ranges, 0, -1)


def camera_points():
    """Rows and columns of a pinhole camera: x to the right, y down, z ahead."""
    v, u = np.mgrid[0:120, 0:160]
    return measure(np.array([(u - 79.5) / 140, (v - 59.5) / 140, np.ones(u.shape)]), CAMERA, 15.0)


def scanner_points():
    """16 rings of 900 points, those with a return alone, in one row."""
    elevation, azimuth = np.meshgrid(np.radians(np.arange(-15, 16, 2)), np.radians(0.4 * np.arange(-450, 450)))
    rays = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    points = measure(rays, SCANNER, 30.0)
    return points[~np.isnan(points[..., 0])][None]


def cloud_msg(points, stamp, frame):
    msg = PointCloud2(height=points.shape[0], width=points.shape[1], point_step=16, row_step=16 * points.shape[1])
    msg.header.stamp = stamp
    msg.header.frame_id = frame
    msg.fields = [PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate("xyz")]
    msg.data = np.pad(points, ((0, 0), (0, 0), (0, 1))).astype("<f4").tobytes()
    return msg


def transform_of(axes, stamp, frame):
    msg = transform_msg(stamp, child=frame)
    rotation = msg.transforms[0].transform.rotation
    rotation.w = math.sqrt(max(0.0, 1 + np.trace(axes))) / 2
    rotation.x, rotation.y, rotation.z = (
        (axes[k, j] - axes[j, k]) / (4 * rotation.w) for j, k in ((1, 2), (2, 0), (0, 1)))
    return msg


class CloudTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.clouds = rospy.Publisher("camera/points", PointCloud2, queue_size=1000)
        cls.tf = rospy.Publisher("/tf", TFMessage, queue_size=1000)
        cls.map = Latest("objects", MappedObjectArray)
        cls.scans = Latest("level_scan", LaserScan)
        cls.diagnostics = Diagnostics()
        wait_until(lambda: cls.clouds.get_num_connections() > 0 and cls.tf.get_num_connections() > 0
                   and cls.map.subscriber.get_num_connections() > 0
                   and cls.scans.subscriber.get_num_connections() > 0, 60.0, "the stages")
        time.sleep(1.0)

    def publish(self, msg, axes=CAMERA):
        self.tf.publish(transform_of(axes, msg.header.stamp, msg.header.frame_id))
        self.clouds.publish(msg)
        time.sleep(PERIOD_S)

    def run_clouds(self, points, axes, frame):
        for _ in range(20):
            stamp = rospy.Time.now()
            self.publish(cloud_msg(points, stamp, frame), axes)
        wait_until(lambda: stamp in self.map.stamps(), 5.0, "the map of the last cloud")
        return self.map.messages[self.map.stamps().index(stamp)], stamp

    def scan_of(self, stamp):
        wait_until(lambda: stamp in self.scans.stamps(), 5.0, "the scan of that cloud")
        return self.scans.messages[self.scans.stamps().index(stamp)]

    def assert_posts(self, latest):
        self.assertEqual(latest.header.frame_id, "world")
        self.assertEqual(len(latest.objects), len(POSTS))
        for ellipse, (x, y, radius) in zip(sorted(latest.objects, key=lambda e: e.pose.position.x), POSTS):
            self.assertAlmostEqual(ellipse.pose.position.x, x, delta=0.02)
            self.assertAlmostEqual(ellipse.pose.position.y, y, delta=0.02)
            self.assertAlmostEqual(ellipse.rx, radius, delta=0.03)
            self.assertAlmostEqual(ellipse.ry, radius, delta=0.03)

    def test_1_a_depth_camera(self):
        points = camera_points()
        self.assertGreater(np.isnan(points).sum(), 1000)
        latest, stamp = self.run_clouds(points, CAMERA, "camera_optical")
        self.assert_posts(latest)
        scan = self.scan_of(stamp)
        self.assertEqual(scan.header.frame_id, "camera_optical_level")
        ranges = np.array(scan.ranges)
        self.assertEqual(len(ranges), 900)
        self.assertGreater(np.isposinf(ranges).sum(), 80)  # it looked there and met nothing
        self.assertGreater(np.isnan(ranges).sum(), 700)  # it looks ahead alone
        self.assertGreater(np.isfinite(ranges).sum(), 30)

    def test_2_a_scanner_without_rows(self):
        latest, stamp = self.run_clouds(scanner_points(), SCANNER, "velodyne")
        self.assert_posts(latest)
        self.assertEqual(self.scan_of(stamp).header.frame_id, "velodyne_level")

    def assert_dropped(self, reason, msg):
        key = "dropped: " + reason
        before = self.diagnostics.count("slicing", key)
        self.publish(msg)
        wait_until(lambda: self.diagnostics.count("slicing", key) > before, 5.0, f"'{key}'")

    def good(self):
        return cloud_msg(camera_points(), rospy.Time.now(), "camera_optical")

    def test_3_clouds_that_cannot_be_used(self):
        msg = self.good()
        msg.header.frame_id = ""
        key = "dropped: bad cloud: no frame_id"
        self.clouds.publish(msg)
        wait_until(lambda: self.diagnostics.count("slicing", key) > 0, 5.0, f"'{key}'")
        msg = self.good()
        msg.header.stamp = rospy.Time()
        key = "dropped: bad cloud: stamp is zero"
        self.clouds.publish(msg)
        wait_until(lambda: self.diagnostics.count("slicing", key) > 0, 5.0, f"'{key}'")
        msg = self.good()
        msg.width = 0
        self.assert_dropped("bad cloud: no points", msg)
        msg = self.good()
        msg.is_bigendian = True
        self.assert_dropped("bad cloud: big-endian", msg)
        msg = self.good()
        msg.fields[2].datatype = PointField.FLOAT64
        self.assert_dropped("bad cloud: x, y, z are not float32", msg)
        msg = self.good()
        msg.fields[2].offset = 14
        self.assert_dropped("bad cloud: field beyond its point", msg)
        msg = self.good()
        msg.data = msg.data[:-1]
        self.assert_dropped("bad cloud: less data than points", msg)
        msg = self.good()
        msg.width *= 2
        self.assert_dropped("bad cloud: less data than points", msg)
        stamp = self.map.stamps()[-1]
        self.assert_dropped("stamp repeats or goes back", cloud_msg(camera_points(), stamp, "camera_optical"))
        key = "dropped: no transform"
        self.clouds.publish(self.good())
        wait_until(lambda: self.diagnostics.count("slicing", key) > 0, 5.0, f"'{key}'")

    def timed(self, times):
        """A good cloud whose times are `times`(0 for each point)."""
        points = np.pad(camera_points(), ((0, 0), (0, 0), (0, 1)))
        points[..., 3] = times(points[..., 3])
        msg = self.good()
        msg.fields.append(PointField("time", 12, PointField.FLOAT32, 1))
        msg.data = points.astype("<f4").tobytes()
        return msg

    def test_4_times_that_cannot_be(self):
        def one_late(times):
            times[90, 80] = 1e9  # where the floor is
            return times
        for times, key in ((one_late, "dropped points without a time"),
                           (lambda times: np.random.default_rng(1).normal(times, 1e6), "times of points ignored")):
            msg = self.timed(times)
            self.publish(msg)
            wait_until(lambda: msg.header.stamp in self.map.stamps(), 5.0, "the map")
            wait_until(lambda: self.diagnostics.count("slicing", key) == 1, 5.0, "the count")
        self.assertIn("times of points cannot be used", self.diagnostics.summary("slicing"))

    def test_5_afterwards_it_maps(self):
        self.assertTrue(rosnode.rosnode_ping("/map_manager", max_count=1), "the manager lives")
        self.assert_posts(self.run_clouds(camera_points(), CAMERA, "camera_optical")[0])


if __name__ == "__main__":
    rospy.init_node("cloud_test")
    rostest.rosrun("situation_awareness", "cloud_test", CloudTest)
