#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""check_bag on simulated drives, as they are and with what drivers do to them: its line maps them, and each contradiction
is named."""
import math
import pathlib
import shlex
import subprocess
import sys
import unittest

import genpy
import numpy as np
import rosbag

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import small_bags  # noqa: E402
from bag_tools import BagToolTest, ROOT, program, run_program  # noqa: E402

TEN_SECONDS = ROOT / "test" / "data" / "leg_tracker_ten_seconds.bag"
DATA = ROOT.parent / "shared" / "data"


def ranges(change):
    """An alteration that changes each range of a scan."""
    def alter(topic, msg):
        if topic == "/scan":
            msg.ranges = [change(range_m) for range_m in msg.ranges]
        return topic, msg
    return alter


def fields(of, **values):
    """An alteration that sets fields of the messages of a topic."""
    def alter(topic, msg):
        if topic == of:
            for name, value in values.items():
                *path, last = name.split("__")
                owner = msg
                for part in path:
                    owner = getattr(owner, part)
                setattr(owner, last, value)
        return topic, msg
    return alter


def later(of, seconds):
    """An alteration that stamps the messages of a topic later."""
    def alter(topic, msg):
        if topic == of:
            msg.header.stamp += genpy.Duration.from_sec(seconds)
        return topic, msg
    return alter


def without_child(child):
    """An alteration that leaves out the transforms to a frame."""
    def alter(topic, msg):
        if hasattr(msg, "transforms"):
            msg.transforms = [transform for transform in msg.transforms if transform.child_frame_id != child]
        return topic, msg
    return alter


class CheckBagTest(BagToolTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.odom_bag, cls.tf_bag = cls.drive()
        cls.gps_bag, cls.fast_tf_bag = cls.round()

    def altered(self, bag, alter):
        """The bag with (topic, msg) = alter(topic, msg); None is left out."""
        out = self.path / "altered.bag"
        with rosbag.Bag(str(bag)) as whole, rosbag.Bag(str(out), "w") as part:
            for topic, msg, at in whole.read_messages():
                entry = alter(topic, msg)
                if entry is not None:
                    part.write(*entry, at)
        return out

    def page(self, bag, code=0, *arguments):
        done = run_program("check_bag", bag, *arguments, stderr=subprocess.PIPE)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done.stdout

    def map_by_line_of(self, page):
        """Runs the line of the page as it is, in a folder of its own; returns what the tool says."""
        line = page.split("Map it\n")[1].splitlines()[0]
        words = shlex.split(line)
        self.assertEqual(words[:3], ["rosrun", "situation_awareness", "map_bag"])
        out = self.path / "map.jsonl"
        out.unlink(missing_ok=True)
        done = subprocess.run([program("map_bag"), *words[3:]], cwd=self.path, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, check=False, timeout=300)
        self.assertEqual(done.returncode, 0, line + "\n" + done.stdout)
        self.assertGreater(len(out.read_text().splitlines()), 50)
        return done.stdout

    def test_its_line_maps_a_bag(self):
        for bag in (self.tf_bag, self.gps_bag, TEN_SECONDS):
            with self.subTest(bag.name):
                page = self.page(bag)
                self.map_by_line_of(page)
                self.assertIn("roslaunch situation_awareness map.launch scan:=/scan ", page)
        self.assertNotIn("To look at", self.page(self.tf_bag))

    def test_its_line_reads_transforms_in_a_namespace(self):
        bag = self.altered(self.tf_bag, lambda topic, msg: ("/robot1" + topic, msg))
        page = self.page(bag)
        self.assertIn("--tf-topic /robot1/tf", page)
        self.map_by_line_of(page)

    def test_names_contradictions_of_scans(self):
        for alter, words in (
                (ranges(lambda r: 1000.0 * r), "ranges of up to"),
                (ranges(lambda r: r if math.isfinite(r) and r < 8.0 else 0.0), "scan/no_return to zero"),
                (ranges(lambda r: r if math.isfinite(r) and r < 8.0 else math.nan), "scan/no_return to nan"),
                (ranges(lambda r: math.inf), "no beam has a return"),
                (fields("/scan", angle_increment=0.0), "angle increment of zero"),
                (fields("/scan", header__frame_id=""), "no frame_id"),
                (fields("/scan", time_increment=-1e-5), "time_increment is -1e-05 s"),
                (fields("/scan", time_increment=5e-4), "a scan comes each"),
                (fields("/scan", header__stamp=genpy.Time()), "all stamps are zero"),
                (without_child("laser"), "no transform leads to laser"),
                (without_child("base_link"), "no transform says where base_link is")):
            with self.subTest(words):
                done = run_program("check_bag", self.altered(self.tf_bag, alter))
                self.assertIn(words, done.stdout)

    def test_names_motion_that_distorts_scans(self):
        bag = self.altered(self.fast_tf_bag, fields("/scan", time_increment=0.0))
        self.assertIn("its beams have no times", self.page(bag))
        self.assertNotIn("its beams have no times", self.page(self.fast_tf_bag))

    def test_names_contradictions_of_poses(self):
        def in_g(topic, msg):
            if topic == "/imu":
                for axis in "xyz":
                    setattr(msg.linear_acceleration, axis, getattr(msg.linear_acceleration, axis) / 9.80665)
            return topic, msg

        def on_its_side(topic, msg):
            if topic == "/imu":
                msg.header.frame_id = "case"
                force = msg.linear_acceleration
                force.y, force.z = force.z, -force.y
            return topic, msg

        for alter, words in (
                (on_its_side, "does not stand upright"),
                (later("/fix", 18.0), "18 s ahead of UTC"),
                (later("/imu", -5.0), "stamped 5.0"),
                (fields("/fix", altitude=math.nan), "have no altitude"),
                (fields("/fix", status__status=-1), "STATUS_NO_FIX"),
                (fields("/fix", position_covariance_type=0), "have no covariance"),
                (in_g, "is not that of gravity")):
            with self.subTest(words):
                done = run_program("check_bag", self.altered(self.gps_bag, alter))
                self.assertIn(words, done.stdout)

    def test_names_elevations_and_cameras_that_do_not_fit_the_images(self):
        ahead, byte_labels = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]]), {"encoding": "mono8"}
        for camera, alter, elevation, words in (
                ({}, {}, {}, None),
                ({"images": 200}, {}, {}, None),  # of which some are mapped
                ({}, {}, {"shift": (1000.0, 0.0)}, "no image shows ground of the elevation"),
                ({}, {}, {"height_m": -4.0}, "m above the elevation, not on it"),
                ({"turned": ahead}, {}, {}, "is its frame an optical one"),
                ({}, byte_labels, {}, "labels are 32FC1, and these images are mono8")):
            with self.subTest(words):
                messages = small_bags.camera(**camera)
                for _, topic, msg in messages:
                    if topic == "/camera/labels":
                        for name, value in alter.items():
                            setattr(msg, name, value)
                bag = small_bags.write(self.path / "camera.bag", messages)
                page = self.page(bag, 0, "--dem", small_bags.elevation(self.path / "ground.asc", **elevation))
                if words is None:
                    self.assertNotIn("To look at", page)
                else:
                    self.assertIn(words, page.split("To look at")[1])

    def test_a_bag_without_sensors_cannot_be_mapped(self):
        bag = self.altered(self.tf_bag, lambda topic, msg: None if topic == "/scan" else (topic, msg))
        self.assertIn("neither scans nor clouds", self.page(bag, 1))

    @unittest.skipUnless(DATA.exists(), "../shared/data is absent")
    def test_its_line_maps_recordings(self):
        for name in ("overtakes", "overtake_ego", "leg_tracker_walking_person", "obstacle_detector_two_scanners",
                     "scan_tools_hand_moved"):
            with self.subTest(name):
                page = self.page(DATA / f"{name}.bag")
                self.map_by_line_of(page)
                self.assertEqual("/scan moves: " in page, name == "scan_tools_hand_moved")


if __name__ == "__main__":
    unittest.main()
