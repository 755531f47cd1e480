#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelets and splinegons_bag make the same boundaries of the same flight, scan by scan and bit for bit: by GPS and
INS, and by a pose in TF."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

import genpy
import rosbag
import rospy
import rostest
from sensor_msgs.msg import Imu, LaserScan, NavSatFix
from tf2_msgs.msg import TFMessage

HERE = pathlib.Path(__file__).resolve()
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE.parents[2] / "scripts" / "evaluation"))
import splinegon_worlds  # noqa: E402
from ros_support import Diagnostics, Latest, wait_until  # noqa: E402
from situation_awareness.msg import SplinegonArray  # noqa: E402

SCANS = 350
# Fixes are sent so far ahead of the samples, and it is waited until they have come: a fix is used by its stamp. Nothing
# else depends on the order in which messages of two topics come.
AHEAD_S = 1.5
KINDS = {"/imu": Imu, "/fix": NavSatFix, "/scan": LaserScan, "/tf": TFMessage}


class Text(float):
    """A number as text: a stamp has more digits than a float."""

    def __init__(self, text):
        self.text = text


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

    def expected(self, bag, *arguments):
        lines = pathlib.Path(self.folder.name) / "out.jsonl"
        subprocess.run(["rosrun", "situation_awareness", "splinegons_bag", str(bag), *arguments, "--out", str(lines)],
                       check=True, timeout=120)
        maps = [json.loads(line, parse_float=Text) for line in lines.read_text().splitlines()]
        return {genpy.Time(*map(int, line["stamp"].text.split("."))): line["boundaries"] for line in maps}

    def compare(self, namespace, bag, expected, topics, last):
        """`last`: the topic by whose messages a scan's pose is known, and their stamps."""
        maps = Latest(f"/{namespace}/splinegons", SplinegonArray)
        publishers = {topic: rospy.Publisher(f"/{namespace}{topic}", KINDS[topic], queue_size=10000, tcp_nodelay=True)
                      for topic in topics}
        tf_static = rospy.Publisher(f"/{namespace}/tf_static", TFMessage, queue_size=10, latch=True)
        links = [*publishers.values(), tf_static, maps.subscriber]
        wait_until(lambda: all(link.get_num_connections() > 0 for link in links), 20.0, "the nodelets")
        with rosbag.Bag(str(bag)) as recording:
            messages = [(topic, msg) for topic, msg, _ in recording.read_messages()]
        fixes = [msg for topic, msg in messages if topic == "/fix" and topic in topics]
        fixes_sent, fixes_until = 0, None
        last_topic, stamp_of = last
        compared = boundaries = 0
        waiting, known = [], genpy.Time()
        for topic, msg in messages:
            if topic == "/tf_static":
                tf_static.publish(msg)
            if topic not in publishers or topic == "/fix":
                continue
            if fixes and (fixes_until is None or msg.header.stamp >= fixes_until):
                fixes_until = msg.header.stamp + genpy.Duration.from_sec(AHEAD_S)
                while fixes_sent < len(fixes) and fixes[fixes_sent].header.stamp < fixes_until:
                    publishers["/fix"].publish(fixes[fixes_sent])
                    fixes_sent += 1
                wait_until(lambda: self.diagnostics.count(f"{namespace}/splinegon_mapping", "fixes received")
                           == fixes_sent, 20.0, f"{fixes_sent} fixes")
            publishers[topic].publish(msg)
            if topic == last_topic:
                known = max(known, stamp_of(msg))
            elif topic == "/scan" and msg.header.stamp in expected:
                waiting.append(msg)
            while waiting and waiting[0].header.stamp + genpy.Duration(
                    nsecs=round(1e9 * waiting[0].time_increment * (len(waiting[0].ranges) - 1))) <= known:
                stamp = waiting.pop(0).header.stamp
                wait_until(lambda: maps.messages and maps.messages[-1].header.stamp >= stamp, 20.0,
                           f"the map of {stamp}")
                message = maps.messages[-1]
                self.assertEqual(message.header.stamp, stamp)
                self.assertEqual([own.id for own in message.splinegons],
                                 sorted(own.id for own in message.splinegons))
                self.assertEqual(boundaries_of(message), {own["id"]: own for own in expected[stamp]}, f"at {stamp}")
                compared += 1
                boundaries += len(message.splinegons)
            if compared >= SCANS:
                break
        self.assertGreaterEqual(compared, min(SCANS, len(expected)))
        self.assertGreater(boundaries, compared // 4)

    def test_by_gps_and_ins(self):
        bag = pathlib.Path(self.folder.name) / f"{self.name}.bag"
        self.compare("by_gps", bag, self.expected(bag, "--origin=47.3769,8.5417,408.0"), ("/imu", "/fix", "/scan"),
                     ("/imu", lambda msg: msg.header.stamp))

    def test_by_tf(self):
        bag = pathlib.Path(self.folder.name) / f"{self.name}_tf.bag"
        self.compare("by_tf", bag, self.expected(bag, "--localization", "tf"), ("/tf", "/scan"),
                     ("/tf", lambda msg: max(t.header.stamp for t in msg.transforms)))


if __name__ == "__main__":
    rospy.init_node("splinegons_live_offline_test")
    rostest.rosrun("situation_awareness", "splinegons_live_offline_test", SplinegonsLiveOfflineTest)
