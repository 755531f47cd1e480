#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelet gps_ins: a rover stands, then drives in turns on a level field, twenty times as fast as time."""
import math
import pathlib
import sys
import time
import unittest

import numpy as np
import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import Imu, NavSatFix, NavSatStatus
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from fault_record import fault  # noqa: E402
from ros_support import Diagnostics, Latest, comes_true, wait_until, yaw_of  # noqa: E402

STAGE = "gps_ins"
ORIGIN = (48.1, 11.5, 520.0)
IMU_HZ = 100
FIX_EVERY = 20  # samples
FIX_SIGMA_M = (0.3, 0.3, 0.5)
GRAVITY = 9.80665
SPEED_M_S = 4.0
STANDING_S = 5.0
DURATION_S = 600.0
IMU_PLACE, IMU_YAW = np.array([0.2, -0.1, 0.3]), math.radians(90.0)  # on the rover
ANTENNA = np.array([-0.4, 0.1, 0.8])
TIMES_REAL_TIME = 20.0
MOST_BEHIND_S = 0.5


def smooth_step(s):
    s = np.clip(s, 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)


class Drive:
    """Place, yaw and what is measured of them at each sample."""

    def __init__(self):
        step_s = 0.5 / IMU_HZ
        t = np.arange(0.0, DURATION_S, step_s)
        u = np.maximum(t - STANDING_S - 3.0, 0.0)
        speed = SPEED_M_S * smooth_step((t - STANDING_S) / 3.0)
        rate = 0.5 * np.sin(2.0 * math.pi * u / 17.0) * smooth_step(u)
        yaw = self.integral(rate, step_s) + 0.8
        east, north = self.integral(speed * np.cos(yaw), step_s), self.integral(speed * np.sin(yaw), step_s)
        self.t, self.speed, self.rate, self.yaw = t[::2], speed[::2], rate[::2], yaw[::2]
        self.place = np.column_stack((east, north, np.zeros(len(t))))[::2]
        self.acceleration = np.gradient(speed, step_s)[::2]
        self.rate_change = np.gradient(rate, step_s)[::2]

    @staticmethod
    def integral(values, step_s):
        return np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * step_s)))

    def sensor(self, i, place):
        """Place of a sensor in the world."""
        c, s = math.cos(self.yaw[i]), math.sin(self.yaw[i])
        return self.place[i] + np.array([c * place[0] - s * place[1], s * place[0] + c * place[1], place[2]])

    def force(self, i):
        """At the IMU, in its axes."""
        w, dw = self.rate[i], self.rate_change[i]
        x, y, _ = IMU_PLACE
        ahead = self.acceleration[i] - dw * y - w * w * x
        left = self.speed[i] * w + dw * x - w * w * y
        c, s = math.cos(IMU_YAW), math.sin(IMU_YAW)
        return np.array([c * ahead + s * left, -s * ahead + c * left, GRAVITY])


def geodetic(p):
    """Of east, north, up at the origin, on the WGS 84 ellipsoid."""
    a, e2 = 6378137.0, 6.69437999014e-3
    lat, lon = math.radians(ORIGIN[0]), math.radians(ORIGIN[1])
    n = a / math.sqrt(1.0 - e2 * math.sin(lat)**2)
    start = np.array([(n + ORIGIN[2]) * math.cos(lat) * math.cos(lon), (n + ORIGIN[2]) * math.cos(lat) * math.sin(lon),
                      (n * (1.0 - e2) + ORIGIN[2]) * math.sin(lat)])
    east = np.array([-math.sin(lon), math.cos(lon), 0.0])
    up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
    x, y, z = start + p[0] * east + p[1] * np.cross(up, east) + p[2] * up
    across = math.hypot(x, y)
    for _ in range(6):
        n = a / math.sqrt(1.0 - e2 * math.sin(lat)**2)
        height = across / math.cos(lat) - n
        lat = math.atan2(z, across * (1.0 - e2 * n / (n + height)))
    return math.degrees(lat), math.degrees(math.atan2(y, x)), height


def mounting_of(child, place, yaw):
    transform = TransformStamped()
    transform.header.stamp = rospy.Time.now()
    transform.header.frame_id, transform.child_frame_id = "rover", child
    transform.transform.translation.x, transform.transform.translation.y, transform.transform.translation.z = place
    transform.transform.rotation.z, transform.transform.rotation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    return transform


def wrapped(angle):
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


class GpsInsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.logs = []
        cls.log = rospy.Subscriber("/rosout", Log, cls.logs.append, queue_size=1000)
        cls.diagnostics = Diagnostics()
        cls.odometry = Latest("odometry", Odometry)
        cls.poses = Latest("pose", PoseWithCovarianceStamped)
        cls.imu = rospy.Publisher("imu", Imu, queue_size=5000)
        cls.fix = rospy.Publisher("fix", NavSatFix, queue_size=5000)
        cls.altitude = rospy.Publisher("altitude", PoseWithCovarianceStamped, queue_size=100)
        cls.heading = rospy.Publisher("compass", Imu, queue_size=100)
        cls.mounting = rospy.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        cls.chance = np.random.default_rng(1)
        cls.drive = Drive()
        cls.begin = rospy.Time.now()
        cls.i = 0  # sample

    def stamp(self, i=None):
        return self.begin + rospy.Duration.from_sec((self.i if i is None else i) / IMU_HZ)

    def imu_msg(self):
        msg = Imu()
        msg.header.stamp, msg.header.frame_id = self.stamp(), "imu"
        force = self.drive.force(self.i) + 0.03 + self.chance.normal(0.0, 0.02, 3)
        rate = np.array([0.0, 0.0, self.drive.rate[self.i]]) + 2e-3 + self.chance.normal(0.0, 1e-3, 3)
        msg.linear_acceleration.x, msg.linear_acceleration.y, msg.linear_acceleration.z = force
        msg.angular_velocity.x, msg.angular_velocity.y, msg.angular_velocity.z = rate
        msg.orientation_covariance[0] = -1.0
        return msg

    def fix_msg(self):
        msg = NavSatFix()
        msg.header.stamp, msg.header.frame_id = self.stamp(), "/antenna"
        msg.status.status = NavSatStatus.STATUS_FIX
        place = self.drive.sensor(self.i, ANTENNA) + self.chance.normal(0.0, FIX_SIGMA_M)
        msg.latitude, msg.longitude, msg.altitude = geodetic(place)
        msg.position_covariance = np.diag(np.square(FIX_SIGMA_M)).ravel().tolist()
        msg.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
        return msg

    def run_for(self, duration_s, fixes=True, change_imu=None, change_fix=None, each=None):
        """The drive goes on; `change` may spoil a message."""
        end, wall, begin = self.i + int(duration_s * IMU_HZ), time.monotonic(), self.i
        while self.i < end:
            msg = self.imu_msg()
            if change_imu:
                change_imu(msg)
            self.imu.publish(msg)
            if fixes and self.i % FIX_EVERY == 0:
                msg = self.fix_msg()
                if change_fix:
                    change_fix(msg)
                self.fix.publish(msg)
            if each:
                each()
            type(self).i += 1
            if self.i % (IMU_HZ // 4) == 0 and TIMES_REAL_TIME < 100.0:
                self.wait_for_pose()
            ahead_s = (self.i - begin) / IMU_HZ / TIMES_REAL_TIME - (time.monotonic() - wall)
            if ahead_s > 0.005:
                time.sleep(ahead_s)

    def wait_for_pose(self):
        """On a busy machine no sample shall be lost. Nothing is waited for while there is no pose."""
        messages = self.odometry.messages

        def behind_s():
            return (self.stamp() - messages[-1].header.stamp).to_sec()

        end = time.monotonic() + 1.0
        while messages and MOST_BEHIND_S < behind_s() < 2.0 * MOST_BEHIND_S and time.monotonic() < end:
            time.sleep(0.005)

    def status(self):
        return self.diagnostics.stages.get(STAGE, {})

    def settle(self):
        """Until a report has come that is later than all that was sent."""
        time.sleep(0.3)
        before = len(self.diagnostics.history)
        wait_until(lambda: sum(name == STAGE for name, _ in self.diagnostics.history[before:]) >= 1, 5.0, "a report")

    def said(self, text):
        return any(text in status["summary"] for stage, status in self.diagnostics.history if stage == STAGE)

    def count(self, key):
        return self.diagnostics.count(STAGE, key)

    def counts(self, key, run, at_least=1):
        """How many more there are after `run`, once there are so many."""
        before = self.count(key)
        run()
        comes_true(lambda: self.count(key) >= before + at_least, 20.0)
        self.settle()
        return self.count(key) - before

    def run_until_ready(self, within_s=60.0):
        end = self.i + int(within_s * IMU_HZ)
        messages = self.odometry.messages
        while True:
            self.run_for(2.0)
            if comes_true(lambda: messages and abs((messages[-1].header.stamp - self.stamp()).to_sec()) < 0.5, 0.5):
                return
            self.assertLess(self.i, end, f"not ready: {self.status()}")

    def sample_of(self, message):
        return round((message.header.stamp - self.begin).to_sec() * IMU_HZ)

    def assert_true(self, messages, within_m=2.5, within_rad=0.3):
        """Within bounds, and within 5 standard deviations."""
        self.assertGreater(len(messages), 0)
        for message in messages:
            i, pose = self.sample_of(message), message.pose.pose
            P = np.array(message.pose.covariance).reshape(6, 6)
            error = np.array([pose.position.x, pose.position.y, pose.position.z]) - self.drive.place[i]
            when = f"{i / IMU_HZ} s"
            self.assertLess(np.linalg.norm(error), within_m, when)
            self.assertLess(error @ np.linalg.solve(P[:3, :3], error), 25.0, when)
            yaw_error = abs(wrapped(yaw_of(pose.orientation) - self.drive.yaw[i]))
            self.assertLess(yaw_error, within_rad, when)
            self.assertLess(yaw_error, 5.0 * math.sqrt(P[5, 5]), when)

    def run_and_assert_true(self, duration_s=3.0, **arguments):
        before = len(self.odometry.messages)
        self.run_for(duration_s)
        time.sleep(0.3)
        self.assert_true(self.odometry.messages[before:], **arguments)

    def logged(self, level, *parts):
        return [log for log in self.logs if log.level == level and all(part in log.msg for part in parts)]

    # --- start

    @fault("origin that is none", "\"nowhere\", then a good one",
           "named in a FATAL sentence; with the good one it starts by itself")
    def test_01_an_origin_that_cannot_be_used_is_said_and_tried_again(self):
        wait_until(lambda: self.logged(Log.FATAL, "origin", "nowhere", "LAT,LON,ALT"), 30.0, "the origin to be named")
        rospy.set_param(f"{STAGE}/origin", ",".join(map(str, ORIGIN)))
        rospy.wait_for_service(f"{STAGE}/reset", 30.0)
        wait_until(lambda: min(p.get_num_connections() for p in (self.imu, self.fix, self.altitude, self.heading)) > 0,
                   10.0, "inputs")
        wait_until(lambda: self.odometry.subscriber.get_num_connections() > 0, 10.0, "outputs")

    @fault("no mounting in TF, no fix", "1 s without transforms, 1 s without fixes, 1 s with STATUS_NO_FIX",
           "all samples dropped by reason, the log names the frames; ready once all are there", times=3)
    def test_02_says_what_is_missing(self):
        self.run_for(1.0)
        self.settle()
        self.assertEqual(self.count("dropped: no transform"), 100)
        self.assertTrue(self.logged(Log.WARN, "from rover to imu"))
        self.assertIn("not ready", self.status()["pose"])
        self.mounting.publish(TFMessage([mounting_of("imu", IMU_PLACE, IMU_YAW)]))
        wait_until(lambda: self.mounting.get_num_connections() > 0, 5.0, "the listener")
        time.sleep(0.5)
        self.run_for(1.0)
        self.settle()
        self.assertTrue(self.said("from rover to antenna"))
        self.assertEqual(self.count("dropped: no transform"), 200)
        self.mounting.publish(TFMessage([mounting_of("imu", IMU_PLACE, IMU_YAW),
                                         mounting_of("antenna", ANTENNA, 0.0)]))
        time.sleep(0.5)

        def lose(msg):
            msg.status.status = NavSatStatus.STATUS_NO_FIX
            msg.latitude = msg.longitude = msg.altitude = math.nan

        self.run_for(2.0, change_fix=lose)
        self.settle()
        self.assertEqual(self.status()["pose"], "not ready: no usable fix yet")
        self.assertGreater(self.count("no fix"), 3)
        self.assertTrue(self.said("pose not ready (no usable fix yet)"))
        self.assertEqual(self.odometry.messages, [])

    def test_03_finds_its_pose_and_publishes_it(self):
        buffer = tf2_ros.Buffer(rospy.Duration(1000.0))
        listener = tf2_ros.TransformListener(buffer)  # noqa: F841
        self.run_until_ready()
        self.run_for(40.0)
        begin = self.i
        self.run_and_assert_true(20.0, within_m=0.8, within_rad=0.08)
        messages = [message for message in self.odometry.messages if self.sample_of(message) >= begin]
        self.assertAlmostEqual(len(messages), 20 * 50, delta=10)  # rate_hz
        self.assertEqual({(m.header.frame_id, m.child_frame_id) for m in messages}, {("field", "rover")})
        for message in messages[::50]:
            i = self.sample_of(message)
            self.assertAlmostEqual(message.twist.twist.linear.x, SPEED_M_S, delta=0.3)
            self.assertAlmostEqual(message.twist.twist.linear.y, 0.0, delta=0.3)
            self.assertAlmostEqual(message.twist.twist.angular.z, self.drive.rate[i], delta=0.01)
            for covariance in (message.pose.covariance, message.twist.covariance):
                P = np.array(covariance).reshape(6, 6)
                self.assertLess(np.abs(P - P.T).max(), 1e-9)
                self.assertGreater(np.linalg.eigvalsh(P).min(), 0.0)

        message = messages[-1]
        wait_until(lambda: message.header.stamp in self.poses.stamps(), 2.0, "the pose")
        self.assertEqual(self.poses.messages[self.poses.stamps().index(message.header.stamp)].pose, message.pose)
        wait_until(lambda: buffer.can_transform("field", "rover", message.header.stamp), 2.0, "TF")
        transform = buffer.lookup_transform("field", "rover", message.header.stamp).transform
        self.assertAlmostEqual(transform.translation.x, message.pose.pose.position.x, delta=1e-6)
        self.assertAlmostEqual(transform.translation.y, message.pose.pose.position.y, delta=1e-6)
        self.assertAlmostEqual(transform.rotation.z, message.pose.pose.orientation.z, delta=1e-6)

        self.settle()
        status = self.status()
        self.assertEqual(status["pose"], "ready")
        self.assertEqual(status["origin"], "48.1000000,11.5000000,520.000")
        self.assertLess(float(status["sigma yaw [rad]"]), 0.1)
        for key in ("accelerometer bias [m/s^2]", "gyroscope bias [rad/s]", "correlated share of fixes",
                    "correlation of fixes [s]", "fix NIS matches", "age of the last fix [s]"):
            self.assertIn(key, status)
        bias = [float(b) for b in status["gyroscope bias [rad/s]"].split()]
        self.assertAlmostEqual(bias[2], 2e-3, delta=1e-3)
        self.assertEqual(len(self.logged(Log.INFO, "the pose is ready")), 1)

    # --- fixes and samples that cannot be used as they are

    @fault("fixes without a covariance", "of unknown type, all zero, a negative variance",
           "~fix_sigma_m is used, each is counted; the pose stays", times=3)
    def test_04_fixes_without_a_covariance_are_used(self):
        def unknown(msg):
            msg.position_covariance_type = NavSatFix.COVARIANCE_TYPE_UNKNOWN

        def zero(msg):
            msg.position_covariance = [0.0] * 9

        def negative(msg):
            msg.position_covariance = [-1.0] + [0.0] * 8

        for spoil in (unknown, zero, negative):
            before = len(self.odometry.messages)
            self.assertEqual(self.counts("fix without covariance: fix_sigma_m used",
                                         lambda change=spoil: self.run_for(4.0, change_fix=change), 20), 20)
            self.assert_true(self.odometry.messages[before:])

    @fault("fixes that cannot be used",
           "NaN, a covariance of NaN, no frame, another frame, 20 s old, 20 s ahead, 50 m off",
           "each is counted by its reason; the pose stays", times=7)
    def test_05_fixes_that_cannot_be_used_change_nothing(self):
        def of(msg, name, value):
            setattr(msg, name, value)

        def shift(msg, by_s):
            msg.header.stamp += rospy.Duration(by_s)

        for key, spoil in (
                ("fix not finite", lambda msg: of(msg, "latitude", math.nan)),
                ("fix without covariance", lambda msg: of(msg, "position_covariance", [math.nan] * 9)),
                ("fix without a frame", lambda msg: of(msg.header, "frame_id", "")),
                ("fix in another frame", lambda msg: of(msg.header, "frame_id", "other")),
                ("fix too late", lambda msg: shift(msg, -20)),
                ("fix ahead of the imu", lambda msg: shift(msg, 20)),
                ("fix outside its gate", lambda msg: of(msg, "latitude", msg.latitude + 50.0 / 111e3))):
            before = len(self.odometry.messages)
            self.assertEqual(self.counts(key, lambda change=spoil: self.run_for(1.0, change_fix=change), 5), 5, key)
            self.assert_true(self.odometry.messages[before:])
            self.run_and_assert_true()

    @fault("samples of the IMU that cannot be used", "NaN, inf, 1e300 m/s^2, no frame, another frame, a stamp of zero, "
           "stamps that repeat or go back by 0.5 s", "each is dropped by its reason; the pose stays", times=8)
    def test_06_samples_that_cannot_be_used_change_nothing(self):
        def finite(msg, value):
            msg.linear_acceleration.y = value

        def stamped(msg, stamp):
            msg.header.stamp = stamp

        def framed(msg, frame):
            msg.header.frame_id = frame

        for key, spoil in (
                ("bad imu: not finite", lambda msg: finite(msg, math.nan)),
                ("bad imu: not finite", lambda msg: setattr(msg.angular_velocity, "x", math.inf)),
                ("bad imu: out of range", lambda msg: finite(msg, 1e300)),
                ("bad imu: no frame", lambda msg: framed(msg, "")),
                ("bad imu: another frame", lambda msg: framed(msg, "other")),
                ("bad imu: stamp of zero", lambda msg: stamped(msg, rospy.Time(0))),
                ("stamp repeats or goes back", lambda msg: stamped(msg, self.stamp(self.i - 1))),
                ("stamp repeats or goes back", lambda msg: stamped(msg, self.stamp(self.i - 50)))):
            def every_third(msg, change=spoil):
                if self.i % 3 == 0:
                    change(msg)

            self.run_for(0.01)  # so that the first to be spoilt has one before
            wanted = sum(i % 3 == 0 for i in range(self.i, self.i + 30))
            before = len(self.odometry.messages)
            dropped = self.counts(f"dropped: {key}", lambda change=every_third: self.run_for(0.3, change_imu=change),
                                  wanted)
            self.assertEqual(dropped, wanted, key)
            self.assert_true(self.odometry.messages[before:])
        self.run_and_assert_true()

    @fault("fixes missing", "for 10 s",
           "the pose goes on by the IMU, its sigma grows, a warning says for how long; then it is back")
    def test_07_goes_on_without_fixes(self):
        self.run_and_assert_true()
        self.settle()
        before = len(self.odometry.messages)
        sigma = math.sqrt(self.odometry.messages[-1].pose.covariance[0])
        self.run_for(10.0, fixes=False)
        self.settle()
        self.assert_true(self.odometry.messages[before:], within_m=5.0)
        self.assertGreater(math.sqrt(self.odometry.messages[-1].pose.covariance[0]), 2.0 * sigma)
        self.assertTrue(self.said("no fix was used for"))
        self.assertGreater(float(self.status()["age of the last fix [s]"]), 9.0)
        self.run_for(5.0)
        self.run_and_assert_true()

    # --- other sensors

    @fault("height or heading that cannot be used",
           "another frame, no variance, NaN; no orientation, no rotation, another frame",
           "each is counted by its reason; the pose stays", times=6)
    def test_08_takes_heights_and_headings(self):
        def height():
            msg = PoseWithCovarianceStamped()
            msg.header.stamp, msg.header.frame_id = self.stamp(), "field"
            msg.pose.pose.position.z = IMU_PLACE[2] + self.chance.normal(0.0, 0.1)
            msg.pose.covariance = [0.0] * 36
            msg.pose.covariance[14] = 0.01
            return msg

        def compass():
            msg = Imu()
            msg.header.stamp, msg.header.frame_id = self.stamp(), "imu"
            yaw = self.drive.yaw[self.i] + IMU_YAW + self.chance.normal(0.0, 0.05)
            msg.orientation.z, msg.orientation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
            return msg

        def each():
            if self.i % 10 == 0:
                self.altitude.publish(height())
                self.heading.publish(compass())

        before = len(self.odometry.messages)
        used = {"altitude": 0, "heading": 0}
        reports = len(self.diagnostics.history)
        self.run_for(20.0, each=each)
        self.settle()
        self.assert_true(self.odometry.messages[before:])
        for name in used:
            used[name] = sum(int(status.get(f"{name} NIS matches", "0"))
                             for stage, status in self.diagnostics.history[reports:] if stage == STAGE)
        self.assertAlmostEqual(used["altitude"], 200, delta=5)
        self.assertAlmostEqual(used["heading"], 20, delta=1)  # one a second
        self.assertLess(self.odometry.messages[-1].pose.covariance[14], 0.1**2)

        for key, publisher, message, spoil in (
                ("altitude in another frame", self.altitude, height, lambda m: setattr(m.header, "frame_id", "map")),
                ("altitude without a variance", self.altitude, height,
                 lambda m: setattr(m.pose, "covariance", [0.0] * 36)),
                ("altitude not finite", self.altitude, height, lambda m: setattr(m.pose.pose.position, "z", math.nan)),
                ("heading without an orientation", self.heading, compass,
                 lambda m: setattr(m, "orientation_covariance", [-1.0] + [0.0] * 8)),
                ("heading not a rotation", self.heading, compass, lambda m: setattr(m.orientation, "w", math.nan)),
                ("heading in another frame", self.heading, compass, lambda m: setattr(m.header, "frame_id", "other"))):
            self.run_for(1.5)

            def send(m=message, change=spoil, to=publisher):
                msg = m()
                change(msg)
                to.publish(msg)

            self.assertEqual(self.counts(key, send), 1, key)
        self.run_and_assert_true()

    # --- starting anew

    def test_09_starts_anew_when_asked(self):
        answer = rospy.ServiceProxy(f"{STAGE}/reset", Trigger)()
        self.assertTrue(answer.success)
        self.settle()
        self.assertIn("not ready", self.status()["pose"])
        self.run_until_ready()
        self.run_for(10.0)
        self.run_and_assert_true()

    @fault("IMU silent", "for 3 s", "the pose starts anew and is back")
    def test_10_a_silent_imu_starts_it_anew(self):
        def skip():
            type(self).i += 300

        self.assertEqual(self.counts("restarted after an imu gap", lambda: (skip(), self.run_for(0.5))), 1)
        self.run_until_ready()
        self.run_for(10.0)
        self.run_and_assert_true()

    @fault("flood of samples and fixes", "20 s of them as fast as they can be sent", "none is dropped, the pose stays")
    def test_11_survives_a_flood(self):
        global TIMES_REAL_TIME
        TIMES_REAL_TIME, before = 1e6, TIMES_REAL_TIME
        messages = len(self.odometry.messages)
        self.run_for(20.0)
        TIMES_REAL_TIME = before
        self.settle()
        self.assertEqual(self.count("dropped: overtaken"), 0)
        self.assert_true(self.odometry.messages[messages:])
        self.run_and_assert_true()

    @fault("time is reset", "stamps 1000 s back", "the pose starts anew")
    def test_12_time_that_starts_again(self):
        type(self).begin -= rospy.Duration(1000)
        self.assertEqual(self.counts("imu restarted", lambda: self.run_for(1.0)), 1)
        self.run_until_ready()
        self.run_for(10.0)
        self.run_and_assert_true()
        self.assertFalse(self.logged(Log.ERROR, STAGE))


if __name__ == "__main__":
    rospy.init_node("gps_ins_test")
    rostest.rosrun("situation_awareness", "gps_ins_test", GpsInsTest)
