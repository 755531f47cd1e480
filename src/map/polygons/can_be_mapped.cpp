// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "situation_awareness/estimation/covariance.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"

namespace situation_awareness {
namespace {

/// rad. A yaw of so many turns is no yaw of a sensor.
constexpr double kMostYaw_rad = 1e6;
/// rad. An azimuth is that of a beam, not wrapped.
constexpr float kMaxAzimuth_rad = 100.0F;
/// The length of a unit vector may be off by so much.
constexpr double kLengthError = 1e-6;

/// Whether there are as many ranges as azimuths, which ascend, and all of them are numbers.
bool is_free_space(const std::vector<float>& azimuth_rad, const std::vector<float>& range_m) {
  return azimuth_rad.size() == range_m.size() && std::is_sorted(azimuth_rad.begin(), azimuth_rad.end()) &&
         std::all_of(azimuth_rad.begin(), azimuth_rad.end(), [](float a) { return std::abs(a) < kMaxAzimuth_rad; }) &&
         std::all_of(range_m.begin(), range_m.end(), [](float r) { return r >= 0.0F; });
}

}  // namespace

bool can_be_mapped(const Polylines& polylines, const Eigen::Matrix3d& pose_covariance) {
  const Pose2& T = polylines.T_world_level;
  const auto is_size = [](double value) { return value >= 0.0 && value < kFarthestFromOrigin_m; };
  const auto is_near = [](const Eigen::Vector2d& p_m) {
    return p_m.allFinite() && p_m.cwiseAbs().maxCoeff() < kFarthestFromOrigin_m;
  };
  if (!is_near(T.translation_m) || !(std::abs(T.yaw_rad) < kMostYaw_rad) ||
      !is_size(std::abs(polylines.height_world_m)) || !is_size(polylines.resolution_rad) ||
      !is_size(polylines.range_sigma_m) || !is_positive_semidefinite(pose_covariance) ||
      !is_free_space(polylines.free_space.azimuth_rad, polylines.free_space.range_m)) {
    return false;
  }
  const Eigen::Matrix2d R_world_level = T.rotation();
  return std::all_of(polylines.hits.begin(), polylines.hits.end(), [&](const PolylineHit& hit) {
    return is_near(hit.p_level_m) && is_near(R_world_level * hit.p_level_m + T.translation_m) &&
           std::abs(hit.normal_level.norm() - 1.0) < kLengthError && hit.sigma_m > 0.0 && is_size(hit.sigma_m);
  });
}

}  // namespace situation_awareness
