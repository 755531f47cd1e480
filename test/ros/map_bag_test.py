#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""map_bag end to end, on recordings of the simulator: no roscore."""
import json
import math
import pathlib
import sys
import unittest

from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from bag_tools import ROOT, BagToolTest, grid_bags  # noqa: E402

DEMO = ROOT / "test" / "golden" / "demo.bag"
# Of models/worlds/demo.xml, as it is from 1000 s on.
STANDING = {"pillar": (-0.7, 0.0), "pole": (0.55, -0.2), "barrel": (5.8, 3.6), "planter": (-6.0, 4.0),
            "bin": (-5.6, -4.4), "sign": (2.2, 4.7)}

LINE = ["stamp", "map", "base", "version", "full", "pose", "changed", "gone"]
ALWAYS = ["id", "kind", "class", "p_class", "p_exists", "p_moving", "motion", "first_seen", "last_seen", "seen_by",
          "outline", "closed", "sigma_m", "x", "y"]
OF_BODY = ["psi", "rx", "ry", "vx", "vy", "wz", "covariance"]
MORE = {"ellipse": OF_BODY, "box": OF_BODY, "polyline": [], "boundary": [], "target": ["area_m2", "z"]}
WITH_BULGES = ("boundary", "target")


def chords(feature):
    """The edges of an outline, arcs as chords of 0.1 rad."""
    outline = feature["outline"]
    for a, b in zip(outline, outline[1:] + outline[:feature["closed"]]):
        bulge = a[2] if len(a) > 2 else 0.0
        if abs(bulge) < 1e-9:
            yield a[:2], b[:2]
            continue
        sweep = 4 * math.atan(bulge)
        way = complex(b[0] - a[0], b[1] - a[1])
        middle = complex(a[0], a[1]) + way / 2 * complex(1, (1 - bulge**2) / (2 * bulge))
        count = math.ceil(abs(sweep) / 0.1)
        points = []
        for i in range(count + 1):
            angle = sweep * i / count
            p = middle + (complex(a[0], a[1]) - middle) * complex(math.cos(angle), math.sin(angle))
            points.append((p.real, p.imag))
        yield from zip(points, points[1:])


def pieces(feature, step_m=0.05):
    """(place, unit vector to the free side, length) along an outline."""
    side = 1.0 if feature["kind"] == "polyline" else -1.0
    for a, b in chords(feature):
        length_m = math.dist(a, b)
        if length_m < 1e-6:
            continue
        normal = (-side * (b[1] - a[1]) / length_m, side * (b[0] - a[0]) / length_m)
        count = max(1, round(length_m / step_m))
        for i in range(count):
            part = (i + 0.5) / count
            yield (a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])), normal, length_m / count


def covered_twice(features, reach_m=0.1):
    """The part of the outlines' length beside which another one faces the same way."""
    all_pieces = [(k, *piece) for k, feature in enumerate(features) for piece in pieces(feature)]
    cells = {}
    for piece in all_pieces:
        cells.setdefault((piece[1][0] // reach_m, piece[1][1] // reach_m), []).append(piece)

    def is_covered(k, p, normal):
        x, y = p[0] // reach_m, p[1] // reach_m
        near = (other for i in (-1, 0, 1) for j in (-1, 0, 1) for other in cells.get((x + i, y + j), ()))
        for other, q, other_normal, _ in near:
            dx, dy = q[0] - p[0], q[1] - p[1]
            if (other != k and normal[0] * other_normal[0] + normal[1] * other_normal[1] > 0.5 and
                    abs(dx * normal[0] + dy * normal[1]) < reach_m and abs(dx * normal[1] - dy * normal[0]) < 0.03):
                return True
        return False

    twice_m = sum(length_m for k, p, normal, length_m in all_pieces if is_covered(k, p, normal))
    return twice_m / max(sum(piece[3] for piece in all_pieces), 1e-9)


class MapBagTest(BagToolTest):
    def maps_of(self, bag, *arguments):
        """(line, features by id) after each line: what a reader of the changes alone has is what full lines say."""
        text, _ = self.written("map_bag", bag, *arguments)
        result, features, version, told = [], {}, None, None
        for line in map(json.loads, text.splitlines()):
            self.assertEqual(list(line), LINE)
            self.assertEqual(list(line["pose"]), ["x", "y", "yaw", "covariance"])
            self.assertEqual(len(line["pose"]["covariance"]), 9)
            is_next = told == line["map"]
            if is_next:
                self.assertEqual(line["base"], version)
            else:
                self.assertTrue(line["full"])
            before = features if is_next else {}
            features = dict(before)
            for gone in line["gone"]:
                self.assertIn(gone["reason"], ["left", "seen through", "merged", "forgotten"])
                self.assertEqual("into" in gone, gone["reason"] == "merged")
                if is_next and gone["reason"] == "seen through":
                    self.assertLessEqual(before[gone["id"]]["first_absent"], line["stamp"])
                if is_next:
                    del features[gone["id"]]
            for feature in line["changed"]:
                self.check_feature(feature, line["stamp"])
                features[feature["id"]] = feature
            if line["full"]:
                self.assertEqual(set(features), {feature["id"] for feature in line["changed"]})
            version, told = line["version"], line["map"]
            result.append((line, features))
        return result

    def check_feature(self, feature, stamp_s):
        self.assertEqual([key for key in feature if key not in ("last_absent", "first_absent")],
                         ALWAYS + MORE[feature["kind"]])
        self.assertLess(feature.get("last_absent", -math.inf), feature["first_seen"])
        self.assertGreater(feature.get("first_absent", math.inf), feature["last_seen"])
        self.assertLess(feature["id"], 2**53)
        self.assertIn(feature["motion"], ["moving", "standing", "fixed"])
        self.assertLessEqual(feature["first_seen"], feature["last_seen"])
        self.assertLessEqual(feature["last_seen"], stamp_s + 1e-6)
        for point in feature["outline"]:
            self.assertEqual(len(point), 3 if feature["kind"] in WITH_BULGES else 2)
        if feature["kind"] in ("polyline", "boundary"):
            self.assertEqual(len(feature["sigma_m"]), len(feature["outline"]))
        else:
            self.assertGreater(feature["sigma_m"], 0.0)
        self.assertEqual(len(feature.get("covariance", range(64))), 64)

    def test_each_thing_of_the_demo_is_there_once(self):
        maps = self.maps_of(DEMO, "--full-every", "3")
        self.assertEqual(len(maps), 200)
        self.assertEqual([line["full"] for line, _ in maps].count(True), 7)
        line, features = maps[-1]
        for name, (x, y) in STANDING.items():
            near = [feature for feature in features.values()
                    if min(math.dist((x, y), p) for p, _, _ in pieces(feature)) < 0.6 and feature["motion"] != "moving"
                    and max(math.dist((x, y), p) for p, _, _ in pieces(feature)) < 1.2]
            self.assertEqual(len(near), 1, (name, near))
            self.assertLess(math.hypot(near[0]["x"] - x, near[0]["y"] - y), 0.35, name)
        self.assertTrue(any(feature["motion"] == "moving" for feature in features.values()))
        for _, features in maps[::20]:
            self.assertLess(covered_twice(list(features.values())), 0.005)

    def test_the_same_bag_gives_the_same_lines(self):
        self.assertEqual(self.written("map_bag", DEMO)[0], self.written("map_bag", DEMO)[0])

    def test_kinds(self):
        for kinds, shown in (("objects", {"ellipse", "box"}), ("polygons", {"polyline"}), ("splinegons", {"boundary"}),
                             ("objects,polygons", {"ellipse", "box", "polyline"})):
            maps = self.maps_of(DEMO, "--kinds", kinds)
            seen = {feature["kind"] for _, features in maps for feature in features.values()}
            self.assertLessEqual(seen, shown, kinds)
            self.assertTrue(seen, kinds)

    def test_poses_by_reflectors_are_those_of_polygons_bag(self):
        bag, _ = self.drive()
        arguments = [bag, "--reflectors", bag.with_suffix(".reflectors.yaml"), "--world-frame", "map"]
        lines = [json.loads(line) for line in self.written("polygons_bag", *arguments)[0].splitlines()]
        maps = self.maps_of(*arguments, "--pose", "reflectors")
        self.assertEqual([(line["stamp"], line["pose"]) for line, _ in maps],
                         [(line["stamp"], line["pose"]) for line in lines])

    def test_a_large_obstacle_is_one_boundary_under_one_id(self):
        bag, tf_bag = self.round(2)
        for arguments in ([bag, "--pose", "gps", "--lidar-frame", "laser", "--base-frame", "base_link"],
                          [tf_bag, "--kinds", "splinegons"]):
            maps = self.maps_of(*arguments)
            [feature] = maps[-1][1].values()
            self.assertEqual((feature["kind"], feature["closed"]), ("boundary", True))
            self.assertEqual(feature["id"], min(i for _, features in maps for i in features))
            # All others are told to be part of it.
            heirs = {gone["id"]: gone.get("into") for line, _ in maps for gone in line["gone"]}
            for i in {i for _, features in maps for i in features} - {feature["id"]}:
                for _ in range(10):
                    i = heirs.get(i, i)
                self.assertEqual(i, feature["id"])

    def test_targets_of_images(self):
        folder = self.orbit()
        bag = grid_bags.write_bag(folder, lambda messages: messages)
        maps = self.maps_of(bag, "--kinds", "grid", "--dem", folder / "dem.tif")
        lines = [json.loads(line) for line in self.written("grid_bag", bag, "--dem", folder / "dem.tif")[0].splitlines()]
        self.assertEqual(len(maps), len(lines))
        features = maps[-1][1].values()
        self.assertEqual({feature["kind"] for feature in features}, {"target"})
        self.assertEqual([(f["x"], f["y"], f["z"], f["area_m2"], f["p_class"], f["seen_by"]) for f in features],
                         [(t["x"], t["y"], t["z"], t["area_m2"], t["p"], ["camera"]) for t in lines[-1]["targets"]])

    def test_images_that_come_after_later_scans_are_mapped(self):
        def with_scans(messages):
            scans = []
            for time, topic, _ in messages:
                if topic == "/tf":
                    scan = LaserScan(header=Header(stamp=time, frame_id="base_link"), angle_min=-3.0, angle_max=3.0,
                                     angle_increment=0.1, range_min=0.1, range_max=30.0, ranges=[3.0] * 61)
                    scans.append((time, "/scan", scan))
            return messages + scans

        folder = self.orbit()
        bag = grid_bags.write_bag(folder, with_scans)
        dem = ["--dem", folder / "dem.tif"]
        images = {json.loads(line)["stamp"] for line in self.written("grid_bag", bag, *dem)[0].splitlines()}
        maps = self.maps_of(bag, "--kinds", "polygons,grid", *dem)
        stamps = [line["stamp"] for line, _ in maps]
        self.assertGreater(len(stamps), 2 * len(images))
        self.assertLessEqual(images, set(stamps))
        self.assertIn("target", {feature["kind"] for feature in maps[-1][1].values()})

    def test_what_cannot_be_asked_for(self):
        for arguments, words in ((["--kinds", "grid"], "--dem"), (["--pose", "reflectors"], "--reflectors"),
                                 (["--kinds", "grid", "--dem", "dem.tif", "--pose", "gps"], "--pose tf"),
                                 (["--kinds", "walls"], "--kinds")):
            with self.subTest(arguments=arguments), self.assertRaisesRegex(AssertionError, words):
                self.written("map_bag", DEMO, *arguments)


if __name__ == "__main__":
    unittest.main()
