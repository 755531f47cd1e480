// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/path/segment_path.hpp"

namespace situation_awareness {

/// How far a scanner saw that nothing is there.
struct FreeBeams {
  Pose2 T_world_sensor;
  double from_rad = 0.0;       ///< direction of the first beam in the sensor's plane
  double step_rad = 0.0;       ///< to the next beam, counter-clockwise, > 0
  std::vector<double> free_m;  ///< along each beam: the range, or what the scanner reaches; 0 where it says nothing
  std::vector<Eigen::Vector2d> hits_world_m;  ///< what the beams ended at, counter-clockwise
};

/// What was seen to be free, from many places. Keeps its memory: no allocation after warm-up.
class SeenArea {
 public:
  /// `spacing_m` > 0: of the places that are kept; `count` >= 1: of the latest ones.
  SeenArea(double spacing_m, std::size_t count) : spacing_m_(spacing_m), sights_(count) {}

  void clear();
  /// A disc that is known to be free, beside what was seen: where the vehicle started.
  void set_start(const Eigen::Vector2d& center_m, double radius_m);
  void add(const FreeBeams& sight);

  /// A point is seen if it is nearer than what both beams beside it passed, from one of the places. In time linear in
  /// their number.
  bool contains(const Eigen::Vector2d& p_world_m) const;

  /// Whether the path, and what is `half_width_m` beside it, was seen: its points 1 m apart.
  bool contains(const SegmentPath& path, double from_m, double to_m, double half_width_m) const;

 private:
  double spacing_m_;
  std::vector<FreeBeams> sights_;  ///< a ring
  std::size_t used_ = 0, latest_ = 0;
  Eigen::Vector2d start_m_ = Eigen::Vector2d::Zero();
  double start_radius_m_ = 0.0;
};

}  // namespace situation_awareness
