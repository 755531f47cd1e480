#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelets safety_areas and path_following lead a vehicle along its path, stop it before what is in the way, and
where scans, poses or sense are missing."""
import math
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import numpy as np
import rosnode
import rospy
import rostest
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist
from nav_msgs.msg import Odometry, Path
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from fault_record import cell, fault  # noqa: E402
from mission_faults import map_update, outline_feature  # noqa: E402
from ros_support import Diagnostics, Latest, pid_of, run_beside, scan_msg, transform_msg, wait_until  # noqa: E402
from situation_awareness.msg import MapFeature, MapUpdate, PathError, SafetyVerdict  # noqa: E402

LASER_X_M = 0.1
WALLS = (((-2, -1.6), (6, -1.6)), ((-2, 1.6), (6, 1.6)), ((-2, -1.6), (-2, 1.6)), ((6, -1.6), (6, 1.6)))


def box(x, y, half):
    corners = [(x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half)]
    return list(zip(corners, corners[1:] + corners[:1]))


def cast(edges, x, y, azimuths):
    ranges = np.full(len(azimuths), np.inf)
    ux, uy = np.cos(azimuths), np.sin(azimuths)
    for (ax, ay), (bx, by) in edges:
        dx, dy, fx, fy = bx - ax, by - ay, ax - x, ay - y
        determinant = dx * uy - dy * ux
        with np.errstate(divide="ignore", invalid="ignore"):
            r = (fy * dx - fx * dy) / determinant
            s = (ux * fy - uy * fx) / determinant
            ranges = np.where((r > 0) & (s >= 0) & (s <= 1) & (r < ranges), r, ranges)
    return ranges


class Vehicle:
    """Does as cmd_vel says; publishes scan, odom, TF and a map in real time. What it does not publish can be chosen."""

    def __init__(self):
        self.x, self.y, self.yaw = 0.0, 0.0, 0.0
        self.speed, self.turn_rate = 0.0, 0.0
        self.watchdog_s, self.told_at = math.inf, time.monotonic()  # of the base
        self.edges = list(WALLS)
        self.with_scan = self.with_tf = self.with_objects = True
        self.chains = []  # on the map: edges, id and motion of each; None: no map
        self.is_blind = False
        self.range = None  # of all beams
        self.poses, self.variance, self.pose_frame = None, 1e-4, "map"
        self.commands = []
        self.objects_stamp = rospy.Time()
        self.scans = rospy.Publisher("scan", LaserScan, queue_size=10)
        self.tf = rospy.Publisher("/tf", TFMessage, queue_size=100)
        self.odometry = rospy.Publisher("odom", Odometry, queue_size=100)
        self.maps = rospy.Publisher("semantic_map/updates", MapUpdate, queue_size=10)
        self.subscriber = rospy.Subscriber("cmd_vel", Twist, self.command, queue_size=10)
        self.lock = threading.Lock()  # of its pose
        run_beside(self.run)

    def place(self, x, y, yaw=0.0):
        with self.lock:
            self.x, self.y, self.yaw = x, y, yaw

    def command(self, msg):
        self.speed, self.turn_rate, self.told_at = msg.linear.x, msg.angular.z, time.monotonic()
        self.commands.append(msg)

    def run(self):
        before, count = rospy.Time.now().to_sec(), 0
        while not rospy.is_shutdown():
            time.sleep(0.02)
            stamp = rospy.Time.now()
            period = min(stamp.to_sec() - before, 0.5)
            before = stamp.to_sec()
            if time.monotonic() - self.told_at > self.watchdog_s:
                self.speed = self.turn_rate = 0.0
            with self.lock:
                self.x += period * self.speed * math.cos(self.yaw)
                self.y += period * self.speed * math.sin(self.yaw)
                self.yaw += period * self.turn_rate
            self.publish(stamp, count)
            count += 1

    def publish(self, stamp, count):
        if self.with_tf:
            base = transform_msg(stamp, self.x, "map", "base_link")
            transform = base.transforms[0].transform
            transform.translation.y = self.y
            transform.rotation.z, transform.rotation.w = math.sin(self.yaw / 2), math.cos(self.yaw / 2)
            self.tf.publish(TFMessage(base.transforms
                                      + transform_msg(stamp, LASER_X_M, "base_link", "laser").transforms))
        odometry = Odometry()
        odometry.header.stamp = stamp
        odometry.twist.twist.linear.x = self.speed
        self.odometry.publish(odometry)
        if self.poses is not None:
            pose = PoseWithCovarianceStamped()
            pose.header.stamp, pose.header.frame_id = stamp, self.pose_frame
            pose.pose.covariance = [self.variance if k in (0, 7, 35) else 0.0 for k in range(36)]
            self.poses.publish(pose)
        if count % 2 == 0:
            self.publish_map(stamp)
        if self.with_scan and count % 2 == 0:
            scan = scan_msg(stamp, [], frame="laser")
            azimuths = self.yaw + scan.angle_min + scan.angle_increment * np.arange(541)
            lidar_x = self.x + LASER_X_M * math.cos(self.yaw)
            lidar_y = self.y + LASER_X_M * math.sin(self.yaw)
            ranges = cast(self.edges, lidar_x, lidar_y, azimuths)
            scan.ranges = (np.full(541, np.nan).tolist() if self.is_blind else
                           [self.range] * 541 if self.range is not None else ranges.tolist())
            scan.angle_max = scan.angle_min + 540 * scan.angle_increment
            self.scans.publish(scan)

    def publish_map(self, stamp):
        if self.chains is None:
            return
        if self.with_objects:
            self.objects_stamp = stamp
        msg = map_update(stamp, stamp.to_nsec(), [known_outline(stamp, *chain) for chain in self.chains])
        msg.objects_stamp = self.objects_stamp
        self.maps.publish(msg)

    def stands(self):
        return self.speed == 0.0 and self.turn_rate == 0.0


def known_outline(stamp, edges, ident=1, motion=MapFeature.FIXED):
    outline = outline_feature(ident, [first for first, _ in edges], sigma=0.005, closed=True)
    outline.motion, outline.seen_by, outline.p_exists = motion, MapFeature.SCAN, 0.99
    outline.first_seen, outline.last_seen = stamp - rospy.Duration(5.0), stamp
    return outline


class PathTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.logs = []
        cls.log_subscriber = rospy.Subscriber("/rosout", Log, cls.logs.append, queue_size=1000)
        cls.verdicts = Latest("safety", SafetyVerdict)
        cls.errors = Latest("path_error", PathError)
        cls.paths = Latest("path", Path)
        cls.markers = Latest("safety_areas", MarkerArray)
        cls.diagnostics = Diagnostics()
        cls.safety = rospy.Publisher("safety", SafetyVerdict, queue_size=5)
        for name in ("start", "stop"):
            rospy.wait_for_service(f"path_following/{name}", 60.0)
        cls.start = rospy.ServiceProxy("path_following/start", Trigger)
        cls.stop = rospy.ServiceProxy("path_following/stop", Trigger)
        cls.vehicle = Vehicle()
        wait_until(lambda: cls.verdicts.messages, 30.0, "a verdict")
        wait_until(lambda: cls.vehicle.maps.get_num_connections() > 0 and cls.safety.get_num_connections() > 1, 30.0,
                   "subscribers")

    def latest(self):
        return self.verdicts.messages[-1]

    def settle(self, x=0.0):
        """The vehicle stands at the begin of its way, with nothing there but walls, and is told nothing."""
        self.stop()
        vehicle = self.vehicle
        wait_until(vehicle.stands, 10.0, "the vehicle to stand")
        vehicle.edges, vehicle.with_scan, vehicle.with_tf, vehicle.with_objects = list(WALLS), True, True, True
        vehicle.chains = []
        vehicle.place(x, 0.0)
        moved = rospy.Time.now() + rospy.Duration(0.1)
        wait_until(lambda: self.latest().header.stamp > moved and self.latest().kind != SafetyVerdict.POSE
                   and self.latest().allowed_speed_m_s > 0.3, 10.0, "a verdict of full speed or nearly")

    def drive(self):
        self.assertTrue(self.start().success)
        wait_until(lambda: self.vehicle.speed > 0.2, 10.0, "the vehicle to drive")

    def test_1_it_drives_to_the_end_of_its_path(self):
        self.settle()
        wait_until(lambda: self.paths.messages, 5.0, "the path")
        poses = self.paths.messages[0].poses
        self.assertEqual(self.paths.messages[0].header.frame_id, "map")
        self.assertAlmostEqual(poses[-1].pose.position.x, 3.0, places=6)
        self.assertTrue(self.vehicle.stands(), "it waits for the service")
        before = len(self.errors.messages)
        self.drive()
        wait_until(lambda: self.errors.messages[-1].state == PathError.ARRIVED and self.vehicle.stands(), 40.0,
                   "the end of the path")
        self.assertLess(math.hypot(self.vehicle.x - 3.0, self.vehicle.y), 0.08)
        across = [abs(error.across_m) for error in self.errors.messages[before:]]
        self.assertLess(max(across), 0.08)
        self.assertGreater(max(command.linear.x for command in self.vehicle.commands), 0.4)
        names = {marker.ns for array in self.markers.messages for marker in array.markers}
        self.assertEqual(names, {"warning", "protective", "decides", "verdict"})

    def test_2_it_stops_before_what_is_in_the_way(self):
        self.settle()
        self.vehicle.edges += box(2.0, 0.1, 0.15)
        self.drive()
        wait_until(lambda: self.vehicle.stands() and self.vehicle.x > 0.5, 20.0, "the vehicle to stop")
        wait_until(lambda: self.latest().verdict == SafetyVerdict.STOP, 5.0, "the verdict")
        self.assertEqual(self.latest().kind, SafetyVerdict.UNKNOWN_HIT)
        self.assertLess(self.vehicle.x + 0.215, 1.85 - 0.1)
        self.assertLess(abs(self.latest().place.x - 1.85), 0.1)
        self.vehicle.edges = list(WALLS)
        wait_until(lambda: self.vehicle.speed > 0.2, 10.0, "it to go on")

    def test_3_known_chains_do_not_slow_it_down(self):
        self.settle()
        self.vehicle.place(1.0, 0.0)
        edges = box(1.4, 0.85, 0.2)
        self.vehicle.edges += edges
        wait_until(lambda: self.latest().kind == SafetyVerdict.UNKNOWN_HIT and self.latest().allowed_speed_m_s < 0.3,
                   5.0, "slow")
        self.vehicle.chains = [(edges, 7, MapFeature.STANDING)]
        wait_until(lambda: self.latest().kind == SafetyVerdict.CHAIN and self.latest().id == 7, 5.0, "the new chain")
        self.vehicle.chains = [(edges, 7)]
        wait_until(lambda: self.latest().allowed_speed_m_s > 0.35, 5.0, "the speed beside the walls, which are on no map")
        self.assertEqual((self.latest().policy, list(self.latest().missing)), (SafetyVerdict.UPDATED, []))

        save = rospy.ServiceProxy("safety_areas/save_local_maps", Trigger)()
        self.assertTrue(save.success, save.message)
        file = pathlib.Path(save.message.split()[-1])
        self.assertIn("id: 7", file.read_text())
        file.unlink()

    def assert_stops(self, what, key):
        count = self.diagnostics.count("path_following", key)
        wait_until(self.vehicle.stands, 5.0, f"the vehicle to stop: {what}")
        wait_until(lambda: self.diagnostics.count("path_following", key) > count, 5.0, key)
        wait_until(lambda: "stopped" in self.diagnostics.summary("path_following")
                   or "no input" in self.diagnostics.summary("path_following"), 5.0, "a warning")

    @fault("scanner silent", "while the vehicle drives", "it stops, and goes on by itself with the next scans")
    def test_4_without_scans_it_stops_and_goes_on(self):
        self.settle()
        self.drive()
        self.vehicle.with_scan = False
        self.assert_stops("no scan", "commands without a verdict")
        self.vehicle.with_scan = True
        wait_until(lambda: self.vehicle.speed > 0.2, 10.0, "it to go on")

    @fault("scanner covered", "all ranges NaN while the vehicle drives", "it stops: the way is hidden; then it goes on")
    def test_4b_by_scans_that_say_nothing_it_stops_and_goes_on(self):
        self.settle()
        self.drive()
        self.vehicle.is_blind = True
        try:
            wait_until(self.vehicle.stands, 5.0, "the vehicle to stop")
            wait_until(lambda: self.latest().kind == SafetyVerdict.HIDDEN and not self.latest().may_turn, 5.0,
                       "the reason")
        finally:
            self.vehicle.is_blind = False
        wait_until(lambda: self.vehicle.speed > 0.2, 10.0, "it to go on")

    @fault("pose missing", "no transforms while the vehicle drives", "it stops, and goes on with the next ones")
    def test_5_without_a_pose_it_stops_and_goes_on(self):
        self.settle()
        self.drive()
        self.vehicle.with_tf = False
        self.assert_stops("no pose", "commands without a pose")
        self.vehicle.with_tf = True
        wait_until(lambda: self.vehicle.speed > 0.2, 10.0, "it to go on")

    @fault("verdicts that cannot be used", "a speed of NaN, inf or -1, an unknown verdict, one that contradicts its "
           "speed, another frame, 5 s old", "each counts as none: the vehicle stands", times=7)
    def test_6_stale_verdicts_and_those_that_are_no_sense_stop_it(self):
        self.settle()
        self.drive()
        self.vehicle.with_scan = False
        wait_until(self.vehicle.stands, 5.0, "the vehicle to stop")
        key, before = "dropped: bad message", self.diagnostics.count("path_following", "dropped: bad message")
        good = {"verdict": SafetyVerdict.FULL_SPEED, "may_turn": True}
        for wrong in ({"allowed_speed_m_s": math.nan}, {"allowed_speed_m_s": -1.0}, {"allowed_speed_m_s": math.inf},
                      {"allowed_speed_m_s": 0.5, "verdict": 9}, {"allowed_speed_m_s": 0.5, "verdict": 2}):
            msg = SafetyVerdict(**{**good, **wrong})
            msg.header.stamp, msg.header.frame_id = rospy.Time.now(), "map"
            self.safety.publish(msg)
            time.sleep(0.1)  # of several at once the newest alone is taken
        elsewhere = SafetyVerdict(allowed_speed_m_s=0.5, **good)
        elsewhere.header.stamp, elsewhere.header.frame_id = rospy.Time.now(), "moon"
        self.safety.publish(elsewhere)
        time.sleep(0.1)
        old = SafetyVerdict(allowed_speed_m_s=0.5, **good)
        old.header.stamp, old.header.frame_id = rospy.Time.now() - rospy.Duration(5.0), "map"
        self.safety.publish(old)
        wait_until(lambda: self.diagnostics.count("path_following", key) == before + 6, 5.0, "6 bad messages")
        time.sleep(1.0)
        self.assertTrue(self.vehicle.stands())

    @fault("map stopped", "a map without its objects, then no map, for 2 s", "conservative, said in verdict and "
           "diagnostics; without a map all hits are unknown; then as before", times=2)
    def test_3b_without_a_fresh_map_it_is_conservative(self):
        self.settle(1.0)
        edges = box(1.4, 0.85, 0.2)
        self.vehicle.edges += edges
        self.vehicle.chains = [(edges, 7)]
        wait_until(lambda: self.latest().allowed_speed_m_s > 0.35, 5.0, "a known box beside the way")
        self.vehicle.with_objects = False
        wait_until(lambda: list(self.latest().missing) == [SafetyVerdict.MAP], 5.0, "what is missing")
        self.assertEqual(self.latest().policy, SafetyVerdict.CONSERVATIVE)
        self.assertEqual(self.latest().kind, SafetyVerdict.CHAIN)
        self.assertLessEqual(self.latest().allowed_speed_m_s, 0.15)
        wait_until(lambda: "without map" in self.diagnostics.summary("safety_areas"), 5.0, "a warning")
        self.vehicle.with_objects, self.vehicle.chains = True, None
        wait_until(lambda: self.latest().kind == SafetyVerdict.UNKNOWN_HIT, 5.0, "an unknown hit")
        self.assertEqual(list(self.latest().missing), [SafetyVerdict.MAP])
        self.assertEqual(self.latest().policy, SafetyVerdict.CONSERVATIVE)
        self.vehicle.chains = [(edges, 7)]
        wait_until(lambda: self.latest().allowed_speed_m_s > 0.35, 5.0, "the map again")

    @fault("scanner sees nothing", "no beam has a return, between walls of the map", "it stops: a contradiction, also when "
           "the map has forgotten the walls; then it goes on")
    def test_4c_a_scan_that_contradicts_the_map_stops_it(self):
        self.settle()
        self.vehicle.chains = [([edge, edge[::-1]], 10 + i) for i, edge in enumerate(WALLS)]
        self.drive()
        self.vehicle.range = math.inf
        try:
            wait_until(lambda: self.latest().kind == SafetyVerdict.CONTRADICTION, 5.0, "the reason")
            wait_until(self.vehicle.stands, 5.0, "the vehicle to stop")
            self.vehicle.chains = []
            after = rospy.Time.now() + rospy.Duration(0.5)
            wait_until(lambda: self.latest().header.stamp > after, 5.0, "a verdict by the empty map")
            self.assertEqual(self.latest().kind, SafetyVerdict.CONTRADICTION)
            self.assertFalse(self.latest().may_turn)
            wait_until(lambda: "contradict" in self.diagnostics.summary("safety_areas"), 5.0, "a warning")
        finally:
            self.vehicle.range = None
        wait_until(lambda: self.vehicle.speed > 0.2, 10.0, "it to go on")

    @fault("map, speed or pose that cannot be used", "a map with NaN or in another frame, a speed of NaN, a pose "
           "with a variance of NaN, inf, -1 or 0, in another frame, or no more", "counted by reason; once there is a "
           "covariance of the pose, it stops where none can be used", times=9)
    def test_7_bad_maps_and_odometry_are_counted(self):
        self.settle()
        before = self.diagnostics.count("safety_areas", "dropped: bad map")
        self.vehicle.chains, now = None, rospy.Time.now()
        bad = map_update(now, now.to_nsec(), [known_outline(now, box(1, 1, 0.2))])
        bad.changed[0].outline[0].x = math.nan
        self.vehicle.maps.publish(bad)
        elsewhere = [known_outline(now, box(1, 1, 0.2))]
        self.vehicle.maps.publish(map_update(now, now.to_nsec(), elsewhere, frame="moon"))
        wait_until(lambda: self.diagnostics.count("safety_areas", "dropped: bad map") == before + 2, 5.0, "bad maps")
        odometry = Odometry()
        odometry.twist.twist.linear.x = math.nan
        self.vehicle.odometry.publish(odometry)
        wait_until(lambda: self.diagnostics.count("safety_areas", "odometry not used") > 0, 5.0, "bad odometry")
        self.vehicle.chains = []
        self.assertIn("default", self.diagnostics.stages["safety_areas"]["covariance of the pose"])
        self.vehicle.poses = rospy.Publisher("pose", PoseWithCovarianceStamped, queue_size=10)
        vehicle, goes = self.vehicle, lambda: self.latest().allowed_speed_m_s > 0.3

        def is_stopped():
            verdict = self.latest()
            return (verdict.verdict == SafetyVerdict.STOP and verdict.kind == SafetyVerdict.POSE
                    and SafetyVerdict.COVARIANCE in verdict.missing)
        for vehicle.variance in (math.nan, math.inf, -1.0, 0.0):
            wait_until(is_stopped, 10.0, f"a stop by a variance of {vehicle.variance}")
            vehicle.variance = 1e-4
            wait_until(goes, 5.0, "a covariance that can be used")
        vehicle.pose_frame = "moon"
        wait_until(is_stopped, 5.0, "a stop by a pose of another frame")
        vehicle.pose_frame = "map"
        wait_until(goes, 5.0, "a covariance that can be used")
        wait_until(lambda: self.diagnostics.count("safety_areas", "pose not used") > 0, 5.0, "the count")
        poses, vehicle.poses = vehicle.poses, None
        wait_until(is_stopped, 5.0, "a stop without a covariance")
        vehicle.poses = poses
        wait_until(goes, 5.0, "a covariance that can be used")

    @fault("file of the path is none", "a way point of NaN",
           "a FATAL sentence names file and way point, the manager lives", times=2)
    def test_8_a_path_that_is_none_is_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "wrong.yaml"
            file.write_text("path: [{x: 0, y: 0}, {x: .nan, y: 1}]")
            for nodelet in ("safety_areas", "path_following"):
                name = f"wrong_{nodelet}"
                rospy.set_param(name, {"path_file": str(file)})
                loader = subprocess.run(["rosrun", "nodelet", "nodelet", "load", f"situation_awareness/{nodelet}",
                                         "path_manager", f"__name:={name}"], timeout=60, check=False)
                self.assertNotEqual(loader.returncode, 0)
                wait_until(lambda: [log.msg for log in self.logs if log.level == Log.FATAL and f"/{name} " in log.msg
                                    and "path[1].x" in log.msg and str(file) in log.msg], 5.0, "the sentence")
        for nodelet in ("safety_areas", "path_following"):
            with cell(nodelet, "parameters", "never came", "refused: path_file is empty"):
                name = f"without_{nodelet}"
                loader = subprocess.run(["rosrun", "nodelet", "nodelet", "load", f"situation_awareness/{nodelet}",
                                         "path_manager", f"__name:={name}"], timeout=60, check=False)
                self.assertNotEqual(loader.returncode, 0)
                wait_until(lambda: [log.msg for log in self.logs if log.level == Log.FATAL and f"/{name} " in log.msg
                                    and "path_file" in log.msg], 5.0, "the sentence")
        self.assertTrue(rosnode.rosnode_ping("/path_manager", max_count=1), "the manager lives")

    def other_stage(self, stage):
        """Another one of the stages, of a world that has no frame here; what it publishes is below /elsewhere."""
        topics = ("safety", "safety_areas") if stage == "safety_areas" else ("cmd_vel", "path_error", "path")
        return subprocess.Popen(["rosrun", "nodelet", "nodelet", "load", f"situation_awareness/{stage}", "path_manager",
                                 f"__name:=elsewhere_{stage}", "_world_frame:=elsewhere", "_start_at_once:=true",
                                 f"_path_file:={rospy.get_param(f'/{stage}/path_file')}",
                                 *(f"{topic}:=elsewhere/{topic}" for topic in topics)])

    def test_8b_stages_of_another_world_let_the_vehicle_stand(self):
        self.settle()
        verdicts, commands = Latest("elsewhere/safety", SafetyVerdict), Latest("elsewhere/cmd_vel", Twist)
        for stage, reason, what in (("safety_areas", "no transform", "drops all scans, and says so: no verdict"),
                                    ("path_following", "bad message",
                                     "refuses verdicts of other frames, and says so: zero commands alone")):
            with cell(stage, "parameters", "wrong frame", what):
                other = self.other_stage(stage)
                name = f"elsewhere_{stage}"
                try:
                    wait_until(lambda: self.diagnostics.count(name, f"dropped: {reason}") > 10, 30.0, reason)
                    self.assertIn("all input dropped", self.diagnostics.summary(name))
                finally:
                    other.terminate()
                    other.wait()
                self.assertEqual(verdicts.messages, [])
                self.assertTrue(all(told.linear.x == told.angular.z == 0.0 for told in commands.messages))
        self.assertTrue(commands.messages)

    @fault("manager terminated", "SIGTERM while the vehicle drives", "the last command is to stand")
    def test_9_a_manager_that_is_terminated_stops_the_vehicle(self):
        self.settle()
        self.drive()
        with cell("path_following", "manager", "restarted", "the last command is to stand"), \
                cell("safety_areas", "manager", "restarted", "no verdict until it is back: the vehicle stands"):
            os.kill(pid_of("/path_manager"), signal.SIGTERM)
            wait_until(self.vehicle.stands, 5.0, "the last command")


if __name__ == "__main__":
    rospy.init_node("path_test")
    rostest.rosrun("situation_awareness", "path_test", PathTest)
