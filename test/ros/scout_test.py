#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelet scout leads a vehicle to near views of what its camera finds, and home in its budget; it drops messages
that cannot be used."""
import math
import pathlib
import sys
import time
import unittest

import rospy
import rostest
from geometry_msgs.msg import Point, PoseStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from std_msgs.msg import Empty
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from fault_record import fault  # noqa: E402
from ros_support import Diagnostics, Latest, wait_until  # noqa: E402
from situation_awareness.msg import (MappedObjectArray, MappedPolygon, MappedTarget, PolygonArray, ScoutStatus,  # noqa: E402
                                     SplinegonArray, TargetArray)

STAGE = "scout"
SPEED, YAW_RATE, PERIOD = 6.0, 0.6, 0.25
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
        cls.polygons = rospy.Publisher("polygons", PolygonArray, queue_size=10, tcp_nodelay=True)
        cls.start = rospy.ServiceProxy("scout/start", Trigger)
        cls.go_home = rospy.ServiceProxy("scout/go_home", Trigger)
        cls.start.wait_for_service(60.0)
        wait_until(lambda: all(link.get_num_connections() > 0 for link in (
            cls.odometry, cls.targets, cls.grid, cls.polygons, cls.status.subscriber, cls.go_to.subscriber)),
                   60.0, "the nodelet")
        cls.t = 1000.0
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

    def look(self):
        """An image of what is in front."""
        for i, (x, y) in enumerate(CARS):
            off = math.atan2(y - self.p[1], x - self.p[0]) - self.yaw
            if abs(math.remainder(off, 2 * math.pi)) < VIEW and math.dist((x, y), self.p[:2]) < REACH:
                self.seen[i] += 1
        self.targets.publish(self.targets_msg())

    def step(self, looks=True):
        """One step, in which the vehicle does as it is told."""
        cls = type(self)
        cls.t += PERIOD
        self.odometry.publish(self.odometry_msg())
        stamp = rospy.Time.from_sec(self.t)
        wait_until(lambda: self.status.messages and self.status.messages[-1].header.stamp == stamp, 20.0, "a step")
        if looks:
            self.look()
        status = self.status.messages[-1]
        if status.state != ScoutStatus.HOLD:
            wait_until(lambda: self.go_to.messages and self.go_to.messages[-1].header.stamp == stamp, 20.0,
                       "where to go")
            goal = self.go_to.messages[-1].pose
            to = [goal.position.x - self.p[0], goal.position.y - self.p[1], goal.position.z - self.p[2]]
            part = min(1.0, SPEED * PERIOD / max(math.hypot(*to), 1e-9))
            cls.p = [p + part * d for p, d in zip(self.p, to)]
            turn = math.remainder(2 * math.atan2(goal.orientation.z, goal.orientation.w) - self.yaw, 2 * math.pi)
            cls.yaw = self.yaw + max(-YAW_RATE * PERIOD, min(YAW_RATE * PERIOD, turn))
        self.flown.append(tuple(self.p))
        return status

    def count(self, key):
        return self.diagnostics.count(f"/{STAGE}", key) + self.diagnostics.count(STAGE, key)

    def counts(self, key, act):
        """Does `act`, which must be counted."""
        before = self.count(key)
        act()
        wait_until(lambda: self.count(key) > before, 20.0, key)

    def test_1_waits_for_targets(self):
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
        wall = MappedPolygon(id=3, vertices=[Point(-120, -30, 0), Point(30, -30, 0)], sigma_m=[0.05, 0.05],
                             p_exists=1.0)  # around its other end it is far
        polygons = PolygonArray(polygons=[wall])
        polygons.header.frame_id, polygons.header.stamp = "map", rospy.Time.from_sec(self.t)
        self.polygons.publish(polygons)
        time.sleep(0.5)  # the nodelet has it before it begins
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
           "before counts on", times=9)
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
        for topic, kind in (("objects", MappedObjectArray), ("splinegons", SplinegonArray)):
            publisher = rospy.Publisher(topic, kind, queue_size=1)
            wait_until(lambda publisher=publisher: publisher.get_num_connections() > 0, 20.0, topic)
            msg = kind()
            msg.header.frame_id = "elsewhere"
            self.counts("dropped: bad map", lambda publisher=publisher, msg=msg: publisher.publish(msg))
        grid(lambda msg: None)()
        self.assertEqual(self.step().targets, 2)

    @fault("time is reset in a scouting mission", "stamps 500 s back", "a new mission, after the next targets", times=1)
    def test_6_begins_anew_when_time_is_reset(self):
        cls = type(self)
        cls.t -= 500.0
        self.counts("time jumped back: new mission", lambda: self.step(looks=False))
        self.assertEqual(self.status.messages[-1].reason, "no targets yet")
        self.look()
        wait_until(lambda: self.step(looks=False).state != ScoutStatus.HOLD, 20.0, "the begin")
        self.assertLess(self.status.messages[-1].elapsed, 5.0)


if __name__ == "__main__":
    rospy.init_node("scout_test")
    rostest.rosrun("situation_awareness", "scout_test", ScoutTest)
