// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/points/horizontal_projection.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// Motion from the lidar's pose at its first beam to that at its last.
struct Motion {
  Eigen::Vector3d axis_lidar = Eigen::Vector3d::UnitZ();  ///< of the rotation
  double turn_rad = 0.0;
  Eigen::Vector3d translation_world_m = Eigen::Vector3d::Zero();
  bool moves = false;
};

Motion motion_between(const Eigen::Isometry3d& T_world_first, const Eigen::Isometry3d& T_world_last) {
  Motion motion;
  motion.moves = T_world_first.matrix() != T_world_last.matrix();
  if (!motion.moves) return motion;  // exactly none: R^T R is the identity only up to rounding
  const Eigen::AngleAxisd turn(T_world_first.linear().transpose() * T_world_last.linear());
  motion.axis_lidar = turn.axis();
  motion.turn_rad = turn.angle();
  motion.translation_world_m = T_world_last.translation() - T_world_first.translation();
  return motion;
}

/// The vector (x, y, 0) rotated about the unit vector `axis` (Rodrigues).
Eigen::Vector3d turned(const Eigen::Vector2d& v, const Eigen::Vector3d& axis, double angle_rad) {
  const double c = std::cos(angle_rad);
  const double s = std::sin(angle_rad);
  const double along = (1.0 - c) * (axis.x() * v.x() + axis.y() * v.y());
  return {(c * v.x() - s * (axis.z() * v.y())) + along * axis.x(),
          (c * v.y() + s * (axis.z() * v.x())) + along * axis.y(),
          s * (axis.x() * v.y() - axis.y() * v.x()) + along * axis.z()};
}

/// Unit vectors along the beams of a scan, in the lidar's frame. They are the same from scan to scan, so they are
/// cached until angles or their number change, which saves a twelfth of the projection's time
/// (benchmark/stages_benchmark.cpp).
const std::vector<Eigen::Vector2d>& rays_lidar(const Scan& scan) {
  struct Kept {
    double angle_min_rad = 0.0;
    double angle_increment_rad = 0.0;
    std::vector<Eigen::Vector2d> rays;
  };
  thread_local Kept kept;
  const bool same = kept.rays.size() == scan.beams.size() && kept.angle_min_rad == scan.angle_min_rad &&
                    kept.angle_increment_rad == scan.angle_increment_rad;
  if (same) return kept.rays;
  kept.angle_min_rad = scan.angle_min_rad;
  kept.angle_increment_rad = scan.angle_increment_rad;
  kept.rays.resize(scan.beams.size());
  for (std::size_t i = 0; i < kept.rays.size(); ++i) {
    const double angle_rad = scan.angle_min_rad + static_cast<double>(i) * scan.angle_increment_rad;
    kept.rays[i] = {std::cos(angle_rad), std::sin(angle_rad)};
  }
  return kept.rays;
}

/// azimuth_rad + atan2(across, along), to the last bit of the sum: the parallax of most points is so small that a
/// series decides it, much faster than atan2.
double turned_azimuth_rad(double azimuth_rad, double across, double along) {
  constexpr double kSmall = 0.02;  // the first term that is left out is below the margin
  constexpr double kMargin_rad = 2e-17;
  if (along > 0.0 && std::abs(across) < kSmall * along) {
    const double t = across / along;
    const double t2 = t * t;
    const double tail = t2 * (-1.0 / 3.0 + t2 * (1.0 / 5.0 + t2 * (-1.0 / 7.0 + t2 * (1.0 / 9.0 - t2 / 11.0))));
    const double angle_rad = t + t * tail;
    const double low_rad = azimuth_rad + (angle_rad - kMargin_rad);
    if (low_rad == azimuth_rad + (angle_rad + kMargin_rad)) return low_rad;
  }
  return azimuth_rad + std::atan2(across, along);
}

double distance_m(const Point& point) {
  return is_hit(point.state) ? point.range_m : std::numeric_limits<double>::infinity();
}

/// Make azimuths non-decreasing where they decrease by parallax of the moving lidar. Seen from the origin the nearer
/// points cover the others: they keep their azimuths, and the covered points get the azimuth of their edge.
void order_azimuths(Points& points) {
  struct Block {  // of points at one azimuth, that of the nearest of them
    double azimuth_rad;
    double distance_m;
    std::size_t end;
  };
  const std::size_t n = points.points.size();
  const auto decreases = [](const Point& before, const Point& after) { return before.azimuth_rad > after.azimuth_rad; };
  const bool in_order =
      std::adjacent_find(points.points.begin(), points.points.end(), decreases) == points.points.end();
  if (in_order && !points.full_circle) return;
  // The nearest point keeps its azimuth, so that a circle is complete when it is reached again.
  const auto nearest = std::min_element(points.points.begin(), points.points.end(),
                                        [](const Point& a, const Point& b) { return distance_m(a) < distance_m(b); });
  const std::size_t start = points.full_circle ? static_cast<std::size_t>(nearest - points.points.begin()) : 0;
  const auto index = [&](std::size_t k) { return start + k < n ? start + k : start + k - n; };
  const auto turn_rad = [&](std::size_t k) { return start + k < n ? 0.0 : 2.0 * kPi; };

  thread_local std::vector<Block> blocks;  // kept for its memory
  blocks.clear();
  for (std::size_t k = 0; k < n; ++k) {
    const Point& point = points.points[index(k)];
    Block block{point.azimuth_rad + turn_rad(k), distance_m(point), k + 1};
    while (!blocks.empty() && blocks.back().azimuth_rad > block.azimuth_rad) {
      if (blocks.back().distance_m <= block.distance_m) {
        block.azimuth_rad = blocks.back().azimuth_rad;
        block.distance_m = blocks.back().distance_m;
      }
      blocks.pop_back();
    }
    blocks.push_back(block);
  }
  // Each point from its own side of the seam, so that rounding does not separate equal azimuths.
  const double first_rad = points.full_circle ? points.points[start].azimuth_rad : 0.0;
  std::size_t k = 0;
  for (const Block& block : blocks) {
    for (; k < block.end; ++k) {
      double& azimuth_rad = points.points[index(k)].azimuth_rad;
      azimuth_rad = block.azimuth_rad - turn_rad(k);
      if (points.full_circle) azimuth_rad = std::min(azimuth_rad, first_rad + (2.0 * kPi - turn_rad(k)));
    }
  }
}

}  // namespace

double tilt_rad(const Eigen::Isometry3d& T_world_lidar) {
  return std::acos(std::min(1.0, std::abs(T_world_lidar.linear()(2, 2))));
}

const char* projection_defect(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                              const Eigen::Isometry3d& T_world_lidar_end) {
  if (!T_world_lidar.matrix().allFinite() || !T_world_lidar_end.matrix().allFinite()) return "pose";
  const bool level_enough = tilt_rad(T_world_lidar) <= kMaxTiltRad && tilt_rad(T_world_lidar_end) <= kMaxTiltRad;
  if (!level_enough) return "tilt";
  const double steps = scan.beams.empty() ? 0.0 : static_cast<double>(scan.beams.size() - 1);
  const double most_rad = kMaxTurnOfSweep * steps * std::abs(scan.angle_increment_rad);
  return motion_between(T_world_lidar, T_world_lidar_end).turn_rad <= most_rad ? "" : "turn";
}

Points project_horizontally(const Scan& scan, const Eigen::Isometry3d& T_world_lidar) {
  return project_horizontally(scan, T_world_lidar, T_world_lidar);
}

Points project_horizontally(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                            const Eigen::Isometry3d& T_world_lidar_end, Points memory) {
  const std::string defect = projection_defect(scan, T_world_lidar, T_world_lidar_end);
  const Motion motion = motion_between(T_world_lidar, T_world_lidar_end);
  if (defect == "pose") throw std::invalid_argument("the lidar's pose is not finite");
  if (defect == "tilt") {
    const double tilt = std::max(tilt_rad(T_world_lidar), tilt_rad(T_world_lidar_end));
    throw std::invalid_argument("scan plane tilted by " + std::to_string(degrees(tilt)) + " deg, at most " +
                                std::to_string(degrees(kMaxTiltRad)) + " deg can be projected");
  }
  if (defect == "turn") {
    throw std::invalid_argument("lidar turned by " + std::to_string(degrees(motion.turn_rad)) +
                                " deg during a scan, more than " + std::to_string(kMaxTurnOfSweep) + " of its sweep");
  }

  const Eigen::Matrix3d R_world_lidar = T_world_lidar.linear();
  const double yaw_rad = std::atan2(R_world_lidar(1, 0), R_world_lidar(0, 0));
  const Eigen::Matrix3d R_level_world = Eigen::AngleAxisd(-yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Matrix<double, 2, 3> R_level_lidar = (R_level_world * R_world_lidar).topRows<2>();
  const Eigen::Vector2d translation_level_m = (R_level_world * motion.translation_world_m).head<2>();

  Points result = std::move(memory);
  result.points.clear();
  result.full_circle = false;
  result.resolution_rad = 0.0;
  result.stamp_ns = scan.stamp_ns;
  result.T_world_level = {T_world_lidar.translation().head<2>(), yaw_rad};
  result.height_world_m = T_world_lidar.translation().z();
  result.time_increment_s = scan.time_increment_s;
  const std::size_t n = scan.beams.size();
  result.points.reserve(n);
  if (n == 0) return result;

  // A lidar turned upside down, or one with a negative increment, sweeps clockwise seen from above: read it in reverse.
  const bool clockwise = (R_world_lidar(2, 2) < 0.0) != (scan.angle_increment_rad < 0.0);
  const double increment_rad = std::abs(scan.angle_increment_rad);
  const double steps = n > 1 ? static_cast<double>(n - 1) : 1.0;
  const std::vector<Eigen::Vector2d>& rays = rays_lidar(scan);
  double first_rad = 0.0;
  double previous_rad = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t i = clockwise ? n - 1 - k : k;
    const double part = static_cast<double>(i) / steps;  // fraction of the motion at the time of this beam
    const Eigen::Vector3d ray_lidar = motion.moves ? turned(rays[i], motion.axis_lidar, part * motion.turn_rad)
                                                   : Eigen::Vector3d(rays[i].x(), rays[i].y(), 0.0);
    const Eigen::Vector2d direction_level = R_level_lidar * ray_lidar;
    const Eigen::Vector2d lidar_level_m = part * translation_level_m;

    const double wrapped_rad = std::atan2(direction_level.y(), direction_level.x());
    double step_rad = wrap_to_pi(wrapped_rad - previous_rad);
    if (step_rad < increment_rad - kPi) step_rad += 2.0 * kPi;  // more than half a turn to the next beam
    const double azimuth_rad = k == 0 ? wrapped_rad : previous_rad + step_rad;
    if (k == 0) first_rad = azimuth_rad;
    if (azimuth_rad > first_rad + 2.0 * kPi) break;  // beyond a full circle: seen already
    previous_rad = azimuth_rad;

    Point point;
    point.beam = static_cast<int>(i);
    point.state = scan.beams[i].state;
    point.intensity = scan.beams[i].intensity;
    point.azimuth_rad = azimuth_rad;
    if (is_hit(point.state)) {
      point.p_level_m = scan.beams[i].range_m * direction_level;
      if (motion.moves) {
        point.p_level_m += lidar_level_m;
        const double across = direction_level.x() * lidar_level_m.y() - direction_level.y() * lidar_level_m.x();
        // As seen from the origin.
        point.azimuth_rad = turned_azimuth_rad(azimuth_rad, across, direction_level.dot(point.p_level_m));
      }
      point.range_m = point.p_level_m.norm();
    } else if (point.state == BeamState::kFree) {
      point.range_m = scan.beams[i].range_m * direction_level.norm();
    }
    result.points.push_back(point);
  }

  const std::size_t count = result.points.size();
  result.resolution_rad = count > 1 ? (previous_rad - first_rad) / static_cast<double>(count - 1) : increment_rad;
  result.full_circle = increment_rad * (static_cast<double>(n) + 0.5) >= 2.0 * kPi;
  if (motion.moves) order_azimuths(result);
  return result;
}

}  // namespace situation_awareness
