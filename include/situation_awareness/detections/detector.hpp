// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Finds the ellipse in each segment of kind kObject. Not thread-safe: one detector, one thread.
class Detector {
 public:
  virtual ~Detector() = default;

  virtual Detections detect(const Segments& segments) = 0;
};

}  // namespace situation_awareness
