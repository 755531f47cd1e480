#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""sim.launch rings:=16: clouds of a ring scanner in place of scans; and the same in a bag."""
import math
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

import rosbag
import rospy
import rostest
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from ros_support import Latest, wait_until  # noqa: E402
from situation_awareness.msg import MappedObjectArray  # noqa: E402

WORLDS = pathlib.Path(__file__).resolve().parents[2] / "models" / "worlds"


class RingsTest(unittest.TestCase):
    def check_cloud(self, cloud, columns, sweep_s):
        """Fields as drivers name them, a row for each ring, columns in the order of their times."""
        self.assertEqual([field.name for field in cloud.fields], ["x", "y", "z", "intensity", "ring", "time"])
        self.assertEqual((cloud.height, cloud.width), (16, columns))
        self.assertEqual(len(cloud.data), cloud.height * cloud.row_step)
        self.assertFalse(cloud.is_bigendian)
        offset = {field.name: field.offset for field in cloud.fields}
        returns = 0
        for row in range(cloud.height):
            for column in range(0, cloud.width, 7):
                place = row * cloud.row_step + column * cloud.point_step
                x, y, z = (struct.unpack_from("<f", cloud.data, place + offset[name])[0] for name in "xyz")
                self.assertEqual(struct.unpack_from("<H", cloud.data, place + offset["ring"])[0], row)
                self.assertAlmostEqual(struct.unpack_from("<f", cloud.data, place + offset["time"])[0],
                                       sweep_s * column / (columns - 1), 6)
                if math.isnan(x):
                    self.assertTrue(math.isnan(y) and math.isnan(z))
                    continue
                returns += 1
                self.assertAlmostEqual(math.degrees(math.atan2(z, math.hypot(x, y))), -15 + 2 * row, delta=0.2)
        self.assertGreater(returns, 16 * columns / 7 / 2)
        return returns

    def test_1_clouds_replace_scans(self):
        clouds, truths = Latest("points", PointCloud2), Latest("truth", MappedObjectArray)
        transforms = Latest("/tf", TFMessage)
        wait_until(lambda: len(clouds.messages) >= 10 and len(truths.messages) >= 10, 60.0, "10 clouds")
        cloud = clouds.messages[-1]
        stamp = cloud.header.stamp
        self.assertEqual(cloud.header.frame_id, "lidar")
        self.check_cloud(cloud, 900, 0.0499)
        wait_until(lambda: stamp in truths.stamps(), 10.0, "the truth of that time")
        self.assertGreater(sum(ellipse.beams for ellipse in truths.messages[-1].objects), 50)
        wait_until(lambda: any(t.header.stamp == stamp for message in list(transforms.messages)
                               for t in message.transforms), 10.0, "the transforms of that time")
        self.assertNotIn("/scan", [topic for topic, _ in rospy.get_published_topics()])

    def test_2_a_bag_of_clouds(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "rings.bag"
            command = ["rosrun", "situation_awareness", "simulate_bag", "--world", WORLDS / "demo.xml", "--out", path,
                       "--rings", "16", "--resolution-deg", "1", "--duration", "0.4", "--rate", "10", "--sweep-s", "0.08"]
            subprocess.run(command, check=True, timeout=60)
            with rosbag.Bag(str(path)) as bag:
                messages = [(topic, message) for topic, message, _ in bag.read_messages()]
        clouds = [message for topic, message in messages if topic == "/points"]
        self.assertEqual([round(cloud.header.stamp.to_sec(), 6) for cloud in clouds], [1000.0, 1000.1, 1000.2, 1000.3])
        for cloud in clouds:
            self.check_cloud(cloud, 360, 0.08)
        ends = [message.transforms for topic, message in messages if topic == "/tf"]
        self.assertEqual([len(transforms) for transforms in ends], [2] * 4)
        self.assertAlmostEqual((ends[1][1].header.stamp - clouds[1].header.stamp).to_sec(), 0.08, 6)
        self.assertEqual({topic for topic, _ in messages}, {"/points", "/tf"})


if __name__ == "__main__":
    rospy.init_node("rings_test")
    rostest.rosrun("situation_awareness", "rings_test", RingsTest)
