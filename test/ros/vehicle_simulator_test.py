#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The simulator of a world with a vehicle on wheels: the vehicle follows cmd_vel, and stops without; its topics fit
together."""
import math
import pathlib
import sys
import threading
import unittest

import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Latest, refusal_of_node, wait_until  # noqa: E402
from situation_awareness.msg import Transit  # noqa: E402


class Driver:
    """Sends a command again and again, or none."""

    def __init__(self):
        self.command = None
        self._publisher = rospy.Publisher("cmd_vel", Twist, queue_size=1)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        while not self._stopped.wait(0.05):
            command = self.command
            if command is None:
                continue
            message = Twist()
            message.linear.x, message.angular.z = command
            self._publisher.publish(message)

    def close(self):
        self._stopped.set()
        self._thread.join()


class VehicleSimulatorTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.driver = Driver()
        cls.odometry, cls.scans = Latest("odom", Odometry), Latest("scan", LaserScan)
        cls.poses, cls.transits = Latest("true_pose", PoseStamped), Latest("transit", Transit)
        cls.tf = tf2_ros.Buffer()
        cls.listener = tf2_ros.TransformListener(cls.tf)
        wait_until(lambda: len(cls.scans.messages) > 5 and cls.odometry.messages and cls.poses.messages and
                   cls.transits.messages, 60.0, "scans and the truth")

    @classmethod
    def tearDownClass(cls):
        cls.driver.close()

    def wait_for_pose(self, stamp):
        """Of this time or later: it comes on a topic of its own."""
        wait_until(lambda: self.poses.messages[-1].header.stamp >= stamp, 10.0, "the pose of that time")

    def x(self):
        return self.poses.messages[-1].pose.position.x

    def speed(self):
        return self.odometry.messages[-1].twist.twist.linear.x

    def test_1_it_stands_until_it_is_driven(self):
        self.assertAlmostEqual(self.x(), 1.6, places=6)
        self.assertEqual(self.speed(), 0.0)
        transit = self.transits.messages[-1]
        self.assertEqual((transit.number, transit.docked), (1, False))
        present = {outline.thing for outline in transit.outlines if outline.is_there}
        absent = {outline.thing for outline in transit.outlines if not outline.is_there}
        self.assertLessEqual({"wall", "reflector_1", "box_moves"}, present)
        self.assertLessEqual({"box_moved", "person"}, absent)

    def test_2_scans_have_reflectors_and_fit_the_poses(self):
        scan = self.scans.messages[-1]
        self.assertEqual(len(scan.ranges), 541)
        self.assertEqual(len(scan.intensities), 541)
        self.wait_for_pose(scan.header.stamp)
        self.assertIn(scan.header.stamp, self.poses.stamps())
        self.assertGreater(scan.time_increment, 0.0)
        bright = [i for i, intensity in enumerate(scan.intensities) if intensity > 450.0]
        self.assertGreater(len(bright), 2)
        mounting = self.tf.lookup_transform("base_link", scan.header.frame_id, rospy.Time(0), rospy.Duration(5))
        self.assertAlmostEqual(mounting.transform.translation.x, 0.16, places=6)
        reflectors = [outline.vertices for outline in self.transits.messages[-1].outlines
                      if outline.thing.startswith("reflector")]
        on_reflector = 0
        for i in bright:  # in the world the vehicle begins at (1.6, 0), heading along x
            angle = scan.angle_min + i * scan.angle_increment
            x = 1.76 + scan.ranges[i] * math.cos(angle)
            y = 0.01 + scan.ranges[i] * math.sin(angle)
            on_reflector += any(min(math.hypot(x - p.x, y - p.y) for p in outline) < 0.06 for outline in reflectors)
        self.assertGreaterEqual(on_reflector, 0.8 * len(bright))

    def test_3_it_follows_commands_and_stops_without(self):
        start = self.x()
        self.driver.command = (0.5, 0.0)
        wait_until(lambda: self.x() > start + 1.0, 30.0, "the vehicle to move")
        self.assertAlmostEqual(self.speed(), 0.5, delta=0.1)
        self.driver.command = None
        wait_until(lambda: self.speed() == 0.0, 10.0, "the vehicle to stop")
        self.wait_for_pose(self.odometry.messages[-1].header.stamp)
        stopped = self.x()
        self.assertLess(stopped - start, 3.0)
        rospy.sleep(1.0)
        self.assertAlmostEqual(self.x(), stopped, delta=0.005)
        wait_until(lambda: self.tf.can_transform("odom", "base_link", rospy.Time(0)), 10.0, "TF of the odometry")
        driven = self.odometry.messages[-1].pose.pose.position.x
        self.assertAlmostEqual(driven, stopped - 1.6, delta=0.1)

    def test_4_it_refuses_what_it_cannot_do(self):
        for argument, facts in (("_rate:=-1", ("rate", "-1", "0.01")), ("_speed:=2", ("speed", "unicycle")),
                                ("_scripted:=true", ("scripted", "unicycle", "transits")),
                                ("_transits:=0", ("transits", "0"))):
            message = refusal_of_node("simulator", "_world:=corridor", argument)
            for fact in facts:
                self.assertIn(fact, message)


if __name__ == "__main__":
    rospy.init_node("vehicle_simulator_test")
    rostest.rosrun("situation_awareness", "vehicle_simulator_test", VehicleSimulatorTest)
