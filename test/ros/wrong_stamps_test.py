#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Each tool that reads a bag, of a recording in which the stamp of one message is wrong: what it writes is what it writes
without that message, bit for bit. No roscore."""
import json
import math
import pathlib
import sys
import unittest

import genpy
import rosbag

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from bag_tools import ROOT, BagToolTest, grid_bags, part_of  # noqa: E402
from fault_record import cell  # noqa: E402
from fault_tables import SHIFTS_S, stamp_fault  # noqa: E402

SAME = "refused and counted, as if it had not come"


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


class WrongStampsTest(BagToolTest):
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
                        without[message] = self.written(tool, changed, *arguments)[0]
                        self.assertGreater(len(without[message]), 0)
                    with_wrong_stamp(bag, changed, topic, message, shift_s)
                    lines, said = self.written(tool, changed, *arguments)
                    if test:
                        test(lines, without[message])
                        continue
                    self.assertTrue(lines == without[message],
                                    f"{tool}, {topic}: message {message} by {shift_s} s: {said}")

    def test_objects_bag(self):
        bag = part_of(ROOT / "test/golden/persons.bag", self.path / "objects.bag", 8.0)
        self.check("objects_bag", bag, "/scan", "scan", (3, 60))

    def test_polygons_bag_by_tf(self):
        bag = part_of(self.drive()[1], self.path / "polygons_tf.bag", 8.0)
        self.check("polygons_bag", bag, "/scan", "scan", (3, 100), "--localization", "tf", "--world-frame", "map")

    def test_polygons_bag_by_reflectors(self):
        whole = self.drive()[0]
        bag = part_of(whole, self.path / "polygons_odom.bag", 8.0)
        arguments = ("--reflectors", whole.with_suffix(".reflectors.yaml"), "--world-frame", "map")
        self.check("polygons_bag", bag, "/scan", "scan", (100,), *arguments)
        self.check("polygons_bag", bag, "/odom", "odometry", (8, 200), *arguments)

    def test_record_reflectors(self):
        bag = part_of(self.drive()[0], self.path / "record.bag", 30.0)
        arguments = ("--radius", 0.05, "--max-distance-sigma", 1.0)
        self.check("record_reflectors", bag, "/scan", "scan", (300,), *arguments)
        self.check("record_reflectors", bag, "/odom", "odometry", (8, 600), *arguments)

    def test_splinegons_bag(self):
        bag = part_of(self.round()[0], self.path / "splinegons.bag", 33.0)
        for topic, stream, messages in (("/scan", "scan", (200,)), ("/imu", "imu", (8, 2000)), ("/fix", "fix", (100,))):
            self.check("splinegons_bag", bag, topic, stream, messages)

    def test_grid_bag(self):
        bag = part_of(grid_bags.write_bag(self.orbit()), self.path / "grid.bag")
        dem = ("--world-frame", "world", "--dem", self.orbit() / "dem.tif")
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
