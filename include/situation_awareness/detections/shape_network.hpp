// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/detections/segment_encoding.hpp"
#include "situation_awareness/detections/segment_network.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// What one segment says of the shape that it is of, and of the box if it is one.
struct ShapeEstimate {
  /// Probabilities that the segment is one ellipse, one box, or neither, if ellipses and boxes are equally frequent and
  /// the others half as frequent (docs/math/synthetic_segments.md, `shapes`). Their sum is 1.
  double p_ellipse = 0.0;
  double p_box = 0.0;
  double p_other = 0.0;
  /// The moment-equal ellipse of the box (geometry/box.hpp) if it is one: (t_x, t_y, m, p, q) in the level frame, and
  /// the covariance of its error, whose 90 % region holds 90 % of the boxes.
  Vector5d smooth_level = Vector5d::Zero();
  Matrix5d covariance = Matrix5d::Zero();
  /// Orientation in the level frame, in [-pi/2, pi/2], of that of the box's axes that is nearest to the major axis of
  /// `smooth_level`; that of a square is known where (p, q) says nothing of it.
  double box_psi_level_rad = 0.0;
};

/// Number of the network's outputs.
constexpr std::size_t kShapeAnswer = kPosteriorAnswer + 5;

/// The estimate for the encoded segment from the network's outputs, which may have any finite values; `max_radius_m` as
/// for `encode`.
ShapeEstimate shape_of(const float* answer, const SegmentEncoding& encoding, double max_radius_m);

/// The package's shape network, read from an ONNX file: ellipse, box or other, and the posterior of the box
/// (docs/math/detections.md, "The shape network").
class ShapeNetwork {
 public:
  /// Throws as OnnxModel does, and std::runtime_error naming the file if it is of another shape.
  explicit ShapeNetwork(const std::string& onnx_path);

  /// One estimate for each listed segment, all in one batched forward; valid until the next call. `range_sigma_m` and
  /// `max_radius_m` as for `encode`. Allocates no memory unless more segments are listed than ever before.
  const std::vector<ShapeEstimate>& infer(const Segments& segments, const std::vector<std::size_t>& which,
                                          double range_sigma_m, double max_radius_m);

  const OnnxModel& model() const { return network_.model(); }

 private:
  SegmentNetwork network_;
  std::vector<ShapeEstimate> estimates_;  ///< kept for its memory
};

}  // namespace situation_awareness
