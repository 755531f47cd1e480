#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelet circumnavigate leads a vehicle to a place and around a boundary until that is closed, drops messages
that cannot be used, and answers plan_dubins."""
import math
import pathlib
import sys
import unittest

import rospy
import rostest
from geometry_msgs.msg import Point, Pose2D, Twist
from nav_msgs.msg import Odometry, Path
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from fault_record import fault  # noqa: E402
from ros_support import Diagnostics, Latest, transform_msg, wait_until  # noqa: E402
from situation_awareness.msg import MappedObjectArray, MappedSplinegon, MissionStatus, PolygonArray, SplinegonArray  # noqa: E402
from situation_awareness.srv import PlanDubins  # noqa: E402

STAGE = "circumnavigate"
SPEED, PERIOD = 5.0, 0.1


def square(boundary_id, closed, sigma):
    """A box of 10 m around (60, 0): main vertices at the corners, joints between them; open: three of its sides."""
    corners = [(65, -5), (65, 5), (55, 5), (55, -5)]
    msg = MappedSplinegon(id=boundary_id, closed=closed, first_seen=rospy.Time(1), last_seen=rospy.Time(2))
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1]):
        msg.vertices += [Point(ax, ay, 0), Point(0.5 * (ax + bx), 0.5 * (ay + by), 0)]
        msg.corner += [True, False]
    if not closed:
        del msg.vertices[7:], msg.corner[7:]
    msg.bulge = [0.0] * len(msg.vertices)
    msg.sigma_m = [sigma] * len(msg.vertices)
    return msg


class CircumnavigateTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.diagnostics = Diagnostics()
        cls.status = Latest("mission", MissionStatus)
        cls.command = Latest("cmd_vel", Twist)
        cls.path = Latest("path", Path)
        cls.markers = Latest("mission_markers", MarkerArray)
        cls.odometry = rospy.Publisher("odometry", Odometry, queue_size=100, tcp_nodelay=True)
        cls.splinegons = rospy.Publisher("splinegons", SplinegonArray, queue_size=10, tcp_nodelay=True)
        cls.scans = rospy.Publisher("scan", LaserScan, queue_size=10, tcp_nodelay=True)
        cls.tf_static = rospy.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        cls.tf_static.publish(transform_msg(rospy.Time(1), parent="base_link"))
        cls.plan = rospy.ServiceProxy("plan_dubins", PlanDubins)
        cls.plan.wait_for_service(60.0)
        wait_until(lambda: all(link.get_num_connections() > 0 for link in (
            cls.odometry, cls.splinegons, cls.scans, cls.tf_static, cls.status.subscriber, cls.command.subscriber)),
                   60.0, "the nodelet")
        cls.x = cls.y = cls.yaw = 0.0
        cls.t = 1000.0

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

    def step(self):
        """One step, in which the vehicle does as it is told. Sees 30 m all around and hits nothing."""
        scan = LaserScan(angle_min=-math.pi, angle_max=math.pi, angle_increment=math.pi / 180, range_min=0.1,
                         range_max=30.0, ranges=[math.inf] * 361)
        scan.header.frame_id = "lidar"
        type(self).t += PERIOD
        scan.header.stamp = rospy.Time.from_sec(self.t)
        self.scans.publish(scan)
        self.odometry.publish(self.odometry_msg())
        stamp = rospy.Time.from_sec(self.t)
        wait_until(lambda: self.status.messages and self.status.messages[-1].header.stamp == stamp, 10.0, "a step")
        status = self.status.messages[-1]
        self.assertLessEqual(abs(status.curvature), 1.0 / 6.0 + 1e-12)
        cls = type(self)
        cls.yaw += status.curvature * SPEED * PERIOD
        cls.x += SPEED * PERIOD * math.cos(self.yaw)
        cls.y += SPEED * PERIOD * math.sin(self.yaw)
        return status

    def count(self, key):
        return self.diagnostics.count(f"/{STAGE}", key) + self.diagnostics.count(STAGE, key)

    def counts(self, key, act):
        """Does `act`, which must be counted."""
        before = self.count(key)
        act()
        wait_until(lambda: self.count(key) > before, 20.0, key)

    def publish(self, *boundaries, frame="map"):
        msg = SplinegonArray(splinegons=list(boundaries))
        msg.header.frame_id = frame
        msg.header.stamp = rospy.Time.from_sec(self.t)
        self.splinegons.publish(msg)

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
        status = self.step()
        self.assertEqual(status.state, MissionStatus.SEARCH, status.reason)
        self.assertEqual(status.reason, "on the way to place 1 of 1")
        self.publish(square(5, False, 0.1))
        wait_until(lambda: self.count("boundaries") == 1, 20.0, "the boundary")
        states = set()
        for _ in range(150):
            status = self.step()
            states.add(status.state)
        self.assertIn(MissionStatus.AROUND, states)
        self.assertEqual(status.target, 5)
        self.assertEqual(status.reason, "boundary 5 is open")
        self.assertGreater(status.clearance, 3.0)
        self.publish(square(5, True, 0.1))
        wait_until(lambda: self.count("closed") == 1, 20.0, "the boundary, closed")
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
        wait_until(lambda: len(self.command.messages) == len(self.status.messages), 20.0, "a command for each step")
        for command, told in zip(self.command.messages, self.status.messages):
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

    @fault("maps that cannot be used", "boundaries, polygons and objects in another frame, boundaries with NaN",
           "each is dropped: bad map; the one before counts on", times=4)
    def test_4_drops_maps_that_cannot_be_used(self):
        self.counts("dropped: bad map", lambda: self.publish(square(9, True, 0.1), frame="elsewhere"))
        self.counts("dropped: bad map", lambda: self.publish(square(9, True, math.nan)))
        for topic, kind in (("polygons", PolygonArray), ("objects", MappedObjectArray)):
            publisher = rospy.Publisher(topic, kind, queue_size=1)
            wait_until(lambda publisher=publisher: publisher.get_num_connections() > 0, 20.0, topic)
            msg = kind()
            msg.header.frame_id = "elsewhere"
            self.counts("dropped: bad map", lambda publisher=publisher, msg=msg: publisher.publish(msg))
        self.assertEqual(self.step().done, 1)

    @fault("scans that cannot be used", "no beam, a stamp without odometry, no mounting in TF",
           "each is counted by its reason; the mission goes on", times=3)
    def test_5_drops_scans_that_cannot_be_used(self):
        def scan(frame="lidar", late_s=0.0, beams=361):
            msg = LaserScan(angle_min=-math.pi, angle_max=math.pi, angle_increment=math.pi / 180, range_min=0.1,
                            range_max=30.0, ranges=[math.inf] * beams)
            msg.header.frame_id = frame
            msg.header.stamp = rospy.Time.from_sec(self.t + late_s)
            return lambda: self.scans.publish(msg)

        self.step()
        self.counts("scans not used: no transform", scan(frame="nowhere"))
        self.counts("scans not used: no odometry", scan(late_s=5.0))
        self.counts("scans not used: bad scan: empty scan", scan(beams=0))
        self.assertEqual(self.step().done, 1)

    @fault("time is reset", "stamps 500 s back", "a new mission: boundaries come anew")
    def test_6_begins_anew_when_time_is_reset(self):
        type(self).t -= 500.0
        self.counts("time jumped back: new mission", self.step)
        status = self.step()
        self.assertEqual(status.done, 0)
        self.assertNotEqual(status.state, MissionStatus.DONE)


if __name__ == "__main__":
    rospy.init_node("circumnavigate_test")
    rostest.rosrun("situation_awareness", "circumnavigate_test", CircumnavigateTest)
