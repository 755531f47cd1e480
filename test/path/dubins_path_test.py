#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""dubins_path end to end: its lines are paths from pose to pose, the same one by one and in a batch, and refusals."""
import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile
import unittest

TOOL = sys.argv.pop(1)


def run(*options):
    return subprocess.run([TOOL, *options], capture_output=True, text=True)


def options_of(case):
    options = ["--from", ",".join(map(repr, case["from"])), "--to", ",".join(map(repr, case["to"])),
               "--radius-from", repr(case["radius_from"]), "--radius-to", repr(case["radius_to"])]
    if "max_curvature" in case:
        options += ["--max-curvature", repr(case["max_curvature"])]
    return options


def ends_of(segment, letter, heading):
    """Begin and end (x, y, heading) of a segment, by its numbers alone."""
    if letter == "S":
        (x0, y0), (x1, y1) = segment["from"], segment["to"]
        if math.hypot(x1 - x0, y1 - y0) > 1e-4:
            heading = math.atan2(y1 - y0, x1 - x0)
        return (x0, y0, heading), (x1, y1, heading)
    sign = {"L": 1.0, "R": -1.0}[letter]
    (x, y), radius = segment["center"], segment["radius"]
    return tuple((x + radius * math.cos(polar), y + radius * math.sin(polar), polar + sign * math.pi / 2)
                 for polar in (segment["from"], segment["from"] + segment["sweep"]))


def gap(a, b):
    return max(math.hypot(a[0] - b[0], a[1] - b[1]), abs(math.remainder(a[2] - b[2], 2.0 * math.pi)))


class DubinsPath(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.cases_file = pathlib.Path(folder.name) / "cases.jsonl"

    def batch(self, lines, *options):
        self.cases_file.write_text("".join(f"{line}\n" for line in lines))
        result = run("--batch", str(self.cases_file), *options)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        return result.stdout.splitlines()

    def assert_is_path(self, path, case):
        self.assertEqual(list(path), ["word", "length", "segments"])
        self.assertEqual(len(path["word"]), 3)
        self.assertEqual(len(path["segments"]), 3)
        at, length = case["from"], 0.0
        for letter, segment in zip(path["word"], path["segments"]):
            if letter == "S":
                self.assertEqual(list(segment), ["type", "from", "to"])
                self.assertEqual(segment["type"], "line")
                length += math.dist(segment["from"], segment["to"])
            else:
                self.assertEqual(list(segment), ["type", "center", "radius", "from", "sweep"])
                self.assertEqual(segment["type"], "arc")
                self.assertTrue(0.0 <= segment["sweep"] * (1.0 if letter == "L" else -1.0) < 2.0 * math.pi)
                length += segment["radius"] * abs(segment["sweep"])
            begin, end = ends_of(segment, letter, at[2])
            self.assertLess(gap(at, begin), 1e-9)
            at = end
        self.assertLess(gap(at, case["to"]), 1e-9)
        self.assertAlmostEqual(path["length"], length, delta=1e-9)

    def test_a_path_is_printed(self):
        result = run("--from", "-1,0,0", "--to", "5.0,2,1.5707963267948966", "--radius-from", "2", "--radius-to", "2")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        path = json.loads(result.stdout)
        self.assertEqual(result.stdout.count("\n"), 1)
        self.assertAlmostEqual(path["length"], 4.0 + math.pi, delta=1e-12)
        self.assertEqual(path["segments"][0]["sweep"], 0.0)
        self.assertNotIn("-0.0", str(path["segments"][0]["sweep"]))
        self.assert_is_path(path, {"from": [-1.0, 0.0, 0.0], "to": [5.0, 2.0, math.pi / 2]})

    def test_a_batch_says_the_same_as_its_cases_alone(self):
        numbers = random.Random(1)
        cases = []
        for i in range(300):
            radius = numbers.uniform(0.5, 5.0)
            cases.append({"from": [numbers.uniform(-9.0, 9.0) for _ in range(3)],
                          "to": [numbers.uniform(-9.0, 9.0) for _ in range(3)], "radius_from": radius,
                          "radius_to": radius if i % 2 else numbers.uniform(0.5, 5.0)})
        lines = self.batch(map(json.dumps, cases))
        self.assertEqual(len(lines), len(cases))
        for case, line in zip(cases, lines):
            self.assert_is_path(json.loads(line), case)
        for case, line in list(zip(cases, lines))[:20]:
            self.assertEqual(run(*options_of(case)).stdout, line + "\n")

    def test_poses_may_begin_with_a_minus(self):
        for pose in ("-1,-2,-3", "-.5,-1e-3,-.25", "+1,2,3"):
            apart = run("--from", pose, "--to", pose, "--radius-from", "1", "--radius-to", "1")
            joined = run(f"--from={pose}", f"--to={pose}", "--radius-from=1", "--radius-to=1")
            self.assertEqual((apart.returncode, apart.stderr), (0, ""))
            self.assertEqual(apart.stdout, joined.stdout)
            self.assertEqual(json.loads(apart.stdout)["length"], 0.0)

    def test_a_radius_below_the_least_is_no_path(self):
        case = {"from": [0.0, 0.0, 0.0], "to": [30.0, 4.0, 1.0], "radius_from": 6.0, "radius_to": 6.0}
        for key in ("radius_from", "radius_to"):
            tight = dict(case, max_curvature=1.0 / 6.0)
            tight[key] = 5.999
            result = run(*options_of(tight))
            self.assertEqual((result.returncode, result.stdout), (2, ""))
            self.assertEqual(result.stderr.count("\n"), 1)
            self.assertIn(key, result.stderr)
        allowed = dict(case, max_curvature=1.0 / 6.0)
        self.assertEqual(run(*options_of(allowed)).returncode, 0)
        lines = [json.loads(line) for line in self.batch(map(json.dumps, [case, tight, allowed]))]
        self.assertEqual([list(line)[0] for line in lines], ["word", "error", "word"])
        lines = [json.loads(line) for line in self.batch(map(json.dumps, [case, tight, allowed]), "--max-curvature", "0.1")]
        self.assertEqual([list(line)[0] for line in lines], ["error", "error", "word"])

    def test_a_line_that_is_no_case_is_answered_with_what_is_wrong(self):
        good = {"from": [0, 0, 0], "to": [3, 4, 1], "radius_from": 1, "radius_to": 1}
        missing = {key: value for key, value in good.items() if key != "radius_to"}
        wrong = [("{", "JSON"), ("[]", "object"), (json.dumps(missing), "radius_to"),
                 (json.dumps(dict(good, to=[1, 2])), "to"), (json.dumps(dict(good, to=[1, 2, None])), "to"),
                 (json.dumps(dict(good, radius_from=0)), "radius"), (json.dumps(dict(good, max_curvature=-1)), "max_curvature"),
                 (json.dumps(dict(good, radius_from="1")), "radius_from"), ('{"from": [1e999, 0, 0]}', "JSON")]
        lines = self.batch([line for line, _ in wrong] + ["", json.dumps(good)])
        self.assertEqual(len(lines), len(wrong) + 1)
        for line, (_, fact) in zip(lines, wrong):
            self.assertEqual(list(json.loads(line)), ["error"])
            self.assertIn(fact, json.loads(line)["error"])
        self.assert_is_path(json.loads(lines[-1]), good)

    def test_what_cannot_be_used_is_refused_in_one_line(self):
        good = ["--from", "0,0,0", "--to", "3,4,1", "--radius-from", "1", "--radius-to", "1"]
        for status, options in [
                (2, []), (2, good[:6]), (2, good[2:]), (2, good + ["--radius-to", "0"]), (2, good + ["--to", "1,2"]),
                (2, good + ["--from", "nan,0,0"]), (2, good + ["--max-curvature", "0"]), (2, good + ["more"]),
                (2, good + ["--max-curvature", "nan"]), (2, good + ["--radius-from", "-1"]), (2, ["--from"]),
                (2, good + ["--batch", str(self.cases_file)]), (1, ["--batch", str(self.cases_file)])]:
            result = run(*options)
            self.assertEqual((result.returncode, result.stdout), (status, ""), options)
            self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
            self.assertTrue(result.stderr.startswith("dubins_path: "))


if __name__ == "__main__":
    unittest.main()
