#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""launch/sim.launch with the model and the parameters that are shipped: a map of the demo world appears."""
import pathlib
import subprocess
import sys
import unittest

import rospy
import rostest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Latest, refusal_of_node, wait_until  # noqa: E402
from situation_awareness.msg import MappedObjectArray  # noqa: E402


class SimTest(unittest.TestCase):
    def test_1_the_map_follows_the_truth(self):
        scans, odometry = Latest("scan", LaserScan), Latest("odometry", Odometry)
        maps, truths = Latest("objects", MappedObjectArray), Latest("truth", MappedObjectArray)
        wait_until(lambda: len(maps.messages) > 40, 90.0, "40 maps")
        self.assertGreater(maps.messages[0].header.stamp.to_sec(), 999.0, "a simulation begins after zero")
        self.assertLessEqual(set(maps.stamps()[5:20]), set(scans.stamps()) & set(truths.stamps()))
        self.assertTrue(odometry.messages)
        self.assertTrue(all(ellipse.label for ellipse in truths.messages[-1].objects))
        self.assertGreaterEqual(len(truths.messages[-1].objects), 7)
        self.assertGreaterEqual(len(maps.messages[-1].objects), 3)

    def test_2_the_evaluator_prints_a_table_and_a_verdict(self):
        strict = subprocess.run(["rosrun", "situation_awareness", "evaluator", "__name:=strict", "_duration_s:=3.0",
                                 "_max_center_rmse_m:=0.0"], capture_output=True, text=True, timeout=60, check=False)
        self.assertEqual(strict.returncode, 1, strict.stdout + strict.stderr)
        self.assertIn("NOT MET", strict.stdout)
        # Of so short a time nothing is asked but that most of what is seen is on the map.
        lenient = subprocess.run(["rosrun", "situation_awareness", "evaluator", "__name:=lenient",
                                  "_world:=demo", "_duration_s:=3.0", "_min_recall:=0.5", "_max_delay_s:=10",
                                  "_max_false_s:=10", "_max_center_rmse_m:=10", "_max_velocity_rmse_m_s:=10",
                                  "_min_on_map:=0.5", "_max_outline_rms_m:=10", "_max_features_per_thing:=10",
                                  "_max_unexplained:=0.5"],
                                 capture_output=True, text=True, timeout=60, check=False)
        self.assertEqual(lenient.returncode, 0, lenient.stdout + lenient.stderr)
        for words in ("pillar", "walls", "features per thing", "bodies: 61 scans"):
            self.assertIn(words, lenient.stdout)

    def test_3_nodes_refuse_what_they_do_not_know(self):
        for program, argument, facts in (("simulator", "_rate:=-1", ("rate", "-1", "[0, 100]")),
                                         ("simulator", "_speed:=2", ("speed", "the robot of demo is on a path")),
                                         ("simulator", "_world:=atlantis", ("atlantis.xml",)),
                                         ("evaluator", "_world:=atlantis", ("atlantis.xml",)),
                                         ("evaluator", "_max_delay:=2", ("max_delay", "max_delay_s"))):
            message = refusal_of_node(program, argument)
            for fact in facts:
                self.assertIn(fact, message)


if __name__ == "__main__":
    rospy.init_node("sim_test")
    rostest.rosrun("situation_awareness", "sim_test", SimTest)
