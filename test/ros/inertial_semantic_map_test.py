#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelet inertial_semantic_map: topics, services, files, and what it does with messages that cannot be used."""
import math
import os
import pathlib
import signal
import sys
import tempfile
import time
import unittest

import numpy as np
import rospy
import rostest
from sensor_msgs.msg import Imu, LaserScan, NavSatFix, NavSatStatus
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

HERE = pathlib.Path(__file__).resolve()
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE.parents[2] / "scripts" / "evaluation"))
import splinegon_worlds  # noqa: E402
from fault_record import fault  # noqa: E402
from ros_support import (BEAMS, Diagnostics, Latest, MapFollower, MapServices, pid_of,  # noqa: E402
                         ranges_to_circles, scan_msg, transform_msg, wait_until)
from situation_awareness.msg import MapFeature  # noqa: E402

STAGE = "inertial_semantic_map"
TOWER = 6.0  # its radius; the vehicle flies around it
DISTANCE = 14.0
SPEED = 5.0
PERIOD = 0.1
ROUND = math.ceil(2.0 * math.pi * DISTANCE / SPEED / PERIOD)
HEIGHT = 15.0
ORIGIN = (47.3769, 8.5417, 408.0)
SAMPLES = 10  # of the IMU, between two scans
FIX_EVERY = 20  # samples
FIX_SIGMA = 0.1
STANDING_S, SPEED_UP_S = 3.0, 2.0  # then the vehicle goes at its speed
GRAVITY = 9.80665
PLACE_WITHIN = 0.6


def circle_through(points):
    """Its middle, by least squares."""
    points = np.array(points)
    matrix = np.column_stack((2.0 * points, np.ones(len(points))))
    return np.linalg.lstsq(matrix, np.sum(points**2, axis=1), rcond=None)[0][:2]


class InertialSemanticMapTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.diagnostics = Diagnostics()
        cls.maps = MapFollower()
        cls.markers = Latest("semantic_map_markers", MarkerArray)
        cls.imu = rospy.Publisher("imu", Imu, queue_size=5000, tcp_nodelay=True)
        cls.fix = rospy.Publisher("fix", NavSatFix, queue_size=1000, tcp_nodelay=True)
        cls.scans = rospy.Publisher("scan", LaserScan, queue_size=1000, tcp_nodelay=True)
        cls.tf_static = rospy.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        cls.tf_static.publish(transform_msg(rospy.Time(1), parent="base_link"))
        cls.services = MapServices()
        wait_until(lambda: all(link.get_num_connections() > 0 for link in (
            cls.imu, cls.fix, cls.scans, cls.tf_static, cls.maps.subscriber, cls.markers.subscriber)), 60.0, "the nodelet")
        time.sleep(1.0)
        cls.begin_anew(rospy.Time(1000))

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.services.pause(False)
        self.services.reset()

    @classmethod
    def stamp(cls):
        return cls.begin + rospy.Duration(PERIOD * cls.i)

    @classmethod
    def begin_anew(cls, begin):
        """The vehicle stands, goes, and turns until its pose is known."""
        cls.begin, cls.i, cls.sample = begin, 0, 0
        before = len(cls.maps.messages)
        for _ in range(400):
            cls.step()
            time.sleep(0.02)
            if len(cls.maps.messages) > before:
                return
        raise AssertionError(f"no map: {cls.diagnostics.stages}")

    @classmethod
    def motion(cls, t):
        """Way, speed and acceleration on the circle."""
        u = min(max(t - STANDING_S, 0.0), SPEED_UP_S)
        acceleration = SPEED / SPEED_UP_S if 0.0 <= t - STANDING_S < SPEED_UP_S else 0.0
        speed = SPEED * u / SPEED_UP_S
        return 0.5 * speed * u + SPEED * max(t - STANDING_S - SPEED_UP_S, 0.0), speed, acceleration

    @classmethod
    def imu_msg(cls):
        t = PERIOD / SAMPLES * cls.sample
        _, speed, acceleration = cls.motion(t)
        msg = Imu()
        msg.header.stamp, msg.header.frame_id = cls.begin + rospy.Duration.from_sec(t), "base_link"
        force, rate = msg.linear_acceleration, msg.angular_velocity
        force.x, force.y, force.z, rate.z = acceleration, speed ** 2 / DISTANCE, GRAVITY, speed / DISTANCE
        return msg

    @classmethod
    def fix_msg(cls):
        t = PERIOD / SAMPLES * cls.sample
        angle = cls.motion(t)[0] / DISTANCE
        msg = NavSatFix()
        msg.header.stamp, msg.header.frame_id = cls.begin + rospy.Duration.from_sec(t), "base_link"
        msg.status.status = NavSatStatus.STATUS_FIX
        place = np.array([[DISTANCE * math.cos(angle), DISTANCE * math.sin(angle), HEIGHT]])
        msg.latitude, msg.longitude, msg.altitude = splinegon_worlds.geodetic_of(place, ORIGIN)[0]
        msg.position_covariance = [FIX_SIGMA ** 2 * (k % 4 == 0) for k in range(9)]
        msg.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
        return msg

    @classmethod
    def samples_until_scan(cls):
        """Samples and fixes up to the stamp of the next scan."""
        while cls.sample <= SAMPLES * cls.i:
            cls.imu.publish(cls.imu_msg())
            if cls.sample % FIX_EVERY == 0:
                cls.fix.publish(cls.fix_msg())
            cls.sample += 1

    @classmethod
    def step(cls, **arguments):
        """To the next scan; its stamp."""
        cls.samples_until_scan()
        stamp = cls.scan_at_once(**arguments)
        cls.i += 1
        return stamp

    @classmethod
    def scan_at_once(cls, **arguments):
        if "ranges" not in arguments:
            # As seen from the vehicle the tower is to the left, whatever its place.
            arguments["ranges"] = ranges_to_circles([(0.0, DISTANCE, TOWER)])
        msg = scan_msg(cls.stamp(), **arguments)
        cls.scans.publish(msg)
        return msg.header.stamp

    def fly(self, count, **arguments):
        """So many scans further; the map after the last."""
        stamp = None
        for _ in range(count):
            stamp = self.step(**arguments)
            time.sleep(0.006)
        self.samples_until_scan()
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
        return set(self.maps.features)

    def assert_the_tower(self):
        self.assertEqual(len(self.maps.features), 1)
        tower = next(iter(self.maps.features.values()))
        self.assertEqual(tower.kind, MapFeature.BOUNDARY)
        self.assertTrue(tower.closed)
        x, y = circle_through([(p.x, p.y) for p in tower.outline])
        self.assertLess(math.hypot(x, y), PLACE_WITHIN, "as well as the pose is known")
        for p, sigma in zip(tower.outline, tower.sigma):
            self.assertAlmostEqual(math.hypot(p.x - x, p.y - y), TOWER, delta=0.1)
            self.assertGreaterEqual(sigma, 0.3 * FIX_SIGMA, "the pose's error is part of it")
            self.assertAlmostEqual(p.z, HEIGHT, delta=0.2)
        return tower.id

    def test_a_tower(self):
        self.fly(ROUND // 3)
        self.assertFalse(any(feature.closed for feature in self.maps.features.values()), "not before it was seen")
        message = self.fly(ROUND)
        self.assertEqual(message.header.frame_id, "world")
        self.assert_the_tower()
        wait_until(lambda: self.markers.messages, 5.0, "markers")
        names = {marker.ns for marker in self.markers.messages[-1].markers}
        self.assertTrue({"closed", "envelope", "vertices", "id"} <= names, names)
        wait_until(lambda: self.count("boundary") == 1, 5.0, "the diagnostics")

    def test_files(self):
        self.fly(ROUND + 30)
        tower = self.assert_the_tower()
        path = self.folder / "map.json"
        answer = self.services.save(str(path))
        self.assertTrue(answer.success, answer.message)
        self.services.reset()
        uuid = self.maps.map
        answer = self.services.load(str(path))
        self.assertTrue(answer.success, answer.message)
        wait_until(lambda: self.maps.map != uuid, 5.0, "another map")
        self.assertEqual(self.ids(), {tower})
        self.assert_the_tower()
        self.fly(20)
        self.assertIn(tower, self.ids(), "by GPS it may be mapped a second time, but it is there")

    def test_reset_and_pause(self):
        self.fly(30)
        last = max(self.ids())
        self.assertTrue(self.services.pause(True).success)
        messages = len(self.maps.messages)
        self.assertGreater(self.counts("passed over while paused", lambda: (self.step(), self.samples_until_scan())), 0)
        self.assertEqual(len(self.maps.messages), messages)
        self.services.pause(False)
        self.assertTrue(self.services.reset().success)
        self.fly(30)
        self.assertGreater(min(self.ids()), last, "ids are not used again")

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

    @fault("sample that cannot be used", "NaN, 2000 g, a stamp of zero, another frame, a stamp that repeats; a fix of "
           "another frame", "counted by reason; the boundaries stay", times=6)
    def test_samples_that_cannot_be_used(self):
        self.fly(30)
        ids = self.ids()

        def send(spoil):
            msg = self.imu_msg()
            spoil(msg)
            self.imu.publish(msg)

        for key, spoil in (
                ("bad imu: not finite", lambda msg: setattr(msg.linear_acceleration, "x", math.nan)),
                ("bad imu: out of range", lambda msg: setattr(msg.linear_acceleration, "z", 2e4)),
                ("bad imu: stamp of zero", lambda msg: setattr(msg.header, "stamp", rospy.Time())),
                ("bad imu: another frame", lambda msg: setattr(msg.header, "frame_id", "other")),
                ("stamp repeats or goes back",
                 lambda msg: setattr(msg.header, "stamp", msg.header.stamp - rospy.Duration(0.2)))):
            self.assertEqual(self.counts(f"not used: {key}", lambda spoil=spoil: send(spoil)), 1, key)
        msg = self.fix_msg()
        msg.header.frame_id = "other"
        # A fix is used once the samples are past its stamp by its patience.
        self.assertEqual(self.counts("fix in another frame", lambda: (self.fix.publish(msg), self.fly(10))), 1)
        self.assertEqual(self.ids(), ids)

    @fault("no valid range", "10 scans all NaN", "every scan is used, ids stay", times=10)
    def test_scans_of_nothing(self):
        self.fly(30)
        ids = self.ids()
        self.fly(10, ranges=[math.nan] * BEAMS)
        self.assertEqual(self.ids(), ids)

    @fault("IMU silent", "for 15 scans, longer than gps_ins/max_imu_gap_s", "these are dropped, the pose starts anew, and "
           "the map goes on", times=15)
    def test_silent_imu(self):
        self.fly(30)
        before, dropped = len(self.maps.messages), self.count("dropped: no pose")
        for _ in range(15):
            self.scan_at_once()
            type(self).i += 1
            time.sleep(0.02)
        type(self).sample = SAMPLES * self.i
        silent = self.stamp()

        def maps_again():
            self.step()
            time.sleep(0.01)
            return self.maps.messages[-1].header.stamp > silent
        wait_until(maps_again, 60.0, "the map to go on")
        wait_until(lambda: self.count("dropped: no pose") + self.count("dropped: pose not ready") - dropped >= 14, 5.0,
                   "the scans to be dropped")
        self.assertEqual(self.count("restarted after an imu gap"), 1)
        stamps = [message.header.stamp for message in self.maps.messages[before:]]
        self.assertEqual(stamps, sorted(set(stamps)))
        self.assertLess(min(stamps) - silent, rospy.Duration(1.0), "scans that waited for the pose were not passed over")

    @fault("time is reset", "stamps 500 s back", "a new map, ids are not used again")
    def test_y_time_that_starts_again(self):
        self.fly(30)
        last = max(self.ids())
        self.assertEqual(self.counts("time jumped back: new map",
                                     lambda: self.begin_anew(self.begin - rospy.Duration(500))), 1)
        self.fly(40)
        self.assertGreater(min(self.ids()), last)

    @fault("manager killed", "SIGKILL", "respawn restarts it, with a new map; a saved one can be loaded")
    def test_z_a_killed_manager_comes_back(self):
        self.fly(ROUND + 30)
        tower = self.assert_the_tower()
        path = str(self.folder / "map.json")
        self.assertTrue(self.services.save(path).success)
        messages = len(self.maps.messages)
        os.kill(pid_of("/map_manager"), signal.SIGKILL)

        time.sleep(2.0)
        wait_until(lambda: all(link.get_num_connections() > 0 for link in (self.imu, self.fix, self.scans)), 60.0,
                   "the manager and its nodelet to come back")
        time.sleep(1.0)
        self.begin_anew(self.begin + rospy.Duration(1000))
        self.assertGreater(len(self.maps.messages), messages)
        self.services.load.wait_for_service(10.0)
        self.assertTrue(self.services.load(path).success)
        wait_until(lambda: self.ids() == {tower}, 5.0, "the loaded map")
        self.fly(20)
        self.assertIn(tower, self.ids())


if __name__ == "__main__":
    rospy.init_node("inertial_semantic_map_test")
    rostest.rosrun("situation_awareness", "inertial_semantic_map_test", InertialSemanticMapTest)
