# SPDX-License-Identifier: BSD-3-Clause
"""Held-out losses of the published ellipse network, on the ellipse paper's distribution.

    python scripts/train/evaluate.py models/ellipse_vgg.onnx
"""

import argparse

import numpy as np
import torch

import dataset
from network import EllipseVgg

# What no estimator can go below on this distribution (posterior sampling of the known generative model, 1,500
# samples), and what the paper prints for VGG-Net on its own test set.
FLOOR_ORDERED_M, FLOOR_ORDERED_SIGMA_M = 0.048, 0.002
FLOOR_SYMMETRIC_M, FLOOR_SYMMETRIC_SIGMA_M = 0.0375, 0.001
PRINTED_ORDERED_M = 0.01408

BATCH = 200


def characteristic_distances(a, b):
    """Eq. 1 for each row of ellipses (t_x, t_y, psi, rx, ry): pairing the points in order, and the better of the two
    pairings that a rotation by pi leaves open."""

    def axes(ellipse):
        cos, sin = np.cos(ellipse[:, 2]), np.sin(ellipse[:, 2])
        return (ellipse[:, 3] * np.stack((cos, sin)), ellipse[:, 4] * np.stack((-sin, cos)))

    offset = (a[:, :2] - b[:, :2]).T

    def pairing(sign):
        return sum(
            np.hypot(*(offset + side * (axis_a - sign * axis_b)))
            for axis_a, axis_b in zip(axes(a), axes(b))
            for side in (1, -1)
        ) / 4

    return pairing(1), np.minimum(pairing(1), pairing(-1))


def ellipses_in_sensor_frame(answers, samples, which):
    """Ellipses as the paper writes them, from the network's answers in each segment's own frame."""
    x, y, m, p, q = answers.astype(float).T
    azimuth = samples.middle_azimuth_rad[which]
    x = x + samples.mean_range_m[which]
    cos, sin = np.cos(azimuth), np.sin(azimuth)
    half_difference = np.hypot(p, q)
    psi = np.arctan2(q, p) / 2 + azimuth
    psi = np.remainder(psi + np.pi / 2, np.pi) - np.pi / 2
    rx, ry = m + half_difference, np.maximum(m - half_difference, 0.0)
    return np.stack((cos * x - sin * y, sin * x + cos * y, psi, rx, ry), axis=1)


def answers(network, samples, which):
    """The network's answers, through the whole input vector."""
    with torch.no_grad():
        full = torch.from_numpy(samples.inputs(which, dataset.MIDDLE))
        return network(full[:, None, None]).numpy()


def evaluate(network, random, n, near_fraction=0.0):
    """Mean losses with standard errors, over n samples drawn with `random`, and by number of hits and distance."""
    samples = dataset.sample(random, n, near_fraction)
    ordered, symmetric = [], []
    for start in range(0, n, BATCH):
        which = np.arange(start, min(start + BATCH, n))
        estimates = ellipses_in_sensor_frame(answers(network, samples, which), samples, which)
        losses = characteristic_distances(estimates, samples.ellipses[which])
        ordered.append(losses[0])
        symmetric.append(losses[1])
    ordered, symmetric = np.concatenate(ordered), np.concatenate(symmetric)
    distance = np.hypot(samples.ellipses[:, 0], samples.ellipses[:, 1])
    strata = {
        "all": np.ones(n, bool),
        "under 10 hits": samples.counts < 10,
        "10 to 30 hits": (samples.counts >= 10) & (samples.counts <= 30),
        "over 30 hits": samples.counts > 30,
        "centre under 2 m": distance < 2,
        "centre 2 to 4 m": (distance >= 2) & (distance < 4),
        "centre 4 to 7 m": (distance >= 4) & (distance < 7),
        "centre over 7 m": distance >= 7,
    }
    table = []
    print(f"{n} samples   mean loss in m (ordered, symmetric), standard error of the symmetric one")
    for name, rows in strata.items():
        if rows.sum() < 2:
            continue
        error = symmetric[rows].std() / np.sqrt(rows.sum())
        table.append((name, int(rows.sum()), ordered[rows].mean(), symmetric[rows].mean(), error))
        print(f"{name:18s} {table[-1][1]:7d}  {table[-1][2]:.4f}  {table[-1][3]:.4f} +- {error:.4f}")
    print(f"floor (cited), ordered {FLOOR_ORDERED_M:.4f} +- {FLOOR_ORDERED_SIGMA_M:.4f}")
    print(f"floor (cited), symmetric {FLOOR_SYMMETRIC_M:.4f} +- {FLOOR_SYMMETRIC_SIGMA_M:.4f}")
    print(f"paper, printed, ordered {PRINTED_ORDERED_M:.5f}")
    return table


def load(onnx_path):
    """The published network as a PyTorch module, its weights read from the ONNX file."""
    import onnx
    from onnx import numpy_helper

    tensors = {t.name: numpy_helper.to_array(t).copy() for t in onnx.load(onnx_path).graph.initializer}
    network = EllipseVgg()
    network.load_state_dict({name: torch.from_numpy(tensors[name]) for name in network.state_dict()})
    return network


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("onnx")
    parser.add_argument("--samples", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--near-fraction", type=float, default=0.0, help="0 is the paper's distribution")
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    random = np.random.default_rng((arguments.seed, 1))  # training draws from (seed, 0)
    evaluate(load(arguments.onnx), random, arguments.samples, arguments.near_fraction)


if __name__ == "__main__":
    main()
