// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/detector.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/detections/onnx_model.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// A network of the ellipse or the circle paper: its input is one segment as the ranges of 1081 beams, without the rest
/// of the scan. docs/math/paper_networks.md defines input and output.
class PaperNetwork {
 public:
  enum class Kind {
    kEllipse,       ///< ellipse paper, Tables I and II: in the sensor's frame, the output is an ellipse
    kCircle,        ///< circle paper, Table I: in the sensor's frame, the output is a circle
    kPolarEllipse,  ///< the ellipse paper's VGG-Net in the segment's own polar frame
  };
  static constexpr int kBeams = 1081;
  static constexpr double kResolutionRad = 0.25 * 3.14159265358979323846 / 180.0;

  /// Throws as OnnxModel does, and std::runtime_error naming the file if it is of another shape.
  PaperNetwork(Kind kind, const std::string& onnx_path);

  /// True if at least one of the network's beams hits the segment. In the sensor's frame they end at +-135 degrees.
  bool sees(const Segments& segments, std::size_t segment) const;

  /// The ellipse in the level frame, rx >= ry > 0, for each listed segment, all in one batched forward. At
  /// least one beam must hit each of them.
  std::vector<Ellipse> infer(const Segments& segments, const std::vector<std::size_t>& which);

  const OnnxModel& model() const { return model_; }

 private:
  Kind kind_;
  OnnxModel model_;
};

/// Detects by a network of the papers as they do: every segment of kind kObject that its beams hit, with or without
/// hidden ends. Covariance and residual are those of `assess_ellipse`.
class PaperNetworkDetector final : public Detector {
 public:
  /// Throws as PaperNetwork does, and std::invalid_argument naming field and bound.
  PaperNetworkDetector(PaperNetwork::Kind kind, const std::string& onnx_path, const EllipseFitParams& params);

  void set_fit(const EllipseFitParams& fit) override { params_ = fit; }
  std::string model_sha256() const override { return network_.model().file_sha256(); }

 private:
  void find(const Segments& segments, Detections& found) override;

  PaperNetwork network_;
  EllipseFitParams params_;
  std::vector<std::size_t> seen_;  ///< segments for the network, kept for its memory
};

}  // namespace situation_awareness
