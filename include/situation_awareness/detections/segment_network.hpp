// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/detections/onnx_model.hpp"
#include "situation_awareness/detections/segment_encoding.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Number of outputs with which the answer of every network of one segment begins: an estimate and its covariance.
constexpr std::size_t kPosteriorAnswer = 21;

/// What these outputs say.
struct SegmentPosterior {
  Vector5d smooth_level = Vector5d::Zero();  ///< (t_x, t_y, m, p, q) in the level frame
  Matrix5d covariance = Matrix5d::Zero();    ///< of its error; its 90 % region holds 90 % of the truths
};

/// The estimate for the encoded segment from the first outputs of a network, which may have any values; `max_radius_m`
/// as for `encode`.
SegmentPosterior posterior_of(const float* answer, const SegmentEncoding& encoding, double max_radius_m);

/// A network whose input is an encoded segment, read from an ONNX file (docs/math/detections.md).
class SegmentNetwork {
 public:
  /// `use`: what the network is for, in messages. Throws as OnnxModel does, and std::runtime_error naming the file if
  /// it has other numbers of inputs or outputs.
  SegmentNetwork(const std::string& onnx_path, std::size_t outputs, const std::string& use);

  /// The answers for the listed segments, rows of `outputs` numbers one behind the other, all in one batched forward;
  /// nullptr if none is listed. Valid until the next call. `range_sigma_m` and `max_radius_m` as for `encode`.
  /// Allocates no memory unless more segments are listed than ever before.
  const float* infer(const Segments& segments, const std::vector<std::size_t>& which, double range_sigma_m,
                     double max_radius_m);

  /// Of the segments of the last call.
  const std::vector<SegmentEncoding>& encodings() const { return encodings_; }

  const OnnxModel& model() const { return model_; }

 private:
  OnnxModel model_;
  std::vector<SegmentEncoding> encodings_;  ///< kept for its memory
};

}  // namespace situation_awareness
