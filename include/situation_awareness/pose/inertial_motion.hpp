// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/estimation/error_state_filter.hpp"
#include "situation_awareness/estimation/navigation_state.hpp"

namespace situation_awareness {

// Inertial navigation between two corrections, and the slow error of fixes (docs/math/gps_ins.md; Sola, "Quaternion
// kinematics for the error-state Kalman filter", 2017; Forster et al., "On-manifold preintegration for real-time
// visual-inertial odometry", 2017).
//
//   symbol  meaning                                                                     space         size
//   x       position, velocity, attitude, biases b_a and b_g; fix error c               manifold
//   f, w    specific force (m/s^2) and angular rate (rad/s) less their biases           R^3           3
//   F       Jacobian of the motion since the covariance was last predicted, by the error  J_e_e       18x18
//   c       slow error of fixes, each axis in units of its standard deviation           R^3           3
//   T       correlation time of c: c' = exp(-dt / T) c + noise, of variance 1           s
//   Q       noise of the motion                                                         R^18x18       18x18

/// Measurement at rest on the ground: standard gravity. What it differs by at a place is part of the bias.
constexpr double kStandardGravity_m_s2 = 9.80665;

/// One measurement of an IMU.
struct InertialSample {
  std::int64_t stamp_ns = 0;
  Eigen::Vector3d specific_force_m_s2 = Eigen::Vector3d::Zero();  ///< +9.8 on the axis that points up, at rest
  Eigen::Vector3d angular_velocity_rad_s = Eigen::Vector3d::Zero();
};

/// State of the filter: that of inertial navigation, with the axes of the base at the place of the IMU, and the slow
/// error of fixes, east, north and up, each in units of its own standard deviation.
struct GpsInsState {
  NavigationState motion;
  Eigen::Vector3d fix_error = Eigen::Vector3d::Zero();
};

template <>
struct Manifold<GpsInsState> {
  static constexpr int kFixError = navigation_error::kSize;  ///< index in the error; those before are of `motion`
  static constexpr int kDimension = navigation_error::kSize + 3;
  static constexpr bool kFlat = false;
  using Error = Eigen::Matrix<double, kDimension, 1>;
  using Jacobian = Eigen::Matrix<double, kDimension, kDimension>;

  static GpsInsState identity() { return {}; }
  static GpsInsState retract(const GpsInsState& x, const Error& e) {
    return {Manifold<NavigationState>::retract(x.motion, e.head<navigation_error::kSize>()), x.fix_error + e.tail<3>()};
  }
  static Error local_coordinates(const GpsInsState& x, const GpsInsState& y) {
    Error e;
    e << Manifold<NavigationState>::local_coordinates(x.motion, y.motion), y.fix_error - x.fix_error;
    return e;
  }
  static Jacobian reset_jacobian(const Error& e) {
    Jacobian G = Jacobian::Identity();
    G.block<3, 3>(navigation_error::kAttitude, navigation_error::kAttitude) =
        right_jacobian_so3(e.segment<3>(navigation_error::kAttitude));
    return G;
  }
};

/// Errors of an IMU; the defaults suit MEMS ones on vehicles that shake.
struct InertialNoiseParams {
  double accelerometer_noise = 0.003;
  double gyroscope_noise = 0.00015;
  double accelerometer_bias_sigma_m_s2 = 0.1;
  double gyroscope_bias_sigma_rad_s = 0.01;
  double accelerometer_bias_walk = 0.0005;
  double gyroscope_bias_walk = 0.00003;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("accelerometer_noise", self.accelerometer_noise, Bounds{1e-5, 10.0}, "m/s^2/sqrt(Hz)",
          "least density of the white noise; more is used where samples differ more from their neighbours");
    visit("gyroscope_noise", self.gyroscope_noise, Bounds{1e-6, 1.0}, "rad/s/sqrt(Hz)",
          "least density of the white noise; more is used where samples differ more from their neighbours");
    visit("accelerometer_bias_sigma_m_s2", self.accelerometer_bias_sigma_m_s2, Bounds{0.0, 10.0}, "m/s^2",
          "standard deviation of the bias at the start, each axis");
    visit("gyroscope_bias_sigma_rad_s", self.gyroscope_bias_sigma_rad_s, Bounds{0.0, 1.0}, "rad/s",
          "standard deviation of the bias at the start, each axis");
    visit("accelerometer_bias_walk", self.accelerometer_bias_walk, Bounds{0.0, 1.0}, "m/s^2/sqrt(s)",
          "of the bias's random walk, each axis");
    visit("gyroscope_bias_walk", self.gyroscope_bias_walk, Bounds{0.0, 1.0}, "rad/s/sqrt(s)",
          "of the bias's random walk, each axis");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "imu"); }
};

/// The Jacobian of a motion of several steps by the error of the state before it, those blocks that are neither zero
/// nor the identity.
struct MotionJacobian {
  double duration_s = 0.0;  ///< also the block of the position by the velocity
  /// Rows: position, velocity. Columns: attitude, bias of the accelerometer, bias of the gyroscope.
  Eigen::Matrix<double, 6, 9> translation = Eigen::Matrix<double, 6, 9>::Zero();
  Eigen::Matrix3d attitude_by_attitude = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d attitude_by_gyroscope = Eigen::Matrix3d::Zero();

  /// The state after a step from `x` in which specific force and angular rate, as measured, are constant; the Jacobian
  /// of that step is appended.
  NavigationState append(const NavigationState& x, const Eigen::Vector3d& specific_force_m_s2,
                         const Eigen::Vector3d& angular_velocity_rad_s, double dt_s);

  /// As a matrix.
  ErrorMatrix<NavigationState> matrix() const;
};

/// P after a motion: F P F^T + Q, with the slow error of fixes, of correlation time T, forgotten meanwhile. White noise
/// acts like a bias that lasts for the motion.
ErrorMatrix<GpsInsState> moved_covariance(const ErrorMatrix<GpsInsState>& P, const MotionJacobian& J,
                                          const InertialNoiseParams& noise, double correlation_s);

/// Of a number with this squared distance from zero, in units of its covariance, the share that is more than its own
/// error: 0 up to 3 sigma, then as James and Stein (1961) shrink a mean.
double significant_share(double mahalanobis2);

/// Takes out of the Jacobian of a motion what its horizontal acceleration says of the yaw, as far as this acceleration
/// may be no more than noise and errors of tilt and bias. Those are fixed in the body and turn with the yaw, so that
/// they say nothing of it; taken as they are, they make it certain while nothing is observed. `q_world_body` is the
/// attitude before the motion, P the covariance then. Returns what was taken out, rows as in
/// MotionJacobian::translation by the angle about the vertical, and the share that was left.
struct YawEffect {
  Eigen::Matrix<double, 6, 1> left_out = Eigen::Matrix<double, 6, 1>::Zero();
  double share_left = 1.0;
};
YawEffect leave_out_insignificant(MotionJacobian& J, const Eigen::Quaterniond& q_world_body,
                                  const ErrorMatrix<GpsInsState>& P, const InertialNoiseParams& noise);

/// Variance of the angle about the vertical.
double vertical_variance(const Eigen::Quaterniond& q_world_body, const ErrorMatrix<GpsInsState>& P);

bool is_finite(const GpsInsState& x);

/// The share of c that is left after a time.
double kept_of_fix_error(double duration_s, double correlation_s);

/// Yaw of R = Rz(yaw) Ry(pitch) Rx(roll), and its Jacobian by the attitude's error in the axes of the body.
double yaw_of(const Eigen::Quaterniond& q_world_body);
Eigen::RowVector3d yaw_jacobian(const Eigen::Quaterniond& q_world_body);

}  // namespace situation_awareness
