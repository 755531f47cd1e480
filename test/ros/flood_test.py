#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Scans that come faster than they can be processed: the newest is processed and the others are counted. If there is
time, nothing is dropped."""
import math
import pathlib
import sys
import time
import unittest

import rosnode
import rospy
import rostest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import (PERIOD_S, Diagnostics, Latest, Robot, ranges_to_circles, scan_msg, transform_msg,  # noqa: E402
                         wait_until)
from situation_awareness.msg import MappedObjectArray  # noqa: E402

RATE_HZ = 500.0
FLOOD_S = 6.0
STAGES = ("segmentation", "detection", "mapping")
MANY = ranges_to_circles(
    [(3.0 * math.cos(angle), 3.0 * math.sin(angle), 0.25) for angle in (0.36 * i - 2.0 for i in range(12))])
# Allowed delay of a scan beyond the stages' processing time: two busy cores, three processes, and polling of transforms
# every 5 ms. Queues of 20 processed in order would be 0.2 s late by the detector alone.
SLACK_S = 0.1


class FloodTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.map = Latest("objects", MappedObjectArray)
        cls.diagnostics = Diagnostics()
        cls.robot = Robot()
        wait_until(lambda: cls.map.subscriber.get_num_connections() > 0, 60.0, "the mapping nodelet")
        wait_until(lambda: set(STAGES) <= set(cls.diagnostics.stages), 60.0, "all stages to speak")
        time.sleep(1.0)
        cls.sent = len(cls.robot.run(20))

    def tearDown(self):
        self.assertTrue(rosnode.rosnode_ping("/map_manager", max_count=1), "the manager lives")

    def drops(self, stage):
        return {key: int(value) for key, value in self.diagnostics.stages[stage].items() if key.startswith("dropped")}

    def settle(self):
        """Wait until all messages have come, each processed or counted as dropped by each stage; return all drops."""
        count = self.diagnostics.count

        def settled():
            return (count("segmentation", "received") == self.sent
                    and count("detection", "received") == count("segmentation", "processed")
                    and count("mapping", "received") == count("detection", "processed")
                    and all(count(stage, "received") == count(stage, "processed") + sum(self.drops(stage).values())
                            for stage in STAGES))
        try:
            wait_until(settled, 10.0, "the accounts")
        except AssertionError:
            self.fail(f"{self.sent} scans sent, but {self.diagnostics.stages}")
        return {stage: self.drops(stage) for stage in STAGES}

    def send(self, msg, transforms_of):
        for stamp in transforms_of:
            self.robot.tf.publish(transform_msg(stamp))
        self.robot.scans.publish(msg)
        type(self).sent += 1

    def flood(self, tf_delay_s):
        """The stamps sent, and by how much transforms were late at most: more than asked for where this process had to
        wait for a processor."""
        stamps, untold = [], []
        latest_s = 0.0
        msg = scan_msg(rospy.Time.now(), ranges=MANY)
        begin = time.monotonic()
        while time.monotonic() - begin < FLOOD_S:
            time.sleep(max(0.0, begin + len(stamps) / RATE_HZ - time.monotonic()))
            msg.header.stamp = rospy.Time.now()
            stamps.append(msg.header.stamp)
            untold.append(msg.header.stamp)
            told = [stamp for stamp in untold if (stamps[-1] - stamp).to_sec() >= tf_delay_s]
            untold = untold[len(told):]
            self.send(msg, told)
            if told:
                latest_s = max(latest_s, (rospy.Time.now() - told[0]).to_sec())
        for stamp in untold:
            self.robot.tf.publish(transform_msg(stamp))
        return stamps, latest_s

    def check_flood(self, tf_delay_s):
        before = self.settle()
        self.diagnostics.history.clear()
        stamps, latest_s = self.flood(tf_delay_s)
        after = self.settle()
        wait_until(lambda: stamps[-1] in self.map.stamps(), 2.0, "the map of the last scan")

        def worst_s(stage, key):
            return 1e-3 * max(float(status[key]) for name, status in self.diagnostics.history
                              if name == stage and key in status)
        work_s = {stage: worst_s(stage, "processing p99 [ms]") for stage in STAGES}
        latency_s = worst_s("mapping", "latency p99 [ms]")
        age_s = worst_s("mapping", "age p99 [ms]")
        mapped = [stamp for stamp in self.map.stamps() if stamp >= stamps[0]]
        gaps_s = [(b - a).to_sec() for a, b in zip([stamps[0]] + mapped, mapped)]
        rate_hz = (len(stamps) - 1) / (stamps[-1] - stamps[0]).to_sec()
        print(f"{len(stamps)} scans at {rate_hz:.0f} Hz, {len(mapped)} mapped; transforms {latest_s:.3f} s late; worst "
              f"processing {work_s}, latency {latency_s:.3f} s, age {age_s:.3f} s, gap {max(gaps_s):.3f} s; dropped {after}",
              file=sys.stderr)

        self.assertGreater(rate_hz * work_s["detection"], 2.0, "this is no flood")
        self.assertGreater(after["detection"].get("dropped: overtaken", 0),
                           before["detection"].get("dropped: overtaken", 0))
        # At each stage a scan waits for the one being processed, and then takes as long itself.
        bound_s = 2.0 * sum(work_s.values()) + latest_s + SLACK_S
        self.assertLess(latency_s, bound_s, "from the arrival of a scan to its map")
        self.assertLess(age_s, bound_s, "from the stamp of a scan to its map")
        self.assertLess(max(gaps_s), bound_s, "from one map to the next")

    def test_1_flood(self):
        self.check_flood(tf_delay_s=0.0)

    def test_2_flood_with_transforms_later_than_the_queue_is_long(self):
        self.check_flood(tf_delay_s=0.1)

    def test_3_at_20_hz_nothing_is_dropped(self):
        before = self.settle()
        stamps = []
        for _ in range(60):
            msg = scan_msg(rospy.Time.now())
            stamps.append(msg.header.stamp)
            self.send(msg, stamps[-1:])
            time.sleep(PERIOD_S)
        self.assertEqual(self.settle(), before)
        self.assertEqual(self.map.stamps()[-len(stamps):], stamps)

    def test_4_transforms_in_batches_cost_no_scan(self):
        """Five scans get their transforms at the same time, five times as late as they come. All five are to be detected
        within one period: at 20 Hz that leaves 10 ms for each, which is not enough on a busy machine."""
        before = self.settle()
        stamps = []
        for i in range(30):
            msg = scan_msg(rospy.Time.now())
            stamps.append(msg.header.stamp)
            self.send(msg, stamps[-5:] if i % 5 == 4 else [])
            time.sleep(4.0 * PERIOD_S)
        self.assertEqual(self.settle(), before)
        self.assertEqual(self.map.stamps()[-len(stamps):], stamps)


if __name__ == "__main__":
    rospy.init_node("flood_test")
    rostest.rosrun("situation_awareness", "flood_test", FloodTest)
