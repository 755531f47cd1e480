#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelet reflector_localization: a robot stands in a hall of which each reflector can be taken away."""
import math
import pathlib
import sys
import time
import unittest

import numpy as np
import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import Pose2D, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from fault_record import fault  # noqa: E402
from ros_support import ANGLE_MIN, BEAMS, INCREMENT, Diagnostics, Latest, comes_true, wait_until  # noqa: E402
from situation_awareness.srv import Relocate  # noqa: E402

STAGE = "reflector_localization"
REFLECTORS = [(3.5, 1.0), (1.0, 3.0), (-2.0, 2.2), (2.5, -2.4)]
RADIUS = 0.05
ROBOT = (0.4, -0.3, 0.5)  # truth, in the world
SCANNER = (0.2, 0.0, math.radians(5.0))  # on the robot
WHEELS = (7.0, 3.0, -1.2)  # the robot in the frame of odometry
LOW, HIGH = (-4.0, -3.5), (5.0, 4.0)  # of the walls
PERIOD_S = 0.04


def composed(a, b):
    return (a[0] + math.cos(a[2]) * b[0] - math.sin(a[2]) * b[1],
            a[1] + math.sin(a[2]) * b[0] + math.cos(a[2]) * b[1], a[2] + b[2])


def scan_of(stamp, reflectors, chance, intensities=True):
    x, y, yaw = composed(ROBOT, SCANNER)
    azimuth = yaw + ANGLE_MIN + INCREMENT * np.arange(BEAMS)
    c, s = np.cos(azimuth), np.sin(azimuth)
    with np.errstate(divide="ignore"):
        ranges = np.minimum(np.where(c > 0, HIGH[0] - x, LOW[0] - x) / c, np.where(s > 0, HIGH[1] - y, LOW[1] - y) / s)
    bright = np.full(BEAMS, 250.0)
    for cx, cy in reflectors:
        along = (cx - x) * c + (cy - y) * s
        aside = (cy - y) * c - (cx - x) * s
        hit = (along > 0) & (np.abs(aside) < RADIUS)
        ranges = np.where(hit, along - np.sqrt(np.maximum(RADIUS**2 - aside**2, 0.0)), ranges)
        bright = np.where(hit, 800.0, bright)
    msg = LaserScan()
    msg.header.stamp = stamp
    msg.header.frame_id = "scanner"
    msg.angle_min, msg.angle_increment, msg.angle_max = ANGLE_MIN, INCREMENT, ANGLE_MIN + INCREMENT * (BEAMS - 1)
    msg.range_min, msg.range_max = 0.05, 20.0
    msg.ranges = (ranges + chance.normal(0.0, 0.01, BEAMS)).tolist()
    msg.intensities = bright.tolist() if intensities else []
    return msg


def odometry_of(stamp, pose=WHEELS):
    msg = Odometry()
    msg.header.stamp = stamp
    msg.header.frame_id, msg.child_frame_id = "wheels", "robot"
    msg.pose.pose.position.x, msg.pose.pose.position.y = pose[0], pose[1]
    msg.pose.pose.orientation.z, msg.pose.pose.orientation.w = math.sin(0.5 * pose[2]), math.cos(0.5 * pose[2])
    return msg


def transform_of(stamp, parent, child, pose):
    transform = TransformStamped()
    transform.header.stamp = stamp
    transform.header.frame_id, transform.child_frame_id = parent, child
    transform.transform.translation.x, transform.transform.translation.y = pose[0], pose[1]
    transform.transform.rotation.z, transform.transform.rotation.w = math.sin(0.5 * pose[2]), math.cos(0.5 * pose[2])
    return transform


class ReflectorLocalizationTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.file = pathlib.Path(rospy.get_param(f"{STAGE}/reflector_file"))
        cls.file.parent.mkdir(parents=True, exist_ok=True)
        cls.logs = []
        cls.log = rospy.Subscriber("/rosout", Log, cls.logs.append, queue_size=1000)
        cls.diagnostics = Diagnostics()
        cls.poses = Latest("pose", PoseWithCovarianceStamped)
        cls.markers = Latest("reflectors", MarkerArray)
        cls.scans = rospy.Publisher("scan", LaserScan, queue_size=1000)
        cls.odometry = rospy.Publisher("odom", Odometry, queue_size=1000)
        cls.given = rospy.Publisher("initialpose", PoseWithCovarianceStamped, queue_size=10)
        cls.tf = rospy.Publisher("/tf", TFMessage, queue_size=1000)
        cls.mounting = rospy.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        cls.chance = np.random.default_rng(1)
        cls.standing = list(REFLECTORS)
        cls.shift_s = 0.0  # of the robot's clock

    def now(self):
        return rospy.Time.now() + rospy.Duration(self.shift_s)

    def send(self, odometry=True, **arguments):
        """Odometry of before and after the scan, then the scan."""
        stamp = self.now()
        if odometry:
            for later_s in (0.0, 0.01):
                self.odometry.publish(odometry_of(stamp + rospy.Duration(later_s)))
            self.tf.publish(TFMessage([transform_of(stamp, "wheels", "robot", WHEELS)]))
        self.scans.publish(scan_of(stamp, self.standing, self.chance, **arguments))
        time.sleep(PERIOD_S)
        return stamp

    def run_scans(self, count, **arguments):
        return [self.send(**arguments) for _ in range(count)]

    def status(self):
        return self.diagnostics.stages.get(STAGE, {})

    def wait_for(self, key, value, timeout_s=5.0):
        """Scans until the diagnostics say so."""
        end = time.monotonic() + timeout_s
        while self.status().get(key) != value:
            self.assertLess(time.monotonic(), end, f"{key} is {self.status().get(key)}, not {value}: {self.status()}")
            self.run_scans(5)

    def wait_for_pose(self, timeout_s=5.0):
        end = time.monotonic() + timeout_s
        while True:
            stamp = self.run_scans(5)[-1]
            if comes_true(lambda: self.poses.messages and self.poses.messages[-1].header.stamp == stamp, 0.5):
                return self.poses.messages[-1]
            self.assertLess(time.monotonic(), end, f"no pose: {self.status()}")

    def assert_true_pose(self, message):
        pose = message.pose.pose
        self.assertEqual(message.header.frame_id, "hall")
        self.assertAlmostEqual(pose.position.x, ROBOT[0], delta=0.015)
        self.assertAlmostEqual(pose.position.y, ROBOT[1], delta=0.015)
        self.assertAlmostEqual(2.0 * math.atan2(pose.orientation.z, pose.orientation.w), ROBOT[2], delta=0.01)

    def logged(self, level, *parts):
        return [log for log in self.logs if log.level == level and all(part in log.msg for part in parts)]

    def count(self, key):
        self.diagnostics.wait_for_reports(STAGE)
        return self.diagnostics.count(STAGE, key)

    # --- start

    @fault("file of reflectors missing or wrong", "no file, one with reflectors that overlap, then a good one",
           "each is named in a FATAL sentence with the reason; with the good one it starts by itself", times=2)
    def test_01_a_file_that_cannot_be_used_is_said_and_tried_again(self):
        wait_until(lambda: self.logged(Log.FATAL, str(self.file)), 30.0, "the missing file to be named")
        self.file.write_text("reflectors: [{x: 1, y: 2, radius_m: 0.05}, {x: 1.01, y: 2, radius_m: 0.05}]\n")
        wait_until(lambda: self.logged(Log.FATAL, str(self.file), "overlap"), 10.0, "the wrong file to be named")
        self.file.write_text("reflectors:\n" + "".join(f"  - {{x: {x}, y: {y}, radius_m: {RADIUS}}}\n"
                                                  for x, y in REFLECTORS))
        rospy.wait_for_service("relocate", 30.0)
        wait_until(lambda: min(self.scans.get_num_connections(), self.odometry.get_num_connections(),
                               self.tf.get_num_connections(), self.given.get_num_connections()) > 0, 10.0, "inputs")

    @fault("no odometry, no mounting in TF", "20 scans without odometry, 20 without the transform base to lidar",
           "all dropped by reason, the log names the frames; localised once both are there", times=2)
    def test_02_scans_without_odometry_or_mounting_are_dropped_by_reason(self):
        self.run_scans(20, odometry=False)
        time.sleep(1.0)
        self.assertEqual(self.count("dropped: no odometry"), 20)
        self.assertIn("no odometry", self.status()["summary"])
        self.run_scans(20)
        time.sleep(1.0)
        self.assertGreater(self.count("dropped: no transform"), 10)
        said = self.logged(Log.WARN, "from robot to scanner")
        self.assertTrue(said)
        self.assertEqual({log.msg.count("from robot to scanner") for log in said}, {1}, said)
        self.mounting.publish(TFMessage([transform_of(rospy.Time.now(), "robot", "scanner", SCANNER)]))
        wait_until(lambda: self.mounting.get_num_connections() > 0, 5.0, "the listener")

    def test_03_finds_its_pose_and_publishes_it_in_tf(self):
        buffer = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(buffer)  # noqa: F841
        time.sleep(0.5)
        self.assert_true_pose(self.wait_for_pose())
        message = self.wait_for_pose()
        covariance = message.pose.covariance
        for i, sigma in ((0, 0.003), (7, 0.003), (35, 0.002)):
            self.assertGreater(covariance[i], 0.0)
            self.assertLess(math.sqrt(covariance[i]), sigma)
        stamp = message.header.stamp
        wait_until(lambda: buffer.can_transform("hall", "robot", stamp), 2.0, "TF at the stamp of the scan")
        transform = buffer.lookup_transform("hall", "robot", stamp).transform
        self.assertAlmostEqual(transform.translation.x, message.pose.pose.position.x, delta=1e-6)
        self.assertAlmostEqual(transform.translation.y, message.pose.pose.position.y, delta=1e-6)
        self.wait_for("matched", "4")
        status = self.status()
        self.assertEqual(status["pose"], "known")
        self.assertEqual([status[key] for key in ("missing", "moved", "ambiguous")], ["0", "0", "0"])
        self.assertLess(float(status["sigma yaw [rad]"]), 0.002)

    def shown(self, name):
        for array in reversed(self.markers.messages):
            found = {m.id: m for m in array.markers if m.ns == name and m.action == Marker.ADD}
            if found:
                return found
        return {}

    # --- reflectors

    @fault("reflector moved", "by 0.3 m", "named with the distance; the pose stays; used again when it is back")
    def test_04_a_moved_reflector_is_named_with_its_distance(self):
        self.standing[1] = (REFLECTORS[1][0] + 0.3, REFLECTORS[1][1])
        self.wait_for("moved", "1")
        wait_until(lambda: "reflectors[1] at (1.00, 3.00) stands 0." in self.status()["summary"], 3.0, "its sentence")
        wait_until(lambda: self.logged(Log.WARN, "reflectors[1]", "from there"), 3.0, "the warning")
        self.assertTrue(any(f"stands {d:.2f} m" in self.status()["summary"] for d in (0.28, 0.29, 0.30, 0.31, 0.32)))
        self.assertEqual(len(self.logged(Log.WARN, "reflectors[1]", "from there")), 1, "it is said once")
        self.assertIn(1, self.shown("moved"))
        self.assert_true_pose(self.wait_for_pose())
        self.standing[1] = REFLECTORS[1]
        self.wait_for("moved", "0")

    @fault("reflector missing", "taken away, and brought back", "named; the pose stays; used again when it is back")
    def test_05_a_missing_reflector_is_named(self):
        self.standing.pop(2)
        self.wait_for("missing", "1")
        wait_until(lambda: "reflectors[2]" in self.status()["summary"], 3.0, "its sentence")
        colours = {i: (m.color.r, m.color.g) for i, m in self.shown("reflector").items()}
        self.assertGreater(colours[2][0], colours[2][1], "red")
        self.assertLess(colours[0][0], colours[0][1], "green")
        self.standing.insert(2, REFLECTORS[2])
        self.wait_for("missing", "0")

    # --- relocation

    def test_06_relocates(self):
        relocate = rospy.ServiceProxy("relocate", Relocate)
        self.wait_for_pose()
        self.assertTrue(relocate(has_pose=False).success)
        self.assert_true_pose(self.wait_for_pose())

        answer = relocate(has_pose=True, pose=Pose2D(math.nan, 0.0, 0.0))
        self.assertFalse(answer.success)
        self.assertIn("finite", answer.message)
        self.assert_true_pose(self.wait_for_pose())

        # Two are not enough without a guess; they are with one.
        del self.standing[2:]
        self.assertTrue(relocate(has_pose=False).success)
        self.wait_for("pose", "not known: too few places")
        self.assertIn("pose not known", self.status()["summary"])
        near = Pose2D(ROBOT[0] + 0.05, ROBOT[1] - 0.04, ROBOT[2] + 0.03)
        self.assertTrue(relocate(has_pose=True, pose=near).success)
        self.assert_true_pose(self.wait_for_pose())

        self.assertTrue(relocate(has_pose=False).success)
        self.wait_for("pose", "not known: too few places")
        given = PoseWithCovarianceStamped()
        given.header.stamp = rospy.Time.now()
        given.header.frame_id = "elsewhere"
        given.pose.pose.position.x, given.pose.pose.position.y = near.x, near.y
        given.pose.pose.orientation.z, given.pose.pose.orientation.w = math.sin(near.theta / 2), math.cos(near.theta / 2)
        given.pose.covariance = [0.0] * 36
        given.pose.covariance[0] = given.pose.covariance[7] = 0.01
        given.pose.covariance[35] = 0.004
        self.given.publish(given)
        self.wait_for("initialpose not used", "1")
        self.assertEqual(self.status()["pose"], "not known: too few places")
        given.header.frame_id = "hall"
        self.given.publish(given)
        self.assert_true_pose(self.wait_for_pose())
        self.standing[:] = REFLECTORS

    @fault("pose that cannot be used", "relocate with NaN or a negative sigma; initialpose with NaN, or a variance "
           "that is NaN or negative", "refused or counted with the reason, the pose stays", times=5)
    def test_06b_a_pose_that_cannot_be_used_changes_nothing(self):
        relocate = rospy.ServiceProxy("relocate", Relocate)
        self.wait_for_pose()
        for wrong in ({"pose": Pose2D(0.0, 0.0, math.nan)}, {"sigma_m": -1.0}):
            answer = relocate(has_pose=True, **wrong)
            self.assertFalse(answer.success)
            self.assertIn("finite", answer.message)
        before = self.count("initialpose not used")
        for spoil in (lambda pose: setattr(pose.pose.position, "y", math.nan),
                      lambda pose: setattr(pose, "covariance", [math.nan] * 36),
                      lambda pose: setattr(pose, "covariance", [-1.0] * 36)):
            given = PoseWithCovarianceStamped()
            given.header.stamp, given.header.frame_id = rospy.Time.now(), "hall"
            given.pose.pose.orientation.w = 1.0
            given.pose.covariance = [0.01 if i in (0, 7, 35) else 0.0 for i in range(36)]
            spoil(given.pose)
            self.given.publish(given)
        self.assertEqual(self.count("initialpose not used"), before + 3)
        poses = len(self.poses.messages)
        self.run_scans(3)
        wait_until(lambda: len(self.poses.messages) > poses, 2.0, "the next pose")
        self.assert_true_pose(self.poses.messages[-1])

    # --- faults

    @fault("odometry that cannot be used", "NaN, no rotation, stamps that repeat or go back, another child frame",
           "each is counted by its reason and not used; the pose stays", times=5)
    def test_07_bad_odometry_is_not_used(self):
        self.wait_for_pose()
        bad = odometry_of(self.now())
        bad.pose.pose.position.x = math.nan
        self.odometry.publish(bad)
        bad = odometry_of(self.now())
        bad.pose.pose.orientation.w = bad.pose.pose.orientation.z = 0.0
        self.odometry.publish(bad)
        self.assertEqual(self.count("not used: odometry not a finite pose"), 2)

        key = "not used: odometry stamp repeats or goes back"
        before, stamp = self.count(key), self.now()
        for before_s in (0.0, 0.0, 0.5):  # repeated, and back
            self.odometry.publish(odometry_of(stamp - rospy.Duration(before_s)))
        self.assertEqual(self.count(key), before + 2)
        other = odometry_of(self.now())
        other.child_frame_id = "other"
        self.odometry.publish(other)
        self.assertEqual(self.count("not used: odometry in another frame"), 1)
        self.assert_true_pose(self.wait_for_pose())

    @fault("odometry late", "0.2 s after its scan", "the scan waits for it and has its pose")
    def test_08_late_odometry_is_waited_for(self):
        self.wait_for_pose()
        stamp = self.now()
        self.scans.publish(scan_of(stamp, self.standing, self.chance))
        time.sleep(0.2)
        self.assertNotIn(stamp, self.poses.stamps())
        self.odometry.publish(odometry_of(stamp + rospy.Duration(0.01)))
        wait_until(lambda: stamp in self.poses.stamps(), 1.0, "its pose")

    @fault("odometry missing", "for 10 scans", "all dropped: no odometry; the pose goes on by the next scans", times=10)
    def test_09_missing_odometry_drops_scans_and_the_pose_stays(self):
        self.wait_for_pose()
        before = self.count("dropped: no odometry")
        self.run_scans(10, odometry=False)
        time.sleep(0.8)
        self.assertEqual(self.count("dropped: no odometry"), before + 10)
        self.assert_true_pose(self.wait_for_pose())

    @fault("odometry jumps", "by 90 m and 2 rad", "no motion: each scan has its pose, the jump is counted")
    def test_10_a_jump_of_odometry_is_no_motion(self):
        global WHEELS
        self.wait_for_pose()
        wheels, WHEELS = WHEELS, (90.0, -40.0, 2.0)
        try:
            stamp = self.now()
            for later_s in (0.0, 0.01):
                self.odometry.publish(odometry_of(stamp + rospy.Duration(later_s), WHEELS))
            before = len(self.poses.messages)
            for _ in range(10):
                stamp = self.now()
                for later_s in (0.0, 0.01):
                    self.odometry.publish(odometry_of(stamp + rospy.Duration(later_s), WHEELS))
                self.scans.publish(scan_of(stamp, self.standing, self.chance))
                time.sleep(PERIOD_S)
            wait_until(lambda: len(self.poses.messages) >= before + 8, 2.0, "poses after the jump")
            self.assert_true_pose(self.poses.messages[-1])
            self.assertEqual(self.count("odometry jumped"), 1)
        finally:
            WHEELS = wheels

    @fault("scans without intensities or ranges", "fewer intensities than ranges; no intensities; all ranges NaN",
           "the first is dropped by reason; the others are counted, and have the pose by odometry", times=7)
    def test_11_bad_scans_are_dropped_by_reason(self):
        self.wait_for_pose()
        scan = scan_of(self.now(), self.standing, self.chance)
        scan.intensities = scan.intensities[:7]
        self.scans.publish(scan)
        self.assertEqual(self.count("dropped: bad scan: intensities are not one per range"), 1)
        scan = scan_of(self.now(), self.standing, self.chance)
        scan.ranges = [math.nan] * BEAMS
        self.odometry.publish(odometry_of(scan.header.stamp + rospy.Duration(0.01)))
        self.scans.publish(scan)  # has no reflector: odometry alone
        wait_until(lambda: scan.header.stamp in self.poses.stamps(), 2.0, "its pose")
        self.run_scans(5, intensities=False)
        self.assertEqual(self.count("scans without intensities"), 5)
        self.assert_true_pose(self.wait_for_pose())

    @fault("flood of scans and odometry", "300 of each at once",
           "localised, or dropped as overtaken; the pose stays")
    def test_11b_a_flood_does_no_harm(self):
        self.wait_for_pose()
        time.sleep(0.5)
        poses, begin = len(self.poses.messages), self.now()
        for i in range(300):
            stamp = begin + rospy.Duration(0.0005 * i)
            self.odometry.publish(odometry_of(stamp))
            self.scans.publish(scan_of(stamp, self.standing, self.chance))
        self.assert_true_pose(self.wait_for_pose(10.0))
        self.assertGreater(len(self.poses.messages), poses)
        self.assertFalse(self.logged(Log.ERROR, STAGE))

    @fault("scanner silent", "for 3 s, while the robot drives 0.5 m by its odometry",
           "the pose is taken along by odometry")
    def test_11c_without_scans_odometry_takes_the_pose_along(self):
        global ROBOT, WHEELS
        self.wait_for_pose()
        robot, wheels = ROBOT, WHEELS
        for i in range(60):
            step = (0.5 * (i + 1) / 60, 0.0, 0.0)
            self.odometry.publish(odometry_of(self.now(), composed(wheels, step)))
            time.sleep(0.05)
        ROBOT, WHEELS = composed(robot, step), composed(wheels, step)
        self.assert_true_pose(self.wait_for_pose())

    @fault("time is reset", "stamps 200 s back", "the pose is forgotten, and found by the reflectors")
    def test_12_time_that_starts_again_forgets_the_pose_and_finds_it(self):
        self.wait_for_pose()
        type(self).shift_s = -200.0
        self.assert_true_pose(self.wait_for_pose(10.0))
        self.assertEqual(self.count("odometry restarted"), 1)
        self.assertFalse(self.logged(Log.ERROR, STAGE))


if __name__ == "__main__":
    rospy.init_node("reflector_localization_test")
    rostest.rosrun("situation_awareness", "reflector_localization_test", ReflectorLocalizationTest)
