#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What is made of a recording depends on what its messages say, not on when they came: each tool, of ten orders in which
the messages of a recording may come within the patience of the stage that joins them, writes the same, bit for bit. The
nodelets wait by the same code, and there is no clock here to depend on. No roscore."""
import os
import pathlib
import random
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
from wrong_stamps_test import part_of  # noqa: E402

ORDERS = 10
PATIENCE_S = 0.19  # InertialNavigation::kPatience_s is 0.2 s


def in_another_order(bag, out, seed):
    """Each message comes up to PATIENCE_S later than its stamp or its transforms' latest; those of a topic in order."""
    draw = random.Random(seed)
    latest, messages = {}, []
    with rosbag.Bag(str(bag)) as whole:
        for topic, msg, at in whole.read_messages():
            if topic != "/tf_static":
                stamp = max(one.header.stamp for one in msg.transforms) if topic == "/tf" else msg.header.stamp
                late = genpy.Duration.from_sec(draw.uniform(0.0, PATIENCE_S))
                at = latest[topic] = max(stamp + late, latest.get(topic, genpy.Time(0, 1)))
            messages.append((at, len(messages), topic, msg))
    with rosbag.Bag(str(out), "w") as changed:
        for at, _, topic, msg in sorted(messages, key=lambda entry: entry[:2]):
            changed.write(topic, msg, at)


class ArrivalOrderTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def check(self, tool, bag, *arguments):
        first = None
        for seed in range(ORDERS):
            changed, out = self.path / "changed.bag", self.path / "out"
            in_another_order(bag, changed, seed)
            done = subprocess.run(["rosrun", "situation_awareness", tool, str(changed), *map(str, arguments), "--out",
                                   str(out)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                  universal_newlines=True, check=False, timeout=120)
            self.assertEqual(done.returncode, 0, done.stdout)
            written = out.read_text().splitlines()
            first = first or written
            self.assertGreater(len(written), 5)
            differing = [k for k, (a, b) in enumerate(zip(first, written)) if a != b]
            self.assertEqual((len(written), differing[:3]), (len(first), []), f"{tool}, order {seed}: {done.stdout}")

    def test_objects(self):
        self.check("objects_bag", part_of(ROOT / "test/golden/demo.bag", self.path / "objects.bag", 12.0))

    def test_polygons(self):
        polygon_worlds.write_world(self.path, "corridor", 1, sweep=True, with_initial_pose=True, transits=1)
        whole = next(path for path in self.path.glob("*.bag") if path.stem.startswith("corridor")
                     and not path.stem.endswith("_tf"))
        by_tf = part_of(whole.with_name(whole.stem + "_tf.bag"), self.path / "by_tf.bag", 12.0)
        self.check("polygons_bag", by_tf, "--localization", "tf", "--world-frame", "map")
        by_odometry = part_of(whole, self.path / "by_odometry.bag", 12.0)
        self.check("polygons_bag", by_odometry, "--reflectors", whole.with_suffix(".reflectors.yaml"), "--world-frame",
                   "map")

    def test_splinegons(self):
        name = splinegon_worlds.write_world(self.path, "ellipse", 1)
        self.check("splinegons_bag", part_of(self.path / f"{name}.bag", self.path / "splinegons.bag", 45.0))

    def test_grid(self):
        [folder] = grid_bags.make_cases(os.environ["GRID_SCENES"], self.path, ["orbit_bias_1"], [56], 1)
        self.check("grid_bag", grid_bags.write_bag(folder), "--world-frame", "world", "--dem", folder / "dem.tif")


if __name__ == "__main__":
    unittest.main()
