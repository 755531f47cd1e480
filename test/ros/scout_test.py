#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelet scout leads a vehicle to near views of what its camera finds, and home in its budget, whatever the stamps
say; it drops messages that cannot be used."""
import contextlib
import math
import pathlib
import subprocess
import sys
import unittest

import rospy
import rostest
from geometry_msgs.msg import Point, PoseStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Empty
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from fault_record import cell, fault  # noqa: E402
from mission_faults import (cells_of, common, ellipse_feature, map_update, numbers, outline_feature,  # noqa: E402
                            set_number)
from ros_support import Diagnostics, Latest, comes_true, wait_until  # noqa: E402
from situation_awareness.msg import MapUpdate, MappedTarget, ScoutStatus, TargetArray  # noqa: E402

STAGE = "scout"
SPEED, YAW_RATE, PERIOD = 6.0, 0.6, 0.25
MAP_PERIOD = 2.0  # s, kMapPeriod_s of scout: the next map is taken so long after the one before
HOME = (-45.0, -45.0, 25.0)
CARS = ((20.0, 10.0), (-10.0, 35.0))
VIEW, REACH = 0.45, 70.0  # half of the field of view, rad; m


class ScoutTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.diagnostics = Diagnostics()
        cls.status, cls.go_to = Latest("scout", ScoutStatus), Latest("go_to", PoseStamped)
        cls.done, cls.markers = Latest("flight_done", Empty), Latest("scout_markers", MarkerArray)
        cls.odometry = rospy.Publisher("odometry", Odometry, queue_size=100, tcp_nodelay=True)
        cls.targets = rospy.Publisher("targets", TargetArray, queue_size=100, tcp_nodelay=True)
        cls.grid = rospy.Publisher("grid", OccupancyGrid, queue_size=10, tcp_nodelay=True)
        cls.maps = rospy.Publisher("semantic_map/updates", MapUpdate, queue_size=10, tcp_nodelay=True)
        cls.clock = rospy.Publisher("/clock", Clock, queue_size=10, tcp_nodelay=True)
        cls.start = rospy.ServiceProxy("scout/start", Trigger)
        cls.go_home = rospy.ServiceProxy("scout/go_home", Trigger)
        cls.start.wait_for_service(60.0)
        wait_until(lambda: all(link.get_num_connections() > 0 for link in (
            cls.odometry, cls.targets, cls.grid, cls.maps, cls.clock, cls.status.subscriber, cls.go_to.subscriber)),
                   60.0, "the nodelet")
        cls.t = 10000.0
        cls.version = 0
        cls.p, cls.yaw = list(HOME), 0.0
        cls.seen = [0] * len(CARS)
        cls.flown = []

    def odometry_msg(self):
        msg = Odometry(child_frame_id="base_link")
        msg.header.frame_id = "map"
        msg.header.stamp = rospy.Time.from_sec(self.t)
        msg.pose.pose.position = Point(*self.p)
        msg.pose.pose.orientation.z, msg.pose.pose.orientation.w = math.sin(self.yaw / 2), math.cos(self.yaw / 2)
        return msg

    def targets_msg(self):
        msg = TargetArray()
        msg.header.frame_id, msg.header.stamp = "map", rospy.Time.from_sec(self.t)
        for i, (x, y) in enumerate(CARS):
            if self.seen[i] >= 3:
                msg.targets.append(MappedTarget(id=i + 1, position=Point(x, y, 0), covariance=[0.01, 0, 0, 0.01],
                                                area=8.0, probability=0.9))
        return msg

    def look_at(self):
        """What is in front is shown by another image."""
        for i, (x, y) in enumerate(CARS):
            off = math.atan2(y - self.p[1], x - self.p[0]) - self.yaw
            if abs(math.remainder(off, 2 * math.pi)) < VIEW and math.dist((x, y), self.p[:2]) < REACH:
                self.seen[i] += 1

    def look(self):
        """An image."""
        self.look_at()
        self.targets.publish(self.targets_msg())

    def tick(self, seconds=PERIOD):
        type(self).t += seconds
        self.clock.publish(Clock(rospy.Time.from_sec(self.t)))

    def fly(self, goal):
        """Towards a pose, for one step."""
        to = [goal.position.x - self.p[0], goal.position.y - self.p[1], goal.position.z - self.p[2]]
        part = min(1.0, SPEED * PERIOD / max(math.hypot(*to), 1e-9))
        cls = type(self)
        cls.p = [p + part * d for p, d in zip(self.p, to)]
        turn = math.remainder(2 * math.atan2(goal.orientation.z, goal.orientation.w) - self.yaw, 2 * math.pi)
        cls.yaw = self.yaw + max(-YAW_RATE * PERIOD, min(YAW_RATE * PERIOD, turn))

    def send_until_used(self):
        """Odometry: where it comes before the clock of its time it is dropped, as one of another time."""
        msg = self.odometry_msg()
        for _ in range(40):
            self.odometry.publish(msg)
            if comes_true(lambda: self.status.messages and self.status.messages[-1].header.stamp == msg.header.stamp, 0.5):
                return
        self.fail("no step")

    def step(self, looks=True):
        """One step, in which the vehicle does as it is told."""
        self.tick()
        self.send_until_used()
        stamp = rospy.Time.from_sec(self.t)
        if looks:
            self.look()
        status = self.status.messages[-1]
        if status.state != ScoutStatus.HOLD:
            wait_until(lambda: self.go_to.messages and self.go_to.messages[-1].header.stamp == stamp, 20.0,
                       "where to go")
            self.fly(self.go_to.messages[-1].pose)
        self.flown.append(tuple(self.p))
        return status

    def count(self, key):
        return self.diagnostics.count(f"/{STAGE}", key) + self.diagnostics.count(STAGE, key)

    def counts(self, key, act):
        """Does `act`, which must be counted."""
        before = self.count(key)
        act()
        wait_until(lambda: self.count(key) > before, 20.0, key)

    def knows(self, msg, publisher):
        """The nodelet has the map: it drops the next one, which cannot be used."""
        publisher.publish(msg)
        bad = type(msg)()
        bad.header.frame_id = "elsewhere"
        self.counts("dropped: bad map", lambda: publisher.publish(bad))

    def test_1_waits_for_targets(self):
        with cell("scout", "odometry", "never came", "nothing is told: the autopilot holds"), \
                cell("scout", "targets", "never came", "does not begin, and says so"):
            self.waits()

    def waits(self):
        self.diagnostics.wait_for_reports(next(name for name in ("/scout", "scout") if comes_true(
            lambda name=name: name in self.diagnostics.stages, 5.0)))
        self.assertEqual(self.go_to.messages + self.status.messages, [])
        self.assertFalse(self.go_home().success)
        for _ in range(3):
            status = self.step(looks=False)
            self.assertEqual(status.state, ScoutStatus.HOLD)
            self.assertEqual(status.reason, "no targets yet")
        self.assertEqual(self.go_to.messages, [])

    def test_2_finds_goes_near_and_comes_home(self):
        self.look()
        wait_until(lambda: self.step().state != ScoutStatus.HOLD, 20.0, "the begin")
        states = set()
        begin = self.t
        while self.t < begin + 150.0:
            status = self.step()
            states.add(status.state)
            self.assertNotEqual(status.state, ScoutStatus.HOLD, status.reason)
            self.assertAlmostEqual(status.elapsed + status.left, 150.0, 6)
            if status.state == ScoutStatus.DONE:
                break
        self.assertEqual(states, {ScoutStatus.SCOUT, ScoutStatus.CLOSE_UP, ScoutStatus.HOME, ScoutStatus.DONE})
        self.assertGreater(status.left, 0.0)
        self.assertLess(math.dist(self.p[:2], HOME[:2]), 3.0)
        self.assertEqual((status.targets, status.close_ups, status.given_up), (2, 2, 0))
        for x, y in CARS:
            self.assertLess(min(math.dist((x, y, 0), p) for p in self.flown), 1.3 * math.hypot(18.0, 12.0))
        wait_until(lambda: self.done.messages, 20.0, "flight_done")
        shown = {marker.ns for marker in self.markers.messages[0].markers if marker.action == Marker.ADD}
        self.assertEqual(shown, {"region", "way", "route", "views", "budget"})

    def test_3_starts_again_around_a_wall_and_goes_home_when_told(self):
        wall = outline_feature(3, [(30, -30), (-120, -30)], 0.05)  # around its other end it is far
        self.knows(self.features_msg(wall), self.maps)  # before it begins
        self.assertTrue(self.start().success)
        first = len(self.flown)
        crossed = False
        for _ in range(200):
            status = self.step()
            crossed = crossed or self.p[1] > -25.0
            if crossed:
                break
        self.assertTrue(crossed)
        self.assertLess(status.elapsed, 60.0)
        self.assertTrue(self.go_home().success)
        while self.step().state != ScoutStatus.DONE:
            self.assertEqual(self.status.messages[-1].state, ScoutStatus.HOME)
            self.assertEqual(self.status.messages[-1].reason, "told to go home")
            self.assertLess(len(self.flown), first + 600)
        for a, b in zip(self.flown[first:], self.flown[first + 1:]):
            if (a[1] + 30.0) * (b[1] + 30.0) <= 0.0:
                self.assertGreater(min(a[0], b[0]), 30.0)

    @fault("odometry that cannot be used by a scouting mission", "NaN in the pose, no rotation, another frame or child "
           "frame, stamps of zero, that repeat or go back", "each is dropped by its reason; the mission goes on",
           times=7)
    def test_4_drops_odometry_that_cannot_be_used(self):
        def spoilt(spoil):
            msg = self.odometry_msg()
            msg.header.stamp += rospy.Duration(0.01)
            spoil(msg)
            return lambda: self.odometry.publish(msg)

        self.step()
        before = self.status.messages[-1].header.stamp
        for key, spoil in (
                ("odometry not a finite pose", lambda msg: setattr(msg.pose.pose.position, "x", math.nan)),
                ("odometry not a finite pose", lambda msg: setattr(msg.pose.pose.orientation, "w", 7.0)),
                ("odometry of other frames", lambda msg: setattr(msg.header, "frame_id", "elsewhere")),
                ("odometry of other frames", lambda msg: setattr(msg, "child_frame_id", "wheel")),
                ("odometry with a stamp of zero", lambda msg: setattr(msg.header, "stamp", rospy.Time())),
                ("stamp repeats or goes back", lambda msg: setattr(msg.header, "stamp", before)),
                ("stamp repeats or goes back",
                 lambda msg: setattr(msg.header, "stamp", before - rospy.Duration(0.5)))):
            self.counts(f"dropped: {key}", spoilt(spoil))
        self.assertEqual(self.status.messages[-1].header.stamp, before)
        self.step()

    @fault("targets, grids and maps that cannot be used by a scouting mission", "another frame, NaN, an id of zero, a "
           "grid with too few cells, off its lattice or with a cell above 100 %", "each is dropped: bad map; the one "
           "before counts on", times=8)
    def test_5_drops_maps_that_cannot_be_used(self):
        def targets(spoil):
            msg = self.targets_msg()
            spoil(msg)
            return lambda: self.targets.publish(msg)

        def grid(spoil):
            msg = OccupancyGrid(data=[0, -1, 100, 50])
            msg.header.frame_id, msg.header.stamp = "map", rospy.Time.from_sec(self.t)
            msg.info.resolution, msg.info.width, msg.info.height = 0.5, 2, 2
            msg.info.origin.orientation.w = 1.0
            spoil(msg)
            return lambda: self.grid.publish(msg)

        for act in (targets(lambda msg: setattr(msg.header, "frame_id", "elsewhere")),
                    targets(lambda msg: setattr(msg.targets[0].position, "x", math.nan)),
                    targets(lambda msg: setattr(msg.targets[0], "id", 0)),
                    grid(lambda msg: setattr(msg.header, "frame_id", "elsewhere")),
                    grid(lambda msg: setattr(msg.info, "width", 3)),
                    grid(lambda msg: setattr(msg.info.origin.position, "x", 0.2)),
                    grid(lambda msg: msg.data.__setitem__(1, 101))):
            self.counts("dropped: bad map", act)
        self.counts("dropped: bad map", lambda: self.maps.publish(self.features_msg(frame="elsewhere")))
        grid(lambda msg: None)()
        self.assertEqual(self.step().targets, 2)

    def begin(self, p=HOME):
        cls = type(self)
        cls.p, cls.yaw, cls.seen = list(p), 0.0, [0] * len(CARS)
        self.assertTrue(self.start().success)
        self.look()
        for _ in range(12):
            status = self.step()
        self.assertIn(status.state, (ScoutStatus.SCOUT, ScoutStatus.CLOSE_UP), status.reason)

    def heads_home(self):
        """When told to, straight to where the mission began."""
        self.assertTrue(self.go_home().success)
        for _ in range(3):
            self.step()
        goal = self.go_to.messages[-1].pose.position
        self.assertLess(math.dist((goal.x, goal.y), HOME[:2]), 0.5)

    def comes_home(self, home=HOME, longest=150.0):
        """When told to."""
        self.assertTrue(self.go_home().success)
        end = self.t + longest
        while self.step().state != ScoutStatus.DONE:
            self.assertLess(self.t, end)
        self.assertLess(math.dist(self.p[:2], home[:2]), 3.0)

    @fault("time is reset in a scouting mission", "stamps 500 s back", "the mission goes on: home and budget are as before",
           times=1)
    def test_6_goes_on_when_time_is_reset(self):
        self.begin()
        before = self.step()
        self.clock.publish(Clock(rospy.Time.from_sec(self.t - 500.0)))
        type(self).t -= 500.0
        self.counts("time jumped back: the mission goes on",
                    lambda: [(self.tick(), self.odometry.publish(self.odometry_msg())) for _ in range(8)])
        self.look()
        status = self.step()
        self.assertGreaterEqual(status.elapsed, before.elapsed)
        self.assertLess(status.elapsed, before.elapsed + 5.0)
        self.comes_home()

    @fault("one stamp of odometry is wrong in a scouting mission", "2 s and 1 h ahead, 5 s and 1 h back",
           "home and budget are as before", times=4)
    def test_6_one_stamp_moves_nothing(self):
        self.begin()
        for off in (2.0, 3600.0, -5.0, -3600.0):
            before = self.step()
            msg = self.odometry_msg()
            msg.header.stamp += rospy.Duration(off)
            self.odometry.publish(msg)
            for _ in range(4):
                status = self.step()
            self.assertLess(status.elapsed, before.elapsed + 3.1)
            self.assertNotEqual(status.state, ScoutStatus.HOLD, status.reason)
        self.comes_home()

    # --- cells of the table of docs/reliability.md

    def setUp(self):
        self.failed = []  # cells: the test goes on with the others

    def tearDown(self):
        self.assertEqual(self.failed, [])

    def reacts(self, spoil, others):
        """A step whose inputs may be spoilt; the status, or that before where there is none: odometry that is dropped
        leads to none."""
        self.tick()
        if "odometry" not in spoil:
            self.send_until_used()
        else:
            before, odometry = len(self.status.messages), spoil["odometry"](self.odometry_msg())
            if odometry is not None:
                self.odometry.publish(odometry)
                comes_true(lambda: len(self.status.messages) > before, 0.2)
        kinds = {"targets": (self.targets, self.targets_msg), "grid": (self.grid, self.grid_msg),
                 "map": (self.maps, self.features_msg)}
        for name, (publisher, make) in kinds.items():
            if name != "targets" and name not in others:
                continue
            if name == "targets":
                self.look_at()
            msg = spoil.get(name, lambda msg: msg)(make())
            if msg is not None:
                publisher.publish(msg)
        if self.go_to.messages:
            self.fly(self.go_to.messages[-1].pose)
        return self.status.messages[-1]

    def features_msg(self, *features, frame="map"):
        type(self).version += 1
        return map_update(rospy.Time.from_sec(self.t), self.version, features, frame)

    def map_msg(self, kind):
        msg = kind()
        msg.header.frame_id, msg.header.stamp = "map", rospy.Time.from_sec(self.t)
        return msg

    def grid_msg(self):
        msg = self.map_msg(OccupancyGrid)
        msg.data = [0, -1, 100, 50]
        msg.info.resolution, msg.info.width, msg.info.height, msg.info.origin.orientation.w = 0.5, 2, 2, 1.0
        return msg

    def check(self, input_, name, act, expected, does, **flight):
        try:
            with contextlib.ExitStack() as cells:
                for one in cells_of(name):
                    cells.enter_context(cell("scout", input_, one, does))
                self.fly_with(input_, act, expected, **flight)
        except AssertionError as error:
            self.failed.append(f"{input_}, {name}: {error}")

    def fly_with(self, input_, act, expected, steps=40, from_home_m=0.0):
        """The fault is there for some steps of a mission, which is so far from home then: the vehicle `holds`, for the
        expected reason, or `goes on`; then it goes on, and home is where it was."""
        others, spoil = (input_,), {input_: act}
        self.begin()
        for _ in range(80):
            if math.dist(self.p[:2], HOME[:2]) >= from_home_m:
                break
            self.step()
        self.assertGreaterEqual(math.dist(self.p[:2], HOME[:2]), from_home_m)
        elapsed, begin = self.status.messages[-1].elapsed, self.t
        states = [self.reacts(spoil, others) for _ in range(steps)]
        if expected == "goes on":
            self.assertNotIn(ScoutStatus.HOLD, [status.state for status in states], states[-1].reason)
        elif expected == "on again":
            if input_ == "odometry":
                self.assertLess(len({status.header.stamp for status in states}), steps / 2)
            self.assertNotEqual(states[-1].state, ScoutStatus.HOLD, states[-1].reason)
        elif expected == "nothing":
            self.assertEqual(len({status.header.stamp for status in states}), 1)
        else:
            self.assertEqual(states[-1].state, ScoutStatus.HOLD)
            self.assertIn(expected, states[-1].reason)
        on_again = self.t + MAP_PERIOD + 2.0
        status = self.reacts({}, others)
        while self.t < on_again and (self.t < on_again - MAP_PERIOD or status.state == ScoutStatus.HOLD):
            status = self.reacts({}, others)
        self.assertNotEqual(status.state, ScoutStatus.HOLD, status.reason)
        self.assertAlmostEqual(status.elapsed - elapsed, self.t - begin, delta=0.6)
        self.heads_home()

    def check_all(self, input_, faults, outcomes, **arguments):
        for name, act in faults.items():
            self.check(input_, name, act, *outcomes[name], **arguments)

    def test_7_faults_of_parameters(self):
        with cell("scout", "parameters", "wrong frame", "drops all that is in others and says so; nothing is told"):
            told = Latest("elsewhere/go_to", PoseStamped)
            other = subprocess.Popen(["rosrun", "nodelet", "nodelet", "load", "situation_awareness/scout",
                                      "mission_manager", "__name:=elsewhere", "_world_frame:=elsewhere",
                                      "go_to:=elsewhere/go_to", "scout:=elsewhere/scout"])
            try:
                wait_until(lambda: told.subscriber.get_num_connections() > 0, 30.0, "the other stage")
                self.begin()
                wait_until(lambda: self.diagnostics.count("/elsewhere", "dropped: odometry of other frames") +
                           self.diagnostics.count("elsewhere", "dropped: odometry of other frames") > 0, 20.0, "drops")
                self.assertEqual(told.messages, [])
            finally:
                other.terminate()
                other.wait()

    def test_7_faults_of_targets(self):
        holds = ("no image is mapped", "holds after 5 s where it is, until the way home is due")
        faults = common(28)
        for name, act in numbers("targets[0].covariance[0]").items():
            faults[name] = lambda msg, act=act: act(set_number(msg, "targets", [
                MappedTarget(id=9, covariance=[0.01, 0, 0, 0.01], area=8.0, probability=0.9)]))
        faults["empty"] = lambda msg: set_number(msg, "targets", [])
        outcomes = dict.fromkeys(faults, holds)
        outcomes.update({"frozen": ("goes on", "flies on: what was found stays"),
                         "late by 1 s": ("goes on", "flies on: an image counts from where it was taken"),
                         "2 s ahead": ("goes on", "flies on; counted: no odometry of that time, so no image"),
                         "empty": ("goes on", "flies on: nothing was found")})
        outcomes["restarted"] = ("on again", "holds after 5 s where it is, until the next image")
        outcomes["contradicts another input"] = ("goes on", "flies on: what is outside the region is no target")
        faults["contradicts another input"] = lambda msg: set_number(msg, "targets", [
            MappedTarget(id=9, position=Point(900, 900, 0), covariance=[0.01, 0, 0, 0.01], area=8.0, probability=0.9)])
        del faults["never came"]
        self.check_all("targets", faults, outcomes)

    def test_7_faults_of_grids(self):
        goes_on = ("goes on", "flies on, by what it had: the grid says where to look, not where to fly")
        faults = common(28)
        faults.update(numbers("info.resolution"))
        faults["empty"] = lambda msg: set_number(set_number(set_number(msg, "data", []), "info.width", 0),
                                                 "info.height", 0)
        faults["contradicts another input"] = lambda msg: set_number(msg, "data", [100, 100, 100, 100])
        self.check_all("grid", faults, dict.fromkeys(faults, goes_on))

    def test_7_faults_of_maps(self):
        goes_on = ("goes on", "flies on; what was mapped stays an obstacle")

        corners = ((400, 0), (410, 0), (410, 10), (400, 10))

        def with_all(msg):
            return set_number(msg, "changed", [outline_feature(3, [(400, 9), (400, -9)], 0.05),
                                               ellipse_feature(4, 400.0, 0.0, 2.0, 2.0),
                                               outline_feature(5, corners, closed=True, bulge=[0.0] * 4)])

        faults = {fault_: lambda msg, act=act: act(with_all(msg)) for fault_, act in common(28).items()}
        # One of each kind.
        faults["NaN"] = lambda msg: set_number(with_all(msg), "changed[0].outline[0].x", math.nan)
        faults["inf"] = lambda msg: set_number(with_all(msg), "changed[1].rx", math.inf)
        faults["-1"] = lambda msg: set_number(with_all(msg), "changed[2].sigma[0]", -1.0)
        faults["empty"] = lambda msg: msg
        self.check_all("map", faults, dict.fromkeys(faults, goes_on))

        # On the map something stands all around the vehicle, wherever it went until the map came, and nearer than the
        # clearance of 5 m: else a view from within may be the next stop. Shut in at home it would be done.
        def shut_in(bulge):
            def around(msg):
                x, y = self.p[:2]
                corners = [(x + dx, y + dy) for dx, dy in ((-4, -4), (4, -4), (4, 4), (-4, 4))]
                return set_number(msg, "changed", [outline_feature(3, corners, closed=True, bulge=bulge)])
            return around

        def in_an_ellipse(msg):
            return set_number(msg, "changed", [ellipse_feature(3, self.p[0], self.p[1], 4.0, 4.0)])

        self.check("map", "contradicts another input", shut_in(None), "there is no free way",
                   "a map on which the vehicle is shut in: holds, and says so", from_home_m=15.0)
        for around in (shut_in([0.0] * 4), in_an_ellipse):
            self.fly_with("map", around, "there is no free way", from_home_m=15.0)

    def test_7_faults_of_odometry(self):
        stays = ("nothing", "nothing is told: the autopilot holds its last goal; the budget goes on")
        faults = common(11)
        del faults["never came"]
        faults.update(numbers("pose.pose.position.x", ("NaN", "inf")))
        faults["-1"] = lambda msg: numbers("pose.covariance[0]")["-1"](
            set_number(msg, "pose.covariance", list(msg.pose.covariance)))
        outcomes = dict.fromkeys(faults, stays)
        outcomes["-1"] = ("goes on", "flies on: variances are not used")
        outcomes["restarted"] = ("on again", "nothing is told: the autopilot holds its last goal; then on")
        outcomes["frozen"] = ("goes on", "told to go on from there; its budget ends, and it is told to go home")
        self.check_all("odometry", faults, outcomes, steps=16)


if __name__ == "__main__":
    rospy.init_node("scout_test")
    rostest.rosrun("situation_awareness", "scout_test", ScoutTest)
