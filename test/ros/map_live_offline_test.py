#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The nodelets and map_bag make the same map of the same recording, scan by scan: who follows the updates has the
features of its lines, by a pose in TF and by GPS and INS."""
import pathlib
import sys
import tempfile
import unittest

import rospy
import rostest
from std_srvs.srv import SetBool, Trigger

HERE = pathlib.Path(__file__).resolve()
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE.parents[2] / "scripts" / "evaluation"))
import splinegon_worlds  # noqa: E402
from live_offline import BY_IMU, BY_TF, lines_of, play_in_step  # noqa: E402
from ros_support import Diagnostics, MapFollower, wait_until  # noqa: E402
from situation_awareness.msg import MapFeature  # noqa: E402

DEMO = HERE.parents[1] / "golden" / "demo.bag"
SCANS = 180
KINDS = {MapFeature.ELLIPSE: "ellipse", MapFeature.BOX: "box", MapFeature.POLYLINE: "polyline",
         MapFeature.BOUNDARY: "boundary", MapFeature.TARGET: "target"}
MOTIONS = ["moving", "standing", "fixed"]
# The messages of objects have orientations as quaternions, so that angles are rounded on their way.
NEAR = 1e-6


def line_of(feature):
    """What a line of map_bag says of it, of a body without its outline."""
    line = {"id": feature.id, "kind": KINDS[feature.kind], "motion": MOTIONS[feature.motion],
            "p_exists": feature.p_exists, "first_seen": 1e-9 * feature.first_seen.to_nsec(),
            "last_seen": 1e-9 * feature.last_seen.to_nsec(), "closed": bool(feature.closed)}
    if feature.kind in (MapFeature.POLYLINE, MapFeature.BOUNDARY):
        bulges = [[bulge] for bulge in feature.bulge] or [[]] * len(feature.outline)
        line["outline"] = [[p.x, p.y, *bulge] for p, bulge in zip(feature.outline, bulges)]
        line["sigma_m"] = list(feature.sigma)
    else:
        line.update(closed=True, x=feature.center.x, y=feature.center.y, vx=feature.twist.x, vy=feature.twist.y,
                    wz=feature.twist.z, covariance=list(feature.covariance))
    return line


class MapLiveOfflineTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        cls.diagnostics = Diagnostics()

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def assert_near(self, own, other, where):
        if isinstance(own, (list, float)) and isinstance(other, (list, float, int)):
            own, other = ([x] if isinstance(x, (float, int)) else x for x in (own, other))
            self.assertEqual(len(own), len(other), where)
            for a, b in zip(own, other):
                if isinstance(a, list):
                    self.assert_near(a, b, where)
                else:
                    self.assertLess(abs(a - b), NEAR * max(1.0, abs(b)), where)
        else:
            self.assertEqual(own, other, where)

    def compare(self, namespace, bag, arguments, by):
        """The follower after SCANS scans, each of which was compared, its kinds, and the rest of the play."""
        lines = lines_of("map_bag", bag, self.folder / "out.jsonl", "--full-every", "0", *arguments)
        maps = MapFollower(f"/{namespace}/semantic_map/updates")
        compared, kinds = 0, set()
        play = play_in_step(bag, namespace, maps, lines, by, None if by is BY_TF else lambda: self.diagnostics.count(
            f"{namespace}/inertial_semantic_map", "fixes received"))
        for stamp in play:
            self.assertEqual(maps.messages[-1].header.stamp, stamp)
            expected = {line["id"]: line for line in lines[stamp]["changed"]}
            self.assertEqual(set(maps.features), set(expected), f"at {stamp}")
            for feature_id, feature in maps.features.items():
                for key, value in line_of(feature).items():
                    self.assert_near(value, expected[feature_id][key], f"{key} of {feature_id} at {stamp}")
            compared += 1
            kinds |= {feature.kind for feature in maps.features.values()}
            if compared >= SCANS:
                break
        self.assertGreaterEqual(compared, min(SCANS, len(lines)))
        return maps, kinds, play

    def test_by_gps_and_ins(self):
        bag = self.folder / f"{splinegon_worlds.write_world(self.temporary.name, 'ellipse', 1)}.bag"
        _, kinds, _ = self.compare("by_gps", bag, ["--pose", "gps", "--origin=47.3769,8.5417,408.0"], BY_IMU)
        self.assertIn(MapFeature.BOUNDARY, kinds)

    def test_by_tf(self):
        maps, kinds, play = self.compare("by_tf", DEMO, [], BY_TF)
        # By GPS all scans come at once that waited for the pose: more than a queue has.
        self.assertEqual(maps.missed, 0)
        self.assertLessEqual({MapFeature.ELLIPSE, MapFeature.POLYLINE}, kinds)

        # Who comes later begins with the whole map, whichever topic it takes. One process has one connection for a topic.
        maps.subscriber.unregister()
        for topic in ("semantic_map", "semantic_map/updates"):
            late = MapFollower(f"/by_tf/{topic}")
            wait_until(lambda: late.messages, 10.0, topic)
            self.assertTrue(late.messages[0].full)
            self.assertEqual(late.map, maps.map)
        self.assertEqual(set(late.features), set(maps.features))

        self.diagnostics.wait_for_reports("by_tf/semantic_map")
        self.assertEqual(self.diagnostics.count("by_tf/semantic_map", "features"), len(maps.features))
        ids = max(maps.features)
        answer = rospy.ServiceProxy("/by_tf/semantic_map/reset", Trigger)()
        self.assertTrue(answer.success)
        self.assertIn(f"{len(maps.features)} features", answer.message)
        maps.messages = late.messages
        next(play)
        self.assertNotEqual(late.map, maps.map)
        self.assertTrue(late.messages[-1].full)
        self.assertGreater(min(late.features, default=ids + 1), ids, "no id is given twice")

        pause = rospy.ServiceProxy("/by_tf/semantic_map/pause", SetBool)
        self.assertTrue(pause(True).success)
        self.diagnostics.wait_for_reports("by_tf/semantic_map")
        self.assertEqual(self.diagnostics.summary("by_tf/semantic_map"), "paused")
        self.assertTrue(pause(False).success)


if __name__ == "__main__":
    rospy.init_node("map_live_offline_test")
    rostest.rosrun("situation_awareness", "map_live_offline_test", MapLiveOfflineTest)
