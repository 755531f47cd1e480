// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/gps_ins_report.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <ros/console.h>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/nis_report.hpp"

namespace situation_awareness {
namespace {

using diagnostic_msgs::DiagnosticStatus;

/// s. Receivers have a fix once a second at least; without one for so long something is wrong.
constexpr double kLongWithoutFix_s = 5.0;

void add_vector(StageDiagnostics::Status& status, const std::string& name, const Eigen::Vector3d& v) {
  status.addf(name, "%.5f %.5f %.5f", v.x(), v.y(), v.z());
}

}  // namespace

void GpsInsReport::add() {
  const GpsIns* filter = input_.filter();
  if (filter == nullptr || filter->is_ready() == is_ready_) return;
  is_ready_ = filter->is_ready();
  if (is_ready_) {
    ROS_INFO_STREAM(name_ << ": the pose is ready");
  } else {
    ROS_WARN_STREAM(name_ << ": the pose is not ready any more: " << filter->reason());
  }
}

void GpsInsReport::report(StageDiagnostics::Status& status) {
  GpsIns* filter = input_.filter();
  if (filter == nullptr) {
    status.add("pose", "not ready: " + input_.why_not_ready());
  } else {
    report_filter(*filter, status);
  }
  const std::string contradiction = input_.contradiction();
  if (!contradiction.empty()) status.mergeSummary(DiagnosticStatus::WARN, contradiction);
  for (const auto& [reason, count] : input_.counters()) status.add(reason, count);
}

void GpsInsReport::report_filter(GpsIns& filter, StageDiagnostics::Status& status) {
  const GpsInsPose pose = filter.pose();
  status.add("pose", pose.is_ready ? "ready" : "not ready: " + std::string(pose.reason));
  if (filter.origin()) {
    status.addf("origin", "%.7f,%.7f,%.3f", filter.origin()->latitude_deg, filter.origin()->longitude_deg,
                filter.origin()->altitude_m);
  }
  constexpr const char* kSensors[] = {"fix", "altitude", "heading", "sideslip"};
  for (int i = 0; i < 4; ++i) {
    const auto summary = report_nis(filter.nis(static_cast<GpsInsSensor>(i)), status, kSensors[i]);
    if (i == 0 && summary.matches > 0) used_ns_ = filter.stamp_ns();
  }
  const std::int64_t now_ns = filter.stamp_ns();
  if (now_ns < used_ns_) used_ns_ = StampOrder::kNone;  // time started again
  if (now_ns != StampOrder::kNone && input_.fix_stamp_ns() != StampOrder::kNone) {
    status.addf("age of the last fix [s]", "%.2f", seconds_between(input_.fix_stamp_ns(), now_ns));
  }
  if (pose.is_ready) {
    const Eigen::Matrix<double, 6, 6>& P = pose.covariance;
    const double sigma_m = std::sqrt(std::max(P(0, 0), P(1, 1)));
    status.addf("sigma x [m]", "%.3f", std::sqrt(P(0, 0)));
    status.addf("sigma y [m]", "%.3f", std::sqrt(P(1, 1)));
    status.addf("sigma z [m]", "%.3f", std::sqrt(P(2, 2)));
    const Eigen::RowVector3d up_base = pose.T_world_base.linear().row(2);  // the yaw turns about it
    status.addf("sigma yaw [rad]", "%.4f",
                std::sqrt((up_base * P.bottomRightCorner<3, 3>() * up_base.transpose()).value()));
    add_vector(status, "accelerometer bias [m/s^2]", pose.accelerometer_bias_m_s2);
    add_vector(status, "gyroscope bias [rad/s]", pose.gyroscope_bias_rad_s);
    const FixNoise noise = filter.fix_noise();
    status.addf("correlated share of fixes", "%.3f", noise.correlated_share);
    status.addf("correlation of fixes [s]", "%.1f", noise.correlation_s);
    status.addf("accelerometer noise [m/s^2/sqrt(Hz)]", "%.5f", filter.imu_noise()(0));
    status.addf("gyroscope noise [rad/s/sqrt(Hz)]", "%.6f", filter.imu_noise()(1));
    if (used_ns_ != StampOrder::kNone && seconds_between(used_ns_, now_ns) > kLongWithoutFix_s) {
      char text[128];
      std::snprintf(text, sizeof text, "no fix was used for %.0f s: the position is known to %.1f m",
                    seconds_between(used_ns_, now_ns), sigma_m);
      status.mergeSummary(DiagnosticStatus::WARN, text);
    }
  }
  for (const auto& [reason, count] : filter.counters()) status.add(reason, count);
}

}  // namespace situation_awareness
