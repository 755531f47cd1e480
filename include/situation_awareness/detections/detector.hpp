// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

struct EllipseFitParams;

/// Estimates an ellipse from each segment of kind kObject. Not thread-safe: one detector, one thread.
class Detector {
 public:
  virtual ~Detector() = default;

  /// `memory`: detections no longer needed, whose memory the result reuses.
  Detections detect(const Segments& segments, Detections memory = {});

  /// Other parameters from the next scan on; they have been validated.
  virtual void set_fit(const EllipseFitParams& fit) = 0;

  /// SHA-256 of its network's file in hexadecimal; empty if it has none.
  virtual std::string model_sha256() const { return ""; }

 private:
  /// Add to `found` the detections, and the reasons for segments without one; on entry it has only the fields copied
  /// from the segments.
  virtual void find(const Segments& segments, Detections& found) = 0;
};

}  // namespace situation_awareness
