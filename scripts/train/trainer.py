# SPDX-License-Identifier: BSD-3-Clause
"""Train any network that a small task object describes: resumable, on a CPU or GPU, alone or under torchrun.

A task has

    name      of its files, "<name>.checkpoint.pt" and so on
    network   an nn.Module; it is moved to the device and holds all that is trained
    batch     samples in one batch
    unit      of its loss, for people
    batches(seed, first_step, steps)   iterates over the batches first_step ... steps - 1; batch i depends on (seed, i)
                                       alone, so that a resumed run sees what an uninterrupted one would have seen
    loss(batch, progress)              mean loss of one batch, a scalar; progress grows from 0 to 1 over the run

The same task and `Options` give the same weights on one machine, bit for bit, whether the run was interrupted or not.
Under torchrun the gradients are averaged over the processes, whose samples come from different seeds:

    torchrun --nproc-per-node 2 scripts/train/train.py vgg
"""

import csv
import math
import os
import pathlib
import signal
import time
from dataclasses import asdict, dataclass
from typing import Any, Iterator, Protocol

import numpy as np
import torch
from torch import distributed, nn
from tqdm import tqdm

CURVE_POINTS = 500  # of the loss curve at most
EMA_START = 10  # the average forgets the first steps: its decay is at most (1 + step) / (EMA_START + step)


class Task(Protocol):
    name: str
    network: nn.Module
    batch: int
    unit: str

    def batches(self, seed: Any, first_step: int, steps: int) -> Iterator: ...

    def loss(self, batch: Any, progress: float) -> torch.Tensor: ...


@dataclass
class Options:
    steps: int
    seed: int = 1
    peak_learning_rate: float = 1e-3
    weight_decay: float = 0.01
    warm_up: float = 0.1  # share of the steps before the peak
    clip: float = 1.0  # norm of the gradient
    ema: float = 0.0  # decay of the averaged weights; 0: none


@dataclass
class Processes:
    """This process's place among those that torchrun started; one process without it."""

    rank: int = 0
    size: int = 1
    device: torch.device = torch.device("cpu")


def join_processes() -> Processes:
    """To be called once, before train()."""
    rank, size = int(os.environ.get("RANK", 0)), int(os.environ.get("WORLD_SIZE", 1))
    device = torch.device("cpu")
    if torch.cuda.is_available():
        device = torch.device("cuda", int(os.environ.get("LOCAL_RANK", 0)))
        torch.cuda.set_device(device)
    if size > 1:
        distributed.init_process_group("nccl" if device.type == "cuda" else "gloo")
    return Processes(rank, size, device)


def learning_rate(step, options):
    """One cycle of cosines: from a 25th of the peak up to it and down to nearly 0."""

    def cosine(start, end, share):
        return end + (start - end) * (1 + math.cos(math.pi * share)) / 2

    peak, rise = options.peak_learning_rate, max(1.0, options.warm_up * options.steps)
    if step < rise:
        return cosine(peak / 25, peak, step / rise)
    return cosine(peak, peak / 25e4, (step - rise) / max(1.0, options.steps - 1 - rise))


def checkpoint_path(folder, name):
    return pathlib.Path(folder) / f"{name}.checkpoint.pt"


class _Run:
    """The state of the training, with storage."""

    def __init__(self, task, options, processes):
        self.task, self.options, self.processes = task, options, processes
        task.network.to(processes.device)
        self.parameters = [p for p in task.network.parameters() if p.requires_grad]
        self.optimizer = torch.optim.AdamW(
            self.parameters, lr=options.peak_learning_rate, weight_decay=options.weight_decay, fused=True
        )
        self.average = None
        self.step = 0
        self.seconds = 0.0
        self.losses = torch.zeros(options.steps, device=processes.device)
        if processes.size > 1:
            for tensor in task.network.state_dict().values():
                distributed.broadcast(tensor, 0)
        if options.ema > 0:
            self.average = [p.detach().clone() for p in self.parameters]

    def save(self, path):
        state = {
            "options": asdict(self.options), "processes": self.processes.size, "step": self.step,
            "seconds": self.seconds, "network": self.task.network.state_dict(),
            "optimizer": self.optimizer.state_dict(), "average": self.average, "losses": self.losses[: self.step],
        }
        beside = path.with_suffix(".part")  # so that an interruption never leaves half a checkpoint
        torch.save(state, beside)
        os.replace(beside, path)

    def load(self, path):
        state = torch.load(path, map_location=self.processes.device, weights_only=True)
        wanted = asdict(self.options) | {"processes": self.processes.size}
        stored = state["options"] | {"processes": state["processes"]}
        different = sorted(name for name in wanted if wanted[name] != stored.get(name))
        if different:
            raise ValueError(f"{path} is of another run: {', '.join(f'{n} {stored.get(n)}' for n in different)}")
        self.task.network.load_state_dict(state["network"])
        self.optimizer.load_state_dict(state["optimizer"])
        if self.average is not None:
            self.average = state["average"]
        self.step, self.seconds = state["step"], state["seconds"]
        self.losses[: self.step] = state["losses"]

    def advance(self, batch, stop):
        """One step; true if any process asked to stop."""
        options, processes = self.options, self.processes
        # A task's random numbers from PyTorch depend only on the step, so no generator has to be stored.
        torch.manual_seed((options.seed * processes.size + processes.rank) * 1_000_003 + self.step)
        for group in self.optimizer.param_groups:
            group["lr"] = learning_rate(self.step, options)
        loss = self.task.loss(batch, self.step / options.steps)
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        loss = loss.detach()
        if processes.size > 1:
            loss, stop = self._average_over_processes(loss, stop)
        torch.nn.utils.clip_grad_norm_(self.parameters, options.clip)
        self.optimizer.step()
        self.losses[self.step] = loss
        self.step += 1
        if self.average is not None:
            decay = min(options.ema, (1 + self.step) / (EMA_START + self.step))
            torch._foreach_lerp_(self.average, [p.detach() for p in self.parameters], 1 - decay)
        return stop

    def _average_over_processes(self, loss, stop):
        gradients = [p.grad if p.grad is not None else torch.zeros_like(p) for p in self.parameters]
        flat = torch.cat([g.flatten() for g in gradients] + [loss.new_tensor([loss, stop])])
        distributed.all_reduce(flat)
        flat /= self.processes.size
        for parameter, part in zip(self.parameters, flat.split([p.numel() for p in self.parameters] + [2])):
            parameter.grad = part.view_as(parameter)
        return flat[-2], flat[-1].item() > 0

    def finish(self):
        """Leave the averaged weights in the network, where there are any."""
        if self.average is not None:
            with torch.no_grad():
                for parameter, average in zip(self.parameters, self.average):
                    parameter.copy_(average)


def train(task, options, folder, processes=Processes(), resume=False, checkpoint_minutes=2.0, stop_after=None):
    """Train task.network in place. Returns (minutes spent, mean loss of the last twentieth of the steps).

    Files in `folder`: a checkpoint every `checkpoint_minutes` and at the end, the loss curve as .csv and .png.
    SIGINT and SIGTERM end the run after the step in hand, with a checkpoint, by SystemExit; so does `stop_after`, a
    number of steps.
    """
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    path = checkpoint_path(folder, task.name)
    run = _Run(task, options, processes)
    if resume:
        run.load(path)
    first = processes.rank == 0
    signals = []
    handlers = {s: signal.signal(s, lambda number, _: signals.append(number)) for s in (signal.SIGINT, signal.SIGTERM)}
    started, saved = time.monotonic() - run.seconds, time.monotonic()
    seed = options.seed if processes.size == 1 else (options.seed, processes.rank)
    progress = tqdm(
        task.batches(seed, run.step, options.steps), initial=run.step, total=options.steps, unit="batch",
        mininterval=5, desc=task.name, disable=not first,
    )
    try:
        for batch in progress:
            stop = run.advance(batch, bool(signals)) or run.step == stop_after
            run.seconds = time.monotonic() - started
            if run.step % 100 == 0:
                recent = run.losses[max(0, run.step - 1000) : run.step].mean().item()
                if not math.isfinite(recent):
                    raise FloatingPointError(f"the loss of {task.name} is {recent} at step {run.step}")
                progress.set_postfix_str(f"loss {recent:.5f} {task.unit}", refresh=False)
            if first and (stop or time.monotonic() - saved > 60 * checkpoint_minutes):
                run.save(path)
                saved = time.monotonic()
            if stop and run.step < options.steps:
                raise SystemExit(f"stopped after step {run.step} of {options.steps}; --resume goes on")
    finally:
        progress.close()
        for number, handler in handlers.items():
            signal.signal(number, handler)
    losses = run.losses.cpu().numpy()
    if first:
        run.save(path)
        write_curve(folder, task, options, losses, processes.size)
    run.finish()
    return run.seconds / 60, float(losses[-max(1, options.steps // 20) :].mean())


def write_curve(folder, task, options, losses, processes=1):
    """The loss over the samples, in means over intervals, as <name>.csv and <name>.png."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    bounds = np.unique(np.linspace(0, len(losses), min(len(losses), CURVE_POINTS) + 1).astype(int))
    samples = bounds[1:] * task.batch * processes
    means = [losses[a:b].mean() for a, b in zip(bounds[:-1], bounds[1:])]
    with open(pathlib.Path(folder) / f"{task.name}.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("samples", "learning_rate", f"loss_{task.unit}"))
        for end, n, mean in zip(bounds[1:], samples, means):
            writer.writerow((n, f"{learning_rate(end - 1, options):.6g}", f"{mean:.6g}"))
    figure, axes = pyplot.subplots(figsize=(7, 4), layout="constrained")
    axes.plot(samples, means)
    axes.set_yscale("log" if min(means) > 0 else "linear")
    axes.set(xlabel="samples", ylabel=f"training loss in {task.unit}", title=task.name)
    axes.grid(True, which="both", alpha=0.3)
    figure.savefig(pathlib.Path(folder) / f"{task.name}.png", dpi=120)
    pyplot.close(figure)


def steps_in(minutes, task, seed=0, timed=30):
    """The number of steps in that time, estimated by a few forward and backward passes."""
    start = None
    for i, batch in enumerate(task.batches(seed, 0, timed + 5)):
        start = time.monotonic() if i == 5 else start
        task.loss(batch, 0.0).backward()
    task.network.zero_grad(set_to_none=True)
    return max(2, int(minutes * 60 / ((time.monotonic() - start) * 1.1) * timed))
