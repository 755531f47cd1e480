#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Who walks through a room and parks there is on the one map once, under one id, and never a part of its walls."""
import math
import pathlib
import sys
import time
import unittest

import rospy
import rostest
from std_srvs.srv import Trigger

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import (ANGLE_MIN, BEAMS, INCREMENT, Diagnostics, Latest, MapFollower, Robot,  # noqa: E402
                         scan_msg, transform_msg, wait_until)
from situation_awareness.msg import MapFeature, MappedObject, MappedObjectArray  # noqa: E402

PERIOD_S = 0.04
RADIUS_M = 0.2
STAGE = "semantic_map"


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


class SemanticMapMoversTest(unittest.TestCase):
    def setUp(self):
        self.robot = Robot()
        self.diagnostics = Diagnostics()
        self.maps = MapFollower()
        wait_until(lambda: self.maps.subscriber.get_num_connections() > 0, 60.0, "the nodelets")
        time.sleep(1.5)  # the connections among them
        self.stamp = rospy.Time.now()
        self.scans = 0

    def see(self, x, y):
        """A scan with the thing there."""
        self.stamp += rospy.Duration.from_sec(PERIOD_S)
        self.robot.tf.publish(transform_msg(self.stamp, parent="map"))
        self.robot.publish(scan_msg(self.stamp, ranges=ranges_in_a_room(x, y)), transforms=False)
        wait_until(lambda: self.maps.messages and self.maps.messages[-1].header.stamp >= self.stamp, 10.0, "the map")
        self.assertEqual(self.maps.messages[-1].header.stamp, self.stamp)
        self.scans += 1

    def inside(self):
        """What is not the walls: the ids of what has no vertex on them, none of which may be one of several."""
        def is_on_wall(vertex):
            return min(abs(abs(vertex.x) - 5.0), abs(abs(vertex.y) - 4.0)) < 0.1
        inside = []
        for feature in self.maps.features.values():
            if feature.kind == MapFeature.POLYLINE:
                on_wall = [is_on_wall(vertex) for vertex in feature.outline]
                self.assertIn(sum(on_wall), (0, len(on_wall)), "no line leads from a wall to what is before it")
                if on_wall[0]:
                    continue
            inside.append(feature.id)
        return inside

    def count(self, key):
        return self.diagnostics.count(f"/{STAGE}", key) + self.diagnostics.count(STAGE, key)

    def test_who_walks_and_parks(self):
        x, y, ids = 2.0, -2.0, set()
        while y < 0.5:
            self.see(x, y)
            ids |= set(self.inside())
            y += PERIOD_S
        for _ in range(round(12.0 / PERIOD_S)):
            self.see(x, y)
            self.assertEqual(len(self.inside()), 1, "it is there once")
            ids |= set(self.inside())
        self.assertEqual(len(ids), 1, "under one id")
        parked = self.maps.features[self.inside()[0]]
        self.assertEqual(parked.motion, MapFeature.STANDING)
        for vertex in parked.outline:
            self.assertLess(math.hypot(vertex.x - x, vertex.y - y), RADIUS_M + 0.1)
        wait_until(lambda: self.count("scans with the map of objects") >= self.scans - 1, 5.0, "the maps of objects")
        self.assertEqual(self.count("no objects of that stamp"), 0)

        # Maps that cannot be used are counted, and change nothing.
        publisher = rospy.Publisher("objects", MappedObjectArray, queue_size=10)
        wait_until(lambda: publisher.get_num_connections() > 0, 10.0, STAGE)
        time.sleep(0.3)
        elsewhere, bad = MappedObjectArray(), MappedObjectArray()
        elsewhere.header.frame_id, bad.header.frame_id = "elsewhere", "map"
        elsewhere.header.stamp = bad.header.stamp = self.stamp
        bad.objects = [MappedObject(rx=math.nan, ry=1.0)]
        publisher.publish(elsewhere)
        publisher.publish(bad)
        wait_until(lambda: self.count("objects in another frame") == 1, 5.0, "objects in another frame")
        wait_until(lambda: self.count("objects that cannot be used") == 1, 5.0, "objects that cannot be used")
        self.see(x, y)
        self.assertEqual(set(self.inside()), ids)

    def test_z_a_reset_forgets_what_the_map_of_objects_knows(self):
        objects = Latest("objects", MappedObjectArray)
        wait_until(lambda: objects.subscriber.get_num_connections() > 0, 10.0, "mapping")
        y = -2.0
        while y < 0.0:
            self.see(2.0, y)
            y += PERIOD_S
        self.assertEqual(len(objects.messages[-1].objects), 1)
        uuid, ids = self.maps.map, {feature.id for feature in objects.messages[-1].objects} | set(self.inside())
        response = rospy.ServiceProxy("semantic_map/reset", Trigger)()
        self.assertTrue(response.success, response.message)
        wait_until(lambda: not objects.messages[-1].objects, 5.0, "no objects")
        while y < 1.0:
            self.see(2.0, y)
            y += PERIOD_S
        self.assertNotEqual(self.maps.map, uuid)
        self.assertEqual(len(objects.messages[-1].objects), 1)
        self.assertFalse(ids & ({feature.id for feature in objects.messages[-1].objects} | set(self.inside())))


if __name__ == "__main__":
    rospy.init_node("semantic_map_movers_test")
    rostest.rosrun("situation_awareness", "semantic_map_movers_test", SemanticMapMoversTest)
