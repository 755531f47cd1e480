// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/detector.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/detections/segment_encoding.hpp"
#include "situation_awareness/detections/segment_network.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// The ellipse network's estimate for one segment.
struct EllipseEstimate {
  Vector5d smooth_level = Vector5d::Zero();  ///< (t_x, t_y, m, p, q) in the level frame
  Matrix5d covariance = Matrix5d::Zero();    ///< of its error; its 90 % region holds 90 % of the truths
  double p_ellipse = 0.0;                    ///< probability that the segment is one ellipse
};

/// Number of the network's outputs.
constexpr std::size_t kEllipseAnswer = kPosteriorAnswer + 1;

/// The estimate for the encoded segment from the network's outputs, which may have any values; `max_radius_m` as for
/// `encode`.
EllipseEstimate estimate_of(const float* answer, const SegmentEncoding& encoding, double max_radius_m);

/// The detection from an estimate.
Detection make_detection(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                         const EllipseEstimate& estimate);

/// The package's ellipse network, read from an ONNX file. Its input has hits, free and hidden ends at any position,
/// resolution and scale, its output a covariance; docs/math/detections.md defines both.
class EllipseNetwork {
 public:
  /// Throws as OnnxModel does, and std::runtime_error naming the file if it is of another shape.
  explicit EllipseNetwork(const std::string& onnx_path);

  /// One estimate for each listed segment, all in one batched forward; valid until the next call. `range_sigma_m` and
  /// `max_radius_m` as for `encode`.
  const std::vector<EllipseEstimate>& infer(const Segments& segments, const std::vector<std::size_t>& which,
                                            double range_sigma_m, double max_radius_m);

  const OnnxModel& model() const { return network_.model(); }

 private:
  SegmentNetwork network_;
  std::vector<EllipseEstimate> estimates_;  ///< kept for its memory
};

/// Detects by the ellipse network, hidden ends included.
class NetworkDetector final : public Detector {
 public:
  /// Throws as EllipseNetwork does, and std::invalid_argument naming field and bound.
  NetworkDetector(const std::string& onnx_path, const EllipseFitParams& params);

  void set_fit(const EllipseFitParams& fit) override { params_ = fit; }
  std::string model_sha256() const override { return network_.model().file_sha256(); }

 private:
  void find(const Segments& segments, Detections& found) override;

  EllipseNetwork network_;
  EllipseFitParams params_;
  std::vector<std::size_t> selected_;  ///< segments for the network, kept for its memory
};

}  // namespace situation_awareness
