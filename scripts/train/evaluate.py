# SPDX-License-Identifier: BSD-3-Clause
"""Losses of a published network of the papers, on fresh samples of its paper's distribution.

    python scripts/train/evaluate.py vgg models/paper_vgg.onnx
"""

import argparse

import numpy as np
import torch

import paper_tasks
import publish


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task", choices=("vgg", "alex", "circle"))
    parser.add_argument("onnx")
    parser.add_argument("--samples", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    task = getattr(paper_tasks, arguments.task)(arguments.seed, "float32")
    network = publish.load(task.published(), arguments.onnx).eval()
    figures = task.measure(network, np.random.default_rng((arguments.seed, 1)), arguments.samples)
    for name, figure in figures.items():
        print(f"{name:20s} {figure:.6g}")


if __name__ == "__main__":
    main()
