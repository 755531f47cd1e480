// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/detector.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/detections/paper_networks.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Detects by the network in the segment's polar frame where both ends of a segment are silhouettes, which is what it
/// was trained on, and by least squares where an end is hidden.
class NetworkDetector final : public Detector {
 public:
  /// Throws as PaperNetwork does, and std::invalid_argument naming field and bound.
  NetworkDetector(const std::string& onnx_path, const EllipseFitParams& params);

  Detections detect(const Segments& segments) override;

 private:
  PaperNetwork network_;
  EllipseFitParams params_;
  std::vector<std::size_t> whole_;  ///< segments for the network, kept for its memory
};

}  // namespace situation_awareness
