// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

/// Wheel odometry that drifts; the defaults are those of a small robot with two driven wheels on a hard floor.
struct SimulatedOdometryParams {
  double rate_hz = 50.0;
  double distance_noise = 0.01;
  double yaw_noise_of_distance = 0.01;
  double yaw_noise_of_yaw = 0.02;
  double distance_scale_sigma = 0.005;
  double yaw_scale_sigma = 0.01;
  double yaw_drift_sigma = 0.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("rate_hz", self.rate_hz, Bounds{0.1, 1000.0}, "Hz", "poses per second");
    visit("distance_noise", self.distance_noise, Bounds{0.0, 1.0}, "m/sqrt(m)",
          "random error of the distance, by distance");
    visit("yaw_noise_of_distance", self.yaw_noise_of_distance, Bounds{0.0, 1.0}, "rad/sqrt(m)",
          "random error of the yaw, by distance");
    visit("yaw_noise_of_yaw", self.yaw_noise_of_yaw, Bounds{0.0, 1.0}, "rad/sqrt(rad)",
          "random error of the yaw, by turning");
    visit("distance_scale_sigma", self.distance_scale_sigma, Bounds{0.0, 0.5}, "",
          "standard deviation of the constant error of the wheels' radius, relative");
    visit("yaw_scale_sigma", self.yaw_scale_sigma, Bounds{0.0, 0.5}, "",
          "standard deviation of the constant error of the wheels' track, relative");
    visit("yaw_drift_sigma", self.yaw_drift_sigma, Bounds{0.0, 1.0}, "rad/m",
          "standard deviation of the constant turn by distance, of wheels that differ");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "odometry"); }
};

/// Pose by wheel odometry relative to time 0, in the plane.
struct OdometrySample {
  std::int64_t stamp_ns = 0;
  Pose2 T_odom_base;
  Eigen::Vector2d velocity_base_m_s = Eigen::Vector2d::Zero();  ///< mean since the previous sample
  double yaw_rate_rad_s = 0.0;                                  ///< mean since the previous sample
  Eigen::Matrix3d pose_covariance = Eigen::Matrix3d::Zero();    ///< of x, y (m) and yaw (rad) in odom, to first order
  Eigen::Matrix3d twist_covariance = Eigen::Matrix3d::Zero();   ///< of vx, vy (m/s) and yaw rate (rad/s) in base
};

/// Wheel odometry of a mounting place on the robot of a world, which drives in the plane. The motion in the plane
/// between two samples, in the axes of the first, has errors that grow with the square root of the distance and the
/// rotation, constant errors of scale, and a constant turn by distance; the motions are chained.
class SimulatedOdometry {
 public:
  /// `world` must outlive the odometry. Throws std::invalid_argument for params.
  SimulatedOdometry(const World& world, const Eigen::Isometry3d& T_robot_base, const SimulatedOdometryParams& params,
                    std::uint64_t seed);

  const SimulatedOdometryParams& params() const { return params_; }

  /// When the next pose is due; the first is at time 0.
  double next_time_s() const { return static_cast<double>(samples_) / params_.rate_hz; }

  OdometrySample next();

 private:
  Pose2 true_pose_at(double time_s) const;
  void add_motion(const Pose2& motion, OdometrySample& sample);

  const World& world_;
  Eigen::Isometry3d T_robot_base_;
  SimulatedOdometryParams params_;
  Random random_;
  double distance_scale_, yaw_scale_;
  double yaw_drift_rad_m_ = 0.0;
  Pose2 T_odom_base_;
  Eigen::Matrix<double, 6, 6> covariance_;  ///< of x, y, yaw, scale of distances, scale of yaw, yaw by distance
  std::uint64_t samples_ = 0;
};

}  // namespace situation_awareness
