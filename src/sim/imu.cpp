// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/imu.hpp"

#include <cmath>

#include "seeds.hpp"
#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

SimulatedImu::SimulatedImu(const World& world, const Eigen::Isometry3d& T_robot_imu, const SimulatedImuParams& params,
                           std::uint64_t seed)
    : world_(world), T_robot_imu_(T_robot_imu), params_(params), random_(seed_of_scan(seed, 0)) {
  params.validate();
  accelerometer_bias_m_s2_ = params.accelerometer_bias_sigma_m_s2 * normal3(random_);
  gyroscope_bias_rad_s_ = params.gyroscope_bias_sigma_rad_s * normal3(random_);
}

SimulatedImu::Motion SimulatedImu::motion_at(double time_s) const {
  const RobotState robot = world_.robot_at(time_s);
  const Eigen::Vector3d lever_velocity_robot_m_s = robot.angular_velocity_robot_rad_s.cross(T_robot_imu_.translation());
  return {robot.T_world_robot.linear() * T_robot_imu_.linear(),
          robot.velocity_world_m_s + robot.T_world_robot.linear() * lever_velocity_robot_m_s};
}

ImuSample SimulatedImu::next() {
  const double period_s = 1.0 / params_.rate_hz;
  const double time_s = next_time_s();
  if (samples_++ > 0) {
    accelerometer_bias_m_s2_ += params_.accelerometer_bias_walk * std::sqrt(period_s) * normal3(random_);
    gyroscope_bias_rad_s_ += params_.gyroscope_bias_walk * std::sqrt(period_s) * normal3(random_);
  }
  const Motion before = motion_at(time_s - 0.5 * period_s), after = motion_at(time_s + 0.5 * period_s);
  const Eigen::AngleAxisd turn(before.R_world_imu.transpose() * after.R_world_imu);
  const Eigen::Vector3d acceleration_world_m_s2 = (after.velocity_world_m_s - before.velocity_world_m_s) / period_s;

  const double noise_of_sample = std::sqrt(params_.rate_hz);  // the density's band is that of the samples
  ImuSample sample;
  sample.stamp_ns = nanoseconds(time_s);
  sample.accelerometer_bias_m_s2 = accelerometer_bias_m_s2_;
  sample.gyroscope_bias_rad_s = gyroscope_bias_rad_s_;
  sample.specific_force_imu_m_s2 = motion_at(time_s).R_world_imu.transpose() *
                                       (acceleration_world_m_s2 + params_.gravity_m_s2 * Eigen::Vector3d::UnitZ()) +
                                   accelerometer_bias_m_s2_ +
                                   params_.accelerometer_noise * noise_of_sample * normal3(random_);
  sample.angular_velocity_imu_rad_s = turn.angle() / period_s * turn.axis() + gyroscope_bias_rad_s_ +
                                      params_.gyroscope_noise * noise_of_sample * normal3(random_);
  return sample;
}

}  // namespace situation_awareness
