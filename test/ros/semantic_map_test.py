#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelet semantic_map: topics, services, files, and what it does with messages that cannot be used."""
import copy
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
from geometry_msgs.msg import PoseWithCovarianceStamped
from visualization_msgs.msg import MarkerArray

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from fault_record import fault  # noqa: E402
from ros_support import (ANGLE_MIN, BEAMS, INCREMENT, Diagnostics, Latest, MapFollower,  # noqa: E402
                         MapServices, Robot, comes_true, pid_of, scan_msg, transform_msg, wait_until)
from situation_awareness.msg import MapFeature, SegmentArray  # noqa: E402

STAGE = "semantic_map"


def ranges_in_a_room(box=True):
    """Of a scanner at the origin of a room of 10 m x 8 m, with a box of 1 m x 1 m before its wall."""
    ranges = []
    for i in range(BEAMS):
        angle = ANGLE_MIN + i * INCREMENT
        dx, dy = math.cos(angle), math.sin(angle)
        nearest = min(5.0 / abs(dx) if dx else math.inf, 4.0 / abs(dy) if dy else math.inf)
        if box and dx > 0 and abs(2.5 / dx * dy) < 0.5:
            nearest = min(nearest, 2.5 / dx)
        ranges.append(nearest)
    return ranges


class SemanticMapTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.robot = Robot()
        cls.diagnostics = Diagnostics()
        cls.maps = MapFollower()
        cls.markers = Latest("semantic_map_markers", MarkerArray)
        cls.segments = Latest("segments", SegmentArray)
        cls.raw = rospy.Publisher("segments", SegmentArray, queue_size=100)
        cls.services = MapServices()
        wait_until(lambda: cls.raw.get_num_connections() > 1 and all(
            latest.subscriber.get_num_connections() > 0
            for latest in (cls.maps, cls.markers, cls.segments)), 60.0, "the nodelets")
        time.sleep(0.5)

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.services.pause(False)
        self.services.reset()
        time.sleep(1.1)  # the room is new

    def send(self, count, before_scan=lambda stamp: None, **arguments):
        """So many scans of the room; the stamp of the last one."""
        stamp = None
        for _ in range(count):
            stamp = rospy.Time.now()
            before_scan(stamp)
            self.robot.tf.publish(transform_msg(stamp, parent="map"))
            self.robot.publish(scan_msg(stamp, ranges=ranges_in_a_room(**arguments)), transforms=False)
        return stamp

    def scan(self, count, before_scan=lambda stamp: None, **arguments):
        """The same; the map of the last one."""
        stamp = self.send(count, before_scan, **arguments)
        wait_until(lambda: self.maps.messages and self.maps.messages[-1].header.stamp >= stamp, 10.0, "the map")
        return self.maps.messages[-1]

    def count(self, key):
        return self.diagnostics.count(f"/{STAGE}", key) + self.diagnostics.count(STAGE, key)

    def test_a_room_with_a_box(self):
        message = self.scan(25)
        self.assertEqual(message.header.frame_id, "map")
        features = list(self.maps.features.values())
        self.assertGreaterEqual(len(features), 2)
        for feature in features:
            self.assertEqual(feature.kind, MapFeature.POLYLINE)
            self.assertEqual(feature.motion, MapFeature.STANDING)
            self.assertEqual(len(feature.outline), len(feature.sigma))
            for vertex in feature.outline:
                off_wall = min(abs(abs(vertex.x) - 5.0), abs(abs(vertex.y) - 4.0))
                self.assertLess(min(off_wall, abs(vertex.x - 2.5)), 0.03)
        self.assertGreaterEqual(min(len(feature.outline) for feature in features), 2)
        wait_until(lambda: self.markers.messages, 5.0, "markers")
        names = {marker.ns for marker in self.markers.messages[-1].markers}
        self.assertTrue({"known", "id", "uncertainty"} <= names, names)

    def test_files(self):
        self.scan(25)
        ids, uuid = self.ids(), self.maps.map
        path = self.folder / "map.json"
        answer = self.services.save(str(path))
        self.assertTrue(answer.success, answer.message)
        self.assertFalse(self.services.save("map.json").success, "no absolute path")
        saved = json.loads(path.read_text())
        self.assertEqual({feature["id"] for feature in saved["features"]}, ids)
        self.services.reset()
        answer = self.services.load(str(path))
        self.assertTrue(answer.success, answer.message)
        wait_until(lambda: self.maps.map != uuid, 5.0, "another map")
        self.assertEqual(self.ids(), ids)
        self.scan(3)
        self.assertEqual(self.ids(), ids, "it is the same room")
        # Damage is refused with the file's name, and the map stays.
        text = path.read_text()
        for name, damaged in (("cut.json", text[:len(text) // 2]), ("frame.json", text.replace('"map"', '"odom"', 1)),
                              ("number.json", text.replace('"p_exists":', '"p_exists":7', 1))):
            path = self.folder / name
            path.write_text(damaged)
            answer = self.services.load(str(path))
            self.assertFalse(answer.success)
            self.assertTrue(answer.message.startswith(f"{path}: "), answer.message)
        self.scan(1)
        self.assertEqual(self.ids(), ids)

    def test_reset_and_pause(self):
        self.scan(25)
        last, uuid = max(self.ids()), self.maps.map
        self.assertTrue(self.services.pause(True).success)
        messages = len(self.maps.messages)
        for _ in range(3):
            stamp = rospy.Time.now()
            self.robot.tf.publish(transform_msg(stamp, parent="map"))
            self.robot.publish(scan_msg(stamp, ranges=ranges_in_a_room()), transforms=False)
        self.assertEqual(len(self.maps.messages), messages)
        self.services.pause(False)
        self.assertTrue(self.services.reset().success)
        time.sleep(1.1)
        self.scan(25)
        self.assertNotEqual(self.maps.map, uuid)
        self.assertGreater(min(self.ids()), last, "ids are not used again")

    @fault("segments that cannot be used", "another frame, NaN, huge numbers, indices out of range, stamps that repeat "
           "or go back; then 100 s back", "each is counted by its reason, the map stays; far back is a new map",
           times=11)
    def test_messages_that_cannot_be_used(self):
        self.scan(25)
        good = self.segments.messages[-1]
        self.assertGreater(len(good.points), 100)
        expected, uuid = dict(self.maps.features), self.maps.map

        def later(spoil):
            msg = copy.deepcopy(good)
            msg.header.stamp = rospy.Time.now()
            spoil(msg)
            return msg

        def set_point(msg, name, value):
            setattr(msg.points[7], name, value)

        def far_free_space(msg):
            msg.free_azimuth = [azimuth + 1e9 for azimuth in msg.free_azimuth]

        faults = [lambda msg: setattr(msg.header, "frame_id", "elsewhere"),
                  lambda msg: set_point(msg, "x", math.nan), lambda msg: set_point(msg, "y", 1e30),
                  lambda msg: setattr(msg.level, "x", math.inf), lambda msg: setattr(msg.level, "x", 1e9),
                  lambda msg: setattr(msg.segments[0], "first", 10**6),
                  lambda msg: setattr(msg.segments[0], "right_end", 77), far_free_space]
        bad = self.count("dropped: bad message")
        for spoil in faults:
            self.raw.publish(later(spoil))
            time.sleep(0.05)
        wait_until(lambda: self.count("dropped: bad message") == bad + len(faults), 5.0, "the drops of bad messages")
        stamps = self.count("dropped: stamp repeats or goes back")
        for seconds in (0.0, 0.3):
            msg = copy.deepcopy(good)
            msg.header.stamp = good.header.stamp - rospy.Duration(seconds)
            self.raw.publish(msg)
            time.sleep(0.05)
        wait_until(lambda: self.count("dropped: stamp repeats or goes back") == stamps + 2, 5.0, "stamps that go back")
        self.assertEqual(self.maps.features, expected, "the map is as it was")
        # A jump far back begins a new map; it goes on from there.
        msg = copy.deepcopy(good)
        msg.header.stamp = good.header.stamp - rospy.Duration(100.0)
        self.raw.publish(msg)
        wait_until(lambda: self.maps.map != uuid, 5.0, "the new map")
        wait_until(lambda: self.count("time jumped back: new map") >= 1, 5.0, "the reason")

    @fault("pose that cannot be used", "NaN, a negative variance, another frame, another stamp, a sigma of 1 m",
           "counted by reason; not mapped where the pose does not say how certain it is, or that it is too uncertain",
           times=13)
    def test_z_the_covariance_of_the_pose(self):
        """It is that of the same stamp, waited for while `pose` has a publisher; without one it is not mapped any more."""
        publisher = rospy.Publisher("pose", PoseWithCovarianceStamped, queue_size=100)
        self.addCleanup(publisher.unregister)
        wait_until(lambda: publisher.get_num_connections() > 0, 10.0, "semantic_map")
        time.sleep(0.3)
        variance, frame, offset = [1e-6], ["map"], [rospy.Duration()]

        def publish(stamp):
            msg = PoseWithCovarianceStamped()
            msg.header.stamp, msg.header.frame_id = stamp + offset[0], frame[0]
            msg.pose.pose.orientation.w = 1.0
            for i in (0, 7, 35):
                msg.pose.covariance = [variance[0] if k == i else value for k, value in
                                       enumerate(msg.pose.covariance)]
            publisher.publish(msg)

        key = "scans with the covariance of pose"
        before = self.count(key)
        least_sigma_m = []
        for variance[0] in (1e-6, 4e-4):  # the second is that of the default
            self.assertTrue(self.services.reset().success)
            for _ in range(25):  # one by one, so that none is overtaken on a busy computer
                self.scan(1, publish)
            least_sigma_m.append(min(min(feature.sigma) for feature in self.maps.features.values()))
        wait_until(lambda: self.count(key) == before + 50, 5.0, "all covariances")
        self.assertLess(least_sigma_m[0], 0.99 * least_sigma_m[1])
        unsure = self.count("pose not known well enough")
        variance[0] = 1.0
        self.scan(5, publish)
        wait_until(lambda: self.count("pose not known well enough") == unsure + 5, 5.0, "what is not known well enough")
        # Once there is a source, what it does not say well is not known, and no default in its place.
        bad, dropped = self.count("pose that cannot be used"), self.count("dropped: no covariance of the pose")
        for variance[0] in (math.nan, -1.0):
            self.send(2, publish)
        variance[0] = 1e-6
        wait_until(lambda: self.count("pose that cannot be used") == bad + 4, 5.0, "bad poses")
        other = self.count("pose in another frame")
        frame[0] = "odom"
        self.send(2, publish)
        wait_until(lambda: self.count("pose in another frame") == other + 2, 5.0, "poses in another frame")
        wait_until(lambda: self.count("dropped: no covariance of the pose") == dropped + 6, 5.0, "drops")
        # One of nearly the same time says it as well, after the timeout.
        missing, before = self.count("no pose of that stamp"), self.count(key)
        frame[0], offset[0] = "map", rospy.Duration(0.001)
        self.scan(2, publish)
        wait_until(lambda: self.count("no pose of that stamp") == missing + 2, 5.0, "poses of other stamps")
        wait_until(lambda: self.count(key) == before + 2, 5.0, "their covariances")

    def ids(self):
        return set(self.maps.features)

    @fault("file of the map missing or none", "no file, a folder, an empty file, text, a map of objects, GeoJSON of points",
           "load_map answers with the file's name and the reason, the map stays", times=6)
    def test_files_that_are_none(self):
        self.scan(25)
        ids = self.ids()
        points = {"type": "FeatureCollection", "features": [
            {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": [1, 2]}}]}
        for name, text in (("none.json", None), ("empty.json", ""), ("text.json", "a: [1"),
                           ("objects.yaml", "objects: []\n"), ("points.geojson", json.dumps(points))):
            path = self.folder / name
            if text is not None:
                path.write_text(text)
            answer = self.services.load(str(path))
            self.assertFalse(answer.success, name)
            self.assertTrue(answer.message.startswith(str(path)), answer.message)
            self.assertNotIn("\n", answer.message)
        answer = self.services.load(str(self.folder))
        self.assertFalse(answer.success)
        self.assertIn(str(self.folder), answer.message)
        self.scan(2)
        self.assertEqual(self.ids(), ids)

    @fault("no valid range", "10 scans all NaN", "every scan is mapped, ids stay", times=10)
    def test_scans_of_nothing(self):
        self.scan(25)
        ids = self.ids()
        before = len(self.maps.messages)
        for _ in range(10):
            stamp = rospy.Time.now()
            self.robot.tf.publish(transform_msg(stamp, parent="map"))
            self.robot.publish(scan_msg(stamp, ranges=[math.nan] * BEAMS), transforms=False)
        wait_until(lambda: len(self.maps.messages) >= before + 10, 5.0, "their maps")
        self.scan(2)
        self.assertEqual(self.ids(), ids)

    @fault("transforms missing", "for 10 scans, longer than ~tf_timeout_s", "all dropped: no transform; ids stay",
           times=10)
    def test_scans_without_transforms(self):
        self.scan(25)
        ids = self.ids()
        key = "dropped: no transform"
        before = self.diagnostics.count("segmentation", key)
        for _ in range(10):
            self.robot.publish(scan_msg(rospy.Time.now(), ranges=ranges_in_a_room()), transforms=False)
        wait_until(lambda: self.diagnostics.count("segmentation", key) == before + 10, 5.0, "the drops")
        self.scan(2)
        self.assertEqual(self.ids(), ids)

    @fault("scanner silent", "for 3 s", "ids stay")
    def test_silence(self):
        self.scan(25)
        ids = self.ids()
        time.sleep(3.0)
        self.scan(2)
        self.assertEqual(self.ids(), ids)

    @fault("flood", "200 scans at once", "mapped, or dropped as overtaken, ids stay")
    def test_a_flood(self):
        self.scan(25)
        ids = self.ids()
        begin = rospy.Time.now()
        for i in range(200):
            stamp = begin + rospy.Duration(0.0005 * i)
            self.robot.tf.publish(transform_msg(stamp, parent="map"))
            self.robot.scans.publish(scan_msg(stamp, ranges=ranges_in_a_room()))
        time.sleep(1.0)
        self.scan(2)
        self.assertEqual(self.ids(), ids)

    @fault("manager killed", "SIGKILL", "respawn restarts all, with a new map; a saved one can be loaded")
    def test_z_a_killed_manager_comes_back(self):
        self.scan(25)
        ids = self.ids()
        path = str(self.folder / "map.json")
        self.assertTrue(self.services.save(path).success)
        os.kill(pid_of("/map_manager"), signal.SIGKILL)

        def maps_again():
            stamp = rospy.Time.now()
            self.robot.tf.publish(transform_msg(stamp, parent="map"))
            self.robot.publish(scan_msg(stamp, ranges=ranges_in_a_room()), transforms=False)
            return comes_true(lambda: stamp in self.maps.stamps(), 0.5)
        wait_until(maps_again, 60.0, "the manager and its nodelets to come back")
        self.services.load.wait_for_service(10.0)
        self.assertTrue(self.services.load(path).success)
        self.scan(3)
        self.assertEqual(self.ids(), ids)


if __name__ == "__main__":
    rospy.init_node("semantic_map_test")
    rostest.rosrun("situation_awareness", "semantic_map_test", SemanticMapTest)
