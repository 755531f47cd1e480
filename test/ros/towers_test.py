#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""launch/towers.launch with the parameters that are shipped: the vehicle finds its pose by GPS and INS and maps the
boundary of the building that it flies around."""
import math
import pathlib
import sys
import unittest

import rospy
import rostest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path
from sensor_msgs.msg import Imu, LaserScan, NavSatFix
from std_msgs.msg import Empty

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Latest, wait_until, yaw_of  # noqa: E402
from situation_awareness.msg import MapFeature, MapUpdate  # noqa: E402

SEMI_AXES, YAW = (10.0, 6.0), 0.5  # of the ellipse at the origin, models/worlds/towers.xml
CIRCLE = 17.0
SPEED = 5.0


def seconds(message):
    return message.header.stamp.to_sec()


def of_quaternion(q):
    """Roll and yaw."""
    return math.atan2(2.0 * (q.w * q.x + q.y * q.z), 1.0 - 2.0 * (q.x**2 + q.y**2)), yaw_of(q)


def ellipse_points():
    points = []
    for i in range(360):
        x, y = SEMI_AXES[0] * math.cos(math.radians(i)), SEMI_AXES[1] * math.sin(math.radians(i))
        points.append((x * math.cos(YAW) - y * math.sin(YAW), x * math.sin(YAW) + y * math.cos(YAW)))
    return points


class TowersTest(unittest.TestCase):
    def test_the_first_building_is_mapped(self):
        truths, poses = Latest("true_pose", PoseStamped), Latest("odometry", Odometry)
        imu, fixes, scans = Latest("imu", Imu), Latest("fix", NavSatFix), Latest("scan", LaserScan)
        maps, paths, done = Latest("semantic_map", MapUpdate), Latest("path", Path), Latest("flight_done", Empty)
        wait_until(lambda: done.messages, 180.0, "the end of the round")
        flown = seconds(truths.messages[-1]) - seconds(truths.messages[0])

        # What the sensors are.
        for topic, rate in ((imu, 200.0), (fixes, 5.0), (scans, 25.0)):
            self.assertAlmostEqual((len(topic.messages) - 1) / (seconds(topic.messages[-1]) - seconds(
                topic.messages[0])), rate, delta=0.05 * rate)
        # What the vehicle does: constant height, a tight bank in the turn, at its speed through the air.
        rolls = [of_quaternion(message.pose.orientation)[0] for message in truths.messages]
        self.assertLess(math.degrees(max(map(abs, rolls))), 20.6)  # with gusts
        self.assertLess(min(rolls), -0.1, "left turns")
        self.assertLess(max(abs(message.pose.position.z - 15.0) for message in truths.messages), 1e-6)
        way = sum(math.hypot(b.pose.position.x - a.pose.position.x, b.pose.position.y - a.pose.position.y)
                  for a, b in zip(truths.messages[:-1], truths.messages[1:]))
        self.assertAlmostEqual(way / flown, SPEED, delta=1.2)  # with wind
        self.assertGreaterEqual(len(paths.messages), 2, "the way, the round")
        around = [message.pose.position for message in truths.messages[-500:]]
        for p in around:
            self.assertAlmostEqual(math.hypot(p.x, p.y), CIRCLE, delta=1.0)

        # The pose is not worse than fixes of 2.1 m. Each has the nearest truth, which is at most 10 ms, 6 cm, from it.
        truth = {round(50.0 * seconds(message)): message.pose.position for message in truths.messages}
        errors = [math.hypot(message.pose.pose.position.x - truth[key].x, message.pose.pose.position.y - truth[key].y)
                  for message in poses.messages for key in (round(50.0 * seconds(message)),) if key in truth]
        self.assertGreater(len(errors), 500)
        self.assertLess(math.sqrt(sum(error**2 for error in errors) / len(errors)), 3.0)

        # The building: where GPS says that it is, and of its shape.
        near = [own for own in maps.messages[-1].changed if own.kind == MapFeature.BOUNDARY
                and max(math.hypot(p.x, p.y) for p in own.outline) < CIRCLE]
        self.assertTrue(near)
        own = max(near, key=lambda boundary: len(boundary.outline))
        outline = ellipse_points()
        offsets = [min(math.hypot(p.x - x, p.y - y) for x, y in outline) for p in own.outline]
        self.assertLess(sum(offsets) / len(offsets), 2.5)
        self.assertLess(max(offsets), 4.0)
        self.assertGreater(min(own.sigma), 0.3, "GPS's error is part of it")
        extent = [max(p.x for p in own.outline) - min(p.x for p in own.outline),
                  max(p.y for p in own.outline) - min(p.y for p in own.outline)]
        expected = [max(p[axis] for p in outline) - min(p[axis] for p in outline) for axis in (0, 1)]
        for is_, should in zip(extent, expected):
            self.assertAlmostEqual(is_, should, delta=1.5)


if __name__ == "__main__":
    rospy.init_node("towers_test")
    rostest.rosrun("situation_awareness", "towers_test", TowersTest)
