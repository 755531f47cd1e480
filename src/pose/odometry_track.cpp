// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/odometry_track.hpp"

#include <cmath>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// s. A pose is extrapolated beyond the latest one for this time at most.
constexpr double kMaxExtrapolation_s = 0.15;

/// `part` of the motion from one pose to another, on an arc.
Pose2 part_of(const Pose2& from, const Pose2& to, double part) {
  return from * exp_se2(part * log_se2(inverse(from) * to));
}

/// Between poses nearer in time than this a velocity says little; a jump is then one by distance.
constexpr double kMinOdometryPeriod_s = 0.005;

}  // namespace

void OdometryTrackParams::validate() const { check_bounds(*this, "odometry"); }

OdometryTrack::OdometryTrack(const OdometryTrackParams& params) : params_(params), entries_(kCapacity) {
  params_.validate();
  counters_.reset();
}

OdometryTrack::Verdict OdometryTrack::add(std::int64_t stamp_ns, const Pose2& T_odom_base, std::int64_t received_ns) {
  if (!T_odom_base.translation_m.allFinite() || !std::isfinite(T_odom_base.yaw_rad)) {
    ++counters_["odometry not finite"];
    return Verdict::kRefused;
  }
  const bool is_repeated = stamp_ns == order_.latest_ns();
  const StampOrder::Verdict verdict = order_.judge(stamp_ns, received_ns);
  if (verdict == StampOrder::Verdict::kRefused) {
    ++counters_[order_.doubted() > 0 ? "odometry of another time"
                : is_repeated        ? "odometry stamped twice"
                                     : "odometry out of order"];
    return Verdict::kRefused;
  }
  const bool restarted = verdict == StampOrder::Verdict::kRestart;
  if (restarted) {
    ++counters_["odometry restarted"];
    clear();
  }
  Entry entry{stamp_ns, T_odom_base, 0};
  if (size_ > 0) {
    const Entry& before = latest();
    const double period_s = seconds_between(before.stamp_ns, stamp_ns);
    Pose2 motion = inverse(T_odom_latest_) * T_odom_base;
    const Eigen::Vector3d tau = log_se2(motion);
    const double judged_s = std::max(period_s, kMinOdometryPeriod_s);
    entry.jumps = before.jumps;
    if (tau.head<2>().norm() > params_.max_speed_m_s * judged_s ||
        std::abs(tau(2)) > params_.max_yaw_rate_rad_s * judged_s) {
      ++counters_["odometry jumped"];
      ++entry.jumps;
      motion = {};
      if (size_ > 1) {  // as before
        const Entry& earlier = (*this)[size_ - 2];
        const double part = std::min(
            1.0, period_s / std::max(kMinOdometryPeriod_s, seconds_between(earlier.stamp_ns, before.stamp_ns)));
        motion = exp_se2(part * log_se2(inverse(earlier.T_track_base) * before.T_track_base));
      }
    }
    entry.T_track_base = before.T_track_base * motion;
  }
  T_odom_latest_ = T_odom_base;
  if (size_ == kCapacity) {
    begin_ = (begin_ + 1) % kCapacity;
    --size_;
  }
  entries_[(begin_ + size_) % kCapacity] = entry;
  ++size_;
  return restarted ? Verdict::kRestarted : Verdict::kAdded;
}

std::size_t OdometryTrack::after(std::int64_t stamp_ns) const {
  std::size_t i = size_;
  while (i > 0 && (*this)[i - 1].stamp_ns > stamp_ns) --i;  // it is mostly one of the last
  return i;
}

bool OdometryTrack::at(std::int64_t stamp_ns, Entry& entry) const {
  const std::size_t next = after(stamp_ns);
  if (next == 0) return false;  // empty, or before the oldest
  entry = (*this)[next - 1];
  const double beyond_s = seconds_between(entry.stamp_ns, stamp_ns);
  entry.stamp_ns = stamp_ns;
  if (beyond_s <= 0.0) return true;
  if (next < size_) {
    const Entry& before = (*this)[next - 1];
    const Entry& behind = (*this)[next];
    const double part = beyond_s / seconds_between(before.stamp_ns, behind.stamp_ns);
    entry.T_track_base = part_of(before.T_track_base, behind.T_track_base, part);
    return true;
  }
  if (beyond_s > kMaxExtrapolation_s) return false;
  if (size_ < 2) return true;
  const Entry& earlier = (*this)[size_ - 2];
  const double part = beyond_s / std::max(kMinOdometryPeriod_s, seconds_between(earlier.stamp_ns, latest().stamp_ns));
  entry.T_track_base = part_of(latest().T_track_base,
                               latest().T_track_base * (inverse(earlier.T_track_base) * latest().T_track_base), part);
  return true;
}

}  // namespace situation_awareness
