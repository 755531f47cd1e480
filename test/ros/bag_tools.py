# SPDX-License-Identifier: BSD-3-Clause
"""Programs of this package as tests run them, and what the tests of those that read a bag share."""
import functools
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import genpy
import rosbag
from catkin.find_in_workspaces import find_in_workspaces

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts" / "evaluation"))
import grid_bags  # noqa: E402
import polygon_worlds  # noqa: E402
import splinegon_worlds  # noqa: E402

LATER = genpy.Duration(10000)


@functools.lru_cache(maxsize=None)
def program(name):
    """The path of a program of this package. rosrun looks for it at each run, which takes longer than most runs."""
    found = find_in_workspaces(["libexec"], project="situation_awareness", path=name, first_matching_workspace_only=True)
    if not found:
        raise FileNotFoundError(name)
    return found[0]


def run_program(name, *arguments, stderr=subprocess.STDOUT):
    """A run to its end; its errors are in its output, or apart by subprocess.PIPE."""
    return subprocess.run([program(name), *map(str, arguments)], stdout=subprocess.PIPE, stderr=stderr, text=True,
                          check=False, timeout=120)


def part_of(bag, out, seconds=None):
    """The first seconds of a bag, LATER later: simulated time begins at 0, and an hour before that is none."""
    with rosbag.Bag(str(bag)) as whole, rosbag.Bag(str(out), "w") as part:
        end = None if seconds is None else genpy.Time.from_sec(whole.get_start_time() + seconds)
        for topic, msg, at in whole.read_messages(end_time=end):
            for stamped in getattr(msg, "transforms", [msg]):
                stamped.header.stamp += LATER
            part.write(topic, msg, at + LATER)
    return out


class BagToolTest(unittest.TestCase):
    """Its tests have the folder `path`, and recordings that are made once."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    @classmethod
    @functools.lru_cache(maxsize=None)
    def drive(cls, world="corridor", transits=1):
        """A drive through a world of polygon_worlds: the bag with odometry, and that with TF."""
        name = polygon_worlds.write_world(cls.path, world, 1, sweep=True, with_initial_pose=True, transits=transits)
        return cls.path / f"{name}.bag", cls.path / f"{name}_tf.bag"

    @classmethod
    @functools.lru_cache(maxsize=None)
    def round(cls, seed=1):
        """A flight around the ellipse of splinegon_worlds: the bag with IMU and fixes, and that with TF."""
        name = splinegon_worlds.write_world(cls.path, "ellipse", seed)
        return cls.path / f"{name}.bag", cls.path / f"{name}_tf.bag"

    @classmethod
    @functools.lru_cache(maxsize=None)
    def orbit(cls):
        """The folder of a case of grid_scenes, in which fixes are biased."""
        return grid_bags.make_cases(os.environ["GRID_SCENES"], cls.path, ["orbit_bias_1"], [56], 1)[0]

    def written(self, tool, bag, *arguments):
        """What the tool writes of a bag, and says."""
        out = self.path / "out"
        out.unlink(missing_ok=True)
        done = run_program(tool, bag, *arguments, "--out", out)
        self.assertEqual(done.returncode, 0, done.stdout)
        return out.read_text(), done.stdout
