#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelets and polygons_bag make the same map of polygons of the same drive, scan by scan and bit for bit."""
import pathlib
import sys
import tempfile
import unittest

import rospy
import rostest
import yaml

HERE = pathlib.Path(__file__).resolve()
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE.parents[2] / "scripts" / "evaluation"))
import polygon_worlds  # noqa: E402
from live_offline import BY_TF, lines_of, play_in_step  # noqa: E402
from ros_support import Latest, wait_until  # noqa: E402
from situation_awareness.msg import PolygonArray  # noqa: E402
from situation_awareness.srv import LoadPolygons, SavePolygons  # noqa: E402

SCANS = 500


def polylines_of(message):
    """Those of the line of polygons_bag for such a map, by id."""
    return {polygon.id: {"id": polygon.id, "closed": polygon.closed,
                         "points": [[p.x, p.y] for p in polygon.vertices], "sigma_m": list(polygon.sigma_m),
                         "first_seen": 1e-9 * polygon.first_seen.to_nsec(),
                         "last_seen": 1e-9 * polygon.last_seen.to_nsec(), "p": polygon.p_exists}
            for polygon in message.polygons}


class PolygonsLiveOfflineTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        name = polygon_worlds.write_world(cls.folder, "corridor", 1, sweep=True, transits=1)
        cls.bag = cls.folder / f"{name}_tf.bag"

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def compare(self, namespace, arguments=(), after_scan=lambda compared, maps: None):
        """`after_scan`: is called with the number of scans that were compared and the maps that have come."""
        lines = lines_of("polygons_bag", self.bag, self.folder / "out.jsonl", "--localization", "tf", "--world-frame",
                         "map", *arguments)
        maps = Latest(f"/{namespace}/polygons", PolygonArray)
        rospy.wait_for_service(f"/{namespace}/polygon_mapping/save_polygons", 60.0)
        compared = chains = 0
        for stamp in play_in_step(self.bag, namespace, maps, lines, BY_TF):
            message = maps.messages[-1]
            self.assertEqual(message.header.stamp, stamp)
            self.assertEqual([p.id for p in message.polygons], sorted(p.id for p in message.polygons))
            self.assertEqual(polylines_of(message), {line["id"]: line for line in lines[stamp]["polylines"]},
                             f"at {stamp}")
            compared += 1
            chains += len(message.polygons)
            after_scan(compared, maps)
            if compared >= SCANS:
                break
        self.assertGreaterEqual(compared, min(SCANS, len(lines)))
        self.assertGreater(chains, compared)

    def test_the_maps_are_the_same(self):
        self.compare("as_shipped")

    def test_a_map_that_is_saved_and_loaded_at_once_goes_on_as_if_it_had_not_been(self):
        config = yaml.safe_load((HERE.parents[2] / "cfg/polygons.yaml").read_text()) or {}
        config.setdefault("polygons", {})["refresh_s"] = 0.0
        with_each_scan = self.folder / "with_each_scan.yaml"
        with_each_scan.write_text(yaml.safe_dump(config))
        save = rospy.ServiceProxy("/with_each_scan/polygon_mapping/save_polygons", SavePolygons)
        load = rospy.ServiceProxy("/with_each_scan/polygon_mapping/load_polygons", LoadPolygons)

        def save_and_load(compared, maps):
            if compared % 200 != 100:
                return
            path = str(self.folder / "map.yaml")
            self.assertTrue(save(path).success)
            answer = load(path)
            self.assertTrue(answer.success, answer.message)
            wait_until(lambda: len(maps.messages) > compared + compared // 200, 10.0, "the loaded map")

        self.compare("with_each_scan", ["--config", str(with_each_scan)], save_and_load)


if __name__ == "__main__":
    rospy.init_node("polygons_live_offline_test")
    rostest.rosrun("situation_awareness", "polygons_live_offline_test", PolygonsLiveOfflineTest)
