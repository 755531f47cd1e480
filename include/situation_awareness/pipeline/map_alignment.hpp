// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"
#include "situation_awareness/polylines/polylines.hpp"

namespace situation_awareness {

struct MapAlignmentParams {
  double yaw_drift_rad_sqrt_s = 0.003;
  double velocity_drift_m_s_sqrt_s = 0.1;
  double hit_sigma_m = 0.03;
  double independent_part = 0.25;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("yaw_drift_rad_sqrt_s", self.yaw_drift_rad_sqrt_s, Bounds{0.0, 10.0}, "rad/sqrt(s)",
          "random walk of the yaw by inertial navigation between two scans");
    visit("velocity_drift_m_s_sqrt_s", self.velocity_drift_m_s_sqrt_s, Bounds{0.0, 100.0}, "m/s/sqrt(s)",
          "random walk of the error of the velocity in the base's axes");
    visit("hit_sigma_m", self.hit_sigma_m, Bounds{0.001, 10.0}, "m",
          "standard deviation of a hit's distance from the boundary, in addition to those of both");
    visit("independent_part", self.independent_part, Bounds{0.001, 1.0}, "",
          "part of the hits whose errors are independent");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "alignment"); }
};

/// A scan by inertial navigation, which goes on without jumps, and what GPS and INS say of the world.
struct InertialPlacement {
  Pose2 T_world_odom;                                         ///< as it is known now
  Eigen::Matrix3d pose_covariance = Eigen::Matrix3d::Zero();  ///< of x, y (m) and yaw (rad) of the base in the world
  double velocity_sigma_m_s = 0.0;                            ///< of the velocity in the base's axes, in any direction
};

/// Keeps the scans of a map together while what is known of the world wanders: the map has a frame of its own, in which
/// each scan is placed by the boundaries that are there already, as far as they say where it is, and by inertial
/// navigation since the scan before otherwise. The map's place in the world is the mean of what GPS and INS say of it.
///
///   symbol          meaning                                                              size
///   odom            the frame of inertial navigation: it drifts, and does not jump
///   T_map_odom      what corrects it now                                                 SE(2)
///   v               what the velocity is wrong by, in the level axes of the base (m/s)   2
///   P               covariance of the errors of the scanner's x, y (m) and yaw (rad)     5x5
///                   in the map, and of v
///
/// The map's boundaries say nothing of the world, so nothing goes back to the pose, whose covariance stays honest.
class MapAlignment {
 public:
  /// Throws std::invalid_argument naming field and bound.
  explicit MapAlignment(const MapAlignmentParams& params) : params_((params.validate(), params)) {}

  /// Places a scan in the map, whose T_world_level is T_odom_level, and sets that to T_map_level. Returns the
  /// covariance of the scan's place in the map.
  Eigen::Matrix3d align(const PolygonMap& map, const InertialPlacement& placement, Polylines& polylines);

  /// Where the map is in the world, and the variance of a place of it, so far from where most hits were, in any
  /// direction.
  const Pose2& T_world_map() const { return T_world_map_; }
  double variance_m2(double from_middle_m) const;

 private:
  struct Pair {
    Eigen::Vector2d p_level_m, q_map_m, normal_map;
    double variance_m2;
  };

  void pair_up(const PolygonMap& map, const Polylines& polylines, const Pose2& T_map_level, double reach_m);
  void average(const Polylines& polylines, const Pose2& T_map_level, const InertialPlacement& placement);

  MapAlignmentParams params_;
  bool has_begun_ = false;
  std::int64_t stamp_ns_ = 0;
  Pose2 T_map_odom_;
  Eigen::Vector2d at_map_m_ = Eigen::Vector2d::Zero();  ///< the scanner, for P
  Eigen::Vector2d v_level_m_s_ = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 5, 5> P_ = Eigen::Matrix<double, 5, 5>::Zero();
  std::vector<Pair> pairs_;

  Pose2 T_world_map_;
  Eigen::Vector2d middle_map_m_ = Eigen::Vector2d::Zero();  ///< of hits
  Eigen::Vector2d middle_world_m_ = Eigen::Vector2d::Zero();
  double yaw_rad_ = 0.0;
  double position_weight_ = 0.0, yaw_weight_ = 0.0;
  double position_variance_m2_ = 0.0, yaw_variance_rad2_ = 0.0;  ///< of the best pose
};

}  // namespace situation_awareness
