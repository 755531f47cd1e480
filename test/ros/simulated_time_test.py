#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Wall time is measured by the steady clock, also under simulated time, which here stands still between a scan and its
later transform."""
import pathlib
import statistics
import sys
import time
import unittest

import rospy
import rostest
from rosgraph_msgs.msg import Clock

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Diagnostics, Latest, Robot, scan_msg, transform_msg, wait_until  # noqa: E402
from situation_awareness.msg import DetectionArray, MappedObjectArray, SegmentArray  # noqa: E402

STAGES = ("segmentation", "detection", "mapping")
PATIENCE_S = 60.0
LATE_S = 0.1  # the transform, in wall time
STEP_S = 0.05  # of the clock, between scans
COUNTED_S = 0.05  # in wall time, from the map to the next step of the clock: a stage publishes before it takes the age
LATENCY_S = 0.5 * LATE_S  # at least: on a busy machine the scan itself takes part of it to arrive


class SimulatedTimeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.clock = rospy.Publisher("/clock", Clock, queue_size=10)
        cls.robot = Robot()
        cls.segments = Latest("segments", SegmentArray)
        cls.detections = Latest("detections", DetectionArray)
        cls.map = Latest("objects", MappedObjectArray)
        cls.diagnostics = Diagnostics()
        wait_until(lambda: all(each.subscriber.get_num_connections() > 0 for each in
                               (cls.segments, cls.detections, cls.map, cls.diagnostics))
                   and cls.clock.get_num_connections() >= 2, PATIENCE_S, "the nodelets")
        for i in range(40):
            stamp = rospy.Time.from_sec(1000.0 + STEP_S * i)
            cls.clock.publish(Clock(clock=stamp))
            cls.robot.scans.publish(scan_msg(stamp))
            time.sleep(LATE_S)
            cls.robot.tf.publish(transform_msg(stamp))
            wait_until(lambda: stamp in cls.map.stamps(), PATIENCE_S, "the map")
            time.sleep(COUNTED_S)
        wait_until(lambda: stamp in cls.segments.stamps() and stamp in cls.detections.stamps(), 5.0, "the last messages")
        wait_until(lambda: cls.diagnostics.count("mapping", "processed") == 40, 5.0, "what is said of the last scan")

    def worked(self, stage):
        """Its reports of seconds with input."""
        said = [status for name, status in self.diagnostics.history
                if name == stage and float(status["rate [Hz]"]) > 0.0]
        self.assertGreater(len(said), 2)
        return said

    def test_latency_is_from_the_arrival_of_the_scan_on(self):
        for stage in STAGES:
            for status in self.worked(stage):
                for key in ("latency p50 [ms]", "latency p99 [ms]"):
                    self.assertGreater(float(status[key]), 1e3 * LATENCY_S, (stage, key))
                    self.assertLess(float(status[key]), 5e3, (stage, key))
                self.assertGreater(float(status["latency p50 [ms]"]), float(status["processing p50 [ms]"]))

    def test_waiting_and_processing_are_not_those_of_a_clock_that_stands(self):
        for status in self.worked("segmentation"):
            self.assertGreater(float(status["wait for TF p50 [ms]"]), 1e3 * LATENCY_S)
        for stage in STAGES:
            self.assertGreater(max(float(status["processing p99 [ms]"]) for status in self.worked(stage)), 0.0, stage)

    def test_age_is_by_the_clock_of_the_stamps(self):
        for stage in STAGES:
            ages_ms = [float(status["age p50 [ms]"]) for status in self.worked(stage)]
            # Not each: where other programs take the processor, the clock may step before a stage takes the age.
            self.assertEqual(statistics.median(ages_ms), 0.0, (stage, ages_ms))
            self.assertLessEqual(max(ages_ms), 1e3 * STEP_S, (stage, ages_ms))

    def test_messages_carry_it_on(self):
        for segments in self.segments.messages:
            detections = next(msg for msg in self.detections.messages if msg.header.stamp == segments.header.stamp)
            self.assertGreater(detections.latency, segments.latency)
            self.assertLess(detections.latency, 5.0)
        # Not of each: a single scan may arrive as late as its transform.
        self.assertGreater(statistics.median(segments.latency for segments in self.segments.messages), LATENCY_S)


if __name__ == "__main__":
    rospy.init_node("simulated_time_test")
    rostest.rosrun("situation_awareness", "simulated_time_test", SimulatedTimeTest)
