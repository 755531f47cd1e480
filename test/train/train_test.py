# SPDX-License-Identifier: BSD-3-Clause
"""Tests of the training code, for a Python that has scripts/train/requirements.txt:

    python test/train/train_test.py
"""

import pathlib
import sys
import unittest

import numpy as np
import torch
from torch.nn import functional

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "scripts" / "train"))

import dataset  # noqa: E402
import evaluate  # noqa: E402
from network import EllipseVgg, symmetric_loss  # noqa: E402


class DatasetTest(unittest.TestCase):
    def setUp(self):
        self.samples = dataset.sample(np.random.default_rng(1), 500, near_fraction=0.5)

    def test_is_the_described_distribution(self):
        _, _, psi, rx, ry = self.samples.ellipses.T
        self.assertTrue((self.samples.counts >= dataset.MIN_HITS).all())
        self.assertTrue(((0.05 <= ry) & (ry <= rx) & (rx <= 0.5)).all())
        self.assertTrue((np.abs(psi) <= np.pi / 2).all())

    def test_hits_lie_on_the_ellipse_and_the_beams_beside_them_miss_it(self):
        for i in range(100):
            t_x, t_y, psi, rx, ry = self.samples.ellipses[i]
            count = self.samples.counts[i]
            beam = np.arange(-1, count + 1) - count // 2
            azimuth = self.samples.middle_azimuth_rad[i] + beam * dataset.RESOLUTION_RAD
            # A beam meets the ellipse if its distance from the centre is less than the half width across it.
            offset = np.cos(azimuth) * t_y - np.sin(azimuth) * t_x
            half_width = np.hypot(rx * np.sin(azimuth - psi), ry * np.cos(azimuth - psi))
            hit = np.abs(offset) <= half_width
            self.assertTrue(hit[1:-1].all() and not hit[0] and not hit[-1])
            ranges = self.samples.ranges_m[self.samples.first_hit[i] :][:count]
            x, y = ranges * np.cos(azimuth[1:-1]) - t_x, ranges * np.sin(azimuth[1:-1]) - t_y
            own_x, own_y = np.cos(psi) * x + np.sin(psi) * y, np.cos(psi) * y - np.sin(psi) * x
            inside = np.hypot(own_x / rx, own_y / ry)
            self.assertLess(np.abs(np.median(inside) - 1), 0.3)

    def test_same_seed_same_samples(self):
        again = dataset.sample(np.random.default_rng(1), 500, near_fraction=0.5)
        self.assertTrue((again.ranges_m == self.samples.ranges_m).all())

    def test_targets_are_the_ellipses_in_the_segments_frame(self):
        which = np.arange(500)
        ellipses = evaluate.ellipses_in_sensor_frame(self.samples.targets(which), self.samples, which)
        symmetric = evaluate.characteristic_distances(ellipses, self.samples.ellipses)[1]
        self.assertLess(symmetric.max(), 1e-5)


class NetworkTest(unittest.TestCase):
    def test_window_gives_the_whole_vectors_answer_and_gradient(self):
        torch.manual_seed(1)
        network = EllipseVgg().double()
        for convolution in network.convolutions:
            torch.nn.init.normal_(convolution.bias, 0.0, 0.2)  # so that backgrounds are not zero
        samples = dataset.sample(np.random.default_rng(2), 300, near_fraction=1.0)
        for half_width in (9, 28, 200, dataset.MIDDLE):
            which = np.flatnonzero(samples.half_widths() <= half_width)[:16]
            window = torch.from_numpy(samples.inputs(which, half_width)).double()
            truth = torch.from_numpy(samples.targets(which)).double()
            beside = dataset.MIDDLE - half_width
            results = []
            for answer in (
                network(functional.pad(window, (beside, beside))[:, None, None]),
                network.forward_window(window, network.prepare(torch.float64)),
            ):
                network.zero_grad()
                symmetric_loss(answer, truth).mean().backward()
                results.append((answer, [parameter.grad.clone() for parameter in network.parameters()]))
            (whole, whole_gradients), (cut, cut_gradients) = results
            self.assertLess((whole - cut).abs().max().item(), 1e-12)
            for a, b in zip(whole_gradients, cut_gradients):
                self.assertLess((a - b).abs().max().item(), 1e-9 * a.abs().max().item())

    def test_loss_is_the_papers(self):
        samples = dataset.sample(np.random.default_rng(3), 200)
        which = np.arange(200)
        targets = torch.from_numpy(samples.targets(which))
        answers = targets + 0.01 * torch.randn(targets.shape, generator=torch.Generator().manual_seed(4))
        ellipses = evaluate.ellipses_in_sensor_frame(answers.numpy(), samples, which)
        expected = evaluate.characteristic_distances(ellipses, samples.ellipses)[1]
        loss = symmetric_loss(answers, targets).numpy()
        round_ones = samples.ellipses[:, 3] - samples.ellipses[:, 4] < 0.05  # answers may have a negative radius there
        self.assertLess(np.abs(loss - expected)[~round_ones].max(), 2e-4)


if __name__ == "__main__":
    torch.set_num_threads(1)
    unittest.main()
