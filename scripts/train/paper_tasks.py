# SPDX-License-Identifier: BSD-3-Clause
"""Training of the papers' networks: their losses, and tasks for trainer.py."""

import numpy as np
import torch

import dataset
from paper_networks import ALEX, CIRCLE, VGG, Trainee, Window, inputs, windows

BATCH = 256
CHUNK = 100  # batches drawn at once
TINY = 1e-10  # under square roots, in m^2
PARTS_UNTIL = 0.5  # progress at which the parts of the ellipse cease to be trained each by itself
CENTER_SHARE = 0.1  # of the centre in the beginning: its gradient would drown the shape's
SHAPE_SCALE_M = 0.01
SHAPE_WEIGHT = 3.0  # of a circle's radius until PRINTED_FROM
LEAK = 0.1  # slope of the radii's ReLU below zero, in the same time
PRINTED_FROM = 0.7  # progress from which circles are trained with the printed loss, not its root
FLOAT32_FROM = 0.85  # progress from which all products are in single precision


def axes_of(ellipse):
    """rx and ry times the unit vectors of the axes, for rows (t_x, t_y, psi, rx, ry)."""
    cos, sin = torch.cos(ellipse[:, 2]), torch.sin(ellipse[:, 2])
    return ellipse[:, 3:4] * torch.stack((cos, sin), 1), ellipse[:, 4:5] * torch.stack((-sin, cos), 1)


def smooth_of(ellipse):
    """(rx + ry) / 2 and (rx - ry) / 2 (cos 2 psi, sin 2 psi), for rows (t_x, t_y, psi, rx, ry): without jumps."""
    psi, rx, ry = ellipse[:, 2], ellipse[:, 3], ellipse[:, 4]
    half = (rx - ry) / 2
    return torch.stack(((rx + ry) / 2, half * torch.cos(2 * psi), half * torch.sin(2 * psi)), 1)


def ellipse_losses(center, axes, true_center, true_axes):
    """Eq. 1 of the ellipse paper for each row: with the four points paired in order, as printed, and with the better
    of the two pairings that a rotation of the ellipse by pi leaves open."""
    offset = center - true_center

    def pairing(sign):
        return sum(
            torch.sqrt((offset + side * (axis - sign * true)).square().sum(1) + TINY)
            for axis, true in zip(axes, true_axes)
            for side in (1, -1)
        ) / 4

    ordered = pairing(1)
    return ordered, torch.minimum(ordered, pairing(-1))


def circle_losses(answer, truth):
    """Eq. 7 of the circle paper for each row (t_x, t_y, r): the mean over the four points at t + r (+-1, 0) and
    t + r (0, +-1) of their squared distance, in which the mixed terms cancel."""
    return (answer - truth).square().sum(1)


class PaperTask:
    """One of the papers' networks for trainer.train()."""

    batch = BATCH
    ema = 0.0

    def __init__(self, design, seed=1, precision="float32"):
        torch.manual_seed(seed)
        self.design, self.name = design, design.name
        self.network = Trainee(design)
        self.precision = getattr(torch, precision)
        self.circles = design is CIRCLE
        self.unit = "m2" if self.circles else "m"
        self.peak_learning_rate = 5e-4
        self.input_name, self.output_name = "ranges", "circle" if self.circles else "ellipse"
        self.shape, self.outputs, self.fill = (1, 1, dataset.BEAMS), sum(design.outputs), design.fill
        self.parameters = design.parameters

    def sample(self, random, n):
        return (dataset.sample_circles if self.circles else dataset.sample_ellipses)(random, n)

    def batches(self, seed, first_step, steps):
        """Chunks of samples are drawn with (seed, 0, index of the chunk); evaluation draws with (seed, 1)."""
        step = first_step
        while step < steps:
            chunk = step // CHUNK
            samples = self.sample(np.random.default_rng((*np.atleast_1d(seed), 0, chunk)), CHUNK * BATCH)
            for step in range(step, min(steps, (chunk + 1) * CHUNK)):
                yield samples, np.arange(BATCH) + step % CHUNK * BATCH
            step += 1

    def loss(self, batch, progress):
        samples, which = batch
        network, device = self.network, self.network.waves.device
        prepared = network.prepare(self.precision if progress < FLOAT32_FROM else torch.float32)
        places, parts = zip(*windows(self.design, network.total_stride, samples, which))
        parts = [(len(rows), Window(*(part.to(device) for part in window))) for rows, window in zip(places, parts)]
        hidden = network.hidden(parts, prepared)
        truth = torch.from_numpy(samples.ellipses[which[np.concatenate(places)]].astype(np.float32)).to(device)
        answer = network.published.answer(hidden, LEAK if progress < PARTS_UNTIL + 0.1 else 0.0)
        if self.circles:
            truth = truth[:, [0, 1, 3]]
            squared = circle_losses(answer, truth)
            printed = min(1.0, max(0.0, (progress - PRINTED_FROM) / 0.1))
            rooted = torch.sqrt(squared + TINY) + SHAPE_WEIGHT * (answer[:, 2] - truth[:, 2]).abs()
            return (printed * squared + (1 - printed) * rooted).mean()
        true_center, true_axes = truth[:, :2], axes_of(truth)
        printed = min(1.0, max(0.0, (progress - PARTS_UNTIL) / 0.2))
        loss = ellipse_losses(answer[:, :2], axes_of(answer), true_center, true_axes)[0].mean()
        if printed == 1:
            return loss
        smooth = network.smooth(hidden)
        distances = [(part[:, :2] - true_center).square().sum(1) for part in (answer, smooth)]
        center = sum(torch.sqrt(squared + TINY).mean() for squared in distances)
        radii = (answer[:, 3:] - truth[:, 3:]).abs().sum(1).mean()
        turned = axes_of(torch.cat((truth[:, :2], answer[:, 2:3], truth[:, 3:]), 1))
        axis = ellipse_losses(true_center, turned, true_center, true_axes)[0].mean()
        shape = (smooth[:, 2:] - smooth_of(truth)).square().sum(1).mean()
        center_share = min(1.0, max(CENTER_SHARE, (progress - 0.2) / 0.2))
        parts = center_share * center + radii + axis + shape / SHAPE_SCALE_M
        return printed * loss + (1 - printed) * parts

    def published(self):
        return self.network.fold()

    def golden_input(self):
        """One near object, so that it has many hits."""
        samples = self.sample(np.random.default_rng(2020), 1000)
        distance = np.hypot(*samples.ellipses[:, :2].T)
        return inputs(self.design, samples, np.array([np.abs(distance - 2).argmin()]))

    def measure(self, network, random, n=20_000):
        """Losses of `network`, the printed one, on n fresh samples, through the whole input vector: {name: figure}."""
        samples = self.sample(random, n)
        answers = []
        with torch.no_grad():
            for which in np.array_split(np.arange(n), max(1, n // 200)):
                answers.append(network(torch.from_numpy(inputs(self.design, samples, which))[:, None, None]).double())
        answer, truth = torch.cat(answers), torch.from_numpy(samples.ellipses)
        if self.circles:
            truth = truth[:, [0, 1, 3]]
            columns = {"loss_m2": circle_losses(answer, truth), "mse_m2": (answer - truth).square().mean(1),
                       "mae_m": (answer - truth).abs().mean(1)}
        else:
            losses = ellipse_losses(answer[:, :2], axes_of(answer), truth[:, :2], axes_of(truth))
            columns = dict(zip(("ordered_m", "symmetric_m"), losses))
        figures = {"samples": n}
        for name, column in columns.items():
            kind, unit = name.split("_")
            figures |= {name: column.mean().item(), f"{kind}_error_{unit}": (column.std() / n**0.5).item()}
        return figures


def vgg(seed, precision):
    return PaperTask(VGG, seed, precision)


def alex(seed, precision):
    return PaperTask(ALEX, seed, precision)


def circle(seed, precision):
    return PaperTask(CIRCLE, seed, precision)
