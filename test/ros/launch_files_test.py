#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""roslaunch finds each launch file of the package once: it refuses a name that a copy of the sources has, too, unless
that is in a hidden folder."""
import pathlib
import unittest

import roslib.packages

LAUNCH = pathlib.Path(__file__).resolve().parents[2] / "launch"


class LaunchFilesTest(unittest.TestCase):
    def test_each_is_found_once(self):
        names = sorted(path.name for path in LAUNCH.glob("*.launch"))
        self.assertIn("sim.launch", names)
        for name in names:
            found = roslib.packages.find_resource("situation_awareness", name)
            self.assertEqual([str(LAUNCH / name)], found)


if __name__ == "__main__":
    unittest.main()
