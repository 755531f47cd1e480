#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The simulator of a world with a multirotor that is led: it goes where it is told, what its sensors measure is the
truth but for the errors that they are said to have, and it says why it does not start."""
import math
import pathlib
import sys
import unittest

import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, Image, Imu, NavSatFix

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Latest, refusal_of_node, wait_until, yaw_of  # noqa: E402

HEADING_SIGMA, ALTITUDE_SIGMA = 0.02, 0.3  # of an error that stays, and the same of each reading
SIGMAS = 4.5
ORIGIN_ALTITUDE = 408.0  # models/worlds/carpark.xml


class MultirotorSimulatorTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.truths, cls.imu = Latest("true_odometry", Odometry), Latest("imu", Imu)
        cls.headings, cls.fixes = Latest("heading", Imu), Latest("fix", NavSatFix)
        cls.altitudes = Latest("altitude", PoseWithCovarianceStamped)
        cls.labels, cls.infos = Latest("camera/labels", Image), Latest("camera/labels_info", CameraInfo)
        cls.tf = tf2_ros.Buffer()
        cls.listener = tf2_ros.TransformListener(cls.tf)
        cls.goals = rospy.Publisher("go_to", PoseStamped, queue_size=10)
        wait_until(lambda: cls.goals.get_num_connections() > 0 and all(latest.messages for latest in (
            cls.truths, cls.imu, cls.headings, cls.labels, cls.infos)), 60.0, "the simulator")

    def true_pose(self, stamp):
        """The nearest by time: the truth comes every 20 ms, on a topic of its own."""
        wait_until(lambda: self.truths.messages[-1].header.stamp >= stamp, 10.0, "the truth of that time")
        nearest = min(self.truths.messages, key=lambda m: abs((m.header.stamp - stamp).to_sec()))
        self.assertLess(abs((nearest.header.stamp - stamp).to_sec()), 0.021)
        return nearest.pose.pose

    def test_1_it_goes_where_it_is_told(self):
        begin = self.truths.messages[-1].pose.pose
        goal = PoseStamped()
        goal.pose.position.x, goal.pose.position.y = begin.position.x + 8.0, begin.position.y - 5.0
        goal.pose.position.z = begin.position.z + 2.0
        goal.pose.orientation.z, goal.pose.orientation.w = math.sin(0.4), math.cos(0.4)
        self.goals.publish(goal)

        def off():
            now = self.truths.messages[-1].pose.pose
            return math.dist(*([getattr(p, axis) for axis in "xyz"] for p in (now.position, goal.pose.position)))

        wait_until(lambda: off() < 0.3, 30.0, "the goal")
        self.assertAlmostEqual(yaw_of(self.truths.messages[-1].pose.pose.orientation), 0.8, delta=0.1)
        goal.pose.position.x = math.nan
        self.goals.publish(goal)
        rospy.sleep(3.0)
        goal.pose.position.x = begin.position.x + 8.0
        self.assertLess(off(), 0.3, "it ignores what is no place")

    def test_2_its_sensors_measure_the_truth(self):
        wait_until(lambda: len(self.altitudes.messages) > 20 and len(self.fixes.messages) > 20, 30.0, "the sensors")
        frame = self.imu.messages[-1].header.frame_id
        imu = self.tf.lookup_transform("base_link", frame, rospy.Time(), rospy.Duration(5))
        altitudes = self.altitudes.messages[-20:]
        errors = [m.pose.pose.position.z - self.true_pose(m.header.stamp).position.z - imu.transform.translation.z
                  for m in altitudes]
        self.assertLess(max(map(abs, errors)), SIGMAS * math.sqrt(2.0) * ALTITUDE_SIGMA)
        self.assertGreater(max(errors) - min(errors), 0.5 * ALTITUDE_SIGMA)
        for m in altitudes:
            self.assertEqual(m.header.frame_id, "world")
            self.assertGreaterEqual(m.pose.covariance[14], 2.0 * ALTITUDE_SIGMA**2)  # of both errors, at least
        self.assertAlmostEqual((altitudes[-1].header.stamp - altitudes[0].header.stamp).to_sec(), 19.0, delta=1e-6)

        for m in self.headings.messages[-20:]:
            error = math.remainder(yaw_of(m.orientation) - yaw_of(self.true_pose(m.header.stamp).orientation),
                                   2.0 * math.pi)
            self.assertLess(abs(error), SIGMAS * math.sqrt(2.0) * HEADING_SIGMA)
            self.assertGreaterEqual(m.orientation_covariance[8], 2.0 * HEADING_SIGMA**2)

        fix = self.fixes.messages[-1]
        height = self.true_pose(fix.header.stamp).position.z
        sigma = math.sqrt(fix.position_covariance[8])
        self.assertAlmostEqual(fix.altitude - ORIGIN_ALTITUDE, height, delta=SIGMAS * sigma)
        labels, info = self.labels.messages[-1], self.infos.messages[-1]
        self.assertEqual((labels.width, labels.height, labels.encoding), (info.width, info.height, "32FC1"))
        for frame in (fix.header.frame_id, labels.header.frame_id):
            self.assertTrue(self.tf.can_transform("base_link", frame, rospy.Time()), frame)
        self.assertFalse(self.tf.can_transform("world", "base_link", rospy.Time()), "it does not tell where it is")

    def test_3_it_says_why_it_does_not_start(self):
        self.assertIn("the robot of carpark is a multirotor: unknown parameter rounds",
                      refusal_of_node("simulator", "_world:=carpark", "_rounds:=1"))
        self.assertIn("carpark.xml: there is no site 'lidar'",
                      refusal_of_node("simulator", "_world:=carpark", "_rings:=16"))
        self.assertIn("altitude_sigma_m = -1", refusal_of_node("simulator", "_world:=carpark", "_altitude_sigma_m:=-1"))


if __name__ == "__main__":
    rospy.init_node("multirotor_simulator_test")
    rostest.rosrun("situation_awareness", "multirotor_simulator_test", MultirotorSimulatorTest)
