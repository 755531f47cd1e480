#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelets and polygons_bag make the same map of polygons of the same drive, scan by scan and bit for bit."""
import json
import pathlib
import subprocess
import sys
import tempfile
import time
import unittest

import genpy
import rosbag
import rospy
import rostest
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

HERE = pathlib.Path(__file__).resolve()
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE.parents[2] / "scripts" / "evaluation"))
import polygon_worlds  # noqa: E402
from ros_support import Latest, wait_until  # noqa: E402
from situation_awareness.msg import PolygonArray  # noqa: E402
from situation_awareness.srv import LoadPolygons, SavePolygons  # noqa: E402

SCANS = 500


class Text(float):
    """A number as text: a stamp has more digits than a float."""

    def __init__(self, text):
        self.text = text


def polylines_of(message):
    """Those of the line of polygons_bag for such a map, by id."""
    return {polygon.id: {"id": polygon.id, "closed": polygon.closed,
                         "points": [[p.x, p.y] for p in polygon.vertices], "sigma_m": list(polygon.sigma_m),
                         "first_seen": 1e-9 * polygon.first_seen.to_nsec(),
                         "last_seen": 1e-9 * polygon.last_seen.to_nsec(), "p": polygon.p_exists}
            for polygon in message.polygons}


class PolygonsLiveOfflineTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        name = polygon_worlds.write_world(self.folder, "corridor", 1, sweep=True, transits=1)
        self.bag = self.folder / f"{name}_tf.bag"
        lines = self.folder / "out.jsonl"
        subprocess.run(["rosrun", "situation_awareness", "polygons_bag", str(self.bag), "--localization", "tf",
                        "--world-frame", "map", "--out", str(lines)], check=True, timeout=120)
        maps = [json.loads(line, parse_float=Text) for line in lines.read_text().splitlines()]
        self.expected = {genpy.Time(*map(int, line["stamp"].text.split("."))): line["polylines"] for line in maps}

    def test_the_maps_are_the_same(self):
        maps = Latest("polygons", PolygonArray)
        scans = rospy.Publisher("scan", LaserScan, queue_size=100, tcp_nodelay=True)
        tf = rospy.Publisher("/tf", TFMessage, queue_size=1000, tcp_nodelay=True)
        tf_static = rospy.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        save = rospy.ServiceProxy("polygon_mapping/save_polygons", SavePolygons)
        load = rospy.ServiceProxy("polygon_mapping/load_polygons", LoadPolygons)
        save.wait_for_service(60.0)
        wait_until(lambda: all(link.get_num_connections() > 0 for link in (scans, tf, tf_static, maps.subscriber)),
                   60.0, "the nodelets")
        time.sleep(1.0)  # the connections among the nodelets
        compared = chains = 0
        waiting, transformed = [], genpy.Time()
        with rosbag.Bag(str(self.bag)) as recording:
            for topic, msg, _ in recording.read_messages():
                if topic == "/tf_static":
                    tf_static.publish(msg)
                    time.sleep(0.3)
                elif topic == "/tf":
                    tf.publish(msg)
                    transformed = max(transformed, max(t.header.stamp for t in msg.transforms))
                elif topic == "/scan":
                    scans.publish(msg)
                    waiting.append(msg)
                while waiting and waiting[0].header.stamp + genpy.Duration(
                        nsecs=round(1e9 * waiting[0].time_increment * (len(waiting[0].ranges) - 1))) <= transformed:
                    stamp = waiting.pop(0).header.stamp
                    wait_until(lambda: maps.messages and maps.messages[-1].header.stamp >= stamp, 20.0,
                               f"the map of {stamp}")
                    message = maps.messages[-1]
                    self.assertEqual(message.header.stamp, stamp)
                    self.assertEqual([p.id for p in message.polygons], sorted(p.id for p in message.polygons))
                    self.assertEqual(polylines_of(message), {line["id"]: line for line in self.expected[stamp]},
                                     f"at {stamp}")
                    compared += 1
                    chains += len(message.polygons)
                    if compared % 200 == 100:  # saved and loaded at once: it goes on as if it had not been
                        path = str(self.folder / "map.yaml")
                        self.assertTrue(save(path).success)
                        answer = load(path)
                        self.assertTrue(answer.success, answer.message)
                        wait_until(lambda: len(maps.messages) > compared + compared // 200, 10.0, "the loaded map")
                if compared >= SCANS:
                    break
        self.assertGreaterEqual(compared, min(SCANS, len(self.expected)))
        self.assertGreater(chains, compared)


if __name__ == "__main__":
    rospy.init_node("polygons_live_offline_test")
    rostest.rosrun("situation_awareness", "polygons_live_offline_test", PolygonsLiveOfflineTest)
