#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Missions whose manager or master ends or stands still in flight: what the vehicles are told, and that home is where it
was. Needs masters of its own, so this is no rostest."""
import math
import os
import pathlib
import signal
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from master_restart_test import wait_until  # noqa: E402
from process_faults import ProcessesTest  # noqa: E402

PARAMS = """
world_frame: map
search: [[600, 0]]
scouting:
  {routes: 3, changes: 5, budget_s: 500.0,
   region: {x_min_world_m: -50.0, x_max_world_m: 50.0, y_min_world_m: -50.0, y_max_world_m: 50.0}}
"""

# Two vehicles that fly: one circles from (0, 0) to (20, 20), one is at home at first and then elsewhere. All that their
# missions need at 10 Hz, and a line for each thing that they are told.
VEHICLES = """
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from situation_awareness.msg import MapUpdate, MissionStatus, ScoutStatus, TargetArray
from tf2_msgs.msg import TFMessage
from ros_support import transform_msg
rospy.Subscriber("go_to", PoseStamped, lambda msg: say("go_to", msg.pose.position.x, msg.pose.position.y))
rospy.Subscriber("scout", ScoutStatus, lambda msg: say("scout", msg.state, msg.elapsed, msg.header.stamp.to_sec()))
rospy.Subscriber("mission", MissionStatus, lambda msg: say("mission", msg.state))
out = {kind: rospy.Publisher(topic, kind, queue_size=10) for topic, kind in (
    ("odometry", Odometry), ("scan", LaserScan), ("semantic_map/updates", MapUpdate),
    ("targets", TargetArray))}
tf = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
tf.publish(transform_msg(rospy.Time.now(), parent="base_link"))
begin = time.monotonic()
version = 0
while True:
    since = time.monotonic() - begin
    now = rospy.Time.now()
    for kind, publisher in out.items():
        msg = kind()
        msg.header.stamp, msg.header.frame_id = now, "map"
        if kind is LaserScan:
            msg.header.frame_id, msg.angle_min, msg.angle_increment = "lidar", -math.pi, math.pi / 180
            msg.range_min, msg.range_max, msg.ranges = 0.1, 30.0, [math.inf] * 361
        if kind is MapUpdate:
            version += 1
            msg.map, msg.version, msg.full = "empty", version, True
        if kind is Odometry:
            msg.child_frame_id = "base_link"
            angle = 0.5 * since
            msg.pose.pose.position.x, msg.pose.pose.position.y = 10 * math.sin(angle), 10 - 10 * math.cos(angle)
            msg.pose.pose.position.z = 25.0
            msg.pose.pose.orientation.z, msg.pose.pose.orientation.w = math.sin(angle / 2), math.cos(angle / 2)
            msg.twist.twist.linear.x = 5.0
            say("pose", msg.pose.pose.position.x, msg.pose.pose.position.y, now.to_sec())
        publisher.publish(msg)
    time.sleep(0.1)
"""

GO_HOME = """
import rospy
from std_srvs.srv import Trigger
rospy.init_node("go_home", anonymous=True)
assert rospy.ServiceProxy("/scout/go_home", Trigger)().success
"""


class MissionProcessesTest(ProcessesTest):
    """Each test says what both missions do."""

    stages = ("circumnavigate", "scout")
    manager = "/mission_manager"
    params = PARAMS
    program = VEHICLES
    kinds = ("cmd", "go_to")

    def wait_until_it_goes(self):
        since = time.monotonic()
        wait_until(lambda: any(one[1] > 0.0 for one in self.told("cmd", since)), "a mission")
        wait_until(lambda: len(self.told("go_to", since)) > 10, "a scouting mission")

    def assert_home_stays(self, before):
        """The scouting mission is the one that ran at `before`, a status: its budget went on, and it comes home."""
        now = self.told("scout")[-1]
        self.assertGreater(now[2], before[2] + (now[0] - before[0]) - 3.0)
        process = self.start("go_home", ["/usr/bin/python3", "-c", GO_HOME])
        wait_until(lambda: process.poll() == 0, "going home")
        first = self.told("go_to")[-1]
        wait_until(lambda: self.told("go_to")[-1][0] > first[0] + 1.0, "the way home")
        _, x, y = self.told("go_to")[-1]
        self.assertLess(math.hypot(x - self.home[0], y - self.home[1]), 0.5)

    def fly_far(self):
        """Home is where the vehicle is when the mission begins; it flies on from there."""
        self.set_off()
        status = self.told("scout")[-1]
        began_s = status[3] - status[2]  # by stamps
        self.home = min(self.told("pose"), key=lambda pose: abs(pose[3] - began_s))[1:3]
        self.pid_before = self.pid()
        return status

    def test_manager_that_never_came(self):
        self.check_manager_that_never_came("no command: the autopilot has to circle by itself",
                                           "nothing is told: the autopilot holds")

    def test_manager_that_stops(self):
        with self.cells("manager", "stopped", "no command: the autopilot has to circle by itself; then on",
                        "nothing is told: the autopilot holds its last goal; then on"):
            before = self.fly_far()
            with self.stopped_manager():
                pass
            self.wait_until_it_goes()
            self.assert_home_stays(before)

    def test_manager_that_is_killed(self):
        for name, number in (("killed", signal.SIGKILL), ("restarted", signal.SIGTERM)):
            with self.cells("manager", name, "no command until the respawn, within 10 s: the autopilot has to circle by "
                            "itself; then the search anew, with the first start as the place known to be free",
                            "nothing is told until the respawn: the autopilot holds its last goal; then home is where "
                            "it was, and the budget went on"):
                before = self.fly_far()
                os.kill(self.pid_before, number)
                since = time.monotonic()
                self.wait_until_it_goes()
                self.assertLess(time.monotonic(), since + 30.0)
                self.assert_home_stays(before)
            self.tearDown()
            self.setUp()

    def test_master(self):
        self.check_master(("does not start: the autopilot has to circle by itself",
                           "does not start: the autopilot holds"), "missions go on over existing connections")


if __name__ == "__main__":
    unittest.main()
