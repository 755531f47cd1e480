#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""grid_bag end to end, on label images of analytic scenes: no roscore."""
import io
import json
import pathlib
import sys
import unittest

import numpy as np
import PIL.Image
from scipy.ndimage import map_coordinates
from sensor_msgs.msg import CompressedImage, Image

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

    def test_images_that_tell_nothing_do_not_count_as_mapped(self):
        def change(messages):
            for _, _, msg in [entry for entry in messages if entry[1] == "/camera/labels"][20:23]:
                msg.data = np.full(msg.height * msg.width, 0.5, dtype="<f4").tobytes()
            return messages
        output, lines = self.lines_of(change)
        count = len(self.case["images"])
        self.assertIn(f"{count} images, {count - 3} mapped, 3 dropped: no label is known", output)
        self.assertEqual(*([target["id"] for target in line["targets"]] for line in lines[19:21]))
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

    def changed_infos(self, change):
        """Of write_bag: changes each camera_info."""
        def changed(messages):
            for _, topic, msg in messages:
                if topic == "/camera/camera_info":
                    change(msg)
            return messages
        return changed

    def bent(self, model, coefficients):
        """Label images and camera_info of a lens; what it sees beyond the case's images is not known."""
        size, (fx, cx) = self.case["width"], (self.case["fx"], self.case["cx"])
        v, u = np.mgrid[0:size, 0:size]
        bent = np.stack([(u - cx) / fx, (v - cx) / fx])
        straight = bent.copy()
        for _ in range(100):  # where the pixels would be without the lens
            r2 = (straight**2).sum(0)
            if model == "equidistant":
                angle = np.arctan(np.sqrt(r2))
                scale = angle * (1 + angle**2 * coefficients[0]) / np.sqrt(np.maximum(r2, 1e-12))
            else:
                scale = (1 + coefficients[0] * r2 + coefficients[1] * r2**2)
                if model == "rational_polynomial":
                    scale /= 1 + coefficients[5] * r2
            straight = bent / scale
        column, row = fx * straight[0] + cx, fx * straight[1] + cx

        def change(messages):
            for _, topic, msg in messages:
                if topic == "/camera/labels":
                    pixels = np.frombuffer(msg.data, dtype="<f4").reshape(size, size)
                    msg.data = map_coordinates(pixels, [row, column], order=1, cval=np.nan).astype("<f4").tobytes()
                elif topic == "/camera/camera_info":
                    msg.distortion_model, msg.D = model, list(coefficients)
            return messages
        return change

    def test_rectified_images_have_the_matrix_p(self):
        def change(msg):
            msg.D = [-0.25, 0.06, 0.0, 0.0, 0.0]
            msg.K = [1.3 * msg.K[0], 0, msg.K[2] + 4, 0, 1.3 * msg.K[4], msg.K[5] - 3, 0, 0, 1]
        for options, is_told in (((), True), (("--image-kind", "rectified"), False)):
            output, lines = self.lines_of(self.changed_infos(change), None, *options)
            self.check_all_found(lines[-1], 0.5)
            self.assertEqual("images are taken for rectified" in output, is_told)

        def without_k(msg):  # as of a camera that has rectified images alone
            change(msg)
            msg.K = [0.0] * 9
        _, lines = self.lines_of(self.changed_infos(without_k), None, "--image-kind", "rectified")
        self.check_all_found(lines[-1], 0.5)

    def test_raw_images_are_undistorted(self):
        for model, coefficients in (("plumb_bob", (-0.2, 0.05, 0.0, 0.0, 0.0)), ("equidistant", (-0.05, 0.0, 0.0, 0.0)),
                                    ("rational_polynomial", (0.1, 0.02, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0))):
            with self.subTest(model):
                change = self.bent(model, coefficients)
                _, lines = self.lines_of(change, None, "--image-kind", "raw")
                self.check_all_found(lines[-1], 0.6)
                # Nothing but the topic's name can tell it where P is K.
                done = run_program("grid_bag", grid_bags.write_bag(self.case_folder, change), "--world-frame", "world",
                                   "--dem", self.case_folder / "dem.tif", "--out", self.path / "no")
                self.assertEqual(done.returncode, 1)
                self.assertIn("image_kind must say rectified or raw", done.stdout)
                renamed = lambda messages: [(at, topic.replace("labels", "image_raw"), msg)
                                            for at, topic, msg in change(messages)]
                _, lines = self.lines_of(renamed, None, "--labels-topic", "/camera/image_raw")
                self.check_all_found(lines[-1], 0.6)

    def test_binning_and_region_of_interest(self):
        def binned(msg):
            msg.binning_x = msg.binning_y = 2
            msg.width, msg.height = 2 * msg.width, 2 * msg.height
            fx, _, cx, _, fy, cy = msg.K[:6]
            msg.K = [2 * fx, 0, 2 * cx + 0.5, 0, 2 * fy, 2 * cy + 0.5, 0, 0, 1]

        def region(msg):
            msg.roi.x_offset, msg.roi.y_offset, msg.roi.width, msg.roi.height = 60, 40, msg.width, msg.height
            msg.width, msg.height = 200, 150
            fx, _, cx, _, fy, cy = msg.K[:6]
            msg.K = [fx, 0, cx + 60, 0, fy, cy + 40, 0, 0, 1]
        for change in (binned, region):
            _, lines = self.lines_of(self.changed_infos(change))
            self.check_all_found(lines[-1], 0.5)

    def test_compressed_images(self):
        def change(name):
            def changed(messages):
                result = []
                for at, topic, msg in messages:
                    if topic == "/camera/labels":
                        pixels = np.frombuffer(msg.data, dtype="<f4").reshape(self.case["width"], -1)
                        file = io.BytesIO()
                        PIL.Image.fromarray(pixels).save(file, "TIFF")
                        topic, msg = name, CompressedImage(msg.header, "32FC1; tiff compressed ", file.getvalue())
                    result.append((at, topic, msg))
                return result
            return changed
        as_they_are = self.lines_of()[1]
        for name, options in (("/camera/labels/compressed", ()),
                              ("/camera/labels/compressed", ("--labels-topic", "/camera/labels/compressed")),
                              ("/camera/small", ("--labels-topic", "/camera/small"))):
            self.assertEqual(self.lines_of(change(name), None, *options)[1], as_they_are)

        def spoilt(messages):
            messages = change("/camera/labels/compressed")(messages)
            for _, topic, msg in messages:
                if topic.endswith("compressed"):
                    msg.data = msg.data[:30]
            return messages
        done = run_program("grid_bag", grid_bags.write_bag(self.case_folder, spoilt), "--world-frame", "world", "--dem",
                           self.case_folder / "dem.tif", "--out", self.path / "no")
        self.assertEqual(done.returncode, 1)
        self.assertIn("compressed image that cannot be read", done.stdout)

    def test_images_that_a_network_labels_in_each_encoding(self):
        size = 64
        colors = np.random.default_rng(1).integers(0, 255, (size, size, 3), dtype=np.uint8)
        grey = colors[..., 0]

        def change(encoding, data, is_bigendian=0):
            def changed(messages):
                result = []
                for at, topic, msg in [m for m in messages if m[1] != "/camera/labels" or m[0].to_sec() < 1002]:
                    if topic == "/camera/labels":
                        msg = Image(header=msg.header, height=size, width=size, encoding=encoding, data=data,
                                    step=len(data) // size, is_bigendian=is_bigendian)
                        topic = "/camera/image"
                    elif topic == "/camera/camera_info":
                        msg.width = msg.height = size
                    result.append((at, topic, msg))
                return result
            return changed
        for encoding, data, is_bigendian in (
                ("rgb8", colors.tobytes(), 0), ("mono16", (257 * grey.astype("<u2")).tobytes(), 0),
                ("mono16", (257 * grey.astype(">u2")).astype(">u2").tobytes(), 1), ("bayer_rggb8", grey.tobytes(), 0),
                ("bayer_gbrg8", grey.tobytes(), 0), ("yuv422", colors[..., :2].tobytes(), 0),
                ("yuv422_yuy2", colors[..., :2].tobytes(), 0), ("8UC1", grey.tobytes(), 0)):
            bag = grid_bags.write_bag(self.case_folder, change(encoding, data, is_bigendian))
            done = run_program("grid_bag", bag, "--image-topic", "/camera/image", "--world-frame", "world", "--dem",
                               self.case_folder / "dem.tif", "--out", self.path / "images.jsonl")
            self.assertEqual(done.returncode, 0, done.stdout)
            self.assertRegex(done.stdout, r"\b(\d+) images, \1 mapped", encoding)

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
