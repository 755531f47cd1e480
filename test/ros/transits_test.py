#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""simulator and evaluator: a vehicle is steered by its true pose from dock to dock, what stands changes
meanwhile, and the evaluator judges a map that is the truth, and one that has an error."""
import math
import pathlib
import subprocess
import sys
import threading
import unittest

import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist
from sensor_msgs.msg import LaserScan

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from mission_faults import map_update, outline_feature  # noqa: E402
from ros_support import Latest, refusal_of_node, wait_until  # noqa: E402
from situation_awareness.msg import MapUpdate, Transit  # noqa: E402

DOCKS = ((1.6, 0.0), (13.6, 0.0))
STALE_S = 0.3  # of simulated time: an older pose steers no more
SIGMA_M, SIGMA_RAD = 0.001, 0.0005


class Vehicle:
    """Steers to the dock ahead along the corridor's middle; publishes the true pose as the estimate, 1 mm off, and the
    truth as the map.

    It does so in a thread of its own, at the latest pose: subscribers of a topic in one process share a queue, so poses
    that come while it is busy wait for it, whatever the queue_size of its own."""

    def __init__(self):
        self.pose, self.has_pose = None, threading.Event()
        self.transit = None
        self.commands = rospy.Publisher("cmd_vel", Twist, queue_size=1)
        self.estimates = rospy.Publisher("pose", PoseWithCovarianceStamped, queue_size=50)
        self.maps = rospy.Publisher("semantic_map/updates", MapUpdate, queue_size=5)
        self.wrong_maps = rospy.Publisher("wrong/updates", MapUpdate, queue_size=5)
        self.subscribers = [rospy.Subscriber("transit", Transit, self.on_transit, queue_size=10),
                            rospy.Subscriber("true_pose", PoseStamped, self.on_pose, queue_size=1)]

    def on_transit(self, message):
        self.transit = message

    def on_pose(self, message):
        self.pose = message
        self.has_pose.set()

    def drive(self):
        while not rospy.is_shutdown():
            self.has_pose.wait()
            self.has_pose.clear()
            if self.transit is not None:
                self.steer(self.pose)

    def steer(self, message):
        x, y = message.pose.position.x, message.pose.position.y
        yaw = 2.0 * math.atan2(message.pose.orientation.z, message.pose.orientation.w)
        goal = DOCKS[self.transit.number % 2]
        ahead = math.cos(yaw) * (goal[0] - x) + math.sin(yaw) * (goal[1] - y)
        direction = 0.0 if self.transit.number % 2 == 1 else math.pi
        aside = y if direction == 0.0 else -y
        error = math.remainder(yaw - direction, 2.0 * math.pi)
        command = Twist()
        if (rospy.Time.now() - message.header.stamp).to_sec() < STALE_S:
            command.linear.x = max(0.0, min(0.8, ahead))
            command.angular.z = -1.5 * error - 0.8 * aside if ahead > 0.3 else 0.0
        self.commands.publish(command)

        estimate = PoseWithCovarianceStamped()
        estimate.header = message.header
        estimate.pose.pose = message.pose
        estimate.pose.pose.position.x += SIGMA_M
        covariance = [0.0] * 36
        covariance[0] = covariance[7] = SIGMA_M**2
        covariance[35] = SIGMA_RAD**2
        estimate.pose.covariance = covariance
        self.estimates.publish(estimate)
        self.maps.publish(self.map(message.header.stamp, 0.0))
        self.wrong_maps.publish(self.map(message.header.stamp, 0.2))

    def map(self, stamp, shift_m):
        stands = [outline for outline in self.transit.outlines if outline.is_there and not outline.can_move]
        return map_update(stamp, stamp.to_nsec(), [
            outline_feature(1 + i, [(p.x, p.y + shift_m) for p in outline.vertices], sigma=0.01, closed=True)
            for i, outline in enumerate(stands)])


class TransitsTest(unittest.TestCase):
    def evaluator(self, name, *remappings):
        return subprocess.Popen(["rosrun", "situation_awareness", "evaluator", f"__name:={name}", "_world:=corridor", *remappings],
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    def test_1_the_evaluator_judges_two_transits(self):
        transits, scans = [], Latest("scan", LaserScan)
        subscriber = rospy.Subscriber("transit", Transit, lambda m: transits.append((rospy.Time.now(), m)))
        tf = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(tf)
        poses = Latest("true_pose", PoseStamped)
        vehicle = Vehicle()
        right, wrong = self.evaluator("right"), self.evaluator("wrong", "semantic_map/updates:=wrong/updates")
        wait_until(lambda: vehicle.wrong_maps.get_num_connections() > 0 and vehicle.maps.get_num_connections() > 0
                   and poses.messages, 60.0, "the evaluators")
        threading.Thread(target=vehicle.drive, daemon=True).start()
        output, _ = right.communicate(timeout=120)
        self.assertEqual(right.returncode, 0, output)
        self.assertIn("16 of 16", output)
        output, _ = wrong.communicate(timeout=30)
        self.assertEqual(wrong.returncode, 1, output)
        self.assertIn("NOT MET", output)

        wait_until(lambda: len(transits) >= 4, 10.0, "the end of the last transit")
        # Without a scan in the dock, where the vehicle turned and things changed.
        self.assertEqual([(m.number, m.docked) for _, m in transits], [(1, False), (1, True), (2, False), (2, True)])
        self.assertEqual(transits[-1][1].transits, 2)
        docked, free = transits[1][1].header.stamp, transits[2][1].header.stamp
        self.assertFalse([s for s in scans.stamps() if docked < s < free])
        self.assertTrue([s for s in scans.stamps() if s > free])
        there = [{o.thing for o in m.outlines if o.is_there} for _, m in transits]
        self.assertEqual(there[2] - there[1], {"cup", "screen", "box_appears", "box_goes_late"})
        self.assertEqual(there[1] - there[2], set())
        # The simulator's map -> odom makes the pose of the vehicle the true one.
        last = poses.messages[-1]
        estimate = tf.lookup_transform("map", "base_link", last.header.stamp, rospy.Duration(5)).transform.translation
        self.assertAlmostEqual(estimate.x, last.pose.position.x, delta=0.002)
        self.assertAlmostEqual(estimate.y, last.pose.position.y, delta=0.002)
        del listener, subscriber

    def test_2_it_refuses_what_it_does_not_know(self):
        message = refusal_of_node("evaluator", "_world:=corridor", "_max_distance:=2")
        for fact in ("max_distance_m", "the robot of corridor is a unicycle"):
            self.assertIn(fact, message)


if __name__ == "__main__":
    rospy.init_node("transits_test")
    rostest.rosrun("situation_awareness", "transits_test", TransitsTest)
