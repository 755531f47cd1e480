#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""map.launch detector:=NAME, for every name that there is: it is that detector, with its own model, and it finds an
ellipse. What is no name is refused with the names that are."""
import pathlib
import re
import sys
import unittest

import rospy
import rostest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Diagnostics, Latest, Robot, wait_until  # noqa: E402
from situation_awareness.msg import DetectionArray  # noqa: E402

DOCS = pathlib.Path(__file__).resolve().parents[2] / "docs"
MODELS = {"alex": "paper_alex.onnx", "circle": "paper_circle.onnx", "network": "ellipse.onnx",
          "vgg": "paper_vgg.onnx", "vgg_polar": "paper_vgg_polar.onnx"}
# The reference of the parameters is printed by the code, so these are all.
NAMES = re.findall(r"`(\w+)`", re.search(r"`detector` may be: (.*);", (DOCS / "parameters.md").read_text())[1])


class DetectorsTest(unittest.TestCase):
    def test_1_each_name_loads_and_finds_an_ellipse(self):
        self.assertIn("network", NAMES)
        diagnostics = Diagnostics()
        detections = {name: Latest(f"/{name}/detections", DetectionArray) for name in NAMES}
        robot = Robot()
        wait_until(lambda: robot.scans.get_num_connections() == len(NAMES) and
                   all(latest.subscriber.get_num_connections() > 0 for latest in detections.values()),
                   120.0, "all detectors")

        def found(name):
            return any(message.detections for message in list(detections[name].messages))

        def all_found():
            robot.run(5)
            return all(found(name) for name in NAMES)

        try:
            wait_until(all_found, 30.0, "an ellipse from each")
        finally:
            self.assertEqual([name for name in NAMES if not found(name)], [])
        for name in NAMES:
            near = [detection for message in detections[name].messages for detection in message.detections]
            self.assertLess(min(abs(detection.x - 3.0) + abs(detection.y - 0.5) for detection in near), 0.3, name)
        wait_until(lambda: all(f"{name}/detection" in diagnostics.stages for name in NAMES), 10.0, "diagnostics")
        for name in NAMES:
            stage = diagnostics.stages[f"{name}/detection"]
            self.assertEqual(stage["detector"], name)
            self.assertEqual(pathlib.Path(stage["model"]).name, MODELS.get(name, "none"))

    def test_2_the_documentation_says_what_each_is_for(self):
        table = (DOCS / "ros.md").read_text().split("`detections/detector` selects")[1].split("\n\n")[2]
        for name in NAMES:
            row = [line for line in table.splitlines() if f"`{name}`" in line.split("|")[1]]
            self.assertEqual(len(row), 1, name)
            self.assertTrue(row[0].split("|")[4].strip(), name)


if __name__ == "__main__":
    rospy.init_node("detectors_test")
    rostest.rosrun("situation_awareness", "detectors_test", DetectorsTest)
