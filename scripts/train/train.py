# SPDX-License-Identifier: BSD-3-Clause
"""Train the ellipse network and publish it: ONNX file, manifest with golden vector, measured losses.

    python scripts/train/train.py --samples 1800000 --precision bfloat16 --output models

The same arguments give the same weights on the same machine. Nothing of this is needed to build or run the package.
"""

import argparse
import pathlib
import time

import numpy as np
import torch
from torch.nn import functional
from tqdm import tqdm

import dataset
import publish
from evaluate import evaluate
from network import EllipseVgg, symmetric_loss

BATCH = 256
CHUNK = 100 * BATCH  # samples drawn at once
HALF_WIDTHS = (28, 80, 200, dataset.MIDDLE)  # of the windows: a batch is split by the smallest that fits
MIN_GROUP = 8  # fewer samples of one width than this join the next wider ones
ROW_MULTIPLE = 16  # empty rows are added up to it: PyTorch prepares bfloat16 products anew for every new shape
PEAK_LEARNING_RATE = 1e-3
WEIGHT_DECAY = 0.01


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=1_800_000, help="training samples, each seen once")
    parser.add_argument("--minutes", type=float, help="instead of --samples: as many as fit, by a timed start")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1, help="of PyTorch")
    parser.add_argument("--near-fraction", type=float, default=0.5, help="samples drawn uniformly in distance")
    parser.add_argument(
        "--precision", choices=("float32", "bfloat16"), default="float32",
        help="of the convolutions; bfloat16 is faster where the processor has it",
    )
    parser.add_argument("--peak-learning-rate", type=float, default=PEAK_LEARNING_RATE)
    parser.add_argument("--output", type=pathlib.Path, default=pathlib.Path("models"))
    return parser.parse_args()


def groups_by_width(half_widths):
    """Split a batch: (indices, half width of the window) with every sample in one group that it fits in."""
    waiting = np.empty(0, int)
    for low, high in zip((-1,) + HALF_WIDTHS, HALF_WIDTHS):
        waiting = np.concatenate((waiting, np.flatnonzero((half_widths > low) & (half_widths <= high))))
        if len(waiting) >= MIN_GROUP or (len(waiting) > 0 and half_widths.max() <= high):
            yield waiting, high
            waiting = np.empty(0, int)


def batch_loss(network, samples, batch, precision):
    """Mean symmetric loss of the samples `batch`."""
    shared = network.prepare(getattr(torch, precision))
    answers, truths = [], []
    for rows, half_width in groups_by_width(samples.half_widths()[batch]):
        window = torch.from_numpy(samples.inputs(batch[rows], half_width))
        window = functional.pad(window, (0, 0, 0, -len(rows) % ROW_MULTIPLE))
        answers.append(network.forward_window(window, shared)[: len(rows)])
        truths.append(torch.from_numpy(samples.targets(batch[rows])))
    return symmetric_loss(torch.cat(answers), torch.cat(truths)).mean()


def batches(random, n, near_fraction):
    """n batches of (samples, indices)."""
    while True:
        samples = dataset.sample(random, CHUNK, near_fraction)
        for start in range(0, CHUNK, BATCH):
            if n == 0:
                return
            n -= 1
            yield samples, np.arange(start, start + BATCH)


def samples_in(minutes, arguments):
    """How many samples are trained with in that time, judged by 30 batches without the optimiser and new samples."""
    network = EllipseVgg()
    n, start = 30, None
    for i, (samples, batch) in enumerate(batches(np.random.default_rng(0), n + 3, arguments.near_fraction)):
        start = time.monotonic() if i == 3 else start
        batch_loss(network, samples, batch, arguments.precision).backward()
    return int(minutes * 60 / (time.monotonic() - start) * n * BATCH / 1.15)


def train(arguments):
    torch.manual_seed(arguments.seed)
    network = EllipseVgg()
    optimizer = torch.optim.AdamW(
        network.parameters(), lr=arguments.peak_learning_rate, weight_decay=WEIGHT_DECAY, fused=True
    )
    steps = max(2, arguments.samples // BATCH)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, arguments.peak_learning_rate, total_steps=steps, pct_start=0.1, cycle_momentum=False
    )
    random = np.random.default_rng((arguments.seed, 0))  # evaluation draws from (seed, 1)
    progress = tqdm(batches(random, steps, arguments.near_fraction), total=steps, unit="batch", mininterval=5)
    recent = None
    for samples, batch in progress:
        loss = batch_loss(network, samples, batch, arguments.precision)
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        schedule.step()
        recent = loss.item() if recent is None else 0.99 * recent + 0.01 * loss.item()
        progress.set_postfix_str(f"loss {recent:.4f} m", refresh=False)
    return network


def main():
    arguments = parse_arguments()
    torch.set_num_threads(arguments.threads)
    if arguments.minutes:
        arguments.samples = samples_in(arguments.minutes, arguments)
        print(f"{arguments.samples} samples in {arguments.minutes} minutes")
    start = time.monotonic()
    network = train(arguments)
    minutes = (time.monotonic() - start) / 60
    print(f"trained with {arguments.samples} samples in {minutes:.1f} minutes")
    losses = evaluate(network, np.random.default_rng((arguments.seed, 1)), 20_000)
    command = (
        f"scripts/train/train.py --samples {arguments.samples} --seed {arguments.seed} --threads {arguments.threads} "
        f"--near-fraction {arguments.near_fraction} --precision {arguments.precision} "
        f"--peak-learning-rate {arguments.peak_learning_rate}"
    )
    publish.publish(network, arguments.output, command=command, seed=arguments.seed, samples=arguments.samples,
                    losses=losses)


if __name__ == "__main__":
    main()
