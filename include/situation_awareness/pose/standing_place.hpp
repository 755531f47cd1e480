// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include <Eigen/Core>

namespace situation_awareness {

/// Whether what is seen of a place stands there, and is a cylinder of the radius that it is taken for, by where it
/// appears from several sides (docs/math/reflectors.md, "What is wrong"): a centre fitted with a radius that is too
/// small by d lies nearer to the viewer by d. Views from nearly the same place have the same errors, so only those
/// some way apart count. Source: ours.
class StandingPlace {
 public:
  /// A view in which the centre appeared at `center_world_m`, with its covariance, the pose's error included, from a
  /// lidar at `lidar_world_m`.
  void add(std::int64_t stamp_ns, const Eigen::Vector2d& center_world_m, const Eigen::Matrix2d& covariance,
           const Eigen::Vector2d& lidar_world_m);

  /// For how long it has been in view.
  double seen_s() const { return seen_s_; }

  /// Whether the views say that it is a cylinder of its radius that stands: the radius is known well enough and is no
  /// other, and the views agree with one place.
  bool is_reflector() const;

  /// By all views that count; that of the first while they do not determine it.
  Eigen::Vector2d center_world_m() const;

 private:
  bool has_view_ = false;
  std::int64_t stamp_ns_ = 0;
  double seen_s_ = 0.0;
  int views_ = 0;
  Eigen::Vector2d first_world_m_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d lidar_world_m_ = Eigen::Vector2d::Zero();  ///< of the latest view that counts
  // Least squares of the centre after the first view, and of what the radius is too small by.
  Eigen::Matrix3d A_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b_ = Eigen::Vector3d::Zero();
  double square_ = 0.0;
};

}  // namespace situation_awareness
