// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/gps_ins_backlog.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"

namespace situation_awareness {
namespace {

/// Of the yaw that was followed back, at least.
constexpr double kLeastYawSigma_rad = 0.02;

struct YawThen {
  std::int64_t stamp_ns;
  double yaw_rad;
};

}  // namespace

GpsInsBacklog::GpsInsBacklog(const GpsInsParams& params, const GpsInsMounting& mounting, double duration_s)
    : params_((params.validate(), params)), mounting_(mounting), duration_s_(duration_s) {}

void GpsInsBacklog::add_imu(const InertialSample& sample) {
  if (!sample.specific_force_m_s2.allFinite() || !sample.angular_velocity_rad_s.allFinite()) return;
  if (latest_ns_ != StampOrder::kNone && sample.stamp_ns <= latest_ns_) {
    if (seconds_between(sample.stamp_ns, latest_ns_) <= StampOrder::kResetTimeJump_s) return;
    entries_.clear();
  }
  latest_ns_ = sample.stamp_ns;
  entries_.push_back({std::nullopt, sample});
  const auto is_old = [&](const Entry& entry) {
    return seconds_between(entry.fix ? entry.fix->stamp_ns : entry.sample.stamp_ns, latest_ns_) > duration_s_;
  };
  while (is_old(entries_.front())) entries_.pop_front();
}

void GpsInsBacklog::add_fix(const GeodeticFix& fix) { entries_.push_back({fix, {}}); }

std::vector<GpsInsPose> GpsInsBacklog::take_poses(const GpsInsPose& ready, const GeodeticPosition& origin) {
  std::vector<GpsInsPose> poses;
  std::deque<Entry> entries;
  entries.swap(entries_);
  if (!ready.is_ready) return poses;

  std::vector<YawThen> yaws;  // from the latest on
  Eigen::Quaterniond q(ready.T_world_base.linear());
  std::int64_t after_ns = ready.stamp_ns;
  for (auto entry = entries.rbegin(); entry != entries.rend(); ++entry) {
    const std::int64_t stamp_ns = entry->sample.stamp_ns;
    if (entry->fix || stamp_ns > after_ns) continue;
    const Eigen::Vector3d rate =
        mounting_.T_base_imu.linear() * entry->sample.angular_velocity_rad_s - ready.gyroscope_bias_rad_s;
    q = q * exp_so3(-seconds_between(stamp_ns, after_ns) * rate);
    after_ns = stamp_ns;
    yaws.push_back({stamp_ns, yaw_of(q)});
  }
  if (yaws.empty()) return poses;
  const Eigen::Matrix3d R = ready.T_world_base.linear();
  const double yaw_variance = R.row(2) * ready.covariance.bottomRightCorner<3, 3>() * R.row(2).transpose();

  GpsIns again(params_, mounting_, origin);
  for (const Entry& entry : entries) {
    if (!entry.fix) {
      if (entry.sample.stamp_ns >= ready.stamp_ns) break;
      again.add_imu(entry.sample);
      if (!again.is_ready()) continue;
      poses.push_back(again.pose());
      if (!poses.back().is_ready) poses.pop_back();
      continue;
    }
    again.add_fix(*entry.fix);
    if (again.is_ready() || !entry.fix->is_fix) continue;
    const auto then = std::lower_bound(yaws.begin(), yaws.end(), entry.fix->stamp_ns,
                                       [](const YawThen& yaw, std::int64_t stamp) { return yaw.stamp_ns > stamp; });
    if (then == yaws.end()) continue;
    const double since_s = seconds_between(then->stamp_ns, ready.stamp_ns);
    const double drift = since_s * since_s * ready.twist_covariance(5, 5);
    again.add_heading(entry.fix->stamp_ns, then->yaw_rad,
                      std::max(std::sqrt(yaw_variance + drift), kLeastYawSigma_rad));
  }
  return poses;
}

}  // namespace situation_awareness
