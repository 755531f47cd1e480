// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

/// An IMU; the defaults are those of a good MEMS one.
struct SimulatedImuParams {
  double rate_hz = 200.0;
  double gravity_m_s2 = 9.80665;
  double gyroscope_noise = 1.0e-4;
  double gyroscope_bias_sigma_rad_s = 2.0e-3;
  double gyroscope_bias_walk = 2.0e-5;
  double accelerometer_noise = 2.0e-3;
  double accelerometer_bias_sigma_m_s2 = 0.05;
  double accelerometer_bias_walk = 3.0e-4;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("rate_hz", self.rate_hz, Bounds{1.0, 10000.0}, "Hz", "samples per second");
    visit("gravity_m_s2", self.gravity_m_s2, Bounds{0.0, 20.0}, "m/s^2", "measurement of the accelerometer at rest");
    visit("gyroscope_noise", self.gyroscope_noise, Bounds{0.0, 1.0}, "rad/s/sqrt(Hz)", "density of the white noise");
    visit("gyroscope_bias_sigma_rad_s", self.gyroscope_bias_sigma_rad_s, Bounds{0.0, 1.0}, "rad/s",
          "standard deviation of the bias at the start, each axis");
    visit("gyroscope_bias_walk", self.gyroscope_bias_walk, Bounds{0.0, 1.0}, "rad/s/sqrt(s)",
          "of the bias's random walk, each axis");
    visit("accelerometer_noise", self.accelerometer_noise, Bounds{0.0, 10.0}, "m/s^2/sqrt(Hz)",
          "density of the white noise");
    visit("accelerometer_bias_sigma_m_s2", self.accelerometer_bias_sigma_m_s2, Bounds{0.0, 10.0}, "m/s^2",
          "standard deviation of the bias at the start, each axis");
    visit("accelerometer_bias_walk", self.accelerometer_bias_walk, Bounds{0.0, 10.0}, "m/s^2/sqrt(s)",
          "of the bias's random walk, each axis");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "imu"); }
};

/// One measurement of an IMU, in its own axes, with its true biases.
struct ImuSample {
  std::int64_t stamp_ns = 0;
  Eigen::Vector3d specific_force_imu_m_s2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_velocity_imu_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d accelerometer_bias_m_s2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d gyroscope_bias_rad_s = Eigen::Vector3d::Zero();
};

/// An IMU on the robot of a world.
///
/// A sample is the mean over one period h with its stamp t in the middle: the gyroscope's is the rotation vector from
/// the attitude at t - h/2 to that at t + h/2, over h, so that consecutive rotations compose to the attitude exactly;
/// the accelerometer's is R(t)^T ((v(t + h/2) - v(t - h/2)) / h + g e_z), v being the velocity of the place where it is
/// mounted. A random-walk bias and white noise are added. Gravity is a parameter of the sensor and need not be that
/// of the flight (kGravity_m_s2): only the motion is used, not the forces.
class SimulatedImu {
 public:
  /// `world` must outlive the IMU. Throws std::invalid_argument for params.
  SimulatedImu(const World& world, const Eigen::Isometry3d& T_robot_imu, const SimulatedImuParams& params,
               std::uint64_t seed);

  const SimulatedImuParams& params() const { return params_; }

  /// When the next sample is due; the first is at time 0.
  double next_time_s() const { return static_cast<double>(samples_) / params_.rate_hz; }

  ImuSample next();

 private:
  struct Motion {
    Eigen::Matrix3d R_world_imu;
    Eigen::Vector3d velocity_world_m_s;
  };
  Motion motion_at(double time_s) const;

  const World& world_;
  Eigen::Isometry3d T_robot_imu_;
  SimulatedImuParams params_;
  Random random_;
  Eigen::Vector3d accelerometer_bias_m_s2_, gyroscope_bias_rad_s_;
  std::uint64_t samples_ = 0;
};

}  // namespace situation_awareness
