// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include <Eigen/Cholesky>

#include "situation_awareness/detections/detector.hpp"
#include "support/lone_segments.hpp"

namespace situation_awareness {

/// Too few points for an ellipse, the same one repeatedly, points on a line along and across the line of sight, far
/// apart or beyond the range: each is refused or gives a finite detection with a covariance.
inline void expect_degenerate_segments_are_survived(Detector& detector) {
  const std::vector<std::vector<Eigen::Vector2d>> degenerate = {
      {{2.0, 1.0}},
      {{2.0, 1.0}, {2.0, 1.0}, {2.0, 1.0}},
      {{2.0, 1.0}, {2.0, 1.0}, {2.0, 1.0}, {2.0, 1.0}},
      {{2.0, -0.1}, {2.0, 0.1}},
      {{2.0, -0.1}, {2.0, 0.0}, {2.0, 0.1}},
      {{2.0, -0.2}, {2.0, -0.1}, {2.0, 0.0}, {2.0, 0.1}, {2.0, 0.2}},
      {{2.0, 0.0}, {2.1, 0.0}, {2.2, 0.0}},
      {{2.0, 0.0}, {2.1, 0.0}, {2.2, 0.0}, {2.3, 0.0}},
      {{2.0, -9.0}, {2.0, -3.0}, {2.0, 3.0}, {2.0, 9.0}},
      {{12.0, 0.0}, {12.0, 0.05}, {12.0, 0.1}, {12.0, 0.15}},
  };
  for (const auto& points_m : degenerate) {
    const Detections detections = detector.detect(lone_segment(points_m));
    EXPECT_EQ(detections.detections.size() + detections.refused.size(), 1U);
    for (const Detection& detection : detections.detections) {
      EXPECT_TRUE(detection.ellipse_level.center_m.allFinite());
      EXPECT_TRUE(std::isfinite(detection.residual_rms_m));
      EXPECT_EQ(Eigen::LLT<Matrix5d>(detection.covariance).info(), Eigen::Success);
    }
  }
}

}  // namespace situation_awareness
