# SPDX-License-Identifier: BSD-3-Clause
"""The package's shape network: ellipse, box or other, and the box if it is one (docs/math/detections.md; the C++ side is
detections/shape_network.cpp)."""

import torch
from torch.nn import functional

from segment_network import BOX_TRUTH, CASE, INPUTS, IS_BOX, IS_ELLIPSE, ORIENTATION, SHARED_OUTPUTS, SegmentTask, draw

CLASSES = slice(SHARED_OUTPUTS, SHARED_OUTPUTS + 3)  # logits of ellipse, box, other
DIRECTION = slice(CLASSES.stop, CLASSES.stop + 2)  # (cos 4 psi, sin 4 psi) of the box, shorter where uncertain
CLASSES_WEIGHT, DIRECTION_WEIGHT = 2.0, 0.5


def class_of(rows):
    """0, 1, 2 for ellipse, box, other."""
    return torch.where(rows[:, IS_ELLIPSE] > 0.5, 0, torch.where(rows[:, IS_BOX] > 0.5, 1, 2))


class ShapeTask(SegmentTask):
    name, output_name, outputs = "shape", "shape", DIRECTION.stop
    truth, described = BOX_TRUTH, IS_BOX
    # Only the first has all classes, in the proportions that the probabilities assume.
    mix = {"shapes": 0.5, "boxes": 0.4, "faces": 0.1}
    second_mix = {"shapes": 0.4, "boxes": 0.5, "faces": 0.1}
    typical = "shapes"
    measured = ("boxes", "faces", "shapes")

    def of_own(self, answer, rows):
        is_box = rows[:, IS_BOX]
        error = (answer[:, DIRECTION] - rows[:, ORIENTATION]).square().sum(1)
        mixed = rows[:, CASE] == 0
        classes = functional.cross_entropy(answer[mixed][:, CLASSES], class_of(rows[mixed]))
        return DIRECTION_WEIGHT * (error * is_box).sum() / is_box.sum() + CLASSES_WEIGHT * classes

    def measure(self, network, random, n=20_000):
        """Of the estimate, as for every network; then of the classes, on as many samples of the mixture."""
        figures = super().measure(network, random, n)
        rows = torch.from_numpy(draw("shapes", int(random.integers(1 << 62)), n).copy())
        with torch.no_grad():
            logits = network(rows[:, :INPUTS])[:, CLASSES]
        truth = class_of(rows)
        return figures | {
            "shapes_cross_entropy": functional.cross_entropy(logits, truth).item(),
            "shapes_right": (logits.argmax(1) == truth).double().mean().item(),
        }
