#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""No message of a driver or TF ends the manager, each drop is counted, and good scans are mapped afterwards."""
import math
import pathlib
import sys
import time
import unittest

import rosnode
import rospy
import rostest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import (BEAMS, Diagnostics, Latest, Robot, ranges_to_circles, scan_msg, transform_msg,  # noqa: E402
                         wait_until)
from situation_awareness.msg import DetectionArray, MappedObjectArray, SegmentArray  # noqa: E402
from situation_awareness.msg import EllipseDetection, LaserSegment, MappedObject  # noqa: E402

CIRCLE = ((3.0, 0.5, 0.25),)


class BadInputTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.map = Latest("objects", MappedObjectArray)
        cls.diagnostics = Diagnostics()
        cls.robot = Robot()
        wait_until(lambda: cls.map.subscriber.get_num_connections() > 0, 60.0, "the mapping nodelet")
        time.sleep(1.0)

    def tearDown(self):
        self.assertTrue(rosnode.rosnode_ping("/map_manager", max_count=1), "the manager lives")
        stamps = self.robot.run(8)
        wait_until(lambda: stamps[-1] in self.map.stamps(), 5.0, "good scans to be mapped again")
        wait_until(lambda: self.map.messages[-1].objects, 5.0, "the object to be on the map again")
        for ellipse in self.map.messages[-1].objects:
            numbers = [ellipse.pose.position.x, ellipse.pose.position.y, ellipse.rx, ellipse.ry, *ellipse.covariance]
            self.assertTrue(all(math.isfinite(number) for number in numbers))

    def assert_dropped(self, reason, publish, stage="segmentation"):
        key = "dropped: " + reason
        before = self.diagnostics.count(stage, key)
        publish()
        wait_until(lambda: self.diagnostics.count(stage, key) > before, 5.0, f"'{key}' of {stage}")

    def assert_mapped(self, msg):
        self.robot.publish(msg)
        wait_until(lambda: msg.header.stamp in self.map.stamps(), 3.0, "the scan to be mapped")

    def drops_of_bad_scans(self):
        return sum(int(value) for key, value in self.diagnostics.stages.get("segmentation", {}).items()
                   if key.startswith("dropped: bad scan"))

    def assert_bad_scan(self, msg):
        before = self.drops_of_bad_scans()
        self.robot.publish(msg)
        wait_until(lambda: self.drops_of_bad_scans() > before, 5.0, "a bad scan to be counted")

    def test_nan_inf_and_negative_ranges(self):
        for value in (math.nan, math.inf, -math.inf, -1.0, 0.0, 1e30):
            self.assert_mapped(scan_msg(rospy.Time.now(), ranges=[value] * BEAMS))
        mixed = ranges_to_circles(CIRCLE)
        mixed[::7] = [math.nan] * len(mixed[::7])
        mixed[::11] = [-math.inf] * len(mixed[::11])
        mixed[::13] = [-3.0] * len(mixed[::13])
        self.assert_mapped(scan_msg(rospy.Time.now(), ranges=mixed))

    def test_empty_scan(self):
        self.assert_bad_scan(scan_msg(rospy.Time.now(), ranges=[]))

    def test_one_beam(self):
        self.assert_bad_scan(scan_msg(rospy.Time.now(), ranges=[2.0]))

    def test_angles_that_are_not_numbers(self):
        for increment in (math.nan, math.inf, 0.0):
            self.assert_bad_scan(scan_msg(rospy.Time.now(), increment=increment))

    def test_limits_that_are_not_numbers(self):
        msg = scan_msg(rospy.Time.now())
        msg.range_max = math.nan
        self.assert_bad_scan(msg)

    def test_times_that_are_not_numbers(self):
        msg = scan_msg(rospy.Time.now())
        msg.scan_time = msg.time_increment = math.nan
        self.assert_mapped(msg)

    def test_invalid_times(self):
        before = self.diagnostics.count("segmentation", "time increment ignored")
        for increment in (-1e-5, 0.1, math.inf):
            msg = scan_msg(rospy.Time.now())
            msg.time_increment = increment
            self.assert_mapped(msg)
        wait_until(lambda: self.diagnostics.count("segmentation", "time increment ignored") >= before + 3, 5.0,
                   "the count of time increments")

    def test_a_turn_that_would_swap_beams(self):
        stamp = rospy.Time.now()
        msg = scan_msg(stamp)
        msg.time_increment = 1e-5
        turned = transform_msg(stamp + rospy.Duration(0.01))
        turned.transforms[0].transform.rotation.z = turned.transforms[0].transform.rotation.w = math.sqrt(0.5)
        self.robot.tf.publish(transform_msg(stamp))
        self.robot.tf.publish(turned)
        self.assert_dropped("turn", lambda: self.robot.publish(msg, transforms=False))

    def test_no_frame(self):
        self.assert_bad_scan(scan_msg(rospy.Time.now(), frame=""))

    def test_stamp_zero(self):
        msg = scan_msg(rospy.Time(0))
        before = self.drops_of_bad_scans()
        self.robot.publish(msg, transforms=False)
        wait_until(lambda: self.drops_of_bad_scans() > before, 5.0, "a stamp of zero to be counted")

    def test_changed_beam_count(self):
        for beams in (2, 3, 10, 100, 720):
            increment = 4.71 / beams
            self.assert_mapped(scan_msg(rospy.Time.now(), ranges=ranges_to_circles(CIRCLE, beams, increment),
                                        increment=increment))

    def test_repeated_stamp(self):
        stamp = self.robot.run(3)[-1]
        self.assert_dropped("stamp repeats or goes back", lambda: self.robot.publish(scan_msg(stamp)))
        time.sleep(0.2)
        self.assertEqual(self.map.stamps().count(stamp), 1)

    def test_stamp_going_back_a_little(self):
        stamp = self.robot.run(3)[-1] - rospy.Duration(0.5)
        self.assert_dropped("stamp repeats or goes back", lambda: self.robot.publish(scan_msg(stamp)))
        self.assertNotIn(stamp, self.map.stamps())

    def test_missing_transform(self):
        self.assert_dropped("no transform", lambda: self.robot.publish(scan_msg(rospy.Time.now()), transforms=False))

    def test_unknown_frame(self):
        stamp = rospy.Time.now()
        self.assert_dropped("no transform", lambda: self.robot.publish(scan_msg(stamp, frame="no/such//frame")))
        self.assertNotIn(stamp, self.map.stamps())

    def test_transform_that_comes_too_late(self):
        stamp = rospy.Time.now()
        self.assert_dropped("no transform", lambda: self.robot.publish(scan_msg(stamp), transforms=False))
        self.robot.tf.publish(transform_msg(stamp))
        time.sleep(0.3)
        self.assertNotIn(stamp, self.map.stamps())

    def test_flood_without_transforms(self):
        def flood():
            for _ in range(60):
                self.robot.scans.publish(scan_msg(rospy.Time.now()))
                time.sleep(0.005)
        self.assert_dropped("queue full", flood)
        time.sleep(0.5)

    def test_transform_that_is_no_rotation(self):
        stamp = rospy.Time.now()
        broken = transform_msg(stamp)
        broken.transforms[0].transform.rotation.w = math.nan
        self.robot.tf.publish(broken)
        self.assert_dropped("no transform", lambda: self.robot.publish(scan_msg(stamp), transforms=False))

    def test_steep_tilt(self):
        stamp = rospy.Time.now()
        steep = transform_msg(stamp)
        steep.transforms[0].transform.rotation.x = math.sin(math.pi / 4)
        steep.transforms[0].transform.rotation.w = math.cos(math.pi / 4)
        self.robot.tf.publish(steep)
        self.assert_dropped("tilt", lambda: self.robot.publish(scan_msg(stamp), transforms=False))

    def test_invalid_maps(self):
        publisher = rospy.Publisher("objects", MappedObjectArray, queue_size=10)
        wait_until(lambda: publisher.get_num_connections() > 1, 10.0, "the segmentation nodelet")
        msg = MappedObjectArray(objects=[MappedObject(rx=math.nan, ry=0.1)])
        msg.header.frame_id = "world"
        msg.header.stamp = rospy.Time.now()
        self.assert_dropped("bad map", lambda: publisher.publish(msg))
        msg = MappedObjectArray(header=msg.header)
        msg.header.frame_id = "elsewhere"
        self.assert_dropped("bad map", lambda: publisher.publish(msg))
        publisher.unregister()

    def test_inconsistent_segments(self):
        publisher = rospy.Publisher("segments", SegmentArray, queue_size=10)
        wait_until(lambda: publisher.get_num_connections() > 0, 10.0, "the detection nodelet")
        msg = SegmentArray(segments=[LaserSegment(first=0, count=100)], resolution=0.01)
        msg.header.stamp = rospy.Time.now()
        self.assert_dropped("bad message", lambda: publisher.publish(msg), stage="detection")
        publisher.unregister()

    def test_detections_that_are_not_finite(self):
        publisher = rospy.Publisher("detections", DetectionArray, queue_size=10)
        wait_until(lambda: publisher.get_num_connections() > 0, 10.0, "the mapping nodelet")
        msg = DetectionArray(detections=[EllipseDetection(x=math.nan, rx=0.2, ry=0.1)])
        msg.header.stamp = rospy.Time.now()
        self.assert_dropped("bad message", lambda: publisher.publish(msg), stage="mapping")
        publisher.unregister()


if __name__ == "__main__":
    rospy.init_node("bad_input_test")
    rostest.rosrun("situation_awareness", "bad_input_test", BadInputTest)
