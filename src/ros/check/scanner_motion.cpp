// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/check/scanner_motion.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "situation_awareness/common/format.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"

namespace situation_awareness {
namespace {

/// A scan is distorted by more than the noise if the scanner turns or moves by this from its first beam to its last.
constexpr double kDistortion_rad = 0.02, kDistortion_m = 0.05;
/// A scanner that stands still is found within these of its first place.
constexpr double kStands_m = 0.1, kStands_rad = 0.05;

}  // namespace

void ScannerMotion::add(const Scan& scan, const Eigen::Isometry3d& T_world_lidar) {
  has_times_ = scan.time_increment_s > 0.0;
  const double step_s = stamp_ns_ ? seconds_between(*stamp_ns_, scan.stamp_ns) : 0.0;
  if (step_s > 0.0) {
    const double way_m = (T_world_lidar.translation() - T_world_lidar_.translation()).norm();
    const double turned_rad = Eigen::AngleAxisd(T_world_lidar_.linear().transpose() * T_world_lidar.linear()).angle();
    way_m_ += way_m;
    turned_rad_ += turned_rad;
    speed_m_s_ = std::max(speed_m_s_, way_m / step_s);
    rate_rad_s_ = std::max(rate_rad_s_, turned_rad / step_s);
  }
  stamp_ns_ = scan.stamp_ns;
  T_world_lidar_ = T_world_lidar;
}

void ScannerMotion::report(const std::string& topic, double period_s, std::vector<std::string>& facts,
                           std::vector<Finding>& findings) const {
  if (!stamp_ns_) return;
  facts.push_back(formatted("the scanner moves %.1f m, at up to %.2f m/s, and turns by %.0f deg, at up to %.2f rad/s",
                            way_m_, speed_m_s_, degrees(turned_rad_), rate_rad_s_));
  if (!has_times_ && (rate_rad_s_ * period_s > kDistortion_rad || speed_m_s_ * period_s > kDistortion_m)) {
    findings.push_back(
        {formatted("%s moves by up to %.2f m and turns by up to %.1f deg from scan to scan, and its beams "
                   "have no times",
                   topic.c_str(), speed_m_s_ * period_s, degrees(rate_rad_s_ * period_s)),
         "let the driver of a spinning scanner set time_increment"});
  }
}

void StandingScanner::add(const Scan& scan) {
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  points_ = project_horizontally(scan, T, T, std::move(points_));
  const ScanMatch match = has_key_ ? key_.match(points_, T_key_scan_) : ScanMatch{};
  if (match.is_valid) {
    T_key_scan_ = match.T_key_level;
    const Pose2 T_first_scan = T_first_key_ * T_key_scan_;
    largest_m_ = std::max(largest_m_, T_first_scan.translation_m.norm());
    largest_rad_ = std::max(largest_rad_, std::abs(wrap_to_pi(T_first_scan.yaw_rad)));
    return;
  }
  // The scan is taken for one at the place of the latest that could be matched.
  T_first_key_ = T_first_key_ * T_key_scan_;
  T_key_scan_ = Pose2{};
  key_.set(points_);
  has_key_ = true;
}

void StandingScanner::report(const std::string& topic, std::vector<Finding>& findings) const {
  if (largest_m_ < kStands_m && largest_rad_ < kStands_rad) return;
  findings.push_back(
      {formatted("%s moves: what it sees is at places of up to %.2f m and %.0f deg beside those at first, "
                 "and nothing says where it is",
                 topic.c_str(), largest_m_, degrees(largest_rad_)),
       "record its poses in /tf: a map as of a scanner that stands is wrong"});
}

}  // namespace situation_awareness
