#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""polygons_bag end to end, on a simulated drive through the corridor: no roscore."""
import json
import math
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from bag_tools import BagToolTest, run_program  # noqa: E402


class PolygonsBagTest(BagToolTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.bag, cls.tf_bag = cls.drive()
        cls.reflectors = cls.bag.with_suffix(".reflectors.yaml")
        cls.truth = json.loads(cls.bag.with_suffix(".truth.json").read_text())

    def lines_of(self, *args):
        out = self.path / "out.jsonl"
        done = run_program("polygons_bag", *args, "--world-frame", "map", "--out", out)
        self.assertEqual(done.returncode, 0, done.stdout)
        return [json.loads(line) for line in out.read_text().splitlines()]

    def check_lines(self, lines, max_error_m):
        """Format of each line, and pose against the truth."""
        scans = self.truth["scans"]
        places = {round(stamp, 3): (x, y, yaw) for stamp, x, y, yaw in
                  zip(scans["stamp"], scans["x"], scans["y"], scans["yaw"])}
        self.assertGreater(len(lines), 0.98 * len(places))
        before_s = -math.inf
        squares = []
        for line in lines:
            self.assertEqual(list(line), ["stamp", "pose", "polylines"])
            self.assertGreater(line["stamp"], before_s)
            before_s = line["stamp"]
            self.assertEqual(list(line["pose"]), ["x", "y", "yaw", "covariance"])
            self.assertEqual(len(line["pose"]["covariance"]), 9)
            x, y, _ = places[round(line["stamp"], 3)]
            squares.append((line["pose"]["x"] - x)**2 + (line["pose"]["y"] - y)**2)
            ids = [chain["id"] for chain in line["polylines"]]
            self.assertEqual(len(ids), len(set(ids)))
            for chain in line["polylines"]:
                self.assertEqual(list(chain),
                                 ["id", "closed", "points", "sigma_m", "first_seen", "last_seen", "p"])
                self.assertGreaterEqual(len(chain["points"]), 2)
                self.assertEqual(len(chain["points"]), len(chain["sigma_m"]))
                self.assertTrue(all(sigma > 0.0 for sigma in chain["sigma_m"]))
                self.assertLessEqual(chain["first_seen"], chain["last_seen"])
                self.assertLessEqual(chain["last_seen"], line["stamp"] + 1e-6)
        self.assertLess(math.sqrt(sum(squares) / len(squares)), max_error_m)

    def check_map(self, polylines):
        """The walls that were seen are on the map."""
        def distance_m(p, chain):
            points = chain["points"] + chain["points"][:1] if chain["closed"] else chain["points"]
            return min(to_edge_m(p, a, b) for a, b in zip(points, points[1:]))

        def to_edge_m(p, a, b):
            dx, dy = b[0] - a[0], b[1] - a[1]
            squared = max(dx * dx + dy * dy, 1e-12)
            part = min(max(((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / squared, 0.0), 1.0)
            return math.hypot(p[0] - a[0] - part * dx, p[1] - a[1] - part * dy)

        walls = next(thing for thing in self.truth["things"] if thing["id"] == "walls")
        outline = walls["outline"] + walls["outline"][:1]
        seen = walls["seen_s"]
        length_m = sum(math.dist(a, b) for a, b in zip(outline, outline[1:]))
        covered = total = 0
        travelled_m = 0.0
        for a, b in zip(outline, outline[1:]):
            edge_m = math.dist(a, b)
            for k in range(int(edge_m / 0.1)):
                part = (k + 0.5) * 0.1 / edge_m
                place = min(int((travelled_m + part * edge_m) / length_m * len(seen)), len(seen) - 1)
                if seen[place] is None:
                    continue
                p = (a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]))
                total += 1
                covered += min(distance_m(p, chain) for chain in polylines) < 0.025
            travelled_m += edge_m
        self.assertGreater(total, 200)
        self.assertGreater(covered, 0.98 * total)

    def test_reflectors_with_the_first_pose_given(self):
        x, y, yaw = self.truth["initial_pose"]
        lines = self.lines_of(self.bag, "--reflectors", self.reflectors, "--initial-pose", f"{x},{y},{yaw}")
        self.check_lines(lines, 0.005)
        self.check_map(lines[-1]["polylines"])

    def test_reflectors_without_a_first_pose(self):
        self.check_lines(self.lines_of(self.bag, "--reflectors", self.reflectors), 0.005)

    def test_poses_of_tf(self):
        lines = self.lines_of(self.tf_bag, "--localization", "tf")
        self.check_lines(lines, 0.001)
        self.check_map(lines[-1]["polylines"])

    def test_who_follows_the_changes_has_every_line(self):
        whole = self.lines_of(self.tf_bag, "--localization", "tf")
        changes = self.lines_of(self.tf_bag, "--localization", "tf", "--changes", "--full-every", "2")
        self.assertEqual(len(changes), len(whole))
        chains, full = {}, []
        for line, expected in zip(changes, whole):
            self.assertEqual(line["stamp"], expected["stamp"])
            self.assertEqual(line["pose"], expected["pose"])
            for chain in line["changed"]:
                chains[chain["id"]] = chain
            for gone in line["gone"]:
                del chains[gone]
            polylines = [self.rounded(chain) for chain in expected["polylines"]]
            self.assertEqual(sorted(chains.values(), key=lambda chain: chain["id"]),
                             sorted(polylines, key=lambda chain: chain["id"]))
            if "polylines" in line:
                self.assertEqual(line["polylines"], polylines)
                full.append(line["stamp"])
        self.assertEqual(full[0], whole[0]["stamp"])
        for before_s, after_s in zip(full, full[1:]):
            self.assertTrue(2.0 <= after_s - before_s < 2.2, (before_s, after_s))
        self.assertGreater(len(full), 3)

    def rounded(self, chain):
        """The chain with numbers of six decimals, as --changes has them."""
        number = lambda value: math.copysign(math.floor(abs(1e6 * value) + 0.5), value) / 1e6
        return {**chain, "points": [[number(x) for x in point] for point in chain["points"]],
                "sigma_m": [number(sigma_m) for sigma_m in chain["sigma_m"]],
                **{name: number(chain[name]) for name in ("first_seen", "last_seen", "p")}}

    def test_lines_with_all_polylines_are_of_lines_with_changes(self):
        done = run_program("polygons_bag", self.tf_bag, "--localization", "tf", "--full-every", "2", "--out", "/dev/null")
        self.assertEqual(done.returncode, 2)
        self.assertIn("--changes", done.stdout)

    def test_a_first_pose_may_begin_with_a_minus(self):
        done = run_program("polygons_bag", self.bag, "--reflectors", self.reflectors, "--initial-pose", "-1.5,-0.2,x", "--out", "/dev/null")
        self.assertEqual(done.returncode, 2)
        self.assertIn("-1.5,-0.2,x is not X,Y,YAW", done.stdout)

    def test_says_in_a_sentence_what_is_missing(self):
        for args, fact in ((["--reflectors", self.path / "none.yaml"], "none.yaml"), ([], "--reflectors"),
                           (["--reflectors", self.reflectors, "--odom-topic", "/none"], "/none")):
            done = run_program("polygons_bag", self.bag, *args, "--out", self.path / "out.jsonl")
            self.assertNotEqual(done.returncode, 0)
            self.assertIn(fact, done.stdout)
            self.assertEqual(done.stdout.count("\n"), 1, done.stdout)


if __name__ == "__main__":
    unittest.main()
