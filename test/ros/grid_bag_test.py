#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""grid_bag end to end, on label images of analytic scenes: no roscore."""
import json
import pathlib
import sys
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from bag_tools import BagToolTest, grid_bags, run_program  # noqa: E402


class GridBagTest(BagToolTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.case_folder = cls.orbit()
        cls.case = json.loads((cls.case_folder / "case.json").read_text())

    def lines_of(self, change=lambda messages: messages, images=None, *args):
        """Output and lines of a run, of which each line is checked."""
        bag = grid_bags.write_bag(self.case_folder, change)
        out, grid = self.path / "out.jsonl", self.path / "grid.tif"
        for file in (out, grid):
            file.unlink(missing_ok=True)
        done = run_program("grid_bag", bag, "--world-frame", "world", "--dem", self.case_folder / "dem.tif", "--out", out, "--grid-out",
                   grid, *args)
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertTrue(grid.exists())
        lines = [json.loads(line) for line in out.read_text().splitlines()]
        self.assertEqual(len(lines), len(self.case["images"]) if images is None else images)
        for before, line in zip([{"stamp": -np.inf}] + lines, lines):
            self.assertEqual(list(line), ["stamp", "targets"])
            self.assertGreater(line["stamp"], before["stamp"])
            for target in line["targets"]:
                self.assertEqual(list(target), ["id", "x", "y", "z", "covariance", "area_m2", "p"])
                xx, xy, yx, yy = target["covariance"]
                self.assertEqual(xy, yx)
                self.assertGreater(xx * yy, xy * yx)
                self.assertTrue(0.5 < target["p"] <= 1.0)
        return done.stdout, lines

    def check_all_found(self, line, within_m):
        places = np.array([[target["x"], target["y"]] for target in line["targets"]])
        self.assertEqual(len(places), len(self.case["cars"]))
        for car in self.case["cars"]:
            self.assertLess(np.hypot(*(places - [car["x"], car["y"]]).T).min(), within_m)

    def test_cars_over_an_elevation_that_is_off(self):
        output, lines = self.lines_of()
        self.assertIn("-1.00 m off the elevation", output)
        self.assertEqual([line["targets"] for line in lines[:2]], [[], []])
        self.assertGreater(len(lines[2]["targets"]), 0)
        self.check_all_found(lines[-1], 0.5)
        ids = {target["id"] for line in lines for target in line["targets"]}
        self.assertLessEqual({target["id"] for target in lines[-1]["targets"]}, ids)
        for target in lines[-1]["targets"]:
            self.assertAlmostEqual(target["z"], 0.0, delta=0.01)  # that of the ground, not of the elevation

    def test_images_that_cannot_be_used_are_counted_and_the_others_are(self):
        def change(messages):
            labels = [entry for entry in messages if entry[1] == "/camera/labels"]
            labels[3][2].encoding = "mono8"
            labels[4][2].data = labels[4][2].data[:-1]
            labels[5][2].header.frame_id = "elsewhere"
            infos = [entry for entry in messages if entry[1] == "/camera/camera_info"]
            infos[6][2].width = 57
            infos[7][2].K = [0.0] * 9
            infos[8][2].K = [float("nan")] * 9
            return messages
        output, lines = self.lines_of(change, len(self.case["images"]) - 6)
        for reason in ("labels are not 32FC1", "image with too little data", "no transform",
                       "camera_info of another size", "camera_info without focal length",
                       "camera_info with a matrix that is not finite"):
            self.assertIn(reason, output)
        self.check_all_found(lines[-1], 0.5)

    def test_labels_out_of_range_and_unknown_ones(self):
        def change(messages):
            for k, (_, topic, msg) in enumerate(messages):
                if topic != "/camera/labels":
                    continue
                pixels = np.frombuffer(msg.data, dtype="<f4").copy()
                pixels[k % 11::11] = [np.nan, 0.5, -3.0, 7.0, np.inf][k % 5]
                msg.data = pixels.tobytes()
            return messages
        output, lines = self.lines_of(change)
        self.assertNotIn("0 labels out of [0, 1] not used", output)
        self.assertIn("labels out of [0, 1] not used", output)
        self.check_all_found(lines[-1], 1.0)

    def test_images_of_changing_size_big_endian_and_with_padding(self):
        size = self.case["width"]

        def change(messages):
            for k, (_, topic, msg) in enumerate(messages):
                if topic == "/camera/camera_info" and k % 4 < 2:
                    msg.width, msg.height = 2 * size, 2 * size
                    fx, _, cx, _, fy, cy = msg.K[:6]
                    msg.K = [2 * fx, 0, 2 * cx + 0.5, 0, 2 * fy, 2 * cy + 0.5, 0, 0, 1]
                elif topic == "/camera/labels":
                    pixels = np.frombuffer(msg.data, dtype="<f4").reshape(size, size)
                    if (k - 1) % 4 < 2:  # its camera_info is the message before
                        pixels = np.kron(pixels, np.ones((2, 2), dtype=np.float32))
                        msg.height, msg.width = pixels.shape
                    padded = np.pad(pixels, ((0, 0), (0, 3)), constant_values=9.0)
                    msg.is_bigendian, msg.step = 1, 4 * padded.shape[1]
                    msg.data = padded.astype(">f4").tobytes()
            return messages
        messages_of_images = lambda messages: sorted(
            [m for m in messages if not m[1].startswith("/camera")] , key=lambda m: m[0]) + sorted(
            [m for m in messages if m[1].startswith("/camera")], key=lambda m: m[0])
        _, lines = self.lines_of(lambda messages: change(messages_of_images(messages)))
        self.check_all_found(lines[-1], 0.5)

    def test_a_gap_of_transforms(self):
        gap = (grid_bags.START_S + 5.2, grid_bags.START_S + 6.8)
        change = lambda messages: [entry for entry in messages
                                   if entry[1] != "/tf" or not gap[0] < entry[0].to_sec() < gap[1]]
        _, lines = self.lines_of(change)  # interpolated over the gap, on the way of the truth
        self.check_all_found(lines[-1], 0.5)

    def test_without_camera_info_nothing_is_mapped_and_it_says_why(self):
        bag = grid_bags.write_bag(self.case_folder, lambda messages: [
            entry for entry in messages if entry[1] != "/camera/camera_info" or entry[0].to_sec() > 1e4])
        done = run_program("grid_bag", bag, "--world-frame", "world", "--dem", self.case_folder / "dem.tif", "--out", self.path / "no.jsonl")
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("camera_info", done.stdout)
        self.assertFalse((self.path / "no.jsonl").exists())

    def test_one_camera_info_that_comes_late_does_for_all_images(self):
        def change(messages):
            infos = [entry for entry in messages if entry[1] == "/camera/camera_info"]
            return [entry for entry in messages if entry not in infos[:-1]]
        _, lines = self.lines_of(change)
        self.check_all_found(lines[-1], 0.5)

    def test_what_is_no_elevation_is_refused(self):
        bag = grid_bags.write_bag(self.case_folder)
        done = run_program("grid_bag", bag, "--dem", self.case_folder / "case.json", "--out", self.path / "no.jsonl")
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("no elevation", done.stdout)


if __name__ == "__main__":
    unittest.main()
