// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/estimation/manifold.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"

namespace situation_awareness {

/// State of inertial navigation: position, velocity and attitude of an inertial measurement unit, and the biases of its
/// sensors. R^3 x R^3 x SO(3) x R^3 x R^3.
struct NavigationState {
  Eigen::Vector3d position_world_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_world_m_s = Eigen::Vector3d::Zero();
  Eigen::Quaterniond q_world_imu = Eigen::Quaterniond::Identity();    ///< unit length; v_world = q_world_imu * v_imu
  Eigen::Vector3d accelerometer_bias_m_s2 = Eigen::Vector3d::Zero();  ///< in the IMU's frame, as measured minus true
  Eigen::Vector3d gyroscope_bias_rad_s = Eigen::Vector3d::Zero();     ///< the same
};

/// Index of each part in the error of a NavigationState, three numbers each.
namespace navigation_error {
constexpr int kPosition = 0;           ///< m, world
constexpr int kVelocity = 3;           ///< m/s, world
constexpr int kAttitude = 6;           ///< rad, in the IMU's frame: q_true = q exp(e)
constexpr int kAccelerometerBias = 9;  ///< m/s^2, in the IMU's frame
constexpr int kGyroscopeBias = 12;     ///< rad/s, in the IMU's frame
constexpr int kSize = 15;
}  // namespace navigation_error

template <>
struct Manifold<NavigationState> {
  static constexpr int kDimension = navigation_error::kSize;
  static constexpr bool kFlat = false;
  using Error = Eigen::Matrix<double, kDimension, 1>;
  using Jacobian = Eigen::Matrix<double, kDimension, kDimension>;

  static NavigationState identity() { return {}; }

  static NavigationState retract(const NavigationState& x, const Error& e) {
    using namespace navigation_error;
    NavigationState y;
    y.position_world_m = x.position_world_m + e.segment<3>(kPosition);
    y.velocity_world_m_s = x.velocity_world_m_s + e.segment<3>(kVelocity);
    y.q_world_imu = (x.q_world_imu * exp_so3(e.segment<3>(kAttitude))).normalized();
    y.accelerometer_bias_m_s2 = x.accelerometer_bias_m_s2 + e.segment<3>(kAccelerometerBias);
    y.gyroscope_bias_rad_s = x.gyroscope_bias_rad_s + e.segment<3>(kGyroscopeBias);
    return y;
  }

  static Error local_coordinates(const NavigationState& x, const NavigationState& y) {
    using namespace navigation_error;
    Error e;
    e.segment<3>(kPosition) = y.position_world_m - x.position_world_m;
    e.segment<3>(kVelocity) = y.velocity_world_m_s - x.velocity_world_m_s;
    e.segment<3>(kAttitude) = log_so3(x.q_world_imu.conjugate() * y.q_world_imu);
    e.segment<3>(kAccelerometerBias) = y.accelerometer_bias_m_s2 - x.accelerometer_bias_m_s2;
    e.segment<3>(kGyroscopeBias) = y.gyroscope_bias_rad_s - x.gyroscope_bias_rad_s;
    return e;
  }

  static Jacobian reset_jacobian(const Error& e) {
    using namespace navigation_error;
    Jacobian J = Jacobian::Identity();
    J.block<3, 3>(kAttitude, kAttitude) = right_jacobian_so3(e.segment<3>(kAttitude));
    return J;
  }
};

}  // namespace situation_awareness
