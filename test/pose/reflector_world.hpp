// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/pose/reflector_localization.hpp"

namespace situation_awareness {

/// A robot with a level scanner in a room with reflectors, for tests. Every beam is intersected analytically from the
/// pose at its own time; a beam of some width is the mean of thin ones.
class ReflectorWorld {
 public:
  struct Cylinder {
    Eigen::Vector2d center_m;
    double radius_m;
    double intensity;    ///< seen square on
    bool falls = false;  ///< the intensity is that times the cosine of the incidence
  };
  struct Wall {
    Eigen::Vector2d from, to;
    double intensity = 250.0;
    double gloss = 0.0;  ///< added where it is seen square on, within some 3 deg
  };
  /// Pose of the base at a time in s.
  using Path = std::function<Pose2(double)>;

  std::vector<Cylinder> cylinders;
  std::vector<Wall> walls;
  Path path = [](double) { return Pose2{}; };
  Pose2 T_base_lidar;
  double angle_min_rad = radians(-135.0);
  double angle_increment_rad = radians(0.5);
  int beams = 541;
  double sweep_s = 0.0;  ///< from the first beam to the last
  double range_sigma_m = 0.012;
  double intensity_sigma = 0.0;
  double beam_width_rad = 0.0;
  double lost_share = 0.0;  ///< of the beams, at random
  double max_range_m = 20.0;

  void add_room(const Eigen::Vector2d& low, const Eigen::Vector2d& high, double intensity = 250.0) {
    const Eigen::Vector2d a(low.x(), high.y()), b(high.x(), low.y());
    walls.push_back({low, b, intensity});
    walls.push_back({b, high, intensity});
    walls.push_back({high, a, intensity});
    walls.push_back({a, low, intensity});
  }

  void add(const ReflectorMap& map, double intensity = 800.0) {
    for (const Reflector& reflector : map.reflectors) {
      cylinders.push_back({reflector.center_world_m, reflector.radius_m, intensity});
    }
  }

  /// The whole scene moved.
  void move(const Pose2& T) {
    for (Cylinder& cylinder : cylinders) cylinder.center_m = T * cylinder.center_m;
    for (Wall& wall : walls) {
      wall.from = T * wall.from;
      wall.to = T * wall.to;
    }
    path = [T, before = path](double t_s) { return T * before(t_s); };
  }

  Scan scan(double time_s, Random& random) const {
    Scan result;
    result.stamp_ns = nanoseconds(time_s);
    result.angle_min_rad = angle_min_rad;
    result.angle_increment_rad = angle_increment_rad;
    result.time_increment_s = sweep_s / (beams - 1);
    for (int i = 0; i < beams; ++i) {
      const Pose2 T_world_lidar = path(time_s + i * result.time_increment_s) * T_base_lidar;
      const double azimuth_rad = T_world_lidar.yaw_rad + angle_min_rad + i * angle_increment_rad;
      double range_m = 0.0, intensity = 0.0;
      const int rays = beam_width_rad > 0.0 ? 7 : 1;
      for (int k = 0; k < rays; ++k) {
        const double off_rad = rays > 1 ? beam_width_rad * (static_cast<double>(k) / (rays - 1) - 0.5) : 0.0;
        const auto [r, bright] = cast(T_world_lidar.translation_m, azimuth_rad + off_rad);
        range_m += r / rays;
        intensity += bright / rays;
      }
      const double noise_m = range_sigma_m * random.normal();
      const bool is_lost = lost_share > 0.0 && random.uniform() < lost_share;
      if (is_lost || !(range_m < max_range_m)) {
        result.beams.push_back({static_cast<float>(max_range_m), BeamState::kFree});
      } else {
        if (intensity_sigma > 0.0) intensity += intensity_sigma * random.normal();
        result.beams.push_back({static_cast<float>(range_m + noise_m), BeamState::kHit, static_cast<float>(intensity)});
      }
    }
    return result;
  }

  Points points(double time_s, Random& random) const {
    return project_horizontally(scan(time_s, random), Eigen::Isometry3d::Identity());
  }

 private:
  std::pair<double, double> cast(const Eigen::Vector2d& origin, double azimuth_rad) const {
    const Eigen::Vector2d u(std::cos(azimuth_rad), std::sin(azimuth_rad));
    double range_m = std::numeric_limits<double>::infinity(), intensity = 0.0;
    for (const Cylinder& cylinder : cylinders) {
      const Eigen::Vector2d to = cylinder.center_m - origin;
      const double along_m = u.dot(to), across_m = u.x() * to.y() - u.y() * to.x();
      const double half2_m2 = cylinder.radius_m * cylinder.radius_m - across_m * across_m;
      if (half2_m2 <= 0.0 || along_m <= 0.0) continue;
      const double r = along_m - std::sqrt(half2_m2);
      if (r >= range_m) continue;
      range_m = r;
      const double cosine = std::sqrt(half2_m2) / cylinder.radius_m;
      intensity = cylinder.intensity * (cylinder.falls ? cosine : 1.0);
    }
    for (const Wall& wall : walls) {
      const Eigen::Vector2d d = wall.to - wall.from, f = wall.from - origin;
      const double determinant = u.x() * -d.y() + u.y() * d.x();
      if (std::abs(determinant) < 1e-12) continue;
      const double r = (f.x() * -d.y() + f.y() * d.x()) / determinant;
      const double s = (u.x() * f.y() - u.y() * f.x()) / determinant;
      if (r <= 0.0 || s < 0.0 || s > 1.0 || r >= range_m) continue;
      range_m = r;
      const double sine = std::abs(d.normalized().dot(u));
      intensity = wall.intensity + wall.gloss * std::exp(-0.5 * sine * sine / (0.03 * 0.03));
    }
    return {range_m, intensity};
  }
};

/// Wheel odometry of a path with the errors of a small robot: random by distance and by turning, and constant ones of
/// scale that are drawn once.
class DriftingWheels {
 public:
  DriftingWheels(ReflectorWorld::Path path, std::uint64_t seed, double rate_hz = 50.0)
      : path_(std::move(path)), random_(seed), period_s_(1.0 / rate_hz) {
    distance_scale_ = 1.0 + 0.01 * random_.normal();
    yaw_scale_ = 1.0 + 0.01 * random_.normal();
  }

  double next_time_s() const { return static_cast<double>(steps_) * period_s_; }

  std::pair<std::int64_t, Pose2> next() {
    const double time_s = next_time_s();
    if (steps_ > 0) {
      const Eigen::Vector3d tau = log_se2(inverse(path_(time_s - period_s_)) * path_(time_s));
      const double distance_m = tau.head<2>().norm(), turn_rad = std::abs(tau(2));
      Eigen::Vector3d measured = tau;
      measured.head<2>() *= distance_scale_;
      measured(2) *= yaw_scale_;
      const double along_m = 0.01 * std::sqrt(distance_m) * random_.normal();
      if (distance_m > 0.0) measured.head<2>() += along_m / distance_m * tau.head<2>();
      measured(2) += 0.01 * std::sqrt(distance_m) * random_.normal() + 0.02 * std::sqrt(turn_rad) * random_.normal();
      T_odom_base_ = T_odom_base_ * exp_se2(measured);
    }
    ++steps_;
    return {nanoseconds(time_s), T_odom_base_};
  }

 private:
  ReflectorWorld::Path path_;
  Random random_;
  double period_s_;
  double distance_scale_ = 1.0, yaw_scale_ = 1.0;
  Pose2 T_odom_base_{{3.0, -2.0}, 0.7};
  std::int64_t steps_ = 0;
};

/// At about a speed along a figure of eight in the middle of the room.
inline ReflectorWorld::Path winding_path(double speed_m_s) {
  return [speed_m_s](double t_s) {
    const double a = speed_m_s * t_s / 1.47;  // the mean length of v
    const Eigen::Vector2d p(1.4 * std::sin(a), 0.8 * std::sin(2.0 * a + 0.4));
    const Eigen::Vector2d v(1.4 * std::cos(a), 1.6 * std::cos(2.0 * a + 0.4));
    return Pose2{p, std::atan2(v.y(), v.x())};
  };
}

}  // namespace situation_awareness
