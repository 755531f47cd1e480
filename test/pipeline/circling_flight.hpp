// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

using Outline = std::vector<Eigen::Vector2d>;  // counter-clockwise

inline Outline ellipse(const Eigen::Vector2d& semi_axes_m) {
  Outline outline;
  for (int i = 0; i < 720; ++i) {
    const double t = radians(0.5 * i);
    outline.push_back(semi_axes_m.cwiseProduct(Eigen::Vector2d(std::cos(t), std::sin(t))));
  }
  return outline;
}

inline Outline box(double length_m, double width_m) {
  const double x = 0.5 * length_m, y = 0.5 * width_m;
  return {{x, -y}, {x, y}, {-x, y}, {-x, -y}};
}

inline double range_to(const Outline& outline, const Eigen::Vector2d& from_m, const Eigen::Vector2d& u) {
  double range_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d way_m = outline[(i + 1) % outline.size()] - outline[i], d_m = outline[i] - from_m;
    const double determinant = u.x() * way_m.y() - u.y() * way_m.x();
    const double part = (d_m.x() * u.y() - d_m.y() * u.x()) / determinant;
    const double along_m = (d_m.x() * way_m.y() - d_m.y() * way_m.x()) / determinant;
    if (part >= 0.0 && part <= 1.0 && along_m > 0.0) range_m = std::min(range_m, along_m);
  }
  return range_m;
}

/// A vehicle at 5 m/s on a circle around the origin, banked by its turn, with a scanner of 30 mm of noise and a sweep.
class Flight {
 public:
  static constexpr double kRadius_m = 18.0, kSpeed_m_s = 5.0, kPeriod_s = 0.1, kSweep_s = 0.02;
  static constexpr int kBeams = 541;

  explicit Flight(Outline outline, std::uint64_t seed = 1) : outline_(std::move(outline)), random_(seed) {}

  /// So many boxes of 0.6 m go around it to and fro, 2 to 6 m away from the vehicle's way.
  void add_movers(int movers) { movers_ = movers; }

  /// It sees nothing from then on for so long.
  void look_away(double from_s, double for_s) { away_from_s_ = from_s, away_to_s_ = from_s + for_s; }

  static double lap_s() { return 2.0 * kPi * kRadius_m / kSpeed_m_s; }
  static double bank_rad() { return std::atan(kSpeed_m_s * kSpeed_m_s / (9.81 * kRadius_m)); }

  static Pose2 pose2_at(double t_s) {
    const double angle_rad = kSpeed_m_s * t_s / kRadius_m;
    return {kRadius_m * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad)), angle_rad + 0.5 * kPi};
  }
  static Eigen::Isometry3d banked(const Pose2& pose) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation() << pose.translation_m, 10.0;
    T.linear() = (Eigen::AngleAxisd(pose.yaw_rad, Eigen::Vector3d::UnitZ()) *
                  Eigen::AngleAxisd(-bank_rad(), Eigen::Vector3d::UnitX()))
                     .toRotationMatrix();
    return T;
  }

  Scan scan_at(double t_s) {
    Scan scan;
    scan.stamp_ns = 1'000'000'000'000 + static_cast<std::int64_t>(std::llround(1e9 * t_s));
    scan.angle_min_rad = radians(-135.0);
    scan.angle_increment_rad = radians(0.5);
    scan.time_increment_s = kSweep_s / (kBeams - 1);
    std::vector<Outline> movers;
    for (int k = 0; k < movers_; ++k) {
      const double angle_rad = 2.1 * k + 3.0 * std::sin((0.05 + 0.011 * k) * t_s), radius_m = 24.0 + (k % 3) * 2.0;
      const Pose2 pose{radius_m * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad)), angle_rad};
      movers.push_back(box(0.6, 0.6));
      for (Eigen::Vector2d& p_m : movers.back()) p_m = pose * p_m;
    }
    for (int i = 0; i < kBeams; ++i) {
      const Eigen::Isometry3d T = banked(pose2_at(t_s + i * scan.time_increment_s));
      const double angle_rad = scan.angle_min_rad + i * scan.angle_increment_rad;
      const Eigen::Vector3d u = T.linear() * Eigen::Vector3d(std::cos(angle_rad), std::sin(angle_rad), 0.0);
      const double level = u.head<2>().norm();
      const bool is_away = t_s >= away_from_s_ && t_s < away_to_s_;
      double range_m =
          is_away ? std::nan("") : range_to(outline_, T.translation().head<2>(), u.head<2>() / level) / level;
      for (const Outline& mover : movers) {
        range_m = std::min(range_m, range_to(mover, T.translation().head<2>(), u.head<2>() / level) / level);
      }
      const double measured_m = range_m + 0.03 * random_.normal();
      scan.beams.push_back(beam_from_range(static_cast<float>(measured_m), 0.1F, 30.0F));
    }
    return scan;
  }

  const Outline& outline() const { return outline_; }

 private:
  Outline outline_;
  Random random_;
  double away_from_s_ = 0.0, away_to_s_ = 0.0;
  int movers_ = 0;
};

}  // namespace situation_awareness
