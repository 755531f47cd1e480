// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness {

/// A fix, and where the antenna was then.
struct PlacedFix {
  std::int64_t stamp_ns = 0;
  Eigen::Vector2d antenna_m = Eigen::Vector2d::Zero();  ///< in a frame without jumps
  Eigen::Vector2d fix_world_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d variance_m2 = Eigen::Vector2d::Ones();  ///< of the fix, east and north
};

/// Where a map is in the world, from fixes along a way that is known in the map. Errors of fixes last, so that their
/// mean says less than their number; how long is learned. A bank of Kalman filters (Magill, "Optimal adaptive
/// estimation of sampled stochastic processes", 1965), one for each noise of a grid, over
///
///   symbol    meaning                                                                           size
///   t, theta  where a point c of the map is in the world (m), and how the map is turned (rad)   2, 1
///   g         slow part of the fixes' error, in its standard deviations                         2
///
/// with fix = t + R(theta) (p - c) + sqrt(s) sigma g + white noise, g a Gauss-Markov process, s and its time constant
/// those of the filter. Maps bend as they grow: t and theta walk a little.
class MapPlace {
 public:
  bool has_begun() const { return has_begun_; }

  /// What is known before the first fix: the place of the point c, with a variance for each direction, and the yaw. It
  /// is counted again if it is made of the same fixes.
  void begin(const Eigen::Vector2d& c_map_m, const Pose2& T_world_map, double variance_m2, double yaw_variance_rad2);

  /// A fix of a later time than the one before, with the antenna in the map and the variance of that (m^2). One beyond
  /// its gate is left out. Returns whether it was used.
  bool add(const PlacedFix& fix, double way_variance_m2);

  const Pose2& T_world_map() const { return T_world_map_; }
  /// Of x, y (m) and yaw (rad) in the world of what is at this place of the map.
  Eigen::Matrix3d covariance_at(const Eigen::Vector2d& p_map_m) const;

 private:
  using Vector5 = Eigen::Matrix<double, 5, 1>;
  using Matrix5 = Eigen::Matrix<double, 5, 5>;
  struct Filter {
    Vector5 x;  ///< t, theta, g
    Matrix5 P;
    double log_likelihood;
  };
  /// A fix with what a filter expects.
  struct Compared {
    Eigen::Vector2d nu;
    Eigen::Matrix<double, 2, 5> H;
    Eigen::Matrix2d S;
    double mahalanobis2;
  };

  void mix();

  bool has_begun_ = false;
  std::int64_t stamp_ns_ = 0;  ///< of the latest fix; 0 before
  Eigen::Vector2d c_map_m_ = Eigen::Vector2d::Zero();
  std::vector<Filter> filters_;  ///< one for each noise
  std::vector<Compared> compared_;
  Pose2 T_world_map_;
  Eigen::Matrix3d P_ = Eigen::Matrix3d::Zero();  ///< of t and theta
};

}  // namespace situation_awareness
