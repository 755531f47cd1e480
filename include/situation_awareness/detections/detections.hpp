// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/detections/small_segments.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/geometry/shape.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// log_box_ratio where only ellipses are expected.
constexpr double kSurelyEllipse = -1000.0;

/// An ellipse, or a box, estimated from one segment.
struct Detection {
  Ellipse ellipse_level;                   ///< in the level frame, rx >= ry > 0; of a box that of equal moments
  Matrix5d covariance = Matrix5d::Zero();  ///< of the error of its smooth_parameters (t_x, t_y, m, p, q)
  Shape shape = Shape::kEllipse;
  Box box_level;                          ///< if the shape is a box
  double log_box_ratio = kSurelyEllipse;  ///< log-likelihood ratio of a box and an ellipse
  double residual_rms_m = 0.0;            ///< of the hits against the ellipse, along its normal
  double p_ellipse = 1.0;                 ///< probability that the segment is one ellipse
  double time_offset_s = 0.0;             ///< of the middle of its beams after the stamp
  int beams = 0;                          ///< number of its hits
  /// Mean of its hits in the level frame, or NaN where it is not known.
  Eigen::Vector2d middle_level_m = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  bool hidden_end = false;  ///< one end of the segment is no silhouette: the object may extend beyond it
  /// With a hidden end: whether a scan of the last seconds saw free space where half of its hits are. It moves then.
  bool has_arrived = false;
  std::size_t segment = 0;  ///< index in Segments::segments
};

/// A detection less certain than this has no information, and would harm the numerical precision of a filter.
constexpr double kMaxDetectionSigma_m = 100.0;

/// Reason why a detection from any source is invalid, for counters; empty if it is valid. Checked: finite numbers, rx
/// >= ry > 0, p_ellipse in [0, 1], and a covariance that is symmetric, positive definite and of standard deviations up
/// to kMaxDetectionSigma_m.
const char* detection_defect(const Detection& detection);

/// Reasons why a segment of kind kObject has no detection.
namespace detection_refusal {
constexpr const char* kNotOneEllipse = "not one ellipse";
constexpr const char* kBothEndsHidden = "both ends hidden";
constexpr const char* kOffEllipse = "points do not lie on an ellipse";
constexpr const char* kTooLarge = "ellipse too large";
constexpr const char* kAroundSensor = "ellipse around the sensor";
constexpr const char* kOutsideFieldOfView = "outside the network's field of view";
constexpr const char* kNotFinite = "ellipse not finite";
constexpr const char* kBadRadii = "radii not rx >= ry > 0";
constexpr const char* kBadProbability = "p_ellipse not in [0, 1]";
constexpr const char* kBadCovariance = "covariance not usable";
}  // namespace detection_refusal

/// A segment of kind kObject without a detection.
struct RefusedSegment {
  std::size_t segment = 0;  ///< index in Segments::segments
  const char* why = "";     ///< a detection_refusal
};

/// The ellipses detected in one scan, at most one per segment.
struct Detections {
  std::int64_t stamp_ns = 0;
  Pose2 T_world_level;
  double height_world_m = 0.0;
  std::vector<Detection> detections;
  FreeSpace free_space;                          ///< of the whole scan, as Segments::free_space
  Counters refused;                              ///< segments of kind kObject without a detection, by reason
  std::vector<RefusedSegment> refused_segments;  ///< each of them
  std::vector<SmallSegment> small_segments;      ///< hits without a detection that may be legs

  /// Adds a segment without a detection.
  void refuse(std::size_t segment, const char* why) {
    ++refused[why];
    refused_segments.push_back({segment, why});
  }
};

}  // namespace situation_awareness
