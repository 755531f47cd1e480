#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Scans in, a map with their stamps out: launch/map.launch as a user runs it for objects alone."""
import math
import pathlib
import sys
import time
import unittest

import rospy
import rostest
from sensor_msgs import point_cloud2
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import (BEAMS, Diagnostics, Latest, Robot, ranges_to_circles, scan_msg, shown_ids,  # noqa: E402
                         transform_msg, wait_until)
from situation_awareness.msg import DetectionArray, MappedObjectArray, SegmentArray  # noqa: E402


class ChainTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.map = Latest("objects", MappedObjectArray)
        cls.markers = Latest("semantic_map_markers", MarkerArray)
        cls.cloud = Latest("hit_labels", PointCloud2)
        cls.segments = Latest("segments", SegmentArray)
        cls.detections = Latest("detections", DetectionArray)
        cls.diagnostics = Diagnostics()
        cls.robot = Robot()
        wait_until(lambda: cls.map.subscriber.get_num_connections() > 0, 60.0, "the mapping nodelet")
        wait_until(lambda: cls.detections.subscriber.get_num_connections() > 0, 60.0, "the detection nodelet")
        time.sleep(1.0)

    def test_1_objects_appear_with_the_stamps_of_the_scans(self):
        stamps = self.robot.run(20, circles=[(3.0, 0.5, 0.25), (2.0, -2.0, 0.3)])
        wait_until(lambda: self.map.messages and self.map.messages[-1].header.stamp == stamps[-1], 5.0, "the map")
        latest = self.map.messages[-1]
        self.assertEqual(latest.header.frame_id, "world")
        self.assertEqual(self.map.stamps()[-10:], stamps[-10:])
        self.assertEqual(len(latest.objects), 2)
        first, second = sorted(latest.objects, key=lambda ellipse: -ellipse.pose.position.y)
        self.assertAlmostEqual(first.pose.position.x, 3.0, delta=0.05)
        self.assertAlmostEqual(first.pose.position.y, 0.5, delta=0.05)
        self.assertAlmostEqual(first.rx, 0.25, delta=0.08)
        self.assertAlmostEqual(second.pose.position.x, 2.0, delta=0.05)
        self.assertEqual(first.last_seen, stamps[-1])
        self.assertGreater(first.beams, 10)
        self.assertEqual(len(first.covariance), 64)
        for i in range(8):
            self.assertGreater(first.covariance[9 * i], 0.0)

    def test_2_every_stage_reports(self):
        stamps = self.robot.run(10)
        wait_until(lambda: stamps[-1] in self.segments.stamps(), 5.0, "segments")
        wait_until(lambda: stamps[-1] in self.detections.stamps(), 5.0, "detections")
        wait_until(lambda: stamps[-1] in self.cloud.stamps(), 5.0, "the cloud")
        cloud = self.cloud.messages[-1]
        self.assertEqual(cloud.header.frame_id, "world")
        self.assertEqual([field.name for field in cloud.fields],
                         ["x", "y", "z", "rgb", "object", "segment", "fate", "reason"])
        fates = {fate for (fate,) in point_cloud2.read_points(cloud, field_names=["fate"])}
        self.assertEqual(fates, {0}, "all hits are on an object")
        objects = {number for (number,) in point_cloud2.read_points(cloud, field_names=["object"])}
        self.assertLessEqual(objects, {ellipse.id for ellipse in self.map.messages[-1].objects})
        self.assertGreater(cloud.width, 10)
        self.assertLessEqual(cloud.width, BEAMS)
        self.assertEqual(len(cloud.data), cloud.width * cloud.point_step)
        wait_until(lambda: self.markers.messages, 5.0, "markers")
        spaces = {marker.ns for array in self.markers.messages for marker in array.markers
                  if marker.action == Marker.ADD}
        self.assertLessEqual({"object", "id", "position_uncertainty"}, spaces)

    def test_3_markers_show_the_map_and_nothing_else(self):
        stamps = self.robot.run(20, circles=[(3.0, 0.5, 0.25)])
        wait_until(lambda: stamps[-1] in self.map.stamps(), 5.0, "the map")
        ids = {ellipse.id for ellipse in self.map.messages[-1].objects}
        wait_until(lambda: shown_ids(self.markers.messages, "object") == ids, 5.0, "the markers of the map")

    def test_4_a_late_transform_is_waited_for(self):
        self.robot.run(5)
        stamp = rospy.Time.now()
        self.robot.publish(scan_msg(stamp), transforms=False)
        time.sleep(0.2)
        self.assertNotIn(stamp, self.map.stamps(), "no transform, no map")
        self.robot.tf.publish(transform_msg(stamp))
        wait_until(lambda: stamp in self.map.stamps(), 2.0, "the scan whose transform came late")

    def test_5_each_beam_is_taken_at_its_own_time(self):
        """A scanner that moves by 5 cm during a scan, past a post that is hit by late beams."""
        increment = 1e-4
        sweep = rospy.Duration(increment * (BEAMS - 1))
        stamp = rospy.Time.now()
        msg = scan_msg(stamp, ranges=ranges_to_circles([(0.0, 2.0, 0.3)], moved_x=0.05))
        msg.time_increment = increment
        self.robot.publish(msg)
        time.sleep(0.2)
        self.assertNotIn(stamp, self.segments.stamps(), "no transform at the last beam, no segments")
        self.robot.tf.publish(transform_msg(stamp + sweep, x=0.05))
        wait_until(lambda: stamp in self.detections.stamps(), 2.0, "detections")
        wait_until(lambda: stamp in self.segments.stamps(), 2.0, "segments")
        segments = next(message for message in self.segments.messages if message.header.stamp == stamp)
        self.assertAlmostEqual(segments.time_increment, increment, delta=1e-9)
        self.assertEqual(len(segments.free_azimuth), BEAMS)
        self.assertEqual(sum(reach < msg.range_max for reach in segments.free_range), len(segments.points))
        detections = next(message for message in self.detections.messages if message.header.stamp == stamp)
        self.assertEqual(detections.free_range, segments.free_range)
        self.assertEqual(len(detections.detections), 1)
        post = detections.detections[0]
        self.assertAlmostEqual(post.x, 0.0, delta=0.01, msg="4 cm off if all beams were taken at one instant")
        self.assertAlmostEqual(post.y, 2.0, delta=0.05)
        self.assertAlmostEqual(post.time_offset, increment * 450, delta=3 * increment)
        self.robot.run(3)

    def test_6_diagnostics_count(self):
        self.robot.run(40)
        wait_until(lambda: {"segmentation", "detection", "mapping"} <= set(self.diagnostics.stages), 5.0, "diagnostics")
        for stage in ("segmentation", "detection", "mapping"):
            self.assertGreater(self.diagnostics.count(stage, "processed"), 20, stage)
            self.assertTrue(math.isfinite(float(self.diagnostics.stages[stage]["latency p99 [ms]"])))


if __name__ == "__main__":
    rospy.init_node("chain_test")
    rostest.rosrun("situation_awareness", "chain_test", ChainTest)
