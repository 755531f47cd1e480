#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelet splinegon_mapping: topics, services, files, and what it does with messages that cannot be used."""
import json
import math
import os
import pathlib
import signal
import sys
import tempfile
import time
import unittest

import rospy
import rostest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from fault_record import fault  # noqa: E402
from ros_support import BEAMS, Diagnostics, Latest, pid_of, scan_msg, transform_msg, wait_until  # noqa: E402
from ros_support import ranges_to_circles  # noqa: E402
from situation_awareness.msg import SplinegonArray  # noqa: E402
from situation_awareness.srv import GetSplinegons, LoadSplinegons, SaveSplinegons  # noqa: E402

STAGE = "splinegon_mapping"
TOWER = 6.0  # its radius; the vehicle flies around it
DISTANCE = 14.0
SPEED = 5.0
PERIOD = 0.1
ROUND = math.ceil(2.0 * math.pi * DISTANCE / SPEED / PERIOD)
HEIGHT = 15.0


class SplinegonMappingTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.diagnostics = Diagnostics()
        cls.maps = Latest("splinegons", SplinegonArray)
        cls.downlink = Latest("downlink/splinegons", SplinegonArray)
        cls.markers = Latest("splinegon_markers", MarkerArray)
        cls.local = Latest("local_polygon_markers", MarkerArray)
        cls.odometry = rospy.Publisher("odometry", Odometry, queue_size=1000, tcp_nodelay=True)
        cls.scans = rospy.Publisher("scan", LaserScan, queue_size=1000, tcp_nodelay=True)
        cls.tf_static = rospy.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        cls.tf_static.publish(transform_msg(rospy.Time(1), parent="base_link"))
        cls.get = rospy.ServiceProxy("get_splinegons", GetSplinegons)
        cls.save = rospy.ServiceProxy(f"{STAGE}/save_splinegons", SaveSplinegons)
        cls.load = rospy.ServiceProxy(f"{STAGE}/load_splinegons", LoadSplinegons)
        cls.reset = rospy.ServiceProxy(f"{STAGE}/reset", Trigger)
        cls.pause = rospy.ServiceProxy(f"{STAGE}/pause", SetBool)
        cls.load.wait_for_service(60.0)
        wait_until(lambda: all(link.get_num_connections() > 0 for link in (
            cls.odometry, cls.scans, cls.tf_static, *(latest.subscriber for latest in (
                cls.maps, cls.downlink, cls.markers, cls.local)))), 60.0, "the nodelet")
        time.sleep(0.5)
        cls.i = 0
        cls.begin = rospy.Time(1000)

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.pause(False)
        self.reset()

    def stamp(self):
        return self.begin + rospy.Duration(PERIOD * self.i)

    def odometry_msg(self, after_s=0.0):
        angle = SPEED * (PERIOD * self.i + after_s) / DISTANCE
        msg = Odometry()
        msg.header.stamp, msg.header.frame_id, msg.child_frame_id = self.stamp() + rospy.Duration(after_s), "world", \
            "base_link"
        position = msg.pose.pose.position
        position.x, position.y, position.z = DISTANCE * math.cos(angle), DISTANCE * math.sin(angle), HEIGHT
        yaw = angle + 0.5 * math.pi
        msg.pose.pose.orientation.z, msg.pose.pose.orientation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
        msg.twist.twist.linear.x, msg.twist.twist.angular.z = SPEED, SPEED / DISTANCE
        msg.pose.covariance = [0.01 * (k % 7 == 0) for k in range(36)]
        msg.twist.covariance = [0.0025 * (k % 7 == 0) for k in range(36)]
        return msg

    def scan_at_once(self, **arguments):
        if "ranges" not in arguments:
            # As seen from the vehicle the tower is to the left, whatever its place.
            arguments["ranges"] = ranges_to_circles([(0.0, DISTANCE, TOWER)])
        msg = scan_msg(self.stamp(), **arguments)
        self.scans.publish(msg)
        return msg.header.stamp

    def fly(self, count, **arguments):
        """So many scans further; the map after the last."""
        stamp = None
        for _ in range(count):
            for k in range(5):
                self.odometry.publish(self.odometry_msg(0.2 * PERIOD * k))
            stamp = self.scan_at_once(**arguments)
            type(self).i += 1
            time.sleep(0.004)
        self.odometry.publish(self.odometry_msg())
        wait_until(lambda: self.maps.messages and self.maps.messages[-1].header.stamp >= stamp, 10.0, "the map")
        return self.maps.messages[-1]

    def count(self, key):
        return self.diagnostics.count(f"/{STAGE}", key) + self.diagnostics.count(STAGE, key)

    def counts(self, key, act):
        before = self.count(key)
        act()
        wait_until(lambda: self.count(key) > before, 5.0, key)
        return self.count(key) - before

    def ids(self):
        return {own.id for own in self.maps.messages[-1].splinegons}

    def assert_the_tower(self, message):
        self.assertEqual(len(message.splinegons), 1)
        tower = message.splinegons[0]
        self.assertTrue(tower.closed)
        for p, sigma in zip(tower.vertices, tower.sigma_m):
            self.assertAlmostEqual(math.hypot(p.x, p.y), TOWER, delta=0.1)
            self.assertGreaterEqual(sigma, 0.09, "the pose's error is part of it")
            self.assertEqual(p.z, HEIGHT)
        return tower.id

    def test_a_tower(self):
        half = self.fly(ROUND // 3)
        self.assertFalse(half.splinegons[0].closed, "not before it was seen")
        message = self.fly(ROUND)
        self.assertEqual(message.header.frame_id, "world")
        self.assert_the_tower(message)
        for topic in (self.downlink, self.markers, self.local):
            wait_until(lambda topic=topic: topic.messages, 5.0, topic.subscriber.name)
        names = {marker.ns for marker in self.markers.messages[-1].markers}
        self.assertTrue({"closed", "envelope", "vertices", "id"} <= names, names)
        local = self.local.messages[-1].markers[-1]
        self.assertEqual(local.ns, "local_polygon")
        for p in local.points:
            self.assertAlmostEqual(math.hypot(p.x, p.y), TOWER, delta=0.15)
        got = self.get(rospy.Time())
        self.assertTrue(got.success, got.message)
        self.assertEqual(got.splinegons.header.stamp, message.header.stamp)
        self.assertEqual(got.splinegons.splinegons, message.splinegons)
        self.assertTrue(self.get(message.header.stamp + rospy.Duration(1.0)).success)
        self.assertFalse(self.get(message.header.stamp - rospy.Duration(1.0)).success)
        wait_until(lambda: self.count("closed") == 1, 5.0, "the diagnostics")

    def test_files(self):
        tower = self.assert_the_tower(self.fly(ROUND + 30))
        path = self.folder / "map.geojson"
        answer = self.save(str(path))
        self.assertTrue(answer.success, answer.message)
        self.assertFalse(self.save("map.geojson").success, "no absolute path")
        self.assertFalse(self.save(str(self.folder / "map.yaml")).success, "no GeoJSON")
        collection = json.loads(path.read_text())
        self.assertEqual([feature["properties"]["id"] for feature in collection["features"]], [tower])
        self.assertEqual(collection["features"][0]["geometry"]["type"], "Polygon")
        self.reset()
        wait_until(lambda: not self.maps.messages[-1].splinegons, 5.0, "the empty map")
        answer = self.load(str(path))
        self.assertTrue(answer.success, answer.message)
        wait_until(lambda: self.ids() == {tower}, 5.0, "the loaded map")
        self.assertEqual(self.assert_the_tower(self.fly(20)), tower, "it is the same tower")
        # Damage is refused with the file's name, and the map stays.
        bad = self.folder / "bad.geojson"
        for text in (None, "", path.read_text()[:200], "a: [1", json.dumps({"type": "FeatureCollection", "features": [
                {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": [1, 2]}}]})):
            if text is not None:
                bad.write_text(text)
            answer = self.load(str(bad))
            self.assertFalse(answer.success)
            self.assertTrue(answer.message.startswith(str(bad)), answer.message)
        self.assertEqual(self.assert_the_tower(self.fly(2)), tower)

    def test_reset_and_pause(self):
        last = max(own.id for own in self.fly(30).splinegons)
        self.assertTrue(self.pause(True).success)
        messages = len(self.maps.messages)
        self.assertGreater(self.counts("passed over while paused", lambda: [self.odometry.publish(
            self.odometry_msg(0.2 * PERIOD * k)) for k in range(5)] and self.scan_at_once() and self.odometry.publish(
                self.odometry_msg(PERIOD))), 0)
        type(self).i += 1
        self.assertEqual(len(self.maps.messages), messages)
        self.pause(False)
        self.assertTrue(self.reset().success)
        wait_until(lambda: not self.maps.messages[-1].splinegons, 5.0, "the empty map")
        self.assertGreater(min(own.id for own in self.fly(30).splinegons), last, "ids are not used again")

    @fault("scan that cannot be used", "no ranges, an increment of NaN, a stamp that repeats", "counted by reason; the "
           "boundaries stay", times=3)
    def test_scans_that_cannot_be_used(self):
        self.fly(30)
        ids = self.ids()
        before = len(self.maps.messages)
        for arguments in ({"ranges": []}, {"increment": math.nan}):
            self.scan_at_once(**arguments)
        type(self).i -= 1
        self.assertEqual(self.counts("dropped: stamp repeats or goes back", self.scan_at_once), 1)
        type(self).i += 1
        self.assertEqual(len(self.maps.messages), before)
        self.fly(3)
        self.assertEqual(self.ids(), ids)

    @fault("odometry that cannot be used", "NaN, no covariance, another frame, a stamp that repeats",
           "counted by reason; the boundaries stay", times=5)
    def test_odometry_that_cannot_be_used(self):
        self.fly(30)
        ids = self.ids()

        def send(spoil):
            msg = self.odometry_msg(0.01)
            spoil(msg)
            self.odometry.publish(msg)

        for key, spoil in (
                ("odometry not a finite pose", lambda msg: setattr(msg.pose.pose.position, "x", math.nan)),
                ("odometry not finite", lambda msg: setattr(msg.twist.twist.linear, "x", math.nan)),
                ("odometry without a covariance", lambda msg: setattr(msg.pose, "covariance", [0.0] * 36)),
                ("odometry in another frame", lambda msg: setattr(msg.header, "frame_id", "map")),
                ("odometry stamp repeats or goes back",
                 lambda msg: setattr(msg.header, "stamp", msg.header.stamp - rospy.Duration(0.2)))):
            self.assertEqual(self.counts(f"not used: {key}", lambda spoil=spoil: send(spoil)), 1, key)
        self.fly(3)
        self.assertEqual(self.ids(), ids)

    @fault("no valid range", "10 scans all NaN", "every scan is used, ids stay", times=10)
    def test_scans_of_nothing(self):
        self.fly(30)
        ids = self.ids()
        self.fly(10, ranges=[math.nan] * BEAMS)
        self.assertEqual(self.ids(), ids)

    @fault("odometry silent", "for 10 scans, longer than ~tf_timeout_s", "all dropped: no odometry; ids stay", times=10)
    def test_silent_odometry(self):
        self.fly(30)
        ids = self.ids()

        def without_odometry():
            for _ in range(10):
                type(self).i += 1
                self.scan_at_once()
                time.sleep(0.02)
            time.sleep(0.8)  # ~tf_timeout_s

        self.assertEqual(self.counts("dropped: no odometry", without_odometry), 10)
        type(self).i += 1
        self.fly(3)
        self.assertEqual(self.ids(), ids)

    @fault("time is reset", "stamps 500 s back", "a new map, ids are not used again")
    def test_y_time_that_starts_again(self):
        last = max(own.id for own in self.fly(30).splinegons)
        type(self).begin -= rospy.Duration(500)
        self.assertEqual(self.counts("time jumped back: new map", lambda: self.fly_without_waiting(30)), 1)
        self.assertGreater(min(own.id for own in self.fly(10).splinegons), last)

    def fly_without_waiting(self, count):
        for _ in range(count):
            for k in range(5):
                self.odometry.publish(self.odometry_msg(0.2 * PERIOD * k))
            self.scan_at_once()
            type(self).i += 1
            time.sleep(0.02)

    @fault("manager killed", "SIGKILL", "respawn restarts it, with a new map; a saved one can be loaded")
    def test_z_a_killed_manager_comes_back(self):
        tower = self.assert_the_tower(self.fly(ROUND + 30))
        path = str(self.folder / "map.geojson")
        self.assertTrue(self.save(path).success)
        messages = len(self.maps.messages)
        os.kill(pid_of("/splinegons_manager"), signal.SIGKILL)

        def maps_again():
            self.fly_without_waiting(1)
            time.sleep(0.1)
            return len(self.maps.messages) > messages + 3
        wait_until(maps_again, 60.0, "the manager and its nodelet to come back")
        self.load.wait_for_service(10.0)
        self.assertTrue(self.load(path).success)
        self.assertEqual(self.assert_the_tower(self.fly(20)), tower)


if __name__ == "__main__":
    rospy.init_node("splinegon_mapping_test")
    rostest.rosrun("situation_awareness", "splinegon_mapping_test", SplinegonMappingTest)
