#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelets and splinegons_bag make the same boundaries of the same flight, scan by scan and bit for bit: by GPS and
INS, and by a pose in TF."""
import pathlib
import sys
import tempfile
import unittest

import rospy
import rostest

HERE = pathlib.Path(__file__).resolve()
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE.parents[2] / "scripts" / "evaluation"))
import splinegon_worlds  # noqa: E402
from live_offline import BY_IMU, BY_TF, lines_of, play_in_step  # noqa: E402
from ros_support import Diagnostics, Latest  # noqa: E402
from situation_awareness.msg import SplinegonArray  # noqa: E402

SCANS = 350


def boundaries_of(message):
    """Those of the line of splinegons_bag for such a map, by id."""
    return {own.id: {"id": own.id, "closed": own.closed,
                     "vertices": [[p.x, p.y, bulge] for p, bulge in zip(own.vertices, own.bulge)],
                     "sigma_m": list(own.sigma_m)} for own in message.splinegons}


class SplinegonsLiveOfflineTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.name = splinegon_worlds.write_world(cls.folder.name, "ellipse", 1)
        cls.diagnostics = Diagnostics()

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def compare(self, namespace, bag, arguments, by):
        lines = lines_of("splinegons_bag", bag, pathlib.Path(self.folder.name) / "out.jsonl", *arguments)
        maps = Latest(f"/{namespace}/splinegons", SplinegonArray)
        compared = boundaries = 0
        fixes = None if by is BY_TF else lambda: self.diagnostics.count(f"{namespace}/splinegon_mapping", "fixes received")
        for stamp in play_in_step(bag, namespace, maps, lines, by, fixes):
            message = maps.messages[-1]
            self.assertEqual(message.header.stamp, stamp)
            self.assertEqual([own.id for own in message.splinegons], sorted(own.id for own in message.splinegons))
            self.assertEqual(boundaries_of(message), {own["id"]: own for own in lines[stamp]["boundaries"]},
                             f"at {stamp}")
            compared += 1
            boundaries += len(message.splinegons)
            if compared >= SCANS:
                break
        self.assertGreaterEqual(compared, min(SCANS, len(lines)))
        self.assertGreater(boundaries, compared // 4)

    def test_by_gps_and_ins(self):
        bag = pathlib.Path(self.folder.name) / f"{self.name}.bag"
        self.compare("by_gps", bag, ["--origin=47.3769,8.5417,408.0"], BY_IMU)

    def test_by_tf(self):
        bag = pathlib.Path(self.folder.name) / f"{self.name}_tf.bag"
        self.compare("by_tf", bag, ["--localization", "tf"], BY_TF)


if __name__ == "__main__":
    rospy.init_node("splinegons_live_offline_test")
    rostest.rosrun("situation_awareness", "splinegons_live_offline_test", SplinegonsLiveOfflineTest)
