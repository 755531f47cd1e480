#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Both maps of one scanner: what the map of objects follows is kept off the map of polygons until it has parked."""
import math
import pathlib
import sys
import time
import unittest

import rospy
import rostest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import (ANGLE_MIN, BEAMS, INCREMENT, Diagnostics, Latest, Robot, scan_msg,  # noqa: E402
                         transform_msg, wait_until)
from situation_awareness.msg import MappedObject, MappedObjectArray, PolygonArray  # noqa: E402

PERIOD_S = 0.04
RADIUS_M = 0.2
STAGE = "polygon_mapping"


def ranges_in_a_room(x, y):
    """Of a scanner at the origin of a room of 10 m x 8 m, with something round in it."""
    ranges = []
    for i in range(BEAMS):
        angle = ANGLE_MIN + i * INCREMENT
        dx, dy = math.cos(angle), math.sin(angle)
        nearest = min(5.0 / abs(dx) if dx else math.inf, 4.0 / abs(dy) if dy else math.inf)
        ahead, beside = x * dx + y * dy, y * dx - x * dy
        if ahead > 0.0 and abs(beside) < RADIUS_M:
            nearest = min(nearest, ahead - math.sqrt(RADIUS_M ** 2 - beside ** 2))
        ranges.append(nearest)
    return ranges


class PolygonsMoversTest(unittest.TestCase):
    def setUp(self):
        self.robot = Robot()
        self.diagnostics = Diagnostics()
        self.maps = Latest("polygons", PolygonArray)
        self.objects = Latest("objects", MappedObjectArray)
        wait_until(lambda: self.maps.subscriber.get_num_connections() > 0
                   and self.objects.subscriber.get_num_connections() > 0, 60.0, "the nodelets")
        time.sleep(1.5)  # the connections among them
        self.stamp = rospy.Time.now()
        self.scans = 0

    def see(self, x, y):
        """A scan with the thing there; the map after it."""
        self.stamp += rospy.Duration.from_sec(PERIOD_S)
        self.robot.tf.publish(transform_msg(self.stamp, parent="map"))
        self.robot.publish(scan_msg(self.stamp, ranges=ranges_in_a_room(x, y)), transforms=False)
        wait_until(lambda: self.maps.messages and self.maps.messages[-1].header.stamp >= self.stamp, 10.0, "the map")
        self.assertEqual(self.maps.messages[-1].header.stamp, self.stamp)
        self.scans += 1
        return self.maps.messages[-1]

    def inside(self, message):
        """Vertices that are on no wall."""
        return [(vertex.x, vertex.y) for polygon in message.polygons for vertex in polygon.vertices
                if min(abs(abs(vertex.x) - 5.0), abs(abs(vertex.y) - 4.0)) > 0.1]

    def count(self, key):
        return self.diagnostics.count(f"/{STAGE}", key) + self.diagnostics.count(STAGE, key)

    def test_who_walks_and_parks(self):
        x, y = 2.0, -2.0
        while y < 0.5:
            walls = self.see(x, y)
            if y > -1.4:
                self.assertEqual(self.inside(walls), [], f"at {y}")
            y += PERIOD_S
        wait_until(lambda: any(math.hypot(o.pose.position.x - x, o.pose.position.y - y) < 0.15
                               for o in self.objects.messages[-1].objects), 5.0, "it on the map of objects")
        for _ in range(round(3.0 / PERIOD_S)):
            self.assertEqual(self.inside(self.see(x, y)), [], "someone who stands for 3 s")
        for _ in range(round(9.0 / PERIOD_S)):
            parked = self.see(x, y)
        self.assertNotEqual(self.inside(parked), [], "it has stood for 12 s")
        for vertex in self.inside(parked):
            self.assertLess(math.hypot(vertex[0] - x, vertex[1] - y), RADIUS_M + 0.1)
        wait_until(lambda: self.count("scans with the map of objects") >= self.scans - 1, 5.0, "the maps of objects")
        self.assertEqual(self.count("no objects of that stamp"), 0)
        self.assertEqual(self.count("things that set off"), 1)
        self.assertGreater(self.count("hits on movers"), 500)

        # Maps that cannot be used are counted, and change nothing.
        publisher = rospy.Publisher("objects", MappedObjectArray, queue_size=10)
        wait_until(lambda: publisher.get_num_connections() > 1, 10.0, "polygon_mapping")
        time.sleep(0.3)
        elsewhere, bad = MappedObjectArray(), MappedObjectArray()
        elsewhere.header.frame_id, bad.header.frame_id = "elsewhere", "map"
        elsewhere.header.stamp = bad.header.stamp = self.stamp
        bad.objects = [MappedObject(rx=math.nan, ry=1.0)]
        publisher.publish(elsewhere)
        publisher.publish(bad)
        wait_until(lambda: self.count("objects in another frame") == 1, 5.0, "objects in another frame")
        wait_until(lambda: self.count("objects that cannot be used") == 1, 5.0, "objects that cannot be used")
        self.assertNotEqual(self.inside(self.see(x, y)), [])


if __name__ == "__main__":
    rospy.init_node("polygons_movers_test")
    rostest.rosrun("situation_awareness", "polygons_movers_test", PolygonsMoversTest)
