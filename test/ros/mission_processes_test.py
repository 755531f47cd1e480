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
import xmlrpc.client

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from fault_record import cell  # noqa: E402
from master_restart_test import ROOT, MasterTest, wait_until  # noqa: E402

MANAGER = "/mission_manager"
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
import math, sys, threading, time
import rospy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from situation_awareness.msg import MissionStatus, ScoutStatus, SplinegonArray, TargetArray
from tf2_msgs.msg import TFMessage
sys.path.insert(0, sys.argv[1])
from ros_support import transform_msg
rospy.init_node(sys.argv[2], disable_signals=True)
lock = threading.Lock()
def say(*words):
    with lock:
        print(time.monotonic(), *words, flush=True)
rospy.Subscriber("cmd_vel", Twist, lambda msg: say("cmd", msg.linear.x, msg.angular.z))
rospy.Subscriber("go_to", PoseStamped, lambda msg: say("go_to", msg.pose.position.x, msg.pose.position.y))
rospy.Subscriber("scout", ScoutStatus, lambda msg: say("scout", msg.state, msg.elapsed))
rospy.Subscriber("mission", MissionStatus, lambda msg: say("mission", msg.state))
out = {kind: rospy.Publisher(topic, kind, queue_size=10) for topic, kind in (
    ("odometry", Odometry), ("scan", LaserScan), ("splinegons", SplinegonArray), ("targets", TargetArray))}
tf = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
tf.publish(transform_msg(rospy.Time.now(), parent="base_link"))
begin = time.monotonic()
while True:
    since = time.monotonic() - begin
    now = rospy.Time.now()
    for kind, publisher in out.items():
        msg = kind()
        msg.header.stamp, msg.header.frame_id = now, "map"
        if kind is LaserScan:
            msg.header.frame_id, msg.angle_min, msg.angle_increment = "lidar", -math.pi, math.pi / 180
            msg.range_min, msg.range_max, msg.ranges = 0.1, 30.0, [math.inf] * 361
        if kind is Odometry:
            msg.child_frame_id = "base_link"
            angle = 0.5 * since
            msg.pose.pose.position.x, msg.pose.pose.position.y = 10 * math.sin(angle), 10 - 10 * math.cos(angle)
            msg.pose.pose.position.z = 25.0
            msg.pose.pose.orientation.z, msg.pose.pose.orientation.w = math.sin(angle / 2), math.cos(angle / 2)
            msg.twist.twist.linear.x = 5.0
            say("pose", msg.pose.pose.position.x, msg.pose.pose.position.y)
        publisher.publish(msg)
    time.sleep(0.1)
"""

GO_HOME = """
import rospy
from std_srvs.srv import Trigger
rospy.init_node("go_home", anonymous=True)
assert rospy.ServiceProxy("/scout/go_home", Trigger)().success
"""


class MissionProcessesTest(MasterTest):
    """Each test says what both missions do."""

    def start_missions(self):
        config = pathlib.Path(self.folder.name) / "missions.yaml"
        config.write_text(PARAMS)
        return self.start("launch", ["roslaunch", "--wait", str(ROOT / "launch/stages.launch"),
                                     "stages:=circumnavigate scout", "manager:=mission_manager", f"config:={config}"])

    def start_vehicles(self):
        return self.start("vehicles", ["/usr/bin/python3", "-c", VEHICLES, str(ROOT / "test/ros"), "vehicles"])

    def told(self, kind, since=0.0):
        """(time, numbers) of all that was told."""
        path = self.log("vehicles")
        lines = [line.split() for line in path.read_text().splitlines()] if path.exists() else []
        told = [(float(line[0]), *map(float, line[2:])) for line in lines if len(line) > 2 and line[1] == kind]
        return [one for one in told if one[0] > since]

    def wait_for_flight(self):
        since = time.monotonic()
        wait_until(lambda: any(one[1] > 0.0 for one in self.told("cmd", since)), "a mission")
        wait_until(lambda: len(self.told("go_to", since)) > 10, "a scouting mission")

    def fly(self):
        self.start_vehicles()
        self.start_missions()
        self.wait_for_flight()

    def pid(self):
        uri = self.server.lookupNode("/test", MANAGER)[2]
        return xmlrpc.client.ServerProxy(uri).getPid("/test")[2]

    def assert_silent(self, since, until):
        """Nobody is told anything, but for what was under way."""
        for kind in ("cmd", "go_to"):
            self.assertEqual([one for one in self.told(kind, since + 0.2) if one[0] < until], [])

    def assert_told(self, seconds):
        """Both are told something, again and again."""
        since = time.monotonic()
        wait_until(lambda: time.monotonic() > since + seconds, "time")
        for kind in ("cmd", "go_to"):
            times = [since, *(one[0] for one in self.told(kind, since))]
            self.assertGreater(times[-1], since + seconds - 2.0)
            self.assertLess(max(after - before for before, after in zip(times, times[1:])), 2.0, kind)

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
        self.fly()
        status, begin = self.told("scout")[-1], self.told("pose")
        at = status[0] - status[2]
        self.home = min(begin, key=lambda pose: abs(pose[0] - at))[1:]
        self.pid_before = self.pid()
        return status

    def test_manager_that_never_came(self):
        with cell("circumnavigate", "manager", "never came", "no command: the autopilot has to circle by itself"), \
                cell("scout", "manager", "never came", "nothing is told: the autopilot holds"):
            self.start_vehicles()
            wait_until(lambda: len(self.told("pose")) > 30, "the vehicles")
            self.assert_silent(0.0, time.monotonic())

    def test_manager_that_stops(self):
        with cell("circumnavigate", "manager", "stopped", "no command: the autopilot has to circle by itself; then on"), \
                cell("scout", "manager", "stopped", "nothing is told: the autopilot holds its last goal; then on"):
            before = self.fly_far()
            os.kill(self.pid_before, signal.SIGSTOP)
            since = time.monotonic()
            wait_until(lambda: time.monotonic() > since + 3.0, "time")
            self.assert_silent(since, time.monotonic())
            os.kill(self.pid_before, signal.SIGCONT)
            self.wait_for_flight()
            self.assert_home_stays(before)

    def test_manager_that_is_killed(self):
        for name, number in (("killed", signal.SIGKILL), ("restarted", signal.SIGTERM)):
            with cell("circumnavigate", "manager", name, "no command until the respawn, within 10 s: the autopilot has to "
                      "circle by itself; then the search anew, with the first start as the place known to be free"), \
                    cell("scout", "manager", name, "nothing is told until the respawn: the autopilot holds its last goal; "
                         "then home is where it was, and the budget went on"):
                before = self.fly_far()
                os.kill(self.pid_before, number)
                since = time.monotonic()
                self.wait_for_flight()
                self.assertLess(time.monotonic(), since + 30.0)
                self.assert_home_stays(before)
            self.tearDown()
            self.setUp()

    def test_master(self):
        with cell("circumnavigate", "master", "never came", "does not start: the autopilot has to circle by itself"), \
                cell("scout", "master", "never came", "does not start: the autopilot holds"):
            self.end(self.master)
            launch = self.start_missions()
            since = time.monotonic()
            wait_until(lambda: time.monotonic() > since + 3.0, "time")
            self.assertIsNone(launch.poll())
            self.assertEqual(self.told("cmd") + self.told("go_to"), [])
            self.master = self.start_master()
        on = "missions go on over existing connections"
        self.start_vehicles()
        self.wait_for_flight()
        with cell("circumnavigate", "master", "stopped", on), cell("scout", "master", "stopped", on):
            self.master.send_signal(signal.SIGSTOP)
            self.assert_told(6.0)
            self.master.send_signal(signal.SIGCONT)
            self.assert_told(2.0)
        with cell("circumnavigate", "master", "killed", on), cell("scout", "master", "killed", on):
            self.end(self.master)
            self.assert_told(6.0)
        with cell("circumnavigate", "master", "restarted", on), cell("scout", "master", "restarted", on):
            self.master = self.start_master()
            self.assert_told(6.0)


if __name__ == "__main__":
    unittest.main()
