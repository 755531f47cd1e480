# SPDX-License-Identifier: BSD-3-Clause
"""The package's network: python test/train/ellipse_network_test.py (after scripts/build, which makes its samples)."""

import pathlib
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts/train"))

import numpy as np  # noqa: E402
import torch  # noqa: E402

import ellipse_network as product  # noqa: E402
import publish  # noqa: E402


class EllipseTaskTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        torch.set_num_threads(1)
        cls.task = product.EllipseTask(seed=3)
        with torch.no_grad():  # as after training: the exporter stores equal tensors once
            for layer in (cls.task.network.first, *cls.task.network.hidden, cls.task.network.output):
                layer.bias.normal_(std=0.01)
        cls.rows = torch.from_numpy(product.draw("product", 1, 500).copy())

    def test_published_layers_compute_the_same(self):
        with torch.no_grad():
            trained = self.task.network(self.rows[:, : product.INPUTS])
            published = self.task.network.folded()(self.rows[:, : product.INPUTS])
        self.assertLess((trained - published).abs().max().item(), 1e-4)

    def test_goes_on_from_what_it_published(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "ellipse.onnx"
            publish.export(self.task, self.task.network.folded(), path)
            other = product.EllipseTask(seed=4)
            other.start_from(path)
        with torch.no_grad():
            difference = other.network(self.rows[:, : product.INPUTS]) - self.task.network(self.rows[:, : product.INPUTS])
        self.assertLess(difference.abs().max().item(), 1e-4)

    def test_finishing_puts_nine_tenths_inside_at_every_range(self):
        task = product.EllipseTask(seed=5)
        product.FINISHING_SAMPLES, product.FINISHING_STEPS, product.FINISHING_RATE = 40_000, 600, 0.01
        task.finish(seed=5)
        rows = torch.from_numpy(product.draw("ellipse", 1, 20_000).copy())
        with torch.no_grad():
            answer = task.network(rows[:, : product.INPUTS])
            error = rows[:, product.TRUTH] - product.point_of(answer, rows)
            factor = slice(product.POINT, product.POINT + product.FACTOR)
            square = product.whitened(answer[:, factor], error)[0].square().sum(1)
            inside = square < product.CHI_SQUARE_90 * torch.exp(answer[:, product.POINT + product.FACTOR])
        distance = rows[:, product.MEAN_RANGE]
        for low, high in ((0, 3), (3, 6), (6, 10)):  # of an untrained network
            share = inside[(distance >= low) & (distance < high)].double().mean().item()
            self.assertAlmostEqual(share, 0.9, delta=0.04)

    def test_a_batch_depends_on_seed_and_step_alone(self):
        batches = list(self.task.batches(7, 0, 3))
        (third,) = self.task.batches(7, 2, 3)
        self.assertTrue(torch.equal(batches[2], third))
        self.assertFalse(torch.equal(batches[1], third))
        (other,) = self.task.batches((7, 1), 2, 3)
        self.assertFalse(torch.equal(other, third))

    def test_training_and_evaluation_share_no_seed(self):
        for seed in (1, (1, 1)):
            drawn = []
            original = product.draw
            product.draw = lambda case, first, count: (drawn.append(first), original(case, first, count))[1]
            try:
                self.task._chunk(seed, 0)
            finally:
                product.draw = original
            self.assertTrue(all(first >= product.TRAINING_SEEDS for first in drawn))

    def test_whitening_is_a_factor_of_the_precision(self):
        generator = torch.Generator().manual_seed(1)
        factor = torch.randn(4, product.FACTOR, generator=generator) / 3
        error = torch.randn(4, 5, generator=generator) / 10
        matrix = torch.zeros(4, 5, 5)
        for column in range(5):
            unit = torch.zeros(4, 5)
            unit[:, column] = product.MAX_RADIUS_M
            matrix[:, :, column], log_determinant = product.whitened(factor, unit)
        white, _ = product.whitened(factor, error)
        expected = (matrix @ (error / product.MAX_RADIUS_M)[:, :, None])[:, :, 0]
        self.assertLess((white - expected).abs().max().item(), 1e-4)
        self.assertTrue(torch.equal(matrix, matrix.tril()))
        self.assertLess((torch.logdet(matrix) - log_determinant).abs().max().item(), 1e-4)

    def test_the_loss_is_the_papers_and_does_not_know_half_turns(self):
        ellipse = np.array([0.3, -0.2, 0.6, 0.4, 0.15])

        def smooth(t_x, t_y, psi, rx, ry):
            half = (rx - ry) / 2
            row = (t_x, t_y, (rx + ry) / 2, half * np.cos(2 * psi), half * np.sin(2 * psi))
            return torch.tensor([row], dtype=torch.float64)

        turned = smooth(*(ellipse + np.array([0, 0, np.pi, 0, 0])))
        self.assertLess(product.symmetric_loss(smooth(*ellipse), turned).item(), 2e-5)
        moved = smooth(*(ellipse + np.array([0.03, 0.04, 0, 0, 0])))
        self.assertAlmostEqual(product.symmetric_loss(smooth(*ellipse), moved).item(), 0.05, places=5)
        grown = smooth(*(ellipse + np.array([0, 0, 0, 0.02, 0.01])))
        self.assertAlmostEqual(product.symmetric_loss(smooth(*ellipse), grown).item(), 0.015, places=5)


if __name__ == "__main__":
    unittest.main()
