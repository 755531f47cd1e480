# SPDX-License-Identifier: BSD-3-Clause
"""Train a network and publish it: ONNX file, manifest with a golden vector, measured losses.

    python scripts/train/train.py vgg --minutes 30 --precision bfloat16
    python scripts/train/train.py scoutnet --images training/images/town --samples 40000

The same arguments give the same weights on the same machine, also when a run is interrupted and taken up again with
--resume. Checkpoints and the loss curve go to --work. Nothing of this is needed to build or run the package.
"""

import argparse
import os
import pathlib
import shlex

# PyTorch keeps a prepared product for every shape that it has met; by default too few for all windows.
os.environ.setdefault("ONEDNN_PRIMITIVE_CACHE_CAPACITY", "8192")

import numpy as np  # noqa: E402
import torch  # noqa: E402

import ellipse_network  # noqa: E402
import label_networks  # noqa: E402
import paper_tasks  # noqa: E402
import publish  # noqa: E402
import shape_network  # noqa: E402
from trainer import Options, join_processes, steps_in, train  # noqa: E402

TASKS = {  # name: what makes the task from a seed and a precision
    "ellipse": ellipse_network.EllipseTask,
    "shape": shape_network.ShapeTask,
    "vgg": paper_tasks.vgg,
    "alex": paper_tasks.alex,
    "circle": paper_tasks.circle,
}


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task", choices=(*TASKS, *label_networks.NETWORKS))
    length = parser.add_mutually_exclusive_group()
    length.add_argument("--samples", type=int, default=2_000_000, help="training samples, each seen once")
    length.add_argument("--minutes", type=float, help="instead: as many as fit, judged by a timed start")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1, help="of PyTorch")
    parser.add_argument(
        "--precision", choices=("float32", "bfloat16"), default="float32",
        help="of the large products; bfloat16 is faster where the processor has it",
    )
    parser.add_argument("--peak-learning-rate", type=float, help="instead of the task's own")
    parser.add_argument("--initial", type=pathlib.Path, help="published network to start from (ellipse and shape)")
    images = parser.add_argument_group("networks of images")
    images.add_argument("--images", type=pathlib.Path, nargs="+", help="folders of scripts/train/image_scenes.py")
    images.add_argument("--width", type=float, help="of the layers, instead of the shipped one")
    images.add_argument("--hues", action="store_true", help="turn the hues of most samples")
    images.add_argument("--boxes", type=pathlib.Path, help="labels.json of photos, which are then half of the samples")
    images.add_argument("--box-scenes", nargs="+", default=[], help="of those photos")
    parser.add_argument("--resume", action="store_true", help="from the checkpoint of a run with the same arguments")
    parser.add_argument("--work", type=pathlib.Path, default=pathlib.Path("training"), help="checkpoints and curves")
    parser.add_argument("--name", help="of the files, instead of the task's")
    parser.add_argument("--output", type=pathlib.Path, default=pathlib.Path("models"))
    return parser.parse_args()


def make_task(arguments):
    if arguments.task in TASKS:
        return TASKS[arguments.task](arguments.seed, arguments.precision)
    if not arguments.images:
        raise SystemExit(f"{arguments.task} is trained on images: --images")
    return label_networks.LabelTask(
        arguments.task, arguments.seed, arguments.precision, arguments.images, arguments.width, arguments.boxes,
        arguments.box_scenes, arguments.hues,
    )


def main():
    arguments = parse_arguments()
    torch.set_num_threads(arguments.threads)
    processes = join_processes()
    task = make_task(arguments)
    task.name = arguments.name or task.name
    before = {}
    if arguments.initial:
        if not hasattr(task, "start_from"):
            raise SystemExit(f"{arguments.task} starts from nothing: --initial is for ellipse and shape")
        task.start_from(arguments.initial)
        manifest = arguments.initial.with_suffix(".manifest.yaml").read_text()
        before = {"after": manifest.split("  command: ")[1].split("\n")[0]}
    if arguments.minutes:
        if processes.size > 1 or arguments.resume:
            raise SystemExit("--minutes cannot be resumed or shared by processes: give the --samples that it printed")
        arguments.samples = task.batch * steps_in(arguments.minutes, task)
        print(f"--samples {arguments.samples} for {arguments.minutes} minutes")
    options = Options(
        steps=max(2, arguments.samples // (task.batch * processes.size)), seed=arguments.seed, ema=task.ema,
        peak_learning_rate=arguments.peak_learning_rate or task.peak_learning_rate,
    )
    minutes, _ = train(task, options, arguments.work, processes, arguments.resume)
    if processes.rank > 0:
        return
    if hasattr(task, "finish"):
        task.finish(arguments.seed)
    samples = options.steps * task.batch * processes.size
    command = (
        f"scripts/train/train.py {arguments.task} --samples {samples} --seed {arguments.seed} "
        f"--threads {arguments.threads} --precision {arguments.precision} "
        f"--peak-learning-rate {options.peak_learning_rate}"
    )
    if arguments.initial:
        command += f" --initial {arguments.initial}"
    if arguments.name:
        command += f" --name {arguments.name}"
    if arguments.images:
        command += f" --images {' '.join(map(str, arguments.images))}"
        command += f" --width {arguments.width}" if arguments.width else ""
        command += " --hues" if arguments.hues else ""
    if arguments.boxes:
        command += f" --boxes {arguments.boxes} --box-scenes {shlex.join(arguments.box_scenes)}"
    figures = task.measure(task.published().cpu().eval(), np.random.default_rng((arguments.seed, 1)))
    publish.publish(task, arguments.output, {
        "command": command, "seed": arguments.seed, "samples": samples, "minutes": round(minutes, 1), **before,
        "losses": figures,
    })


if __name__ == "__main__":
    main()
