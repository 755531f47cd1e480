#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelet gps_ins on a recording of a Husky, where ../shared/data has it."""
import pathlib
import sys
import time
import unittest

import rosbag
import rospy
import rostest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, NavSatFix

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Diagnostics, Latest, wait_until  # noqa: E402

BAG = pathlib.Path(__file__).resolve().parents[3] / "shared" / "data" / "husky_gps_imu.bag"
TIMES_REAL_TIME = 20.0
AHEAD_S = 4.0  # of stamps, that the recording may be ahead of the odometry


@unittest.skipUnless(BAG.is_file(), f"{BAG} is not there")
class GpsInsRecordingTest(unittest.TestCase):
    def test_runs_to_the_end_consistently_and_names_an_imu_that_lies_on_its_side(self):
        diagnostics = Diagnostics()
        odometry = Latest("odometry", Odometry)
        imu = rospy.Publisher("/imu/data", Imu, queue_size=100000)
        fix = rospy.Publisher("/fix", NavSatFix, queue_size=100000)
        wait_until(lambda: imu.get_num_connections() == 2 and fix.get_num_connections() == 2, 60.0, "both nodelets")
        wait_until(lambda: odometry.subscriber.get_num_connections() == 1, 30.0, "the odometry")
        begin, wall = None, time.monotonic()
        with rosbag.Bag(str(BAG)) as bag:
            for topic, message, stamp in bag.read_messages(topics=["/imu/data", "/fix"]):
                begin = begin or stamp
                ahead_s = (stamp - begin).to_sec() / TIMES_REAL_TIME - (time.monotonic() - wall)
                if ahead_s > 0.01:
                    time.sleep(ahead_s)
                (imu if topic == "/imu/data" else fix).publish(message)
                if odometry.messages and (stamp - odometry.messages[-1].header.stamp).to_sec() > AHEAD_S:
                    # It comes up to the recording, or the Husky stood for too long to know the yaw.
                    wait_until(lambda at=stamp: (at - odometry.messages[-1].header.stamp).to_sec() < 0.5 * AHEAD_S or
                               "yaw is not known" in diagnostics.stages.get("gps_ins", {}).get("pose", ""),
                               10.0, "the odometry to come up to the recording")
        wait_until(lambda: (stamp - odometry.messages[-1].header.stamp).to_sec() < 0.1, 120.0, "the last sample")
        time.sleep(2.5)  # of reports

        status = diagnostics.stages["gps_ins"]
        self.assertEqual(status["pose"], "ready")
        self.assertEqual(diagnostics.count("gps_ins", "restarted after an imu gap"), 0)
        reports = [s for name, s in diagnostics.history if name == "gps_ins" and int(s.get("fix NIS matches", "0")) > 0]
        matches = sum(int(s["fix NIS matches"]) for s in reports)
        mean = sum(int(s["fix NIS matches"]) * float(s["fix NIS mean"]) for s in reports) / matches
        print(f"{matches} fixes, NIS {mean:.2f}")
        self.assertGreater(matches, 900)  # of 989
        self.assertGreater(mean, 0.6)
        self.assertLess(mean, 1.3)

        # It drives in loops on a level parking lot.
        path = [m.pose.pose.position for m in odometry.messages]
        self.assertLess(max(abs(p.x) for p in path) + max(abs(p.y) for p in path), 200.0)
        speeds = [m.twist.twist.linear for m in odometry.messages]
        self.assertLess(max(abs(v.x) for v in speeds), 2.0)
        self.assertLess(sorted(abs(v.y) for v in speeds)[len(speeds) // 2], 0.1)

        askew = diagnostics.stages["askew/gps_ins"]
        self.assertIn("gravity is not along the base's z", askew["pose"])


if __name__ == "__main__":
    rospy.init_node("gps_ins_recording_test")
    rostest.rosrun("situation_awareness", "gps_ins_recording_test", GpsInsRecordingTest)
