#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Faults that need a separate launch: mountings that must give the same map, a model that is damaged while its
nodelet is stopped, a clock that has not started. fault_day has the others."""
import math
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import rosgraph
import rosnode
import rospy
import rostest
from geometry_msgs.msg import TransformStamped
from rosgraph_msgs.msg import Clock, Log
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from fault_record import fault  # noqa: E402
from ros_support import Latest, comes_true, ranges_to_circles, scan_msg, transform_msg, wait_until  # noqa: E402
from situation_awareness.msg import MappedObjectArray, SegmentArray  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[2]
PATIENCE_S = 60.0
CIRCLES = ((3.0, 0.5, 0.25), (2.0, -2.0, 0.3), (4.0, 2.5, 0.4))
SAME_M = 1e-4  # angles in messages have single precision


class Robot:
    """map.launch in a namespace, and a scanner for it."""

    def __init__(self, namespace, *arguments):
        self.namespace = namespace
        self.launch = subprocess.Popen(
            ["roslaunch", "--wait", str(ROOT / "launch/map.launch"), "kinds:=objects", "world_frame:=world", "rviz:=false",
             *arguments],
            env=dict(os.environ, ROS_NAMESPACE=namespace), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.maps = Latest(f"/{namespace}/objects", MappedObjectArray)
        self.segments = Latest(f"/{namespace}/segments", SegmentArray)
        self.scans = rospy.Publisher(f"/{namespace}/scan", LaserScan, queue_size=100)

    def wait(self):
        wait_until(lambda: self.scans.get_num_connections() > 0 and self.maps.subscriber.get_num_connections() > 0
                   and self.segments.subscriber.get_num_connections() > 0, PATIENCE_S, f"the nodelets of {self.namespace}")

    def end(self):
        self.launch.send_signal(signal.SIGINT)
        self.launch.wait(timeout=40)


def reversed_beams(msg):
    """The same scan from a scanner that turns the other way."""
    msg.ranges = msg.ranges[::-1]
    msg.angle_min, msg.angle_max = msg.angle_max, msg.angle_min
    msg.angle_increment = -msg.angle_increment
    return msg


def upside_down(msg):
    """The same scan from a scanner that is turned about its x axis by half a turn."""
    msg.header.frame_id = "lidar_upside_down"
    msg.angle_min, msg.angle_max, msg.angle_increment = -msg.angle_min, -msg.angle_max, -msg.angle_increment
    return msg


MOUNTINGS = {"upright": lambda msg: msg, "clockwise": reversed_beams, "upside_down": upside_down,
             "upside_down_clockwise": lambda msg: upside_down(reversed_beams(msg))}


class FaultsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.tf = rospy.Publisher("/tf", TFMessage, queue_size=1000)
        cls.static_tf = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        turned = TransformStamped()
        turned.header.frame_id = "lidar"
        turned.child_frame_id = "lidar_upside_down"
        turned.transform.rotation.x = 1.0
        cls.static_tf.publish(TFMessage([turned]))
        cls.logs = []
        cls.log_subscriber = rospy.Subscriber("/rosout", Log, cls.logs.append, queue_size=1000)

    def setUp(self):
        self.robots = []
        self.stamp_s = 1000.0

    def tearDown(self):
        for robot in self.robots:
            robot.launch.send_signal(signal.SIGINT)
        for robot in self.robots:
            robot.end()

    def start(self, namespace, *arguments):
        robot = Robot(namespace, *arguments)
        self.robots.append(robot)
        return robot

    def scan(self, robot, stamp=None, transform=True, **arguments):
        """One scan and its transform; its stamp."""
        if stamp is None:
            self.stamp_s += 0.05
            stamp = rospy.Time.from_sec(self.stamp_s)
        if transform:
            self.tf.publish(transform_msg(stamp))
        robot.scans.publish(scan_msg(stamp, circles=CIRCLES, **arguments))
        return stamp

    def maps_again(self, robot):
        stamp = self.scan(robot)
        return (comes_true(lambda: stamp in robot.maps.stamps(), 0.5)
                and len(robot.maps.messages[-1].objects) == len(CIRCLES))

    @fault("mounting", "upside down, clockwise, and both, 40 scans each beside those of an upright scanner",
           "the same ids, ellipses, velocities and covariances, within 0.1 mm", times=3)
    def test_every_mounting_gives_the_same_map(self):
        robots = {name: self.start(name, f"config:={ROOT / 'test/ros/objects_without_model.yaml'}")
                  for name in MOUNTINGS}
        for robot in robots.values():
            robot.wait()
        wait_until(lambda: self.tf.get_num_connections() >= len(robots), PATIENCE_S, "listeners to /tf")
        time.sleep(1.0)
        for i in range(40):
            self.stamp_s += 0.05
            stamp = rospy.Time.from_sec(self.stamp_s)
            x = 0.02 * i  # the robot moves, so does one of the objects
            self.tf.publish(transform_msg(stamp, x=x))
            circles = [(cx - x, cy, radius) for cx, cy, radius in CIRCLES]
            circles[1] = (circles[1][0], circles[1][1] + 0.03 * i, circles[1][2])
            for name, mount in MOUNTINGS.items():
                robots[name].scans.publish(mount(scan_msg(stamp, ranges=ranges_to_circles(circles))))
            for name in MOUNTINGS:
                wait_until(lambda: stamp in robots[name].maps.stamps(), PATIENCE_S, f"the map of {name}")

        def last(name):
            return next(msg for msg in robots[name].maps.messages if msg.header.stamp == stamp)
        expected = last("upright")
        self.assertEqual(len(expected.objects), len(CIRCLES))
        for name in MOUNTINGS:
            got = last(name)
            self.assertEqual([e.id for e in got.objects], [e.id for e in expected.objects], name)
            for a, b in zip(expected.objects, got.objects):
                self.assertAlmostEqual(a.pose.position.x, b.pose.position.x, delta=SAME_M, msg=name)
                self.assertAlmostEqual(a.pose.position.y, b.pose.position.y, delta=SAME_M, msg=name)
                self.assertAlmostEqual(a.rx, b.rx, delta=SAME_M, msg=name)
                self.assertAlmostEqual(a.ry, b.ry, delta=SAME_M, msg=name)
                self.assertAlmostEqual(a.twist.linear.x, b.twist.linear.x, delta=10 * SAME_M, msg=name)
                self.assertAlmostEqual(a.twist.linear.y, b.twist.linear.y, delta=10 * SAME_M, msg=name)
                for k in (0, 9, 18, 27, 54, 63):  # variances of x, y, vx, vy, rx, ry
                    self.assertAlmostEqual(math.sqrt(a.covariance[k]), math.sqrt(b.covariance[k]), delta=10 * SAME_M,
                                           msg=name)

    @fault("model damaged while stopped", "a byte of the network's file is changed, then the manager is killed",
           "one nodelet says why in a FATAL sentence, the others work; the repaired file is taken at the next try",
           times=1)
    def test_a_model_damaged_while_stopped(self):
        with tempfile.TemporaryDirectory() as folder:
            models = pathlib.Path(folder) / "models"
            shutil.copytree(ROOT / "models", models)
            robot = self.start("model", f"model_folder:={models}")
            robot.wait()
            wait_until(lambda: self.maps_again(robot), PATIENCE_S, "the first map")
            model = models / "ellipse.onnx"
            good = model.read_bytes()
            model.write_bytes(good[:1000] + bytes([good[1000] ^ 1]) + good[1001:])
            self.logs.clear()
            manager = rosgraph.Master("faults_test").lookupNode("/model/map_manager")
            os.kill(rosnode.ServerProxy(manager).getPid("faults_test")[2], signal.SIGKILL)

            def fatal():
                return [log.msg for log in self.logs if log.level == Log.FATAL]
            wait_until(fatal, PATIENCE_S, "the sentence")
            self.assertIn(str(model), fatal()[0])
            self.assertIn("detection", fatal()[0])

            def segments_again():
                stamp = self.scan(robot)
                return comes_true(lambda: stamp in robot.segments.stamps(), 0.5)
            wait_until(segments_again, PATIENCE_S, "segments, which need no model")
            rospy.wait_for_service("/model/mapping/reset", timeout=5.0)  # mapping is alive
            self.assertNotIn(self.scan(robot), robot.maps.stamps())
            model.write_bytes(good)
            wait_until(lambda: self.maps_again(robot), PATIENCE_S, "the map to be back")

    @fault("clock not yet started", "/use_sim_time and no /clock: scans of stamp zero, scans with stamps, then /clock",
           "stamp zero is dropped, stamps are mapped, /clock changes nothing", times=1)
    def test_a_clock_that_has_not_started(self):
        rospy.set_param("/use_sim_time", True)
        try:
            robot = self.start("clock", f"config:={ROOT / 'test/ros/objects_without_model.yaml'}")
            robot.wait()
            time.sleep(1.0)
            for _ in range(5):
                self.scan(robot, stamp=rospy.Time(0), transform=False)
            wait_until(lambda: self.maps_again(robot), PATIENCE_S, "maps before the clock starts")
            clock = rospy.Publisher("/clock", Clock, queue_size=10)
            wait_until(lambda: clock.get_num_connections() > 0, PATIENCE_S, "listeners to /clock")
            for _ in range(20):
                self.stamp_s += 0.05
                clock.publish(Clock(clock=rospy.Time.from_sec(self.stamp_s)))
                stamp = self.scan(robot)
                wait_until(lambda: stamp in robot.maps.stamps(), PATIENCE_S, "the map")
            self.assertEqual(len(robot.maps.messages[-1].objects), len(CIRCLES))
            self.assertNotIn(rospy.Time(0), robot.maps.stamps())
        finally:
            rospy.delete_param("/use_sim_time")


if __name__ == "__main__":
    rospy.init_node("faults_test")
    rostest.rosrun("situation_awareness", "faults_test", FaultsTest)
