// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness {

/// A flight at constant height and airspeed in wind: straight legs and loops in turn, with coordinated banks. Rates of
/// turn go over into each other smoothly, so the yaw, the roll and their rates are analytic; the place is the integral
/// of the velocity by Simpson's rule.
struct SimulatedFlight {
  struct Leg {
    double duration_s;
    double rate_rad_s;
  };

  double airspeed_m_s = 5.0;
  Eigen::Vector3d wind_m_s{1.0, -0.6, 0.0};
  double initial_yaw_rad = 0.7;
  double change_s = 1.0;  ///< of the rate of turn, at the beginning of each leg
  std::vector<Leg> legs{{12.0, 0.0}, {14.0, 5.0 / 6.0}, {6.0, 0.0}, {14.0, -5.0 / 6.0}, {8.0, 0.2}, {16.0, 5.0 / 12.0}};

  double rate(double time_s) const { return turn(time_s).first; }
  double yaw(double time_s) const { return initial_yaw_rad + turn(time_s).second; }

  Eigen::Vector3d velocity(double time_s) const {
    return airspeed_m_s * Eigen::Vector3d(std::cos(yaw(time_s)), std::sin(yaw(time_s)), 0.0) + wind_m_s;
  }
  Eigen::Vector3d acceleration(double time_s) const {
    return airspeed_m_s * rate(time_s) * Eigen::Vector3d(-std::sin(yaw(time_s)), std::cos(yaw(time_s)), 0.0);
  }
  Eigen::Quaterniond attitude(double time_s) const {
    const double roll = -std::atan(airspeed_m_s * rate(time_s) / kStandardGravity_m_s2);
    return Eigen::AngleAxisd(yaw(time_s), Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
  }
  Eigen::Vector3d angular_velocity_body(double time_s) const {
    constexpr double kStep_s = 1e-4;
    return log_so3(attitude(time_s - kStep_s).conjugate() * attitude(time_s + kStep_s)) / (2.0 * kStep_s);
  }
  Eigen::Vector3d specific_force_body(double time_s) const {
    return attitude(time_s).conjugate() * (acceleration(time_s) + kStandardGravity_m_s2 * Eigen::Vector3d::UnitZ());
  }

 private:
  /// Rate of turn and the angle turned.
  std::pair<double, double> turn(double time_s) const {
    double begin_s = 0.0, before = 0.0, angle = 0.0;
    for (std::size_t i = 0;; i = (i + 1) % legs.size()) {
      const Leg& leg = legs[i];
      const double in_leg_s = std::min(time_s - begin_s, leg.duration_s);
      // The step 3 s^2 - 2 s^3 and its integral.
      const double s = std::clamp(in_leg_s / change_s, 0.0, 1.0);
      const double rate = before + (leg.rate_rad_s - before) * s * s * (3.0 - 2.0 * s);
      angle += before * in_leg_s + (leg.rate_rad_s - before) *
                                       (change_s * s * s * s * (1.0 - 0.5 * s) + std::max(in_leg_s - change_s, 0.0));
      if (time_s - begin_s <= leg.duration_s) return {rate, angle};
      begin_s += leg.duration_s;
      before = leg.rate_rad_s;
    }
  }
};

/// Its sensors, with the errors of a good MEMS IMU and of a receiver whose error is correlated in time.
struct FlightSensors {
  double imu_rate_hz = 200.0;
  double fix_rate_hz = 5.0;
  double fix_sigma_m = 1.5;
  double correlated_share = 0.5;
  double correlation_s = 20.0;
  double vertical_ratio = 1.5;
  double gyroscope_noise = 1e-4, gyroscope_bias_sigma_rad_s = 2e-3, gyroscope_bias_walk = 2e-5;
  double accelerometer_noise = 2e-3, accelerometer_bias_sigma_m_s2 = 0.05, accelerometer_bias_walk = 3e-4;
};

/// A flight or a drive with its sensors, step by step.
template <class Motion>
class MotionRun {
 public:
  MotionRun(const Motion& flight, const FlightSensors& sensors, std::uint64_t seed, const GpsInsMounting& mounting = {})
      : flight_(flight), sensors_(sensors), mounting_(mounting), random_(seed) {
    accelerometer_bias = sensors.accelerometer_bias_sigma_m_s2 * normal_vector<3>(random_);
    gyroscope_bias = sensors.gyroscope_bias_sigma_rad_s * normal_vector<3>(random_);
    slow_error_ = normal_vector<3>(random_);
  }

  double time_s() const { return static_cast<double>(steps_) / sensors_.imu_rate_hz; }
  std::int64_t stamp_ns() const { return nanoseconds(time_s()); }
  Eigen::Isometry3d T_world_base() const {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = flight_.attitude(time_s()).toRotationMatrix();
    T.translation() = position_;  // of the IMU, moved to the base
    T.translation() -= T.linear() * mounting_.T_base_imu.translation();
    return T;
  }

  /// The sample of the IMU now; the flight goes on with next().
  InertialSample sample() {
    const double noise = std::sqrt(sensors_.imu_rate_hz);
    const Eigen::Matrix3d R_imu_base = mounting_.T_base_imu.linear().transpose();
    InertialSample sample;
    sample.stamp_ns = stamp_ns();
    sample.specific_force_m_s2 = R_imu_base * flight_.specific_force_body(time_s()) + accelerometer_bias +
                                 sensors_.accelerometer_noise * noise * normal_vector<3>(random_);
    sample.angular_velocity_rad_s = R_imu_base * flight_.angular_velocity_body(time_s()) + gyroscope_bias +
                                    sensors_.gyroscope_noise * noise * normal_vector<3>(random_);
    return sample;
  }

  bool has_fix() const { return steps_ % static_cast<long>(sensors_.imu_rate_hz / sensors_.fix_rate_hz) == 0; }
  Eigen::Vector3d antenna() const { return T_world_base() * mounting_.antenna_base_m; }
  Eigen::Matrix3d fix_covariance() const {
    return sensors_.fix_sigma_m * sensors_.fix_sigma_m * scale().cwiseAbs2().asDiagonal().toDenseMatrix();
  }
  Eigen::Vector3d fix() {
    const double kept = std::exp(-1.0 / (sensors_.fix_rate_hz * sensors_.correlation_s));
    slow_error_ = kept * slow_error_ + std::sqrt(1.0 - kept * kept) * normal_vector<3>(random_);
    const Eigen::Vector3d error = std::sqrt(sensors_.correlated_share) * slow_error_ +
                                  std::sqrt(1.0 - sensors_.correlated_share) * normal_vector<3>(random_);
    return antenna() + sensors_.fix_sigma_m * scale().cwiseProduct(error);
  }

  void next() {
    const double h = 1.0 / sensors_.imu_rate_hz, t = time_s();
    position_ += h / 6.0 * (flight_.velocity(t) + 4.0 * flight_.velocity(t + 0.5 * h) + flight_.velocity(t + h));
    ++steps_;
    accelerometer_bias += sensors_.accelerometer_bias_walk * std::sqrt(h) * normal_vector<3>(random_);
    gyroscope_bias += sensors_.gyroscope_bias_walk * std::sqrt(h) * normal_vector<3>(random_);
  }

  Eigen::Vector3d accelerometer_bias, gyroscope_bias;  ///< in the axes of the IMU

 private:
  Eigen::Vector3d scale() const { return {1.0, 1.0, sensors_.vertical_ratio}; }

  Motion flight_;
  FlightSensors sensors_;
  GpsInsMounting mounting_;
  Random random_;
  Eigen::Vector3d position_ = Eigen::Vector3d::Zero(), slow_error_ = Eigen::Vector3d::Zero();
  long steps_ = 0;
};

using FlightRun = MotionRun<SimulatedFlight>;

inline double base_yaw(const Eigen::Isometry3d& T_world_base) {
  return yaw_of(Eigen::Quaterniond(T_world_base.linear()));
}

/// Returns the variance of the pose's yaw in rad^2, which is that of its attitude's error about the vertical.
inline double yaw_variance(const GpsInsPose& pose) {
  const Eigen::RowVector3d up_base = pose.T_world_base.linear().row(2);
  return up_base * pose.covariance.bottomRightCorner<3, 3>() * up_base.transpose();
}

}  // namespace situation_awareness
