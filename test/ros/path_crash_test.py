#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A vehicle that keeps its last command stands after a crash of path_following, and does not drive on by itself, though
the stage starts at once; and it stands while simulated time does."""
import os
import pathlib
import signal
import sys
import threading
import time
import unittest

import rospy
import rostest
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from fault_record import cell, fault  # noqa: E402
from path_test import Vehicle  # noqa: E402
from ros_support import Diagnostics, pid_of, wait_until  # noqa: E402

BACK_S = 20.0  # for the respawn and the first commands; some 5 s on a machine without other work
STANDS_S = 5.0


class SimulatedClock:
    """As fast as the steady one, while it runs."""

    def __init__(self):
        self.runs = True
        self.publisher = rospy.Publisher("/clock", Clock, queue_size=10)
        threading.Thread(target=self.run, daemon=True).start()

    def run(self):
        now, before = 100.0, time.monotonic()
        while not rospy.is_shutdown():
            steady = time.monotonic()
            if self.runs:
                now += steady - before
                self.publisher.publish(Clock(rospy.Time.from_sec(now)))
            before = steady
            time.sleep(0.01)


class PathCrashTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.clock = SimulatedClock()
        wait_until(lambda: rospy.Time.now() > rospy.Time(), 10.0, "simulated time")
        cls.vehicle, cls.diagnostics = Vehicle(), Diagnostics()

    @fault("manager killed while the vehicle drives", "SIGKILL", "zero commands as soon as the stage is back, and it waits "
           "for a call of ~start though it starts at once", times=1)
    def test_1_it_stands_after_a_crash(self):
        vehicle, diagnostics = self.vehicle, self.diagnostics
        wait_until(lambda: vehicle.speed > 0.15, 60.0, "the vehicle to drive at once")
        for stage, what in (("path_following", "the base's watchdog stops it; zero when it is back, until ~start"),
                            ("safety_areas", "no verdict until it is back")):
            with cell(stage, "manager", "killed", what):
                before = pid_of("/path_manager")
                os.kill(before, signal.SIGKILL)
                wait_until(lambda: not vehicle.commands or self.is_old(vehicle), 10.0, "no more commands")
                self.assertGreater(vehicle.speed, 0.0, "the last command stands")
                wait_until(vehicle.stands, BACK_S, "zero commands")
                count = len(vehicle.commands)
                wait_until(lambda: len(vehicle.commands) > count + int(STANDS_S / 0.5), 2 * STANDS_S, "more of them")
                self.assertTrue(all(c.linear.x == 0.0 and c.angular.z == 0.0 for c in vehicle.commands[count:]))
                wait_until(lambda: "~start" in diagnostics.stages["path_following"]["summary"], 5.0, "a warning")
                start = rospy.ServiceProxy("path_following/start", Trigger)
                start.wait_for_service(10.0)
                vehicle.x = vehicle.y = vehicle.yaw = 0.0
                self.assertTrue(start().success)
                wait_until(lambda: vehicle.speed > 0.15, 10.0, "the vehicle to drive when it is told to")

    @fault("simulated time stands", "/clock stops while the vehicle drives", "zero commands, by the steady clock, after "
           "path/timeout_s; it goes on with the time", times=1)
    def test_2_it_stands_while_time_does(self):
        wait_until(lambda: self.vehicle.speed > 0.15, 30.0, "the vehicle to drive")
        self.clock.runs = False
        wait_until(self.vehicle.stands, 5.0, "zero commands")
        count = len(self.vehicle.commands)
        wait_until(lambda: len(self.vehicle.commands) > count + 5, 5.0, "more of them")
        self.assertTrue(self.vehicle.stands())
        self.clock.runs = True
        wait_until(lambda: self.vehicle.speed > 0.15, 10.0, "the vehicle to drive on")

    @staticmethod
    def is_old(vehicle):
        count = len(vehicle.commands)
        time.sleep(0.3)
        return len(vehicle.commands) == count


if __name__ == "__main__":
    rospy.init_node("path_crash_test")
    rostest.rosrun("situation_awareness", "path_crash_test", PathCrashTest)
