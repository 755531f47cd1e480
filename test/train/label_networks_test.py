# SPDX-License-Identifier: BSD-3-Clause
"""Tests of the networks that label images and of what they are trained on, for a Python that has
scripts/train/requirements.txt:

    python test/train/label_networks_test.py
"""

import pathlib
import sys
import tempfile
import unittest
import xml.etree.ElementTree

import numpy as np
import onnx
import torch

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "scripts" / "train"))

import image_scenes  # noqa: E402
import label_networks  # noqa: E402
import publish  # noqa: E402

torch.set_num_threads(1)

def write_netpbm(path, numbers):
    kind = b"P6" if numbers.ndim == 3 else b"P5"
    path.write_bytes(kind + b"\n%d %d\n255\n" % (numbers.shape[1], numbers.shape[0]) + numbers.tobytes())


def bright_squares(random, size=128):
    """An image that is bright where it shows a car, and nowhere else."""
    cover = np.zeros((size, size), np.uint8)
    for _ in range(4):
        row, column = random.integers(0, size - 40, 2)
        cover[row : row + 36, column : column + 36] = 255
    image = np.where(cover[..., None] > 0, 230, 20).astype(np.uint8).repeat(3, axis=2)
    return image, cover


class NetworkTest(unittest.TestCase):
    def test_output_is_a_16th_at_any_multiple_of_32(self):
        for make, width in label_networks.NETWORKS.values():
            network = make(width / 2).eval()
            for height, wide in ((64, 64), (32, 96), (160, 128)):
                with torch.no_grad():
                    answer = network(torch.zeros(1, 3, height, wide))
                self.assertEqual(tuple(answer.shape), (1, 2, height // 16, wide // 16))

    def test_v0_has_half_the_filters(self):
        whole, half = (label_networks.NETWORKS[name][1] for name in ("scoutnet", "scoutnet_v0"))
        self.assertEqual(half, whole / 2)

    def test_whole_width_has_the_layers_of_darknet_19(self):
        network = label_networks.scoutnet(1.0)
        counts = [tuple(m.weight.shape) for m in network.modules() if isinstance(m, torch.nn.Conv2d)]
        self.assertEqual(len(counts), 18 + 2)  # and the two scores
        self.assertIn((1024, 512, 3, 3), counts)
        self.assertIn((512, 1024, 1, 1), counts)

    def test_published_network_gives_the_same_probabilities_without_normalisation_layers(self):
        torch.manual_seed(1)
        for make, width in label_networks.NETWORKS.values():
            network = make(width / 2)
            network.train()
            network(torch.randn(4, 3, 64, 64))  # so that its statistics are not those of the start
            network.eval()
            published = label_networks.Published(network).eval()
            self.assertFalse(any(isinstance(m, torch.nn.BatchNorm2d) for m in published.modules()))
            images = torch.randn(2, 3, 64, 96)
            with torch.no_grad():
                torch.testing.assert_close(published(images), torch.softmax(network(images), 1), atol=1e-5, rtol=1e-4)


class SamplesTest(unittest.TestCase):
    def test_netpbm_files_are_read_as_written(self):
        random = np.random.default_rng(1)
        with tempfile.TemporaryDirectory() as folder:
            for shape in ((5, 7, 3), (6, 4)):
                numbers = random.integers(0, 256, shape, dtype=np.uint8)
                write_netpbm(pathlib.Path(folder) / "file", numbers)
                np.testing.assert_array_equal(label_networks.read_netpbm(pathlib.Path(folder) / "file"), numbers)

    def test_augmented_labels_stay_on_what_they_label(self):
        for seed in range(20):
            random = np.random.default_rng(seed)
            image, cover = bright_squares(random, 200)
            rgb, moved = label_networks.augmented(random, image, cover / np.float32(255), 128, turns=True)
            gray = rgb.mean(0)
            bright, dark = gray[moved > 0.99], gray[moved < 0.01]
            if len(bright) > 50 and len(dark) > 50:
                self.assertGreater(bright.mean() - dark.mean(), 0.25, f"seed {seed}")

    def test_hues_are_turned_about_grey(self):
        random = np.random.default_rng(1)
        for _ in range(5):
            turn = label_networks.hue_turn(random).double()
            torch.testing.assert_close(turn @ turn.T, torch.eye(3).double(), atol=1e-6, rtol=0)
            torch.testing.assert_close(turn @ torch.ones(3).double(), torch.ones(3).double(), atol=1e-6, rtol=0)

    def test_label_pixels_are_means_and_unknown_where_a_part_is(self):
        cover = torch.zeros(1, 32, 32)
        cover[0, :8, :16] = 1
        cover[0, 20, 20] = torch.nan
        labels = label_networks.labels_of(cover)[0]
        self.assertEqual(labels[0, 0].item(), 0.5)
        self.assertEqual(labels[0, 1].item(), 0.0)
        self.assertTrue(torch.isnan(labels[1, 1]))


class TaskTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.path = pathlib.Path(self.folder.name)
        for i in range(8):
            image, cover = bright_squares(np.random.default_rng(i))
            write_netpbm(self.path / f"{i}.ppm", image)
            write_netpbm(self.path / f"{i}.pgm", cover)
        self.task = label_networks.LabelTask("scoutnet_v0", 1, "float32", [self.path], width=0.0625)
        self.task.size, self.task.batch = 96, 4

    def tearDown(self):
        self.folder.cleanup()

    def test_a_batch_depends_on_seed_and_step_alone(self):
        whole = list(self.task.batches(3, 0, 4))
        part = list(self.task.batches(3, 2, 4))
        torch.testing.assert_close(whole[2], part[0])
        self.assertFalse(torch.equal(whole[0][0], whole[1][0]))

    def train(self, steps):
        optimizer = torch.optim.AdamW(self.task.network.parameters(), lr=3e-3)
        losses = []
        for batch in self.task.batches(1, 0, steps):
            loss = self.task.loss(batch, 0.0)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            losses.append(loss.item())
        return losses

    def test_the_loss_falls(self):
        losses = self.train(40)
        self.assertLess(np.mean(losses[-8:]), 0.75 * np.mean(losses[:4]))

    def test_published_files_have_free_sizes_and_a_golden_answer(self):
        self.train(2)  # the exporter writes equal tensors, such as biases of 0, once
        publish.publish(self.task, self.path / "out", {"command": "none"})
        model = onnx.load(self.path / "out/scoutnet_v0.onnx")
        self.assertEqual([d.dim_param for d in model.graph.input[0].type.tensor_type.shape.dim],
                         ["batch", "", "height", "width"])
        manifest = (self.path / "out/scoutnet_v0.manifest.yaml").read_text()
        golden = manifest.split("output: [")[1].split("]")[0].split(",")
        self.assertEqual(len(golden), 2 * 4 * 4)
        sums = np.array(golden, float).reshape(2, -1).sum(axis=0)
        np.testing.assert_allclose(sums, 1.0, atol=2e-6)


class ScenesTest(unittest.TestCase):
    def test_the_same_numbers_give_the_same_scene(self):
        for domain in image_scenes.DOMAINS:
            texts = [image_scenes.make_scene(domain, np.random.default_rng(4))[0] for _ in range(2)]
            self.assertEqual(*texts)
            self.assertNotEqual(texts[0], image_scenes.make_scene(domain, np.random.default_rng(5))[0])

    def test_scenes_are_worlds_with_cars_on_the_ground(self):
        for domain in image_scenes.DOMAINS:
            text, ground, cars = image_scenes.make_scene(domain, np.random.default_rng(1))
            root = xml.etree.ElementTree.fromstring(text)
            paints = [m.get("name") for m in root.iter("material") if m.get("name", "").endswith("/paint")]
            self.assertEqual(len(paints), len(cars))
            self.assertGreater(len(cars), 0)
            self.assertTrue(np.isfinite(ground.rgb).all())

    def test_poses_are_above_the_ground_and_look_down(self):
        for seed in range(20):
            random = np.random.default_rng(seed)
            fov, poses = image_scenes.draw_poses(random, [(3.0, 4.0)], 5)
            for _, _, height, _, pitch, _ in poses:
                self.assertTrue(10 <= height <= 120)
                self.assertLess(pitch, -np.radians(14.9))
            self.assertTrue(0.4 < fov < 1.2)


if __name__ == "__main__":
    unittest.main()
