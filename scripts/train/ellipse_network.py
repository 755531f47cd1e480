# SPDX-License-Identifier: BSD-3-Clause
"""The package's ellipse network: one ellipse, its covariance, and whether the segment is one (docs/math/detections.md;
the C++ side is detections/network.cpp)."""

from torch.nn import functional

from segment_network import IS_ELLIPSE, SHARED_OUTPUTS, TRUTH, SegmentTask

OUTPUTS = SHARED_OUTPUTS + 1  # the logit of "one ellipse"
IS_ELLIPSE_WEIGHT = 0.3


class EllipseTask(SegmentTask):
    name, output_name, outputs = "ellipse", "ellipse", OUTPUTS
    truth, described = TRUTH, IS_ELLIPSE
    mix = {"ellipse": 0.4, "occluded": 0.15, "product": 0.45}
    # Near objects are rare in the papers' data, and the rough outlines of `product` would inflate their covariance, too.
    second_mix = {"ellipse": 0.6, "occluded": 0.3, "product": 0.1}
    typical = "product"
    measured = ("ellipse", "occluded")

    def of_own(self, answer, rows):
        return IS_ELLIPSE_WEIGHT * functional.binary_cross_entropy_with_logits(answer[:, -1], rows[:, IS_ELLIPSE])
