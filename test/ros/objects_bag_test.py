#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""objects_bag end to end, on bags written here: no roscore."""
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import genpy
import rosbag
from std_msgs.msg import String

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from bag_tools import run_program  # noqa: E402
from ros_support import BEAMS, ranges_to_circles, scan_msg, transform_msg  # noqa: E402

START_S = 1_400_000_000
CONFIG = pathlib.Path(__file__).resolve().parent / "objects_without_model.yaml"
MIN_POINTS = 4  # segments/min_points by default


def stamp(i, shift=0):
    return genpy.Time(START_S + shift, 0) + genpy.Duration(nsecs=50_000_000 * i)


def write_bag(path, count=60, tf=True, static_tf=False, frame="lidar", extra=(), shift=0, start_y=-1.0):
    """A round object moves at 0.5 m/s while the scanner moves at 0.2 m/s; `shift` seconds later than usual."""
    def at(i):
        return stamp(i, shift)

    with rosbag.Bag(str(path), "w") as bag:
        bag.write("/chatter", String("hello"), at(0))
        if static_tf:
            bag.write("/tf_static", transform_msg(at(0), parent="robot", child=frame), at(0))
        for i in range(count):
            t = 0.05 * i
            robot_x = 0.2 * t if tf else 0.0
            if tf:
                # a frame of an old bag, with its slash, and a transform that was recorded after its scan
                msg = transform_msg(at(i), x=robot_x, parent="/world", child="robot" if static_tf else frame)
                bag.write("/tf", msg, at(i) + genpy.Duration(0, 10**7))
            msg = scan_msg(at(i), circles=[(3.0 - robot_x, start_y + 0.5 * t, 0.25)], frame=frame)
            bag.write("/scan", msg, at(i))
        for offset, msg in extra:
            bag.write("/scan", msg, at(offset))


def read_lines(path):
    def no_constants(name):
        raise AssertionError(f"{name} is no JSON")
    return [json.loads(line, parse_constant=no_constants) for line in path.read_text().splitlines()]


def is_positive_definite(matrix):
    """By Cholesky's decomposition, which exists for no other symmetric matrix."""
    n = len(matrix)
    L = [[0.0] * n for _ in range(n)]
    for i in range(n):
        for j in range(i + 1):
            rest = matrix[i][j] - sum(L[i][k] * L[j][k] for k in range(j))
            if i == j and rest <= 0.0:
                return False
            L[i][j] = math.sqrt(rest) if i == j else rest / L[j][j]
    return True


class ObjectsBagTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = pathlib.Path(self.folder.name)
        self.bag = self.path / "in.bag"
        self.out = self.path / "out.jsonl"

        self.detections = self.path / "detections.jsonl"

    def run_tool(self, *arguments):
        return run_program("objects_bag", *arguments, stderr=subprocess.PIPE)

    def objects_bag(self, *arguments):
        result = self.run_tool(self.bag, "--out", self.out, "--config", CONFIG, *arguments)
        self.assertEqual(result.returncode, 0, result.stderr)
        return read_lines(self.out), result

    def assert_counts(self, text, *numbers, dropped):
        """Of scans and of those that were mapped, and how many were dropped for each reason."""
        line = next(line for line in text.splitlines() if "dropped: " in line)
        self.assertEqual(tuple(int(word) for word in re.findall(r"\d+", line)[:len(numbers)]), numbers, line)
        counted = {reason: int(number) for number, reason in re.findall(r"(\d+) dropped: ([^,\n]+)", line)}
        self.assertEqual({reason: counted.get(reason) for reason in dropped}, dropped, line)

    def assert_fails(self, *arguments, parts=(), code=1):
        result = self.run_tool(*arguments)
        self.assertEqual(result.returncode, code, result.stderr)
        sentence = result.stderr.strip().splitlines()[-1]
        self.assertTrue(sentence.startswith("objects_bag: "), result.stderr)
        for part in parts:
            self.assertIn(part, sentence)
        self.assertFalse(self.out.exists() or self.detections.exists(), "nothing half-written")
        self.assertFalse(any(self.path.glob("*.part")), "nothing left behind")

    @staticmethod
    def sides(outline):
        """Of a closed outline, each with the next one."""
        sides = [(b[0] - a[0], b[1] - a[1]) for a, b in zip(outline, outline[1:] + outline[:1])]
        return list(zip(sides, sides[1:] + sides[:1]))

    def test_follows_a_moving_object(self):
        write_bag(self.bag)
        lines, result = self.objects_bag()
        self.assertEqual(len(lines), 60)
        for i, line in enumerate(lines):
            self.assertAlmostEqual(line["stamp"], stamp(i).to_sec(), delta=1e-6)
        self.assertEqual(lines[0]["objects"], [], "a line even if nothing is known yet")
        last = lines[-1]["objects"]
        self.assertEqual(len(last), 1)
        self.assertEqual(set(last[0]), {"id", "x", "y", "psi", "rx", "ry", "vx", "vy", "wz", "sigma", "beams", "shape",
                                        "p_shape", "class", "p_class", "outline"})
        self.assertIn(last[0]["shape"], ("ellipse", "box", "compact"))
        self.assertIn(last[0]["class"], ("unknown", "person", "vehicle", "pole"))
        self.assertTrue(0.0 < last[0]["p_shape"] <= 1.0 and 0.0 <= last[0]["p_class"] <= 1.0)
        for x, y in last[0]["outline"]:
            self.assertAlmostEqual(math.hypot(x - last[0]["x"], y - last[0]["y"]), 0.25, delta=0.1)
        turns = [a[0] * b[1] - a[1] * b[0] for a, b in self.sides(last[0]["outline"])]
        self.assertTrue(len(turns) > 3 and all(turn > 0.0 for turn in turns), "convex and counter-clockwise")
        self.assertIsInstance(last[0]["id"], int)
        self.assertIsInstance(last[0]["beams"], int)
        self.assertGreater(last[0]["beams"], 10)
        self.assertEqual(len(last[0]["sigma"]), 8)
        self.assertTrue(all(sigma > 0.0 for sigma in last[0]["sigma"]))
        self.assertAlmostEqual(last[0]["x"], 3.0, delta=0.05)
        self.assertAlmostEqual(last[0]["y"], -1.0 + 0.5 * 0.05 * 59, delta=0.05)
        self.assertAlmostEqual(last[0]["vy"], 0.5, delta=0.15)
        self.assertEqual(len({line["objects"][0]["id"] for line in lines[5:]}), 1, "one id all the way")
        self.assertIn("60 scans, 60 mapped", result.stdout)
        self.assertIn("p50", result.stdout)
        self.assertIn("p99", result.stdout)

    def test_same_input_same_bytes(self):
        write_bag(self.bag)
        self.objects_bag()
        first = self.out.read_bytes()
        self.objects_bag()
        self.assertEqual(first, self.out.read_bytes())

    def test_tells_what_became_of_every_hit(self):
        write_bag(self.bag)
        points = self.path / "points.jsonl"
        maps, result = self.objects_bag("--points", points)
        lines = read_lines(points)
        self.assertEqual([line["stamp"] for line in lines], [line["stamp"] for line in maps])
        columns = ("x", "y", "segment", "fate", "reason", "id")
        for i, (line, scan_map) in enumerate(zip(lines, maps)):
            self.assertEqual(set(line), {"stamp", "compact", "on_no_map", "on_no_map_s", *columns})
            self.assertEqual(len({len(line[column]) for column in columns}), 1)
            for x, y, segment, fate, reason, id_ in zip(*(line[column] for column in columns)):
                self.assertAlmostEqual(math.hypot(x - 3.0, y + 1.0 - 0.5 * 0.05 * i), 0.25, delta=0.05)
                self.assertEqual((segment, fate, reason), (0, "object", ""))
                self.assertEqual(id_, scan_map["objects"][0]["id"] if scan_map["objects"] else None)
            self.assertEqual((line["compact"], line["on_no_map"]), (1, int(not scan_map["objects"])))
        mapped_at = next(i for i, line in enumerate(maps) if line["objects"])
        self.assertGreater(mapped_at, 0)
        longest_s = max(line["on_no_map_s"] for line in lines)
        self.assertAlmostEqual(longest_s, 0.05 * (mapped_at - 1), delta=1e-6)
        self.assertIn(f"{mapped_at} of 60 compact segments on no map, a place for at most {longest_s:.3f} s",
                      result.stdout)

    def test_writes_the_detections_of_every_scan(self):
        write_bag(self.bag)
        lines, _ = self.objects_bag("--detections", self.detections)
        found = read_lines(self.detections)
        self.assertEqual([line["stamp"] for line in found], [line["stamp"] for line in lines])
        for i, line in enumerate(found):
            self.assertEqual(set(line), {"stamp", "detections"})
            self.assertEqual(len(line["detections"]), 1)
            detection = line["detections"][0]
            self.assertEqual(set(detection), {"x", "y", "psi", "rx", "ry", "covariance", "p_ellipse", "beams"})
            t = 0.05 * i
            self.assertAlmostEqual(detection["x"], 3.0 - 0.2 * t, delta=0.1, msg="in the sensor's frame")
            self.assertAlmostEqual(detection["y"], -1.0 + 0.5 * t, delta=0.1)
            self.assertAlmostEqual(detection["rx"], 0.25, delta=0.1)
            self.assertGreaterEqual(detection["rx"], detection["ry"])
            self.assertGreater(detection["ry"], 0.0)
            self.assertLessEqual(abs(detection["psi"]), math.pi / 2 + 1e-12)
            self.assertEqual(len(detection["covariance"]), 25)
            covariance = [detection["covariance"][5 * row:5 * row + 5] for row in range(5)]
            for row in range(5):
                for column in range(5):
                    self.assertAlmostEqual(covariance[row][column], covariance[column][row], delta=1e-12)
            self.assertTrue(is_positive_definite(covariance), covariance)
            self.assertTrue(0.0 <= detection["p_ellipse"] <= 1.0)
            self.assertIsInstance(detection["beams"], int)
            self.assertGreaterEqual(detection["beams"], MIN_POINTS)

    def test_detections_are_the_same_bytes_twice(self):
        write_bag(self.bag, count=20)
        self.objects_bag("--detections", self.detections)
        first = self.detections.read_bytes()
        self.out.unlink()
        result = self.run_tool(self.bag, "--detections", self.detections, "--config", CONFIG)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(first, self.detections.read_bytes())
        self.assertFalse(self.out.exists())

    def test_the_detector_can_be_chosen(self):
        write_bag(self.bag, count=5)
        self.objects_bag("--detections", self.detections)
        by_least_squares = self.detections.read_bytes()
        config = self.path / "network.yaml"
        config.write_text("detections: {detector: network, model: none.onnx}\n")
        for detector in ("least_squares", "network", "vgg_polar"):
            result = self.run_tool(self.bag, "--detections", self.detections, "--config", config,
                                   "--detector", detector)
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertEqual(self.detections.read_bytes() == by_least_squares, detector == "least_squares")
            for line in read_lines(self.detections):
                self.assertAlmostEqual(line["detections"][0]["x"], 3.0, delta=0.1)
        self.detections.unlink()
        self.out.unlink()
        self.assert_fails(self.bag, "--detections", self.detections, "--config", CONFIG, "--detector", "magic",
                          parts=("magic", "least_squares", "network"))
        self.assert_fails(self.bag, "--detections", self.path / "none" / "out.jsonl", "--out", self.out,
                          "--config", CONFIG, parts=("out.jsonl",))

    def test_numbers_are_not_rounded(self):
        write_bag(self.bag, count=10)
        self.objects_bag()
        texts = re.findall(r'"x": ?([^,]+),', self.out.read_text())
        self.assertTrue(texts)
        self.assertGreaterEqual(max(len(text.strip("-").replace(".", "")) for text in texts), 16)

    def test_static_sensor_and_static_tf_agree_with_tf(self):
        write_bag(self.bag, tf=False)
        static, _ = self.objects_bag("--static-sensor", "--scan-topic", "scan")
        self.assertAlmostEqual(static[-1]["objects"][0]["x"], 3.0, delta=0.05)
        write_bag(self.bag, static_tf=True)
        by_two, _ = self.objects_bag()
        write_bag(self.bag)
        by_one, _ = self.objects_bag("--world-frame=world")
        self.assertEqual(by_one, by_two)

    def test_each_beam_is_taken_at_its_own_time(self):
        """A scanner flies at 1 m/s past a post that is hit by late beams, 4.5 cm after the first."""
        increment = 1e-4
        with rosbag.Bag(str(self.bag), "w") as bag:
            for i in range(40):
                bag.write("/tf", transform_msg(stamp(i), x=0.05 * i), stamp(i))
                sweep_m = increment * (BEAMS - 1)
                msg = scan_msg(stamp(i), ranges=ranges_to_circles([(1.0 - 0.05 * i, 2.0, 0.3)], moved_x=sweep_m))
                msg.time_increment = increment
                bag.write("/scan", msg, stamp(i))
        lines, result = self.objects_bag("--detections", self.detections)
        # The poses at the last beams of the last two scans were never recorded.
        self.assert_counts(result.stdout, 40, 38, dropped={"no transform": 2})
        for i, line in enumerate(read_lines(self.detections)):
            self.assertAlmostEqual(line["detections"][0]["x"], 1.0 - 0.05 * i, delta=0.02)
        self.assertAlmostEqual(lines[-1]["objects"][0]["x"], 1.0, delta=0.02)

    def test_counts_what_it_drops(self):
        bad = [(60, scan_msg(stamp(60), ranges=[])), (61, scan_msg(stamp(61), ranges=[1.0])),
               (62, scan_msg(stamp(59))), (63, scan_msg(stamp(50))), (64, scan_msg(stamp(64))),
               (65, scan_msg(genpy.Time(0, 0))), (66, scan_msg(stamp(66), ranges=[math.nan] * BEAMS))]
        write_bag(self.bag, extra=bad)
        lines, result = self.objects_bag()
        self.assertEqual(len(lines), 60)
        self.assert_counts(result.stdout, 67, 60, dropped={"stamp repeats or goes back": 2, "no transform": 2,
                                                           "bad scan: stamp is zero": 1})

    def test_numbers_of_a_line_are_exact(self):
        """All nanoseconds of the stamp, which a double cannot represent, and only finite numbers."""
        with rosbag.Bag(str(self.bag), "w") as bag:
            for i in range(3):
                bag.write("/scan", scan_msg(genpy.Time(1_700_000_000, 123_456_789 + i)), stamp(i))
        self.objects_bag("--static-sensor")
        stamps = re.findall(r'"stamp": ?([0-9.]+),', self.out.read_text())
        self.assertEqual(stamps, [f"1700000000.1234567{89 + i}" for i in range(3)])

    def test_waits_for_transforms_by_the_time_of_the_recording(self):
        """Transforms that come 1.5 s late: longer than the nodelets wait, unless they are told to."""
        with rosbag.Bag(str(self.bag), "w") as bag:
            for i in range(60):
                bag.write("/scan", scan_msg(stamp(i)), stamp(i))
                bag.write("/tf", transform_msg(stamp(i)), stamp(i) + genpy.Duration(1, 5 * 10**8))
        lines, _ = self.objects_bag()
        self.assertEqual(len(lines), 60)
        same, _ = self.objects_bag("--tf-timeout", "1.6")
        self.assertEqual(same, lines)
        self.out.unlink()
        self.assert_fails(self.bag, "--out", self.out, "--config", CONFIG, "--tf-timeout", "0.5",
                          parts=("in.bag", "60", "no transform"))

    def test_nothing_mapped_is_an_error(self):
        common = ("--out", self.out, "--save-objects", self.path / "map.yaml", "--config", CONFIG)
        write_bag(self.bag, static_tf=True)
        self.assert_fails(self.bag, *common, "--world-frame", "wrold",
                          parts=("in.bag", "60", "no transform", "wrold", "lidar", "robot", "world"))
        write_bag(self.bag, tf=False)
        self.assert_fails(self.bag, *common, parts=("in.bag", "60", "no transform", "--static-sensor"))
        write_bag(self.bag, tf=False, static_tf=True)
        self.assert_fails(self.bag, *common, parts=("no transform", "lidar", "robot"))
        write_bag(self.bag, count=0, extra=[(i, scan_msg(stamp(i), ranges=[])) for i in range(3)])
        self.assert_fails(self.bag, *common, "--static-sensor", parts=("in.bag", "3", "bad scan: empty scan"))
        self.assertFalse((self.path / "map.yaml").exists())

    def test_a_loop_starts_a_new_map(self):
        """Stamps go back by a minute while the recording goes on: believed of the third scan, up to which TF refuses
        transforms of before."""
        write_bag(self.bag)
        with rosbag.Bag(str(self.bag), "a") as bag:
            for i in range(1000, 1020):
                past = stamp(i - 2000)
                bag.write("/tf", transform_msg(past, child="lidar"), stamp(i))
                bag.write("/scan", scan_msg(past), stamp(i) + genpy.Duration(0, 10**6))
        lines, result = self.objects_bag()
        self.assertGreaterEqual(len(lines), 60 + 17, result.stdout)
        self.assertAlmostEqual(lines[-1]["stamp"], stamp(-981).to_sec(), delta=1e-6)
        self.assertEqual(len(lines[-1]["objects"]), 1)

    def test_goes_on_with_a_saved_map(self):
        """A bag in two halves, the second a day later."""
        saved = self.path / "map.yaml"
        write_bag(self.bag)
        self.objects_bag("--save-objects", saved)
        first = read_lines(self.out)
        write_bag(self.bag, count=10, shift=86400, start_y=-1.0 + 0.5 * 0.05 * 60)
        lines, _ = self.objects_bag("--load-objects", saved, "--save-objects", saved)
        self.assertEqual({line["objects"][0]["id"] for line in lines}, {first[-1]["objects"][0]["id"]})
        self.assertAlmostEqual(lines[0]["objects"][0]["vy"], 0.5, delta=0.15, msg="it is known how it moves")
        self.objects_bag("--load-objects", saved)
        self.out.unlink()
        common = (self.bag, "--out", self.out, "--config", CONFIG)
        self.assert_fails(*common, "--load-objects", saved, "--world-frame", "robot", parts=("map.yaml", "world_frame"))
        saved.write_text(saved.read_text()[:-1])
        self.assert_fails(*common, "--load-objects", saved, parts=("map.yaml", "sha256"))
        self.assert_fails(*common, "--load-objects", self.path / "none.yaml", parts=("none.yaml",))
        self.assert_fails(*common, "--save-objects", self.path / "none" / "map.yaml", parts=("map.yaml",))

    def test_refuses_in_one_sentence(self):
        common = ("--out", self.out, "--config", CONFIG)
        self.assert_fails(self.path / "none.bag", *common, parts=("none.bag",))
        write_bag(self.bag, count=3)
        self.assert_fails(self.bag, *common, "--scan-topic", "/laser", parts=("/laser", "/scan"))
        self.assert_fails(self.bag, *common, "--scan-topic", "/chatter", parts=("/chatter", "std_msgs/String"))
        self.assert_fails(self.bag, "--out", self.out, "--config", self.path / "none.yaml", parts=("none.yaml",))
        config = self.path / "bad.yaml"
        config.write_text("scan: {max_range_m: -1}\n")
        self.assert_fails(self.bag, "--out", self.out, "--config", config, parts=("bad.yaml", "max_range_m", "1000"))
        config.write_text("detections: {model: none.onnx}\n")
        self.assert_fails(self.bag, "--out", self.out, "--config", config, parts=("none.onnx",))
        self.assert_fails(self.bag, "--out", self.path / "none" / "out.jsonl", "--config", CONFIG, parts=("out.jsonl",))

    def test_refuses_a_damaged_bag(self):
        write_bag(self.bag)
        whole = self.bag.read_bytes()
        for damaged in (b"", b"no bag at all", whole[:100], whole[:len(whole) // 2], whole[:-50]):
            self.bag.write_bytes(damaged)
            self.assert_fails(self.bag, "--out", self.out, "--config", CONFIG, parts=("in.bag", "damaged"))

    def test_an_index_makes_a_bag_of_what_was_cut_short(self):
        write_bag(self.path / "whole.bag")
        with rosbag.Bag(str(self.path / "whole.bag")) as whole, \
             rosbag.Bag(str(self.bag), "w", chunk_threshold=20_000) as chunks:  # those that are complete are found again
            for message in whole:
                chunks.write(*message)
        data = self.bag.read_bytes()
        self.bag.write_bytes(data[:len(data) * 3 // 4])
        self.assert_fails(self.bag, "--out", self.out, "--config", CONFIG, parts=(f"rosbag reindex {self.bag}",))
        subprocess.run(["rosbag", "reindex", "-q", str(self.bag)], check=True, stdout=subprocess.PIPE)
        lines, _ = self.objects_bag()
        self.assertTrue(30 < len(lines) < 60, len(lines))

    def test_a_recording_is_the_same_whole_and_in_parts_and_compressed(self):
        write_bag(self.bag)
        lines, _ = self.objects_bag()
        whole = self.out.read_bytes()
        parts = [self.path / f"a_{i}.bag" for i in range(3)]
        with rosbag.Bag(str(self.bag)) as bag:
            messages = list(bag)
        for i, part in enumerate(parts):
            with rosbag.Bag(str(part), "w", compression=("none", "bz2", "lz4")[i]) as bag:
                for message in messages[len(messages) * i // 3:len(messages) * (i + 1) // 3]:
                    bag.write(*message)
        for order in (parts, parts[::-1]):  # the messages' times tell the order
            result = self.run_tool(*order, "--out", self.out, "--config", CONFIG)
            self.assertEqual((result.returncode, self.out.read_bytes()), (0, whole), result.stderr)
        self.assertEqual(len(lines), 60)

    def test_arguments(self):
        self.assert_fails(code=2, parts=("IN.bag",))
        self.assert_fails("a.bag", code=2, parts=("--out", "--detections", "--save-objects"))
        self.assert_fails("a.bag", "--out", "a", "--detections", "a", code=2, parts=("--out", "--detections"))
        self.assert_fails("a.bag", "--points", "a", "--save-objects", "a", code=2, parts=("--points", "--save-objects"))
        self.assert_fails("a.bag", "--out", "a", "--detector", code=2, parts=("--detector",))
        self.assert_fails("a.bag", "b.bag", code=2, parts=("--out",))
        self.assert_fails("a.bag", "--fast", code=2, parts=("--fast",))
        self.assert_fails("a.bag", "--out", code=2, parts=("--out",))
        for timeout in ("-1", "nan", "soon"):
            self.assert_fails("a.bag", "--out", "a", "--tf-timeout", timeout, code=2, parts=("--tf-timeout", timeout))
        result = self.run_tool("--help")
        self.assertEqual(result.returncode, 0)
        for option in ("--scan-topic", "--world-frame", "--static-sensor", "--config", "--out", "--detections",
                       "--detector", "--load-objects", "--save-objects", "--tf-timeout", "--model-folder"):
            self.assertIn(option, result.stdout)


if __name__ == "__main__":
    unittest.main()
