// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/detector.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/detections/onnx_model.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// The ellipse network: VGG-Net of the ellipse paper (Table II), read from an ONNX file. It works in the segment's own
/// polar frame; docs/math/detections.md writes input and output out.
class EllipseNetwork {
 public:
  static constexpr int kBeams = 1081;
  static constexpr double kResolutionRad = 0.25 * 3.14159265358979323846 / 180.0;

  /// Throws as OnnxModel does, and std::runtime_error naming the file if it is of another shape.
  explicit EllipseNetwork(const std::string& onnx_path);

  /// The ellipse in the level frame for each listed segment, all in one batched forward.
  std::vector<Ellipse> infer(const Segments& segments, const std::vector<std::size_t>& which);

 private:
  OnnxModel model_;
};

/// Detects by the network where both ends of a segment are silhouettes, which is what it was trained on, and by
/// least squares where an end is hidden.
class NetworkDetector final : public Detector {
 public:
  /// Throws as EllipseNetwork does, and std::invalid_argument naming field and bound.
  NetworkDetector(const std::string& onnx_path, const EllipseFitParams& params);

  Detections detect(const Segments& segments) override;

 private:
  EllipseNetwork network_;
  EllipseFitParams params_;
  std::vector<std::size_t> whole_;  ///< segments for the network, kept for its memory
};

}  // namespace situation_awareness
