#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The simulator of a world with a vehicle on wings: it turns as it is told, within its limits, goes straight on without
commands, and says why it does not start."""
import math
import pathlib
import sys
import unittest

import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import PoseStamped, Twist
from sensor_msgs.msg import Imu, LaserScan, NavSatFix
from visualization_msgs.msg import MarkerArray

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Latest, refusal_of_node, wait_until, yaw_of  # noqa: E402

AIRSPEED, RADIUS = 5.0, 6.0
WIND = (0.9, -0.7)  # models/worlds/towers.xml
GRAVITY = 9.80665


def seconds(message):
    return message.header.stamp.to_sec()


class AircraftSimulatorTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.truths, cls.imu = Latest("true_pose", PoseStamped), Latest("imu", Imu)
        cls.scans, cls.fixes = Latest("scan", LaserScan), Latest("fix", NavSatFix)
        cls.markers = Latest("truth_markers", MarkerArray)
        cls.tf = tf2_ros.Buffer()
        cls.listener = tf2_ros.TransformListener(cls.tf)
        cls.commands = rospy.Publisher("cmd_vel", Twist, queue_size=10)
        wait_until(lambda: cls.commands.get_num_connections() > 0 and cls.truths.messages, 60.0, "the simulator")

    def fly(self, turn_rate, duration_s):
        """With commands, in simulated time; the true poses of its last second."""
        begin = seconds(self.truths.messages[-1])
        command = Twist()
        command.angular.z = turn_rate if turn_rate is not None else 0.0
        rate = rospy.Rate(20)
        while seconds(self.truths.messages[-1]) < begin + duration_s:
            if turn_rate is not None:
                self.commands.publish(command)
            rate.sleep()
        end = seconds(self.truths.messages[-1])
        return [message for message in self.truths.messages if seconds(message) > end - 1.0]

    def turn_rate(self, truths):
        turned = math.remainder(yaw_of(truths[-1].pose.orientation) - yaw_of(truths[0].pose.orientation), 2.0 * math.pi)
        return turned / (seconds(truths[-1]) - seconds(truths[0]))

    def test_it_turns_as_it_is_told(self):
        for turn_rate, expected in ((0.4, 0.4), (-0.3, -0.3), (5.0, AIRSPEED / RADIUS), (math.nan, 0.0)):
            last = self.fly(turn_rate, 4.0)
            # Gusts turn it, too: by up to half a degree.
            self.assertAlmostEqual(self.turn_rate(last), expected, delta=0.05)
            time = seconds(last[-1]) - seconds(last[0])
            way = [last[-1].pose.position.x - last[0].pose.position.x - WIND[0] * time,
                   last[-1].pose.position.y - last[0].pose.position.y - WIND[1] * time]
            chord = 2.0 * AIRSPEED / expected * math.sin(0.5 * expected * time) if expected else AIRSPEED * time
            self.assertAlmostEqual(math.hypot(*way), abs(chord), delta=0.02)
        self.fly(0.5, 3.0)
        self.assertAlmostEqual(self.turn_rate(self.fly(None, 4.0)), 0.0, delta=0.05)

    def test_its_sensors(self):
        self.fly(0.3, 5.0)
        forces = [message.linear_acceleration for message in self.imu.messages[-400:]]
        # The lift of a coordinated turn, g / cos(bank); the bias is 5 cm/s^2.
        bank = math.atan(AIRSPEED * 0.3 / GRAVITY)
        self.assertAlmostEqual(sum(f.z for f in forces) / len(forces), GRAVITY / math.cos(bank), delta=0.3)
        self.assertEqual(self.imu.messages[-1].orientation_covariance[0], -1.0)
        self.assertEqual(len(self.scans.messages[-1].ranges), 541)
        self.assertAlmostEqual(self.scans.messages[-1].time_increment, 0.03 / 540, delta=1e-9)
        fix = self.fixes.messages[-1]
        self.assertAlmostEqual(fix.latitude, 47.3769, delta=0.003)
        self.assertAlmostEqual(fix.altitude, 408.0 + 15.0, delta=10.0)
        for frame in (fix.header.frame_id, self.imu.messages[-1].header.frame_id, "laser"):
            self.assertTrue(self.tf.can_transform("base_link", frame, rospy.Time()), frame)
        self.assertFalse(self.tf.can_transform("world", "base_link", rospy.Time()), "it does not tell where it is")
        self.assertTrue(self.markers.messages)

    def test_it_says_why_it_does_not_start(self):
        self.assertIn("the robot of towers is a fixed_wing: unknown parameter transits",
                      refusal_of_node("simulator", "_world:=towers", "_transits:=3"))
        self.assertIn("rate = 0", refusal_of_node("simulator", "_world:=towers", "_rate:=0"))


if __name__ == "__main__":
    rospy.init_node("aircraft_simulator_test")
    rostest.rosrun("situation_awareness", "aircraft_simulator_test", AircraftSimulatorTest)
