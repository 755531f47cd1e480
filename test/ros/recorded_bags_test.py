#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""objects_bag and polygons_bag on recordings of real scanners: ten seconds that stand in test/data, and whole ones where
../shared/data has them."""
import collections
import json
import math
import pathlib
import statistics
import subprocess
import tempfile
import unittest

import rosbag

ROOT = pathlib.Path(__file__).resolve().parents[2]
TEN_SECONDS = ROOT / "test" / "data" / "leg_tracker_ten_seconds.bag"
DATA = ROOT.parent / "shared" / "data"
WITHOUT_MODEL = pathlib.Path(__file__).resolve().parent / "objects_without_model.yaml"

STANDING_M_S = 0.1
WALKING_M_S = 0.5
WALL_M = 0.4  # a longer edge is straight
NEAR_WALL_M = 0.1  # hits so near to it are of it


def map_of(tool, bag, topic, *options):
    """The map, line by line."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "out.jsonl"
        result = subprocess.run(["rosrun", "situation_awareness", tool, str(bag), "--scan-topic", topic,
                                 "--static-sensor", *options, "--out", str(out)],
                                capture_output=True, text=True, timeout=120, check=False)
        if result.returncode != 0:
            raise AssertionError(f"exit code {result.returncode}: {result.stderr}")
        return [json.loads(line) for line in out.read_text().splitlines()]


def objects_bag(bag, topic, *options):
    return map_of("objects_bag", bag, topic, *options)


def hits_of(bag, topic):
    """All hits, in the scanner's frame."""
    with rosbag.Bag(str(bag)) as recording:
        for _, scan, _ in recording.read_messages(topics=[topic]):
            for i, range_m in enumerate(scan.ranges):
                if math.isfinite(range_m) and range_m > 0.1:
                    angle = scan.angle_min + i * scan.angle_increment
                    yield range_m * math.cos(angle), range_m * math.sin(angle)


def offsets_of_walls(line, hits):
    """Median distance of the hits from each straight edge, to its left, of those on it."""
    medians = []
    for chain in line["polylines"]:
        points = chain["points"] + chain["points"][:chain["closed"]]
        for (x, y), end in zip(points, points[1:]):
            length_m = math.dist((x, y), end)
            if length_m < WALL_M:
                continue
            along = ((end[0] - x) / length_m, (end[1] - y) / length_m)
            places = ((along[0] * (hit_y - y) - along[1] * (hit_x - x), along[0] * (hit_x - x) + along[1] * (hit_y - y))
                      for hit_x, hit_y in hits)
            of_wall = [off_m for off_m, along_m in places if abs(off_m) < NEAR_WALL_M and 0.0 < along_m < length_m]
            medians.append(statistics.median(of_wall))
    return medians


def mean_hit(bag, near, within_m):
    """Mean of all hits of the recording around a place, in the scanner's frame: what is there shows this side of it."""
    hits = [hit for hit in hits_of(bag, "/scan") if math.dist(hit, near) < within_m]
    return tuple(sum(coordinate) / len(hits) for coordinate in zip(*hits))


def speed(element):
    return math.hypot(element["vx"], element["vy"])


class TenSecondsTest(unittest.TestCase):
    """A person walks before a scanner that stands still. A post and a piece of furniture stand in what it sees of the
    room apart from walls; the person hides each from time to time."""

    # Where to look, how far its hits are around there, how far its middle may lie behind them (a box of which one face
    # is seen has its depth open), the scan in which it is on the map at the latest, and how many ids it has: of the
    # furniture the person hides a half, and what is left is taken for another thing once.
    STANDING = {"post": ((3.65, 3.95), 0.2, 0.25, 10, 1), "furniture": ((5.46, -0.5), 0.4, 0.4, 30, 2)}

    @classmethod
    def setUpClass(cls):
        cls.lines = objects_bag(TEN_SECONDS, "/scan")

    def test_every_scan_is_mapped(self):
        with rosbag.Bag(str(TEN_SECONDS)) as recording:
            stamps = [scan.header.stamp.to_sec() for _, scan, _ in recording.read_messages(topics=["/scan"])]
        self.assertEqual(len(stamps), 100)
        self.assertEqual([round(line["stamp"], 6) for line in self.lines], [round(stamp, 6) for stamp in stamps])

    def test_what_stands_keeps_its_place_and_id(self):
        for name, (place, within_m, behind_m, latest, ids) in self.STANDING.items():
            with self.subTest(name):
                hit = mean_hit(TEN_SECONDS, place, within_m)
                lives = collections.defaultdict(list)
                for i, line in enumerate(self.lines):
                    for element in line["objects"]:
                        if math.dist((element["x"], element["y"]), place) < within_m:
                            lives[element["id"]].append((i, element))
                lives = {id_: life for id_, life in lives.items() if any(speed(e) < STANDING_M_S for _, e in life)}
                self.assertLessEqual(len(lives), ids)
                life = max(lives.values(), key=len)
                self.assertLessEqual(life[0][0], latest)
                self.assertEqual([i for i, _ in life], list(range(life[0][0], len(self.lines))), "never off the map")
                self.assertGreater(sum(element["beams"] > 0 for _, element in life), 20)
                for _, element in life:
                    self.assertLess(speed(element), STANDING_M_S)
                    self.assertLess(math.dist((element["x"], element["y"]), hit), behind_m)
                    # Seen from the origin its middle is not before what was hit of it.
                    self.assertGreater(math.hypot(element["x"], element["y"]), math.hypot(*hit) - 0.02)
                last = life[-1][1]  # by then more of its sides has been seen
                self.assertLess(math.dist((last["x"], last["y"]), (life[0][1]["x"], life[0][1]["y"])), 0.15)

    def test_who_walks_moves(self):
        places = [place for place, *_ in self.STANDING.values()]
        walking = 0
        for line in self.lines:
            movers = [element for element in line["objects"] if speed(element) > WALKING_M_S]
            walking += any(all(math.dist((mover["x"], mover["y"]), place) > 0.5 for place in places) for mover in movers)
        self.assertGreater(walking, 80, "scans in which somebody walks")


class WallsTest(unittest.TestCase):
    def test_walls_lie_where_they_are_hit(self):
        lines = map_of("polygons_bag", TEN_SECONDS, "/scan", "--localization", "tf")
        self.assertEqual(len(lines), 100)
        walls = offsets_of_walls(lines[-1], list(hits_of(TEN_SECONDS, "/scan")))
        self.assertGreaterEqual(len(walls), 2)
        self.assertLess(max(map(abs, walls)), 0.02)


@unittest.skipUnless(DATA.is_dir(), f"{DATA} is not there")
class WholeRecordingsTest(unittest.TestCase):
    def test_walking_person(self):
        lines = objects_bag(DATA / "leg_tracker_walking_person.bag", "/scan", "--config", str(WITHOUT_MODEL))
        self.assertEqual(len(lines), 1265)
        mapped = sum(bool(line["objects"]) for line in lines)
        self.assertGreater(mapped, 1200)

    def test_two_scanners(self):
        for topic, scans in (("/front_scan", 331), ("/rear_scan", 330)):
            lines = objects_bag(DATA / "obstacle_detector_two_scanners.bag", topic, "--config", str(WITHOUT_MODEL))
            self.assertEqual(len(lines), scans)

    def test_walls_of_two_scanners(self):
        bag = DATA / "obstacle_detector_two_scanners.bag"
        for topic in ("/front_scan", "/rear_scan"):
            lines = map_of("polygons_bag", bag, topic, "--localization", "tf")
            walls = offsets_of_walls(lines[-1], list(hits_of(bag, topic)))
            self.assertGreaterEqual(len(walls), 3)
            self.assertLess(max(map(abs, walls)), 0.02)


if __name__ == "__main__":
    unittest.main()
