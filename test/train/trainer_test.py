# SPDX-License-Identifier: BSD-3-Clause
"""Tests of the trainer, on a network of a few numbers, for a Python that has scripts/train/requirements.txt:

    python test/train/trainer_test.py
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np
import torch
from torch import nn

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "scripts" / "train"))

import trainer  # noqa: E402


class LineTask:
    """Learn y = 2 x - 1, with dropout, so that PyTorch's own random numbers matter too."""

    name, unit, batch = "line", "m", 16

    def __init__(self):
        torch.manual_seed(3)
        self.network = nn.Sequential(nn.Linear(1, 8), nn.ReLU(), nn.Dropout(0.05), nn.Linear(8, 1))
        self.seen = []

    def batches(self, seed, first_step, steps):
        for step in range(first_step, steps):
            x = np.random.default_rng((*np.atleast_1d(seed), step))
            yield torch.from_numpy(x.normal(size=(self.batch, 1)).astype(np.float32))

    def loss(self, batch, progress):
        self.seen.append(batch[0].item())
        return (self.network(batch) - (2 * batch - 1)).square().mean()


def weights(network):
    return torch.cat([parameter.detach().flatten() for parameter in network.parameters()])


class TrainerTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.options = trainer.Options(steps=300, seed=5, peak_learning_rate=1e-2, ema=0.9)

    def test_learns_the_line(self):
        _, loss = trainer.train(LineTask(), self.options, self.folder.name)
        self.assertLess(loss, 0.3)  # of a variance of 4: dropout leaves some

    def test_resumed_run_gives_the_weights_of_an_uninterrupted_one(self):
        whole, again = LineTask(), LineTask()
        trainer.train(whole, self.options, self.folder.name)
        trainer.train(again, self.options, self.folder.name)
        self.assertTrue(torch.equal(weights(whole.network), weights(again.network)))
        with self.assertRaises(SystemExit):
            trainer.train(LineTask(), self.options, self.folder.name, stop_after=120)
        resumed = LineTask()
        nn.init.zeros_(resumed.network[0].weight)  # nothing of it may remain
        trainer.train(resumed, self.options, self.folder.name, resume=True)
        self.assertEqual(resumed.seen, whole.seen[120:])
        self.assertTrue(torch.equal(weights(whole.network), weights(resumed.network)))

    def test_refuses_the_checkpoint_of_another_run(self):
        trainer.train(LineTask(), self.options, self.folder.name)
        with self.assertRaisesRegex(ValueError, "seed 5"):
            trainer.train(LineTask(), trainer.Options(steps=300, seed=6, peak_learning_rate=1e-2, ema=0.9),
                          self.folder.name, resume=True)

    def test_writes_the_curve(self):
        trainer.train(LineTask(), self.options, self.folder.name)
        rows = (pathlib.Path(self.folder.name) / "line.csv").read_text().split()
        self.assertEqual(rows[0], "samples,learning_rate,loss_m")
        self.assertEqual(int(rows[-1].split(",")[0]), 300 * LineTask.batch)
        self.assertGreater((pathlib.Path(self.folder.name) / "line.png").stat().st_size, 1000)

    def test_learning_rate_is_one_cycle(self):
        rates = np.array([trainer.learning_rate(step, self.options) for step in range(300)])
        self.assertAlmostEqual(rates.max(), 1e-2, places=6)
        self.assertEqual(rates.argmax(), 30)
        self.assertTrue((np.diff(rates[:31]) > 0).all() and (np.diff(rates[30:]) < 0).all())
        self.assertLess(rates[-1], 1e-6)

    def test_two_processes_draw_different_samples_and_keep_the_same_weights(self):
        command = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2", "--master-port", "29611",
                   __file__, "--process", self.folder.name]
        environment = os.environ | {"OMP_NUM_THREADS": "1", "CUDA_VISIBLE_DEVICES": ""}
        subprocess.run(command, check=True, env=environment, timeout=120, capture_output=True)
        states = [torch.load(pathlib.Path(self.folder.name) / f"rank{rank}.pt") for rank in (0, 1)]
        self.assertTrue(torch.equal(states[0]["weights"], states[1]["weights"]))
        self.assertEqual(len(set(states[0]["seen"]) & set(states[1]["seen"])), 0)
        self.assertLess(states[0]["loss"], 0.3)


def one_of_two_processes(folder):
    task, processes = LineTask(), trainer.join_processes()
    with torch.no_grad():
        task.network[0].bias.add_(processes.rank)  # the first one's weights count
    _, loss = trainer.train(task, trainer.Options(steps=300, seed=5, peak_learning_rate=1e-2), folder, processes)
    torch.save({"weights": weights(task.network), "seen": task.seen, "loss": loss},
               pathlib.Path(folder) / f"rank{processes.rank}.pt")
    torch.distributed.destroy_process_group()


if __name__ == "__main__":
    torch.set_num_threads(1)
    if "--process" in sys.argv:
        one_of_two_processes(sys.argv[-1])
    else:
        unittest.main()
