#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Each tool that reads a bag, of a recording in which the stamp of one message is wrong: what it writes is what it writes
without that message, bit for bit. No roscore."""
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import genpy
import rosbag

HERE = pathlib.Path(__file__).resolve()
ROOT = HERE.parents[2]
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(ROOT / "scripts" / "evaluation"))
import grid_bags  # noqa: E402
import polygon_worlds  # noqa: E402
import splinegon_worlds  # noqa: E402
from fault_record import cell  # noqa: E402
from fault_tables import SHIFTS_S, stamp_fault  # noqa: E402

LATER = genpy.Duration(10000)
SAME = "refused and counted, as if it had not come"


def part_of(bag, out, seconds=math.inf):
    """The first seconds of a bag, LATER later: simulated time begins at 0, and an hour before that is none."""
    with rosbag.Bag(str(bag)) as whole, rosbag.Bag(str(out), "w") as part:
        end = whole.get_start_time() + seconds
        for topic, msg, at in whole.read_messages():
            if at.to_sec() <= end:
                for stamped in getattr(msg, "transforms", [msg]):
                    stamped.header.stamp += LATER
                part.write(topic, msg, at + LATER)
    return out


def with_wrong_stamp(bag, out, topic, message, shift_s):
    """Of the topic's messages one has its stamp moved, by None it is left out."""
    count = 0
    with rosbag.Bag(str(bag)) as whole, rosbag.Bag(str(out), "w") as changed:
        for at_topic, raw, at in whole.read_messages(raw=True):  # ten times as fast as messages
            count += at_topic == topic
            if at_topic != topic or count != message + 1:
                changed.write(at_topic, raw, at, raw=True)
            elif shift_s is not None:
                msg = raw[-1]().deserialize(raw[1])
                msg.header.stamp += genpy.Duration.from_sec(shift_s)
                changed.write(at_topic, msg, at)
    assert count > message, f"{count} messages of {topic}"
    return out


class WrongStampsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def written(self, tool, bag, arguments):
        """What the tool writes of a bag, and says."""
        out = self.path / "out"
        out.unlink(missing_ok=True)
        done = subprocess.run(["rosrun", "situation_awareness", tool, str(bag), *map(str, arguments), "--out", str(out)],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True, check=False,
                              timeout=120)
        self.assertEqual(done.returncode, 0, done.stdout)
        return out.read_text(), done.stdout

    def check(self, tool, bag, topic, stream, messages, *arguments, others=()):
        """`messages`: which of the topic. `others`: {shift: (does, test of the lines with and without)}."""
        changed, others = self.path / "changed.bag", dict(others)
        without = {}
        for shift_s in SHIFTS_S:
            does, test = others.get(shift_s, (SAME, None))
            with cell(tool, stream, stamp_fault(shift_s), does):
                for message in messages:
                    if message not in without:
                        with_wrong_stamp(bag, changed, topic, message, None)
                        without[message] = self.written(tool, changed, arguments)[0]
                        self.assertGreater(len(without[message]), 0)
                    with_wrong_stamp(bag, changed, topic, message, shift_s)
                    lines, said = self.written(tool, changed, arguments)
                    if test:
                        test(lines, without[message])
                        continue
                    self.assertTrue(lines == without[message],
                                    f"{tool}, {topic}: message {message} by {shift_s} s: {said}")

    def test_objects_bag(self):
        bag = part_of(ROOT / "test/golden/persons.bag", self.path / "objects.bag", 8.0)
        self.check("objects_bag", bag, "/scan", "scan", (3, 60))

    def polygons(self):
        folder = self.path / "polygons"
        if not folder.exists():
            folder.mkdir()
            polygon_worlds.write_world(folder, "corridor", 1, sweep=True, with_initial_pose=True, transits=1)
        bag = next(path for path in folder.glob("*.bag") if not path.stem.endswith("_tf"))
        return bag, bag.with_name(bag.stem + "_tf.bag")

    def test_polygons_bag_by_tf(self):
        bag = part_of(self.polygons()[1], self.path / "polygons_tf.bag", 8.0)
        self.check("polygons_bag", bag, "/scan", "scan", (3, 100), "--localization", "tf", "--world-frame", "map")

    def test_polygons_bag_by_reflectors(self):
        whole = self.polygons()[0]
        bag = part_of(whole, self.path / "polygons_odom.bag", 8.0)
        arguments = ("--reflectors", whole.with_suffix(".reflectors.yaml"), "--world-frame", "map")
        self.check("polygons_bag", bag, "/scan", "scan", (100,), *arguments)
        self.check("polygons_bag", bag, "/odom", "odometry", (8, 200), *arguments)

    def test_record_reflectors(self):
        bag = part_of(self.polygons()[0], self.path / "record.bag", 30.0)
        arguments = ("--radius", 0.05, "--max-distance-sigma", 1.0)
        self.check("record_reflectors", bag, "/scan", "scan", (300,), *arguments)
        self.check("record_reflectors", bag, "/odom", "odometry", (8, 600), *arguments)

    def test_splinegons_bag(self):
        name = splinegon_worlds.write_world(self.path, "ellipse", 1)
        bag = part_of(self.path / f"{name}.bag", self.path / "splinegons.bag", 45.0)
        for topic, stream, messages in (("/scan", "scan", (200,)), ("/imu", "imu", (8, 2000)), ("/fix", "fix", (100,))):
            self.check("splinegons_bag", bag, topic, stream, messages)

    def test_grid_bag(self):
        [folder] = grid_bags.make_cases(os.environ["GRID_SCENES"], self.path, ["orbit_bias_1"], [56], 1)
        bag = part_of(grid_bags.write_bag(folder), self.path / "grid.bag")
        dem = ("--world-frame", "world", "--dem", folder / "dem.tif")
        late = "it may be late: used with the pose of 0.2 s before; targets within 0.3 m of those without"
        self.check("grid_bag", bag, "/camera/labels", "image", (22, 30), *dem, others={-0.2: (late, self.near)})
        self.check("grid_bag", bag, "/camera/camera_info", "camera_info", (8,), *dem)

    def near(self, lines, without):
        """The targets after the last image are the same but for the errors of one pose of 40."""
        last, other = (json.loads(text.splitlines()[-1])["targets"] for text in (lines, without))
        self.assertEqual(len(last), len(other))
        for target in last:
            self.assertLess(min(math.hypot(target["x"] - one["x"], target["y"] - one["y"]) for one in other), 0.3)


if __name__ == "__main__":
    unittest.main()
