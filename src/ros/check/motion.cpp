// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/check/motion.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/common/format.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"

namespace situation_awareness {
namespace {

/// An altitude does not change by so much from fix to fix.
constexpr double kAltitudeStep_m = 20.0;

Eigen::Vector3d vector_of(const geometry_msgs::Vector3& v) { return {v.x, v.y, v.z}; }

}  // namespace

void ImuTopicCheck::look(const sensor_msgs::Imu& msg) {
  const Eigen::Vector3d force = vector_of(msg.linear_acceleration), rate = vector_of(msg.angular_velocity);
  if (!force.allFinite() || !rate.allFinite()) {
    ++not_finite_;
    return;
  }
  if (forces_m_s2_.empty()) has_orientation_ = msg.orientation_covariance[0] >= 0.0;
  forces_m_s2_.push_back(static_cast<float>(force.norm()));
  force_sum_ += force;
  largest_rate_rad_s_ = std::max(largest_rate_rad_s_, rate.norm());
}

Eigen::Vector3d ImuTopicCheck::mean_force_m_s2() const {
  return force_sum_ / static_cast<double>(std::max<std::size_t>(forces_m_s2_.size(), 1));
}

void ImuTopicCheck::add_to(TopicReport& report) const {
  if (not_finite_ > 0) {
    report.findings.push_back({formatted("%zu samples are not finite", not_finite_), "they are not used"});
  }
  if (forces_m_s2_.empty()) return;
  std::vector<float> forces = forces_m_s2_;
  const auto middle = forces.begin() + static_cast<std::ptrdiff_t>(forces.size() / 2);
  std::nth_element(forces.begin(), middle, forces.end());
  const Eigen::Vector3d mean = mean_force_m_s2();
  report.facts.push_back(
      formatted("force %.2f m/s^2 in the median, (%.1f, %.1f, %.1f) in the mean; rates of up to "
                "%.2f rad/s; %s orientation",
                static_cast<double>(*middle), mean.x(), mean.y(), mean.z(), largest_rate_rad_s_,
                has_orientation_ ? "with an" : "no"));
}

void FixTopicCheck::look(const sensor_msgs::NavSatFix& msg) {
  if (msg.status.status < sensor_msgs::NavSatStatus::STATUS_FIX) {
    ++without_fix_;
    return;
  }
  if (!std::isfinite(msg.latitude) || !std::isfinite(msg.longitude)) {
    ++without_position_;
    return;
  }
  if (!std::isfinite(msg.altitude)) ++without_altitude_;
  if (msg.position_covariance_type == sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN) ++without_covariance_;
  largest_sigma_m_ = std::max(largest_sigma_m_, std::sqrt(std::max(0.0, msg.position_covariance[0])));
  if (last_ && std::isfinite(msg.altitude) && std::isfinite(last_->altitude)) {
    const double step_m = msg.altitude - last_->altitude;
    if (std::abs(step_m) > std::abs(altitude_step_m_)) altitude_step_m_ = step_m;
  }
  last_ = msg;
}

void FixTopicCheck::add_to(TopicReport& report) const {
  const auto some = [&](std::size_t count, const char* what, const char* remedy) {
    if (count > 0) report.findings.push_back({formatted("%zu of %zu fixes %s", count, stamps_.count(), what), remedy});
  };
  some(without_fix_, "say that there is none (STATUS_NO_FIX)", "they are not used");
  some(without_position_, "have no latitude and longitude", "they are not used");
  some(without_altitude_, "have no altitude", "they are used in latitude and longitude");
  some(without_covariance_, "have no covariance", "gps_ins uses fix_sigma_m for them: set it to the receiver's");
  if (std::abs(altitude_step_m_) > kAltitudeStep_m) {
    report.findings.push_back({formatted("the altitude jumps by %.1f m", altitude_step_m_),
                               "let the receiver give heights above the ellipsoid, always"});
  }
  if (!last_) return;
  report.facts.push_back(
      formatted("at latitude %.6f, longitude %.6f, altitude %.1f m; standard deviation of up to %.2f "
                "m",
                last_->latitude, last_->longitude, last_->altitude, largest_sigma_m_));
}

void OdometryTopicCheck::look(const nav_msgs::Odometry& msg) {
  const std::string defect = odometry_msg_defect(msg);
  if (!defect.empty()) ++defects_[defect];
  if (stamps_.count() == 1) child_frame_ = tf2_frame(msg.child_frame_id);
  has_covariance_ = has_covariance_ || msg.pose.covariance[0] > 0.0;
}

void OdometryTopicCheck::add_to(TopicReport& report) const {
  report.facts.push_back("pose of " + (child_frame_.empty() ? "?" : child_frame_) +
                         (has_covariance_ ? ", with a covariance" : ", without covariance"));
  add_defects(defects_, stamps_.count(), "messages", "mend the driver's message", report);
  if (frame_.empty() || child_frame_.empty()) {
    report.findings.push_back({std::string("it has no ") + (frame_.empty() ? "frame_id" : "child_frame_id"),
                               "--odom-frame and --base-frame name the frames of odometry"});
  }
}

}  // namespace situation_awareness
