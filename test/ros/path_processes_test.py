#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A vehicle on a path whose manager or master ends or stands still while it drives. What it does when the manager is
killed or terminated is in path_crash_test and path_test. Needs masters of its own, so this is no rostest."""
import math
import pathlib
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from master_restart_test import wait_until  # noqa: E402
from process_faults import ProcessesTest  # noqa: E402

RADIUS_M = 2.5
# Round and round, so that it does not arrive.
PATH = "closed: true\npath:\n" + "".join(
    f"  - {{x: {RADIUS_M * math.cos(0.25 * math.pi * i):.4f}, y: {RADIUS_M * math.sin(0.25 * math.pi * i):.4f}}}\n"
    for i in range(8))

# It stands when it was not told anything for half a second, as a base with a watchdog.
VEHICLE = """
from path_test import Vehicle, box
from situation_awareness.msg import SafetyVerdict
rospy.Subscriber("safety", SafetyVerdict, lambda msg: say("verdict", msg.allowed_speed_m_s))
vehicle = Vehicle()
vehicle.edges, vehicle.watchdog_s = box(0.0, 0.0, 5.0), 0.5
vehicle.place(2.5, 0.0, 0.5 * math.pi)
while True:
    say("pose", vehicle.x, vehicle.y)
    time.sleep(0.1)
"""


class PathProcessesTest(ProcessesTest):
    stages = ("safety_areas", "path_following")
    manager = "/path_manager"
    program = VEHICLE
    kinds = ("cmd", "verdict")

    def setUp(self):
        super().setUp()
        with tempfile.NamedTemporaryFile("w", dir=self.folder.name, suffix=".yaml", delete=False) as path:
            path.write(PATH)
        self.params = f"""
world_frame: map
path_file: {path.name}
tf_timeout_s: 1.0
start_at_once: true
vehicle: {{acceleration_m_s2: 1.0}}
"""

    def wait_until_it_goes(self):
        since = time.monotonic()
        wait_until(lambda: any(one[1] > 0.3 for one in self.told("cmd", since)), "the vehicle to drive")

    def assert_told(self, seconds):
        """And drives meanwhile."""
        super().assert_told(seconds)
        self.wait_until_it_goes()

    def test_manager_that_never_came(self):
        self.check_manager_that_never_came("no verdict: the vehicle stands", "no command: the vehicle stands")
        self.assertEqual({one[1:] for one in self.told("pose")}, {(RADIUS_M, 0.0)})

    def test_manager_that_stops(self):
        with self.cells("manager", "stopped", "no verdict; then on",
                        "no command: the base's watchdog stops the vehicle; then on"):
            self.set_off()
            with self.stopped_manager():
                places = [one[1:] for one in self.told("pose", time.monotonic() - 1.0)]
                self.assertGreater(len(places), 3)
                self.assertEqual(len(set(places)), 1, "it does not stand")
            self.wait_until_it_goes()

    def test_master(self):
        self.check_master(("does not start: the vehicle stands", "does not start: the vehicle stands"),
                          "the vehicle drives on over existing connections")


if __name__ == "__main__":
    unittest.main()
