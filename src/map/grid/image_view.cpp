// SPDX-License-Identifier: BSD-3-Clause
#include "image_view.hpp"

#include <algorithm>

namespace situation_awareness {
namespace {

Eigen::Matrix3d matrix_of(const PinholeCamera& camera) {
  Eigen::Matrix3d K;
  K << camera.fx_px, 0.0, camera.cx_px, 0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 1.0;
  return K;
}

/// ImageView::outwards, along the camera's axes.
std::array<Eigen::Vector3d, 4> outwards_of(const PinholeCamera& camera) {
  return {Eigen::Vector3d(camera.fx_px, 0.0, -(camera.width - 0.5 - camera.cx_px)).normalized(),
          Eigen::Vector3d(-camera.fx_px, 0.0, -(camera.cx_px + 0.5)).normalized(),
          Eigen::Vector3d(0.0, camera.fy_px, -(camera.height - 0.5 - camera.cy_px)).normalized(),
          Eigen::Vector3d(0.0, -camera.fy_px, -(camera.cy_px + 0.5)).normalized()};
}

}  // namespace

ImageView::ImageView(const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera, double reach_m)
    : R_camera_world(T_world_camera.linear().transpose()),
      p_world_camera_m(T_world_camera.translation()),
      reach_m(reach_m),
      A(matrix_of(camera) * R_camera_world),
      outwards(outwards_of(camera)) {}

bool ImageView::may_see(const Eigen::Vector3d& middle_world_m, double radius_m) const {
  const Eigen::Vector3d p = R_camera_world * (middle_world_m - p_world_camera_m);
  if (p.norm() > reach_m + radius_m || p.z() < -radius_m) return false;
  return std::all_of(outwards.begin(), outwards.end(),
                     [&](const Eigen::Vector3d& outward) { return outward.dot(p) < radius_m; });
}

}  // namespace situation_awareness
