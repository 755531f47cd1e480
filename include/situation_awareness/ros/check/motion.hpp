// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <Eigen/Core>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/ros/check/topic_check.hpp"

namespace situation_awareness {

/// Force, rates and orientation of an IMU.
class ImuTopicCheck : public MessageCheck<sensor_msgs::Imu> {
 public:
  using MessageCheck::MessageCheck;

  /// Mean force (m/s^2) in the axes of the IMU: along its z where it stands upright.
  Eigen::Vector3d mean_force_m_s2() const;

 protected:
  void look(const sensor_msgs::Imu& msg) override;
  void add_to(TopicReport& report) const override;

 private:
  bool has_orientation_ = false;
  std::vector<float> forces_m_s2_;                       ///< magnitudes
  Eigen::Vector3d force_sum_ = Eigen::Vector3d::Zero();  ///< m/s^2, in the axes of the IMU
  double largest_rate_rad_s_ = 0.0;
  std::size_t not_finite_ = 0;
};

/// Status, covariance and altitude of the fixes of a GPS receiver.
class FixTopicCheck : public MessageCheck<sensor_msgs::NavSatFix> {
 public:
  using MessageCheck::MessageCheck;

 protected:
  void look(const sensor_msgs::NavSatFix& msg) override;
  void add_to(TopicReport& report) const override;

 private:
  std::size_t without_fix_ = 0, without_position_ = 0, without_altitude_ = 0, without_covariance_ = 0;
  std::optional<sensor_msgs::NavSatFix> last_;
  double largest_sigma_m_ = 0.0, altitude_step_m_ = 0.0;
};

/// Frames and covariances of odometry.
class OdometryTopicCheck : public MessageCheck<nav_msgs::Odometry> {
 public:
  using MessageCheck::MessageCheck;

  /// Child frame of the first message, as tf2 names it; empty if it has none.
  const std::string& child_frame() const { return child_frame_; }

 protected:
  void look(const nav_msgs::Odometry& msg) override;
  void add_to(TopicReport& report) const override;

 private:
  Counters defects_;
  std::string child_frame_;
  bool has_covariance_ = false;
};

}  // namespace situation_awareness
