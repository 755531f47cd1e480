#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""launch/corridor.launch with the parameters that are shipped: the vehicle localises itself, keeps to its path, slows
down beside things, maps what stands, and arrives."""
import math
import pathlib
import sys
import unittest

import rospy
import rostest
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist
from nav_msgs.msg import Path

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Latest, wait_until  # noqa: E402
from situation_awareness.msg import MapFeature, MapUpdate, SafetyVerdict, Transit  # noqa: E402


class CorridorTest(unittest.TestCase):
    def test_the_vehicle_arrives(self):
        transits, truths = Latest("transit", Transit), Latest("true_pose", PoseStamped)
        poses, maps = Latest("pose", PoseWithCovarianceStamped), Latest("semantic_map", MapUpdate)
        commands, verdicts, paths = Latest("cmd_vel", Twist), Latest("safety", SafetyVerdict), Latest("path", Path)
        wait_until(lambda: transits.messages and transits.messages[-1].docked, 200.0, "the end of the transit")

        truth = {message.header.stamp: message.pose.position for message in truths.messages}
        errors = [math.hypot(message.pose.pose.position.x - truth[message.header.stamp].x,
                             message.pose.pose.position.y - truth[message.header.stamp].y)
                  for message in poses.messages if message.header.stamp in truth]
        self.assertGreater(len(errors), 0.9 * len(truth))
        self.assertLess(math.sqrt(sum(error**2 for error in errors) / len(errors)), 0.005)
        way = [point.pose.position for point in paths.messages[-1].poses]
        off_way = [min(math.hypot(p.x - q.x, p.y - q.y) for q in way) for p in list(truth.values())[::10]]
        self.assertLess(max(off_way), 0.1)
        self.assertLessEqual(max(command.linear.x for command in commands.messages), 0.5 + 1e-9)
        self.assertGreater(len(verdicts.messages), 0.5 * len(truth))
        self.assertTrue(any(verdict.verdict == SafetyVerdict.SLOW for verdict in verdicts.messages))
        self.assertLess(transits.messages[-1].duration_s, 90.0)

        # The map has a polyline of each wall, box and post at the way.
        chains = [[(p.x, p.y) for p in feature.outline] for feature in maps.messages[-1].changed
                  if feature.kind == MapFeature.POLYLINE]
        edges = [(a, b) for chain in chains for a, b in zip(chain[:-1], chain[1:])]
        for x, y in ((8.0, -1.6), (12.0, 1.6), (5.6, 2.0), (5.4, -1.2), (3.2, 1.16), (6.4, -1.24)):
            self.assertLess(min(distance(x, y, a, b) for a, b in edges), 0.04, (x, y))


def distance(x, y, a, b):
    along = (b[0] - a[0], b[1] - a[1])
    square = along[0]**2 + along[1]**2
    part = 0.0 if square == 0.0 else ((x - a[0]) * along[0] + (y - a[1]) * along[1]) / square
    part = min(1.0, max(0.0, part))
    return math.hypot(x - a[0] - part * along[0], y - a[1] - part * along[1])


if __name__ == "__main__":
    rospy.init_node("corridor_test")
    rostest.rosrun("situation_awareness", "corridor_test", CorridorTest)
