# SPDX-License-Identifier: BSD-3-Clause
"""The package's networks of one segment: python test/train/segment_network_test.py (after scripts/build, which makes
their samples)."""

import pathlib
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts/train"))

import numpy as np  # noqa: E402
import torch  # noqa: E402

import ellipse_network  # noqa: E402
import publish  # noqa: E402
import segment_network as network  # noqa: E402
import shape_network  # noqa: E402


class TaskTests:
    """For every task; `make` makes one, whose truths are in the 90 % regions of `exact` at every range."""

    @classmethod
    def setUpClass(cls):
        torch.set_num_threads(1)
        cls.task = cls.make(seed=3)
        with torch.no_grad():  # as after training: the exporter stores equal tensors once
            for layer in (cls.task.network.first, *cls.task.network.hidden, cls.task.network.output):
                layer.bias.normal_(std=0.01)
        cls.rows = torch.from_numpy(network.draw(cls.task.typical, 1, 500).copy())

    def test_published_layers_compute_the_same(self):
        with torch.no_grad():
            trained = self.task.network(self.rows[:, : network.INPUTS])
            published = self.task.network.folded()(self.rows[:, : network.INPUTS])
        self.assertLess((trained - published).abs().max().item(), 1e-4)

    def test_goes_on_from_what_it_published(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "network.onnx"
            publish.export(self.task, self.task.network.folded(), path)
            other = self.make(seed=4)
            other.start_from(path)
        with torch.no_grad():
            difference = other.network(self.rows[:, : network.INPUTS]) - self.task.network(self.rows[:, : network.INPUTS])
        self.assertLess(difference.abs().max().item(), 1e-4)

    def test_finishing_puts_nine_tenths_inside_at_every_range(self):
        task = self.make(seed=5)
        network.FINISHING_SAMPLES, network.FINISHING_STEPS, network.FINISHING_RATE = 40_000, 600, 0.01
        task.finish(seed=5)
        rows = torch.from_numpy(network.draw(self.exact, 1, 20_000).copy())
        with torch.no_grad():
            answer = task.network(rows[:, : network.INPUTS])
            error = rows[:, task.truth] - network.point_of(answer, rows)
            square = network.whitened(answer[:, network.POINT : network.QUANTILE], error)[0].square().sum(1)
            inside = square < network.CHI_SQUARE_90 * torch.exp(answer[:, network.QUANTILE])
        distance = rows[:, network.MEAN_RANGE]
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
            original = network.draw
            network.draw = lambda case, first, count: (drawn.append(first), original(case, first, count))[1]
            try:
                self.task._chunk(seed, 0)
            finally:
                network.draw = original
            self.assertTrue(all(first >= network.TRAINING_SEEDS for first in drawn))


class EllipseTaskTest(TaskTests, unittest.TestCase):
    make, exact = ellipse_network.EllipseTask, "ellipse"


class ShapeTaskTest(TaskTests, unittest.TestCase):
    make, exact = shape_network.ShapeTask, "boxes"

    def test_classes_are_learned_from_the_mixture_only(self):
        (rows,) = self.task.batches(7, 0, 1)
        exact = rows[:, network.CASE] > 0
        self.assertTrue(0.3 < exact.float().mean() < 0.7)
        self.assertTrue((rows[exact][:, network.IS_BOX] == 1).all())
        for which, share in enumerate((0.4, 0.4, 0.2)):
            found = (shape_network.class_of(rows[~exact]) == which).double().mean().item()
            self.assertAlmostEqual(found, share, delta=0.05)
        self.task.network.zero_grad()
        self.task.loss(rows, 0.0).backward()
        before = self.task.network.output.weight.grad[shape_network.CLASSES].clone()
        rows = rows.clone()
        rows[exact, network.IS_ELLIPSE] = 1.0  # would change the class of every exact box
        self.task.network.zero_grad()
        self.task.loss(rows, 0.0).backward()
        self.assertTrue(torch.equal(before, self.task.network.output.weight.grad[shape_network.CLASSES]))

    def test_turning_a_box_by_a_right_angle_changes_no_truth(self):
        rows = network.draw("boxes", 1, 200)
        self.assertTrue(np.allclose(np.hypot(*rows[:, network.ORIENTATION].T), 1.0, atol=1e-6))
        # The longer side's direction from (p, q) is that of the orientation, up to right angles.
        p, q = rows[:, network.BOX_TRUTH][:, 3:].T
        doubled = np.arctan2(q, p)
        self.assertTrue(np.allclose(np.cos(2 * doubled), rows[:, network.ORIENTATION.start], atol=1e-3))


class LossTest(unittest.TestCase):
    def test_whitening_is_a_factor_of_the_precision(self):
        generator = torch.Generator().manual_seed(1)
        factor = torch.randn(4, network.FACTOR, generator=generator) / 3
        error = torch.randn(4, 5, generator=generator) / 10
        matrix = torch.zeros(4, 5, 5)
        for column in range(5):
            unit = torch.zeros(4, 5)
            unit[:, column] = network.MAX_RADIUS_M
            matrix[:, :, column], log_determinant = network.whitened(factor, unit)
        white, _ = network.whitened(factor, error)
        expected = (matrix @ (error / network.MAX_RADIUS_M)[:, :, None])[:, :, 0]
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
        self.assertLess(network.symmetric_loss(smooth(*ellipse), turned).item(), 2e-5)
        moved = smooth(*(ellipse + np.array([0.03, 0.04, 0, 0, 0])))
        self.assertAlmostEqual(network.symmetric_loss(smooth(*ellipse), moved).item(), 0.05, places=5)
        grown = smooth(*(ellipse + np.array([0, 0, 0, 0.02, 0.01])))
        self.assertAlmostEqual(network.symmetric_loss(smooth(*ellipse), grown).item(), 0.015, places=5)


if __name__ == "__main__":
    unittest.main()
