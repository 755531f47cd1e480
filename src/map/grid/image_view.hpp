// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/image/image.hpp"

namespace situation_awareness {

/// The view of a grid from the camera of an image.
struct ImageView {
  ImageView(const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera, double reach_m);

  /// Whether a sphere may be in the image.
  bool may_see(const Eigen::Vector3d& middle_world_m, double radius_m) const;

  Eigen::Matrix3d R_camera_world;
  Eigen::Vector3d p_world_camera_m;
  double reach_m;
  Eigen::Matrix3d A;  ///< of a point relative to the camera along the world's axes to (u z, v z, z)
  std::array<Eigen::Vector3d, 4> outwards;  ///< unit vectors away from the planes through the image's edges
};

}  // namespace situation_awareness
