#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""roslaunch finds each launch file of the package once: it refuses a name that a copy of the sources has, too, unless
that is in a hidden folder. They give each stage its file of parameters."""
import pathlib
import subprocess
import tempfile
import unittest

import roslib.packages
import yaml

LAUNCH = pathlib.Path(__file__).resolve().parents[2] / "launch"


class LaunchFilesTest(unittest.TestCase):
    def test_each_is_found_once(self):
        names = sorted(path.name for path in LAUNCH.glob("*.launch"))
        self.assertIn("sim.launch", names)
        for name in names:
            found = roslib.packages.find_resource("situation_awareness", name)
            self.assertEqual([str(LAUNCH / name)], found)

    def test_stages_have_the_text_of_their_file(self):
        with tempfile.TemporaryDirectory() as folder:
            config = pathlib.Path(folder) / "my.yaml"
            config.write_text("scan: {max_range_m: 010, max_range_m: 012}  # twice\n")
            dump = subprocess.run(["roslaunch", "situation_awareness", "map.launch", "rviz:=false", "kinds:=objects",
                                   f"config:={config}", "--dump-params"], check=True, stdout=subprocess.PIPE, text=True)
            params = yaml.safe_load(dump.stdout)
            for stage in ("segmentation", "detection", "mapping", "semantic_map"):
                self.assertEqual(params[f"/{stage}/scan/max_range_m"], 10)
                self.assertEqual(params[f"/{stage}/config_yaml"], config.read_text())


if __name__ == "__main__":
    unittest.main()
