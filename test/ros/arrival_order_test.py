#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What is made of a recording depends on what its messages say, not on when they came: each tool, of three orders in which
the messages of a recording may come within the patience of the stage that joins them, writes the same, bit for bit. The
nodelets wait by the same code, and there is no clock here to depend on. No roscore."""
import pathlib
import random
import sys
import unittest

import genpy
import rosbag

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from bag_tools import ROOT, BagToolTest, grid_bags, part_of  # noqa: E402

ORDERS = 3
PATIENCE_S = 0.19  # InertialNavigation::kPatience_s is 0.2 s


def messages_of(bag):
    """Of each its topic, itself as it is in the bag, when it came, and its stamp or that of its latest transform."""
    def stamp_of(raw):
        msg = raw[-1]().deserialize(raw[1])
        return max(one.header.stamp for one in getattr(msg, "transforms", [msg]))

    with rosbag.Bag(str(bag)) as whole:
        return [(topic, raw, at, stamp_of(raw)) for topic, raw, at in whole.read_messages(raw=True)]


def in_another_order(messages, out, seed):
    """Each message comes up to PATIENCE_S later than its stamp; those of a topic in order."""
    draw = random.Random(seed)
    latest, order = {}, []
    for k, (topic, _, at, stamp) in enumerate(messages):
        if topic != "/tf_static":
            late = genpy.Duration.from_sec(draw.uniform(0.0, PATIENCE_S))
            at = latest[topic] = max(stamp + late, latest.get(topic, genpy.Time(0, 1)))
        order.append((at, k))
    with rosbag.Bag(str(out), "w") as changed:
        for at, k in sorted(order):
            changed.write(messages[k][0], messages[k][1], at, raw=True)


class ArrivalOrderTest(BagToolTest):
    def check(self, tool, bag, *arguments):
        first, messages = None, messages_of(bag)
        for seed in range(ORDERS):
            changed = self.path / "changed.bag"
            in_another_order(messages, changed, seed)
            lines, said = self.written(tool, changed, *arguments)
            written = lines.splitlines()
            first = first or written
            self.assertGreater(len(written), 5)
            differing = [k for k, (a, b) in enumerate(zip(first, written)) if a != b]
            self.assertEqual((len(written), differing[:3]), (len(first), []), f"{tool}, order {seed}: {said}")

    def test_objects(self):
        self.check("objects_bag", part_of(ROOT / "test/golden/demo.bag", self.path / "objects.bag", 12.0))

    def test_polygons(self):
        whole, whole_by_tf = self.drive()
        by_tf = part_of(whole_by_tf, self.path / "by_tf.bag", 12.0)
        self.check("polygons_bag", by_tf, "--localization", "tf", "--world-frame", "map")
        by_odometry = part_of(whole, self.path / "by_odometry.bag", 12.0)
        self.check("polygons_bag", by_odometry, "--reflectors", whole.with_suffix(".reflectors.yaml"), "--world-frame",
                   "map")

    def test_splinegons(self):
        self.check("splinegons_bag", part_of(self.round()[0], self.path / "splinegons.bag", 33.0))

    def test_grid(self):
        folder = self.orbit()
        self.check("grid_bag", grid_bags.write_bag(folder), "--world-frame", "world", "--dem", folder / "dem.tif")


if __name__ == "__main__":
    unittest.main()
