#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelet circumnavigate leads a vehicle to a place and around a boundary until that is closed, drops messages
that cannot be used, holds where what it needs is missing, and answers plan_dubins."""
import contextlib
import math
import pathlib
import subprocess
import sys
import unittest

import rospy
import rostest
from geometry_msgs.msg import Pose2D, Twist
from nav_msgs.msg import Odometry, Path
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from fault_record import cell, fault  # noqa: E402
from mission_faults import (cells_of, common, ellipse_feature, map_update, numbers, outline_feature,  # noqa: E402
                            set_number)
from ros_support import Diagnostics, Latest, comes_true, transform_msg, wait_until  # noqa: E402
from situation_awareness.msg import MapUpdate, MissionStatus  # noqa: E402
from situation_awareness.srv import PlanDubins  # noqa: E402

STAGE = "circumnavigate"
SPEED, PERIOD = 5.0, 0.1


def square(boundary_id, closed, sigma):
    """A box of 10 m around (60, 0): main vertices at the corners, joints between them; open: three of its sides."""
    corners = [(65, -5), (65, 5), (55, 5), (55, -5)]
    points = []
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1]):
        points += [(ax, ay), (0.5 * (ax + bx), 0.5 * (ay + by))]
    if not closed:
        del points[7:]
    return outline_feature(boundary_id, points, sigma, closed, bulge=[0.0] * len(points))


class CircumnavigateTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.diagnostics = Diagnostics()
        cls.status = Latest("mission", MissionStatus)
        cls.command = Latest("cmd_vel", Twist)
        cls.path = Latest("path", Path)
        cls.markers = Latest("mission_markers", MarkerArray)
        cls.odometry = rospy.Publisher("odometry", Odometry, queue_size=100, tcp_nodelay=True)
        cls.maps = rospy.Publisher("semantic_map/updates", MapUpdate, queue_size=10, tcp_nodelay=True)
        cls.scans = rospy.Publisher("scan", LaserScan, queue_size=10, tcp_nodelay=True)
        cls.clock = rospy.Publisher("/clock", Clock, queue_size=10, tcp_nodelay=True)
        cls.start = rospy.ServiceProxy("circumnavigate/start", Trigger)
        cls.tf_static = rospy.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        cls.tf_static.publish(transform_msg(rospy.Time(1), parent="base_link"))
        cls.plan = rospy.ServiceProxy("plan_dubins", PlanDubins)
        cls.plan.wait_for_service(60.0)
        wait_until(lambda: all(link.get_num_connections() > 0 for link in (
            cls.odometry, cls.maps, cls.scans, cls.clock, cls.tf_static, cls.status.subscriber,
            cls.command.subscriber)),
                   60.0, "the nodelet")
        cls.x = cls.y = cls.yaw = 0.0
        cls.t = 10000.0
        cls.boundaries = []
        cls.version = 0

    def odometry_msg(self):
        msg = Odometry(child_frame_id="base_link")
        msg.header.frame_id = "map"
        msg.header.stamp = rospy.Time.from_sec(self.t)
        msg.pose.pose.position.x, msg.pose.pose.position.y = self.x, self.y
        msg.pose.pose.orientation.z, msg.pose.pose.orientation.w = math.sin(self.yaw / 2), math.cos(self.yaw / 2)
        msg.twist.twist.linear.x = SPEED
        for i in range(6):
            msg.pose.covariance[7 * i] = msg.twist.covariance[7 * i] = 1e-4
        return msg

    def scan_msg(self):
        """Sees 30 m all around, and the box, if there is one."""
        scan = LaserScan(angle_min=-math.pi, angle_max=math.pi, angle_increment=math.pi / 180, range_min=0.1,
                         range_max=30.0)
        for i in range(361):
            angle = self.yaw + scan.angle_min + i * scan.angle_increment
            scan.ranges.append(self.range_to_box(math.cos(angle), math.sin(angle)) if self.boundaries else math.inf)
        scan.header.frame_id, scan.header.stamp = "lidar", rospy.Time.from_sec(self.t)
        return scan

    def range_to_box(self, ux, uy):
        """Along a direction, to the box of square(); where the sides' slabs overlap."""
        near, far = 0.0, math.inf
        for u, p, low, high in ((ux, self.x, 55.0, 65.0), (uy, self.y, -5.0, 5.0)):
            if abs(u) < 1e-9:
                if not low < p < high:
                    return math.inf
                continue
            ends = sorted(((low - p) / u, (high - p) / u))
            near, far = max(near, ends[0]), min(far, ends[1])
        return near if near < far else math.inf

    def map_msg(self, *features, frame="map"):
        type(self).version += 1
        return map_update(rospy.Time.from_sec(self.t), self.version, features, frame)

    def send(self, spoil=None):
        """All inputs of a step, but for what `spoil` makes of them, by name; what was published."""
        type(self).t += PERIOD
        self.clock.publish(Clock(rospy.Time.from_sec(self.t)))
        messages = {"scan": (self.scans, self.scan_msg()), "map": (self.maps, self.map_msg(*self.boundaries))}
        messages["odometry"] = (self.odometry, self.odometry_msg())
        sent = []
        for name, (publisher, msg) in messages.items():
            msg = (spoil or {}).get(name, lambda msg: msg)(msg)
            if msg is not None:
                publisher.publish(msg)
                sent.append((publisher, msg))
        return sent

    def send_until_used(self, spoil=None):
        """The inputs of a step: what comes before the clock of its time is dropped, as of another time."""
        sent = self.send(spoil)
        stamp = rospy.Time.from_sec(self.t)
        for _ in range(20):
            if comes_true(lambda: self.status.messages and self.status.messages[-1].header.stamp == stamp, 0.5):
                return
            for publisher, msg in sent:
                publisher.publish(msg)
        self.fail("no step")

    def move(self, turn_rate):
        cls = type(self)
        cls.yaw += turn_rate * PERIOD
        cls.x += SPEED * PERIOD * math.cos(self.yaw)
        cls.y += SPEED * PERIOD * math.sin(self.yaw)

    def step(self):
        """One step, in which the vehicle does as it is told."""
        self.send_until_used()
        status = self.status.messages[-1]
        self.assertLessEqual(abs(status.curvature), 1.0 / 6.0 + 1e-12)
        self.move(status.curvature * SPEED)
        return status

    def step_until(self, state, steps=100):
        for _ in range(steps):
            status = self.step()
            if status.state == state:
                return status
        self.fail(status.reason)

    def count(self, key):
        return self.diagnostics.count(f"/{STAGE}", key) + self.diagnostics.count(STAGE, key)

    def counts(self, key, act):
        """Does `act`, which must be counted."""
        before = self.count(key)
        act()
        wait_until(lambda: self.count(key) > before, 20.0, key)

    def set_map(self, *boundaries):
        """Published from now on."""
        type(self).boundaries = boundaries

    def test_1_plans_dubins_paths(self):
        answer = self.plan(start=Pose2D(0, 0, 0), goal=Pose2D(10, 0, 0), start_radius=2.0, goal_radius=3.0, step=0.5,
                           frame_id="map")
        self.assertTrue(answer.success, answer.message)
        self.assertAlmostEqual(answer.length, 10.0, 9)
        self.assertEqual(len(answer.poses), 21)
        self.assertEqual(answer.header.frame_id, "map")
        self.assertAlmostEqual(answer.poses[-1].pose.position.x, 10.0, 9)
        # Half a turn to the left, with the heading at its end free: straight to a point beside is longer.
        answer = self.plan(start=Pose2D(0, 0, 0), goal=Pose2D(0, 4, math.pi), start_radius=2.0, goal_radius=2.0)
        self.assertAlmostEqual(answer.length, 2.0 * math.pi, 9)
        free = self.plan(start=Pose2D(0, 0, 0), goal=Pose2D(0, 4, 1.0), start_radius=2.0, goal_radius=2.0,
                         goal_heading_is_free=True)
        self.assertLessEqual(free.length, answer.length + 1e-9)
        for bad in ({"max_curvature": 1.0}, {"max_curvature": -1.0}, {"step": -1.0}):
            refused = self.plan(start=Pose2D(0, 0, 0), goal=Pose2D(10, 0, 0), start_radius=0.5, goal_radius=2.0, **bad)
            self.assertFalse(refused.success)
            self.assertTrue(refused.message)
        self.assertFalse(self.plan(start=Pose2D(math.nan, 0, 0), goal=Pose2D(10, 0, 0), start_radius=1.0,
                                   goal_radius=2.0).success)

    def test_2_goes_around_what_it_finds(self):
        # A turn before there is odometry.
        with cell("circumnavigate", "odometry", "never came", "turns with lost_turn_rate_rad_s"), \
                cell("circumnavigate", "parameters", "never came", "the defaults: starts"):
            wait_until(lambda: self.command.messages, 20.0, "a command")
            self.assertEqual((self.command.messages[-1].linear.x, self.command.messages[-1].angular.z), (0.0, 0.45))
        status = self.step_until(MissionStatus.SEARCH, 20)
        self.assertEqual(status.reason, "on the way to place 1 of 1")
        self.set_map(square(5, False, 0.1))
        states = set()
        for _ in range(150):
            status = self.step()
            states.add(status.state)
        self.assertIn(MissionStatus.AROUND, states)
        self.assertEqual(status.target, 5)
        self.assertEqual(status.reason, "boundary 5 is open")
        self.assertGreater(status.clearance, 3.0)
        self.set_map(square(5, True, 0.1))
        # Done when it stays so for 3 s; its place of the search is within the boundary.
        for _ in range(20):
            status = self.step()
        self.assertEqual(status.state, MissionStatus.AROUND, status.reason)
        for _ in range(15):
            status = self.step()
        self.assertEqual(status.state, MissionStatus.DONE, status.reason)
        self.assertEqual(status.done, 1)
        self.assertGreater(max(len(path.poses) for path in self.path.messages), 10)
        wait_until(lambda: self.markers.messages, 20.0, "markers")
        self.assertEqual({marker.ns for marker in self.markers.messages[-1].markers},
                         {"path", "way_out", "orbit", "clearance", "clearance_text"})
        def commands():
            return [command for command in self.command.messages if command.linear.x > 0.0]

        wait_until(lambda: len(commands()) == len(self.status.messages), 20.0, "a command for each step")
        for command, told in zip(commands(), self.status.messages):
            self.assertAlmostEqual(command.linear.x, SPEED, 12)
            self.assertAlmostEqual(command.angular.z, told.curvature * SPEED, 12)

    @fault("odometry that cannot be used", "NaN in pose, twist or covariance, a negative variance, no rotation, another "
           "frame or child frame, stamps of zero, that repeat or go back", "each is dropped by its reason; the mission "
           "goes on", times=10)
    def test_3_drops_odometry_that_cannot_be_used(self):
        def spoilt(spoil):
            msg = self.odometry_msg()
            msg.header.stamp += rospy.Duration(0.01)
            spoil(msg)
            return lambda: self.odometry.publish(msg)

        def covariance(value):
            return lambda msg: msg.pose.covariance.__setitem__(7, value)

        self.step()
        before = self.status.messages[-1].header.stamp
        for key, spoil in (
                ("odometry not a finite pose", lambda msg: setattr(msg.pose.pose.position, "x", math.nan)),
                ("odometry not a finite pose", lambda msg: setattr(msg.pose.pose.orientation, "w", 7.0)),
                ("bad message", lambda msg: setattr(msg.twist.twist.linear, "y", math.inf)),
                ("bad message", covariance(math.nan)), ("bad message", covariance(-1.0)),
                ("odometry of other frames", lambda msg: setattr(msg.header, "frame_id", "elsewhere")),
                ("odometry of other frames", lambda msg: setattr(msg, "child_frame_id", "wheel")),
                ("odometry with a stamp of zero", lambda msg: setattr(msg.header, "stamp", rospy.Time())),
                ("stamp repeats or goes back", lambda msg: setattr(msg.header, "stamp", before)),
                ("stamp repeats or goes back",
                 lambda msg: setattr(msg.header, "stamp", before - rospy.Duration(0.5)))):
            self.counts(f"dropped: {key}", spoilt(spoil))
        self.assertEqual(self.status.messages[-1].header.stamp, before)
        self.assertEqual(self.step().done, 1)

    @fault("maps that cannot be used", "a map in another frame, a boundary with NaN, an update of a version that is not "
           "known", "each is counted by its reason; the map before counts on", times=3)
    def test_4_drops_maps_that_cannot_be_used(self):
        self.counts("dropped: bad map", lambda: self.maps.publish(self.map_msg(frame="elsewhere")))
        self.counts("dropped: bad map", lambda: self.maps.publish(self.map_msg(square(9, True, math.nan))))

        def missed():
            msg = self.map_msg()
            msg.full, msg.base = False, self.version + 7
            self.maps.publish(msg)

        self.counts("updates of a map that is not known", missed)
        self.assertEqual(self.step().done, 1)

    @fault("scans that cannot be used", "no beam, a stamp without odometry, one 5 s ahead, no mounting in TF",
           "each is counted by its reason; the mission goes on", times=4)
    def test_5_drops_scans_that_cannot_be_used(self):
        def scan(frame="lidar", late_s=0.0, beams=361):
            msg = LaserScan(angle_min=-math.pi, angle_max=math.pi, angle_increment=math.pi / 180, range_min=0.1,
                            range_max=30.0, ranges=[math.inf] * beams)
            msg.header.frame_id = frame
            msg.header.stamp = rospy.Time.from_sec(self.t + late_s)
            return lambda: self.scans.publish(msg)

        self.step()
        self.counts("scans not used: no transform", scan(frame="nowhere"))
        self.counts("scans not used: no odometry", scan(late_s=0.3))
        self.counts("scans not used: of another time", scan(late_s=5.0))
        self.counts("scans not used: bad scan: empty scan", scan(beams=0))
        self.assertEqual(self.step().done, 1)

    @fault("time is reset", "stamps 500 s back", "the mission goes on, with all that it knows: it holds until maps come")
    def test_6_goes_on_when_time_is_reset(self):
        done = self.step().done
        type(self).t -= 500.0
        self.counts("time jumped back: the mission goes on", lambda: [self.send() for _ in range(20)])
        status = self.step_until(MissionStatus.DONE)
        self.assertEqual(status.done, done)

    # --- cells of the table of docs/reliability.md

    def begin(self, pose=(0.0, 0.0, 0.0), boundaries=(), spoil=None):
        """A new mission, all of whose inputs but those of `spoil` are there."""
        cls = type(self)
        cls.x, cls.y, cls.yaw = pose
        cls.boundaries = list(boundaries)
        for _ in range(25 if spoil else 0):  # what came before is old by then
            self.send(spoil)
        self.assertTrue(self.start().success)
        return [self.reacts(spoil) for _ in range(15)][-1]

    def reacts(self, spoil):
        """Of a step whose inputs may be spoilt, the state; a command comes in any case, without odometry after .3 s of
        simulated time and then each .1 s of wall time."""
        before = len(self.status.messages)
        if "odometry" in (spoil or {}):
            self.send(spoil)
            comes_true(lambda: len(self.status.messages) > before, 0.3)
        else:
            self.send_until_used(spoil)
        self.move(self.command.messages[-1].angular.z)
        return self.status.messages[-1].state

    def setUp(self):
        self.failed = []  # cells: the test goes on with the others

    def tearDown(self):
        self.assertEqual(self.failed, [])

    def check(self, input_, name, act, expected, does, steps=40, **begin):
        try:
            with contextlib.ExitStack() as cells:
                for one in cells_of(name):
                    cells.enter_context(cell("circumnavigate", input_, one, does))
                self.fly_with(input_, name, act, expected, steps, **begin)
        except AssertionError as error:
            self.failed.append(f"{input_}, {name}: {error}")

    def fly_with(self, input_, name, act, expected, steps, **begin):
        """A mission in whose flight the fault is for some steps: it holds, for the expected reason, or `goes on`, and it
        goes on afterwards."""
        spoil = act if isinstance(act, dict) else {input_: act}
        from_begin = name == "never came"
        self.begin(spoil=spoil if from_begin else None, **begin)
        commands = len(self.command.messages)
        states = [self.reacts(spoil) for _ in range(steps)]
        self.assertGreater(len(self.command.messages), commands + 0.75 * steps)
        reason = self.status.messages[-1].reason
        for told in self.command.messages[commands:]:
            self.assertTrue(math.isfinite(told.angular.z) and told.linear.x > 0.0, told)
        if expected == "goes on":
            self.assertNotIn(MissionStatus.HOLD, states, reason)
        elif expected == "on again":
            self.assertIn(MissionStatus.HOLD, states)
            self.assertNotEqual(states[-1], MissionStatus.HOLD, reason)
        else:
            self.assertEqual(states[-1], MissionStatus.HOLD)
            self.assertIn(expected, reason)
        if from_begin and expected != "goes on":
            return
        type(self).boundaries = []
        self.assertTrue(any(self.reacts(None) != MissionStatus.HOLD for _ in range(60)),
                        self.status.messages[-1].reason)

    def check_all(self, input_, faults, outcomes, **begin):
        for name, act in faults.items():
            self.check(input_, name, act, *outcomes[name], **begin)

    def test_7_faults_of_scans(self):
        def sees_nothing(msg):
            return set_number(msg, "ranges", [math.inf] * 361)

        holds = ("no scan that can be used", "holds after 1 s, on a circle that was seen to be free")

        def hit(msg):
            """A wall behind, so that the scan is one with hits."""
            return set_number(msg, "ranges", [12.0 + 0.01 * i if i < 20 else r for i, r in enumerate(msg.ranges)])

        faults = common(30)
        frozen_scan = faults["frozen"]
        faults["frozen"] = lambda msg: frozen_scan(hit(msg))
        for name, value in (("NaN", math.nan), ("inf", math.inf), ("-1", -1.0)):
            faults[name] = lambda msg, value=value: set_number(msg, "ranges", [value] * 361)
        faults["empty"] = lambda msg: set_number(msg, "ranges", [])
        outcomes = dict.fromkeys(faults, holds)
        outcomes["restarted"] = ("on again", "holds after 1 s, until the next scan")
        outcomes["inf"] = ("goes on", "as no return: flies on, while beams go on behind nothing that is mapped")
        self.check_all("scan", faults, outcomes)
        # By the parameter no_return.
        self.fly_with("scan", "0", lambda msg: set_number(msg, "ranges", [0.0] * 361), "goes on", 40)
        # A box 25 m ahead, which the beams pass.
        self.check("scan", "contradicts another input", sees_nothing, *holds, pose=(30.0, 0.0, 0.0),
                   boundaries=[square(5, False, 0.1)])

    def test_7_faults_of_maps(self):
        holds = ("no map", "holds after 2 s, on a circle that was seen to be free; hits count")
        goes_on = ("goes on", "flies on; hits on no map count, however few")

        def wall(x):
            return outline_feature(6, [(x, 9), (x, -9)], 0.05)

        def with_all(msg):
            return set_number(msg, "changed", [square(5, True, 0.1), wall(25.0), ellipse_feature(7, 200.0, 0.0, 2.0, 2.0)])

        faults = common(30)
        # One of each kind.
        faults["NaN"] = lambda msg: set_number(with_all(msg), "changed[0].outline[0].x", math.nan)
        faults["inf"] = lambda msg: set_number(with_all(msg), "changed[1].outline[0].x", math.inf)
        faults["-1"] = lambda msg: set_number(with_all(msg), "changed[2].rx", -1.0)
        faults["empty"] = lambda msg: msg
        outcomes = dict.fromkeys(faults, holds)
        outcomes.update({"empty": goes_on, "restarted": ("on again", "holds after 2 s, until the next map"),
                         "late by 1 s": ("goes on", "flies on: not older than 2 s")})
        self.check_all("map", faults, outcomes)
        behind = "no scan that can be used"
        self.check("map", "contradicts another input", lambda msg: set_number(msg, "changed", [square(5, False, 0.1)]),
                   behind, "holds: scans that go on behind what is mapped are not used", pose=(30.0, 0.0, 0.0))
        for thing in (wall(25.0), ellipse_feature(7, 28.0, 0.0, 2.0, 2.0)):
            self.fly_with("map", "contradicts another input", lambda msg, thing=thing: set_number(msg, "changed", [thing]),
                          behind, 40)

    def test_7_faults_of_tf(self):
        """The mounting, which is static: each fault has a frame of its own."""
        holds = ("no scan that can be used", "holds after 1 s, on a circle that was seen to be free")
        stays = ("goes on", "flies on: the mounting is static, that from before counts")

        def mounting(frame, shift=0.0, **fields):
            msg = transform_msg(rospy.Time.from_sec(self.t + shift), parent=fields.pop("parent", "base_link"),
                                child=frame)
            for path, value in fields.items():
                msg = set_number(msg, "transforms[0].transform." + path.replace("__", "."), value)
            return msg

        half = math.radians(30.0)
        for name, fields, outcome in (
                ("never came", None, holds), ("stopped", {}, stays), ("restarted", {}, stays), ("frozen", {}, stays),
                ("late by 1 s", {"shift": -1.0}, stays), ("2 s ahead", {"shift": 2.0}, stays),
                ("back by 1 h", {"shift": -3600.0}, stays), ("NaN", {"translation__x": math.nan}, holds),
                ("inf", {"translation__x": math.inf}, holds), ("-1", {"rotation__w": -1.0}, stays),
                ("wrong frame", {"parent": "elsewhere"}, holds),
                ("contradicts another input", {"rotation__x": math.sin(half), "rotation__w": math.cos(half)}, holds)):
            frame = "lidar_" + "".join(letter for letter in name if letter.isalnum())

            def act(msg, frame=frame, fields=fields, name=name):
                if fields is not None and (frame not in sent or name in ("frozen", "restarted")):
                    self.tf_static.publish(mounting(frame, **fields))
                    sent.add(frame)
                return set_number(msg, "header.frame_id", frame)

            sent = set()
            self.check("TF", name, {"scan": act}, *outcome)

    def test_7_faults_of_parameters(self):
        with cell("circumnavigate", "parameters", "wrong frame",
                  "drops all that is in others and says so; turns with lost_turn_rate_rad_s"):
            commands = Latest("elsewhere/cmd_vel", Twist)
            other = subprocess.Popen(["rosrun", "nodelet", "nodelet", "load", "situation_awareness/circumnavigate",
                                      "mission_manager", "__name:=elsewhere", "_world_frame:=elsewhere",
                                      "cmd_vel:=elsewhere/cmd_vel", "mission:=elsewhere/mission",
                                      "plan_dubins:=elsewhere/plan_dubins"])
            try:
                wait_until(lambda: commands.messages, 30.0, "the other stage")
                self.begin()
                wait_until(lambda: self.diagnostics.count("/elsewhere", "dropped: odometry of other frames") +
                           self.diagnostics.count("elsewhere", "dropped: odometry of other frames") > 0, 20.0, "drops")
                self.assertEqual({(told.linear.x, told.angular.z) for told in commands.messages}, {(0.0, 0.45)})
            finally:
                other.terminate()
                other.wait()

    def test_7_faults_of_odometry(self):
        lost = ("no odometry", "after .3 s a circle by dead reckoning, away from what the scans hit; holds until it is back")
        faults = common(14)
        del faults["never came"]
        faults.update({name: act for name, act in numbers("pose.pose.position.x", ("NaN", "inf")).items()})
        faults["-1"] = lambda msg: numbers("pose.covariance[7]")["-1"](
            set_number(msg, "pose.covariance", list(msg.pose.covariance)))
        outcomes = dict.fromkeys(faults, lost)
        outcomes["frozen"] = ("does not move as it says", "holds after 2 m of flight: a circle by dead reckoning")
        outcomes["restarted"] = ("on again", "after .3 s a circle by dead reckoning; then on from where it is")
        self.check_all("odometry", faults, outcomes, steps=20)
        # A pose 30 m beside the path: the vehicle is not on that any more.
        with cell("circumnavigate", "odometry", "contradicts another input",
                  "a pose that jumps off the path: another path from there, through what was seen to be free, or holds"):
            self.begin()
            before = len(self.path.messages)
            self.reacts({"odometry": lambda msg: set_number(msg, "pose.pose.position.y", 30.0)})
            wait_until(lambda: len(self.path.messages) > before, 10.0, "another path")
            self.assertGreater(self.path.messages[-1].poses[0].pose.position.y, 20.0)
            self.step_until(MissionStatus.SEARCH)


if __name__ == "__main__":
    rospy.init_node("circumnavigate_test")
    rostest.rosrun("situation_awareness", "circumnavigate_test", CircumnavigateTest)
