// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/flight_controller.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace situation_awareness {
namespace {

// Position: 2.4 rad/s at a damping of 0.8. Attitude: five times faster, which allows motor lags of some 30 ms;
// about z, where motors have little torque, slower.
constexpr double kPositionGain_1_s2 = 6.0;
constexpr double kVelocityGain_1_s = 4.0;
const Eigen::Vector3d kAttitudeGain_1_s2(140.0, 140.0, 30.0);
const Eigen::Vector3d kAngularVelocityGain_1_s(20.0, 20.0, 9.0);

/// Less than gravity, so that the desired thrust points up at any distance from the path.
constexpr double kMaxFeedback_m_s2 = 5.0;

/// Margin of the collective thrust to the motors' limits, for torques.
constexpr double kReserve = 0.1;

Eigen::Vector3d vee(const Eigen::Matrix3d& skew) { return {skew(2, 1), skew(0, 2), skew(1, 0)}; }

/// The path's state with the feedback's acceleration added.
PathState with_feedback(const RobotState& robot, const PathState& path) {
  const Eigen::Vector3d position_error = robot.T_world_robot.translation() - path.position_m;
  const Eigen::Vector3d velocity_error = robot.velocity_world_m_s - path.velocity_m_s;
  const Eigen::Vector3d feedback = -kPositionGain_1_s2 * position_error - kVelocityGain_1_s * velocity_error;
  PathState wanted = path;
  if (feedback.norm() > kMaxFeedback_m_s2) {
    wanted.acceleration_m_s2 += kMaxFeedback_m_s2 * feedback.normalized();
  } else {
    wanted.acceleration_m_s2 += feedback;
    wanted.jerk_m_s3 -= kPositionGain_1_s2 * velocity_error;
  }
  return wanted;
}

/// `base`, which is within the limits, plus the largest fraction of `more` that stays within them.
Eigen::Vector4d add_within(const Eigen::Vector4d& base, const Eigen::Vector4d& more, const Airframe& airframe) {
  double part = 1.0;
  for (int i = 0; i < 4; ++i) {
    const double limit_N = more[i] > 0.0 ? airframe.max_thrusts_N[i] : airframe.min_thrusts_N[i];
    if (std::abs(more[i]) > 0.0) part = std::min(part, (limit_N - base[i]) / more[i]);
  }
  return base + std::max(part, 0.0) * more;
}

/// The motors' share of force and torque.
Eigen::Vector4d mix(const Airframe& airframe, double thrust_N, const Eigen::Vector3d& torque_N_m) {
  const Eigen::Matrix4d motors_of_wrench = airframe.wrench_of_motors.inverse();
  const Eigen::Vector4d reserve = kReserve * (airframe.max_thrusts_N - airframe.min_thrusts_N);
  const Eigen::Vector4d lift = (motors_of_wrench.col(0) * thrust_N)
                                   .cwiseMax(airframe.min_thrusts_N + reserve)
                                   .cwiseMin(airframe.max_thrusts_N - reserve);
  const Eigen::Vector4d tilt = motors_of_wrench.middleCols<2>(1) * torque_N_m.head<2>();
  return add_within(add_within(lift, tilt, airframe), motors_of_wrench.col(3) * torque_N_m.z(), airframe);
}

}  // namespace

Eigen::Vector4d motor_thrusts(const Airframe& airframe, const RobotState& robot, const PathState& path,
                              double drag_1_s) {
  const PathState wanted_path = with_feedback(robot, path);
  const RobotState wanted = multirotor_state(wanted_path, drag_1_s);
  const Eigen::Vector3d specific_force =
      wanted_path.acceleration_m_s2 + kGravity_m_s2 * Eigen::Vector3d::UnitZ() + drag_1_s * wanted_path.velocity_m_s;

  const Eigen::Matrix3d R = robot.T_world_robot.linear();
  const Eigen::Matrix3d R_robot_wanted = R.transpose() * wanted.T_world_robot.linear();
  const Eigen::Matrix3d skew = 0.5 * (R_robot_wanted.transpose() - R_robot_wanted);
  const Eigen::Vector3d attitude_error = vee(skew);
  const Eigen::Vector3d& w = robot.angular_velocity_robot_rad_s;
  const Eigen::Vector3d w_error = w - R_robot_wanted * wanted.angular_velocity_robot_rad_s;
  const Eigen::Matrix3d& J = airframe.inertia_kg_m2;
  const Eigen::Vector3d angular_acceleration =
      -kAttitudeGain_1_s2.cwiseProduct(attitude_error) - kAngularVelocityGain_1_s.cwiseProduct(w_error);
  const Eigen::Vector3d torque = J * angular_acceleration + w.cross(J * w);

  return mix(airframe, airframe.mass_kg * specific_force.dot(R.col(2)), torque);
}

}  // namespace situation_awareness
