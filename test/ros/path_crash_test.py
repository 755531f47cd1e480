#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A vehicle that keeps its last command stands after a crash of path_following, and does not drive on by itself, though
the stage starts at once; and it stands while simulated time does."""
import os
import pathlib
import signal
import sys
import time
import unittest

import rospy
import rostest
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from fault_record import cell, fault  # noqa: E402
from path_test import Vehicle  # noqa: E402
from ros_support import Diagnostics, pid_of, run_beside, wait_until  # noqa: E402

BACK_S = 60.0  # for the respawn and the first commands; some 5 s on a machine without other work
SOON_S = 30.0  # for what takes a second or two
STANDS_S = 5.0


class SimulatedClock:
    """As fast as the steady one, while it runs."""

    def __init__(self):
        self.runs = True
        self.publisher = rospy.Publisher("/clock", Clock, queue_size=10)
        run_beside(self.run)

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
        wait_until(lambda: rospy.Time.now() > rospy.Time(), SOON_S, "simulated time")
        cls.vehicle, cls.diagnostics = Vehicle(), Diagnostics()

    def wait_until_it_drives(self):
        wait_until(lambda: self.vehicle.speed > 0.15, SOON_S, "the vehicle to drive")

    def start(self):
        """From the begin of its path, when it is told to."""
        start = rospy.ServiceProxy("path_following/start", Trigger)
        start.wait_for_service(BACK_S)
        self.vehicle.place(0.0, 0.0)
        self.assertTrue(start().success)
        self.wait_until_it_drives()

    @fault("manager killed while the vehicle drives", "SIGKILL", "zero commands as soon as the stage is back, and it waits "
           "for a call of ~start though it starts at once", times=1)
    def test_1_it_stands_after_a_crash(self):
        vehicle, diagnostics = self.vehicle, self.diagnostics
        wait_until(lambda: vehicle.commands, BACK_S, "the first command")
        self.wait_until_it_drives()
        for stage, what in (("path_following", "the base's watchdog stops it; zero when it is back, until ~start"),
                            ("safety_areas", "no verdict until it is back")):
            with cell(stage, "manager", "killed", what):
                manager = pid_of("/path_manager")
                self.wait_until_it_drives()
                count = len(vehicle.commands)
                os.kill(manager, signal.SIGKILL)
                wait_until(lambda: vehicle.stands() and len(vehicle.commands) > count, BACK_S, "zero commands")
                back = next(i for i in range(count, len(vehicle.commands)) if vehicle.commands[i].linear.x == 0.0)
                self.assertGreater(vehicle.commands[back - 1].linear.x, 0.0, "the last command stood")
                until = time.monotonic() + STANDS_S
                wait_until(lambda: time.monotonic() > until and len(vehicle.commands) > back + int(STANDS_S / 0.5),
                           SOON_S, "more of them")
                self.assertTrue(all(c.linear.x == 0.0 and c.angular.z == 0.0 for c in vehicle.commands[back:]))
                wait_until(lambda: "~start" in diagnostics.summary("path_following"), SOON_S, "a warning")
                self.start()

    @fault("simulated time stands", "/clock stops while the vehicle drives", "zero commands, by the steady clock, after "
           "path/timeout_s; it goes on with the time", times=1)
    def test_2_it_stands_while_time_does(self):
        self.start()
        self.clock.runs = False
        try:
            wait_until(self.vehicle.stands, SOON_S, "zero commands")
            count = len(self.vehicle.commands)
            wait_until(lambda: len(self.vehicle.commands) > count + 5, SOON_S, "more of them")
            self.assertTrue(self.vehicle.stands())
        finally:
            self.clock.runs = True
        self.wait_until_it_drives()


if __name__ == "__main__":
    rospy.init_node("path_crash_test")
    rostest.rosrun("situation_awareness", "path_crash_test", PathCrashTest)
