# SPDX-License-Identifier: BSD-3-Clause
"""Tests of the data sets, networks and losses that train them, for a Python that has scripts/train/requirements.txt:

    python test/train/train_test.py
"""

import hashlib
import pathlib
import re
import sys
import tempfile
import unittest

import numpy as np
import onnx
import torch

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "scripts" / "train"))

import dataset  # noqa: E402
import paper_tasks  # noqa: E402
import publish  # noqa: E402
from paper_networks import ALEX, CIRCLE, VGG, Trainee, Window, inputs, windows  # noqa: E402

DESIGNS = (VGG, ALEX, CIRCLE)


def sampler(design):
    return dataset.sample_circles if design is CIRCLE else dataset.sample_ellipses


class DatasetTest(unittest.TestCase):
    def setUp(self):
        self.ellipses = dataset.sample_ellipses(np.random.default_rng(1), 2000)
        self.circles = dataset.sample_circles(np.random.default_rng(2), 2000)

    def test_ellipses_are_the_described_ones(self):
        _, _, psi, rx, ry = self.ellipses.ellipses.T
        self.assertGreaterEqual(self.ellipses.counts.min(), 5)
        self.assertTrue(((0.05 <= ry) & (ry <= rx) & (rx <= 0.5)).all())
        self.assertTrue((np.abs(psi) <= np.pi / 2).all())
        self.assertLess(np.abs(np.mean(psi)), 4 * np.pi / np.sqrt(12 * 2000))  # uniform: no side is preferred

    def test_circles_are_the_described_ones(self):
        t_x, t_y, _, rx, ry = self.circles.ellipses.T
        self.assertGreaterEqual(self.circles.counts.min(), 4)
        self.assertTrue((rx == ry).all())
        np.testing.assert_allclose(np.unique(rx), 0.05 * np.arange(1, 11), atol=1e-12)
        for column in (t_x, t_y):
            np.testing.assert_allclose(column / 0.05, np.round(column / 0.05), atol=1e-9)

    def test_objects_are_whole(self):
        for samples in (self.ellipses, self.circles):
            t_x, t_y, _, rx, ry = samples.ellipses.T
            distance = np.hypot(t_x, t_y)
            self.assertTrue(((distance + ry < 10) & (distance - ry > 0.1)).all())
            self.assertTrue(((samples.first_beam >= 0) & (samples.first_beam + samples.counts <= 1081)).all())

    def test_hits_lie_on_the_curve_and_the_beams_beside_them_miss_it(self):
        for samples in (self.ellipses, self.circles):
            away = []
            for i in range(200):
                t_x, t_y, psi, rx, ry = samples.ellipses[i]
                count = samples.counts[i]
                azimuth = np.radians(-135 + 0.25 * (samples.first_beam[i] + np.arange(-1, count + 1)))
                # A beam meets the ellipse if its distance from the centre is less than the half width across it.
                offset = np.cos(azimuth) * t_y - np.sin(azimuth) * t_x
                half_width = np.hypot(rx * np.sin(azimuth - psi), ry * np.cos(azimuth - psi))
                hit = np.abs(offset) <= half_width * (1 + 1e-12)
                self.assertTrue(hit[1:-1].all() and not hit[0] and not hit[-1])
                # Half the chord along each beam, from the widths of the ellipse across and along it.
                along = t_x * np.cos(azimuth) + t_y * np.sin(azimuth)
                lean = np.sin(azimuth - psi) * np.cos(azimuth - psi) * (ry**2 - rx**2) * offset
                chord = rx * ry * np.sqrt(np.maximum(half_width**2 - offset**2, 0))
                expected = along - (lean + chord) / half_width**2
                ranges = samples.ranges_m[samples.first_hit[i] :][:count]
                away.append(ranges - expected[1:-1])
            away = np.concatenate(away)
            self.assertLess(np.abs(np.mean(away)), 4 * 0.01 / np.sqrt(len(away)))
            self.assertAlmostEqual(np.std(away), 0.01, delta=0.0004)

    def test_same_seed_same_samples(self):
        again = dataset.sample_ellipses(np.random.default_rng(1), 2000)
        self.assertTrue((again.ranges_m == self.ellipses.ranges_m).all())


class NetworkTest(unittest.TestCase):
    def test_window_gives_the_whole_vectors_answer_and_gradient(self):
        for design in DESIGNS:
            torch.manual_seed(1)
            trainee = Trainee(design).double()
            network = trainee.published
            for convolution in network.convolutions:
                torch.nn.init.normal_(convolution.bias, 0.0, 0.2)  # so that backgrounds are not zero
            samples = sampler(design)(np.random.default_rng(2), 3000)
            by_beam = np.argsort(samples.first_beam)
            which = np.concatenate((by_beam[:4], by_beam[-4:], np.arange(8), [samples.counts.argmax()]))
            pull = torch.randn(len(which), sum(design.outputs), dtype=torch.float64)

            places, parts = zip(*windows(design, trainee.total_stride, samples, which))
            parts = [(len(rows), Window(part.inputs.double(), part.first)) for rows, part in zip(places, parts)]
            cut = network.answer(trainee.hidden(parts, trainee.prepare(torch.float64)))
            cut = cut[np.argsort(np.concatenate(places))]
            (cut * pull).sum().backward()
            gradients = {name: p.grad.clone() for name, p in trainee.named_parameters() if p.grad is not None}

            trainee.fold().zero_grad()
            network.dense[0].weight.requires_grad_(True)
            whole = network(torch.from_numpy(inputs(design, samples, which)).double()[:, None, None])
            (whole * pull).sum().backward()
            self.assertLess((whole - cut).abs().max().item(), 1e-11)
            for name, parameter in network.named_parameters():
                if name != "dense.0.weight":
                    error = (parameter.grad - gradients["published." + name]).abs().max()
                    self.assertLessEqual(error.item(), 1e-11 * parameter.grad.abs().max().item(), name)
            length = network.lengths[-1]
            own = network.dense[0].weight.grad.view(design.dense[0], -1, length).permute(2, 1, 0).reshape(length, -1)
            for name, expected in (("own", own), ("shared", trainee.waves.t() @ own)):
                error = (expected - gradients[name]).abs().max()
                self.assertLess(error.item(), 1e-11 * expected.abs().max().item(), name)

    def test_onnx_file_has_the_printed_parameters_and_its_golden_answer(self):
        for name, parameters in (("vgg", 1_846_505), ("alex", 1_814_105), ("circle", 1_826_350)):
            task = getattr(paper_tasks, name)(1, "float32")
            network = task.published()
            with torch.no_grad():
                for parameter in network.parameters():  # the exporter stores equal zeros once
                    parameter.add_(1e-3 * torch.randn(parameter.shape))
            with tempfile.TemporaryDirectory() as folder:
                publish.publish(task, folder, {"seed": 1, "losses": {"ordered_m": 0.5}})
                path = pathlib.Path(folder) / f"{task.name}.onnx"
                manifest = path.with_suffix(".manifest.yaml").read_text()
                model = onnx.load(path)
                loaded = publish.load(getattr(paper_tasks, name)(2, "float32").published(), path)
            self.assertEqual(sum(int(np.prod(t.dims)) for t in model.graph.initializer), parameters)
            for a, b in zip(network.parameters(), loaded.parameters()):
                self.assertTrue(torch.equal(a, b))
            golden = {key: np.array(re.search(rf"^  {key}: \[(.*)\]$", manifest, re.M)[1].split(","), np.float32)
                      for key in ("input", "output")}
            first = int(re.search(r"^  first: (\d+)$", manifest, re.M)[1])
            row = np.full((1, 1, 1, 1081), float(re.search(r"^  fill: (\S+)$", manifest, re.M)[1]), np.float32)
            row[..., first : first + len(golden["input"])] = golden["input"]
            with torch.no_grad():
                answer = network(torch.from_numpy(row)).numpy()[0]
            np.testing.assert_allclose(answer, golden["output"], atol=2e-6)

    def test_published_files_are_the_checked_ones(self):
        models = pathlib.Path(__file__).parents[2] / "models"
        for name in ("vgg", "alex", "circle"):
            task = getattr(paper_tasks, name)(1, "float32")
            digest = hashlib.sha256((models / f"{task.name}.onnx").read_bytes()).hexdigest()
            self.assertIn(f"sha256: {digest}", (models / f"{task.name}.manifest.yaml").read_text())


def points(ellipse):
    """The four characteristic points of rows (t_x, t_y, psi, rx, ry), n x 4 x 2."""
    t_x, t_y, psi, rx, ry = ellipse.T
    corners = []
    for angle, radius in ((psi, rx), (psi + np.pi / 2, ry), (psi + np.pi, rx), (psi + 3 * np.pi / 2, ry)):
        corners.append(np.stack((t_x + radius * np.cos(angle), t_y + radius * np.sin(angle)), 1))
    return np.stack(corners, 1)


class LossTest(unittest.TestCase):
    def setUp(self):
        self.truth = dataset.sample_ellipses(np.random.default_rng(3), 300).ellipses
        self.answer = self.truth + 0.1 * np.random.default_rng(4).normal(size=self.truth.shape)

    def test_ellipse_losses_are_distances_of_the_characteristic_points(self):
        answer, truth = torch.from_numpy(self.answer), torch.from_numpy(self.truth)
        ordered, symmetric = paper_tasks.ellipse_losses(
            answer[:, :2], paper_tasks.axes_of(answer), truth[:, :2], paper_tasks.axes_of(truth))
        turned = self.answer + [0, 0, np.pi, 0, 0]
        expected = [np.linalg.norm(points(a) - points(self.truth), axis=2).mean(1) for a in (self.answer, turned)]
        np.testing.assert_allclose(ordered, expected[0], atol=1e-6)
        np.testing.assert_allclose(symmetric, np.minimum(*expected), atol=1e-6)

    def test_smooth_shape_is_that_of_the_same_curve(self):
        truth = torch.from_numpy(self.truth)
        quarter = truth[:, [0, 1, 2, 4, 3]] + torch.tensor([0, 0, np.pi / 2, 0, 0], dtype=torch.float64)
        half = truth + torch.tensor([0, 0, np.pi, 0, 0], dtype=torch.float64)
        for same in (quarter, half):
            np.testing.assert_allclose(paper_tasks.smooth_of(same), paper_tasks.smooth_of(truth), atol=1e-12)

    def test_circle_loss_is_the_mean_squared_distance_of_the_points(self):
        answer, truth = self.answer[:, [0, 1, 3]], self.truth[:, [0, 1, 3]]

        def upright(circle):
            return points(np.column_stack((circle[:, :2], np.zeros(len(circle)), circle[:, 2], circle[:, 2])))

        expected = np.square(upright(answer) - upright(truth)).sum(2).mean(1)
        loss = paper_tasks.circle_losses(torch.from_numpy(answer), torch.from_numpy(truth))
        np.testing.assert_allclose(loss, expected, atol=1e-12)

    def test_resumed_batches_are_those_of_an_uninterrupted_run(self):
        task = paper_tasks.vgg(1, "float32")
        whole = [samples.ellipses[which] for samples, which in task.batches(5, 0, 103)]
        resumed = [samples.ellipses[which] for samples, which in task.batches(5, 98, 103)]
        self.assertEqual(len(whole), 103)
        for a, b in zip(whole[98:], resumed, strict=True):
            self.assertTrue((a == b).all())


if __name__ == "__main__":
    torch.set_num_threads(1)
    unittest.main()
