#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Grids of two classes beside each other: each makes of its labels what grid_bag makes of them with its parameters."""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time
import unittest

import rosbag
import rospy
import rostest
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage

HERE = pathlib.Path(__file__).resolve()
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE.parents[2] / "scripts" / "evaluation"))
import grid_bags  # noqa: E402
from ros_support import Latest, wait_until  # noqa: E402
from situation_awareness.msg import TargetArray  # noqa: E402

DEM = HERE.parents[1] / "data" / "flat.tif"
HEIGHTS_M = {"car": 1.5, "van": 1.25}  # of grid_classes.test
KINDS = {"/camera/car": Image, "/camera/van": Image, "/camera/camera_info": CameraInfo, "/tf": TFMessage}


def targets_offline(folder, bag, height_m):
    """Those of all lines."""
    config, out = folder / "grid.yaml", folder / "out.jsonl"
    config.write_text(f"grid:\n  class_height_m: {height_m}\n")
    subprocess.run(["rosrun", "situation_awareness", "grid_bag", str(bag), "--world-frame", "world", "--dem", str(DEM),
                    "--config", str(config), "--out", str(out), "--grid-out", str(folder / "grid.tif")],
                   check=True, timeout=60)
    return [json.loads(line)["targets"] for line in out.read_text().splitlines()]


class GridClassesTest(unittest.TestCase):
    def test_each_class_has_its_labels_and_its_height(self):
        with tempfile.TemporaryDirectory() as folder:
            # The same poses; the things of a class stand where those of its seed do.
            cases = dict(zip(HEIGHTS_M, grid_bags.make_cases(os.environ["GRID_SCENES"], pathlib.Path(folder), ["orbit"],
                                                             [56], 2)))
            bags = {name: grid_bags.write_bag(case) for name, case in cases.items()}
            offline = {name: targets_offline(cases[name], bags[name], HEIGHTS_M[name]) for name in HEIGHTS_M}
            messages = {}
            for name, bag in bags.items():
                with rosbag.Bag(str(bag)) as recording:
                    messages[name] = [(topic, msg) for topic, msg, _ in recording.read_messages()]
        self.assertNotEqual(offline["car"], offline["van"])
        targets = {name: Latest(f"/{name}/targets", TargetArray) for name in HEIGHTS_M}
        publishers = {topic: rospy.Publisher(topic, kind, queue_size=100, tcp_nodelay=True)
                      for topic, kind in KINDS.items()}
        tf_static = rospy.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        wait_until(lambda: all(publisher.get_num_connections() > 1 for publisher in
                               (publishers["/camera/camera_info"], publishers["/tf"], tf_static)) and
                   all(publishers[f"/camera/{name}"].get_num_connections() > 0 for name in HEIGHTS_M) and
                   all(latest.subscriber.get_num_connections() > 0 for latest in targets.values()), 20.0,
                   "both nodelets")
        vans = iter([msg for topic, msg in messages["van"] if topic == "/camera/labels"])
        for topic, msg in messages["car"]:
            if topic == "/tf_static":
                tf_static.publish(msg)
                time.sleep(0.5)
            elif topic != "/camera/labels":
                publishers[topic].publish(msg)
                time.sleep(0.05 if topic == "/camera/camera_info" else 0.0)
            else:
                publishers["/camera/car"].publish(msg)
                publishers["/camera/van"].publish(next(vans))
                wait_until(lambda: all(latest.messages and latest.messages[-1].header.stamp >= msg.header.stamp
                                       for latest in targets.values()), 20.0, "targets of both")
        for name, latest in targets.items():
            live = [grid_bags.targets_of(message) for message in latest.messages]
            self.assertEqual(live, offline[name], name)
            self.assertEqual(len(live[-1]), 4)

    def test_parameters_of_the_class_are_set(self):
        self.assertEqual(rospy.get_param("/van/grid_mapping/grid/class_height_m"), 1.25)
        self.assertEqual(rospy.get_param("/van/image_labelling/labelling/class_name"), "van")
        self.assertEqual(rospy.get_param("/car/grid_mapping/grid/class_height_m"), 1.5)


if __name__ == "__main__":
    rospy.init_node("grid_classes_test")
    rostest.rosrun("situation_awareness", "grid_classes_test", GridClassesTest)
