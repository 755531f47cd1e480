// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/estimation/assignment.hpp"
#include "situation_awareness/geometry/ellipses_by_x.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/objects/existence.hpp"
#include "situation_awareness/map/objects/map_element.hpp"
#include "situation_awareness/map/objects/object_map_params.hpp"

namespace situation_awareness {

// Association of detections with elements: global nearest neighbour by likelihood ratios (docs/math/objects.md,
// "Association").

/// Natural logarithm of lambda, the density of new objects (or false detections) per scan, square metre of position and
/// cubic metre of (m, p, q): one in 10,000 scans on each square metre, with shapes as the detectors expect them.
/// Measured in 14 flights (rooms, crowds, persons, one hidden mover): a twentieth of it, -7.4, gives 36 id switches
/// instead of 34, and raises the centre RMSE of moving objects, seen from a turning robot, from 0.015 to 0.027 m.
/// In other flights -2.2 and -8.8 change no figure beyond chance.
constexpr double kLogNewObjectDensity = -4.4;

/// The logarithm of P_D / (1 - p_D), of an element's detection against its missed detection. P_D holds at the
/// detection, which nothing hides; p_D at the place where the element is expected.
double log_detection_ratio(const ExpectedDetection& expected, double detection_probability);

/// Reason why a measurement cannot be matched with an element; empty if it can. `gate`: of the squared Mahalanobis
/// distance. `common_shape`: other elements have the same shape.
const char* match_defect(const MapElement& element, const MotionMatch& match, double gate, bool common_shape,
                         std::int64_t stamp_ns);

/// A match of an element with a measurement.
struct Association {
  std::size_t element;
  std::size_t measurement;
  MotionMatch match;
};

/// Reason why a measurement near elements is unmatched: that of its most probable element.
struct Rejection {
  const char* reason = "";  ///< empty: no element nearby
  double log_likelihood = -std::numeric_limits<double>::infinity();
};

/// Elements and measurements of one scan.
struct AssociationInput {
  const std::vector<MapElement>& elements;         ///< predicted to the scan's stamp
  const std::vector<ExpectedDetection>& expected;  ///< of the elements
  const std::vector<char>& common_shape;           ///< of the elements: not zero where others have the same shape
  const EllipsesByX& recently_seen;                ///< the elements that are not out of sight
  const std::vector<Measurement>& measurements;
  const Pose2& T_world_level;
  const Eigen::Matrix3d& U;  ///< covariance of T_world_level, as in object_filter.hpp
  std::int64_t stamp_ns;
  const std::vector<Candidate>& of_persons;  ///< their legs: rows beyond the elements, columns beyond the measurements
  int rows;                                  ///< with theirs
  int columns;                               ///< the same
};

/// Associates the detections of each scan; it has no state but reusable memory.
class Associator {
 public:
  void associate(const AssociationInput& input, const ObjectMapParams& params, double gate);

  /// Of the latest scan, by ascending element.
  const std::vector<Association>& associations() const { return associations_; }
  /// Of the latest scan's measurements.
  const std::vector<Rejection>& rejections() const { return rejections_; }
  /// Of each row, with those of persons; -1: none.
  const std::vector<int>& column_of_row() const { return column_of_row_; }

 private:
  /// A measurement's position and its covariance, for the search.
  struct Place {
    Eigen::Vector2d center_world_m;
    Eigen::Matrix2d covariance_world_m2;
    int measurement;
  };

  void sort_measurements(const AssociationInput& input);
  void find_candidates(const AssociationInput& input, const MeasuringFrame& level, std::size_t element,
                       const ObjectMapParams& params, double gate);

  std::vector<Place> by_x_;    ///< measurements
  std::vector<char> on_seen_;  ///< measurements whose centre is on an element that was seen recently
  double largest_variance_m2_ = 0.0;
  double longest_offset_s_ = 0.0;
  std::vector<Candidate> candidates_;
  std::vector<MotionMatch> matches_;  ///< of the candidates
  std::vector<int> column_of_row_;
  std::vector<Association> associations_;
  std::vector<Rejection> rejections_;
};

}  // namespace situation_awareness
