// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/points/horizontal_projection.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

double tilt_rad(const Eigen::Isometry3d& T_world_lidar) {
  return std::acos(std::min(1.0, std::abs(T_world_lidar.linear()(2, 2))));
}

Points project_horizontally(const Scan& scan, const Eigen::Isometry3d& T_world_lidar) {
  const double tilt = tilt_rad(T_world_lidar);
  if (!(tilt <= kMaxTiltRad)) {
    throw std::invalid_argument("scan plane tilted by " + std::to_string(degrees(tilt)) + " deg, at most " +
                                std::to_string(degrees(kMaxTiltRad)) + " deg can be projected");
  }

  const Eigen::Matrix3d R_world_lidar = T_world_lidar.linear();
  const double yaw_rad = std::atan2(R_world_lidar(1, 0), R_world_lidar(0, 0));
  const Eigen::Matrix3d R_level_world = Eigen::AngleAxisd(-yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Matrix<double, 2, 3> R_level_lidar = (R_level_world * R_world_lidar).topRows<2>();

  Points result;
  result.stamp_ns = scan.stamp_ns;
  result.T_world_level = {T_world_lidar.translation().head<2>(), yaw_rad};
  result.height_world_m = T_world_lidar.translation().z();
  const std::size_t n = scan.beams.size();
  result.points.reserve(n);
  if (n == 0) return result;

  // A lidar turned upside down, or one with a negative increment, sweeps clockwise seen from above: read it backwards.
  const bool clockwise = (R_world_lidar(2, 2) < 0.0) != (scan.angle_increment_rad < 0.0);
  double previous_rad = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t i = clockwise ? n - 1 - k : k;
    const double angle_rad = scan.angle_min_rad + static_cast<double>(i) * scan.angle_increment_rad;
    const Eigen::Vector2d direction_level =
        R_level_lidar.leftCols<2>() * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad));

    Point point;
    point.beam = static_cast<int>(i);
    point.state = scan.beams[i].state;
    const double wrapped_rad = std::atan2(direction_level.y(), direction_level.x());
    point.azimuth_rad = k == 0 ? wrapped_rad : previous_rad + wrap_to_pi(wrapped_rad - previous_rad);
    previous_rad = point.azimuth_rad;
    if (point.state == BeamState::kHit || point.state == BeamState::kOutside) {
      point.p_level_m = scan.beams[i].range_m * direction_level;
      point.range_m = point.p_level_m.norm();
    }
    result.points.push_back(point);
  }

  const double sweep_rad = result.points.back().azimuth_rad - result.points.front().azimuth_rad;
  const double increment_rad = std::abs(scan.angle_increment_rad);
  result.resolution_rad = n > 1 ? sweep_rad / static_cast<double>(n - 1) : increment_rad;
  result.full_circle = increment_rad * (static_cast<double>(n) + 0.5) >= 2.0 * kPi;
  return result;
}

}  // namespace situation_awareness
