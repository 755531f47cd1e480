#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Restarts: a bag that loops, and a killed manager. A static sensor needs no TF."""
import os
import pathlib
import signal
import sys
import time
import unittest

import rospy
import rostest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Latest, Robot, comes_true, pid_of, scan_msg, wait_until  # noqa: E402
from situation_awareness.msg import MappedObjectArray  # noqa: E402


class RestartTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.map = Latest("objects", MappedObjectArray)
        cls.robot = Robot(transforms=False)
        wait_until(lambda: cls.map.subscriber.get_num_connections() > 0, 60.0, "the mapping nodelet")
        time.sleep(1.0)

    def test_1_a_loop_starts_a_new_map(self):
        """Stamps of the past, as rosbag play --loop sends them."""
        for _ in range(2):
            for i in range(10):
                stamp = rospy.Time.from_sec(1.4e9 + 0.2 * i)
                self.robot.publish(scan_msg(stamp))
        wait_until(lambda: self.map.stamps().count(stamp) == 2, 5.0, "the second round")
        self.assertEqual(len(self.map.messages[-1].objects), 1)
        self.assertEqual(self.map.messages[-1].objects[0].observations, 10)

    def test_2_a_killed_manager_comes_back(self):
        os.kill(pid_of("/map_manager"), signal.SIGKILL)

        def maps_again():
            stamp = self.robot.run(1)[0]
            return comes_true(lambda: stamp in self.map.stamps(), 0.5)
        wait_until(maps_again, 60.0, "the manager and its nodelets to come back")


if __name__ == "__main__":
    rospy.init_node("restart_test")
    rostest.rosrun("situation_awareness", "restart_test", RestartTest)
