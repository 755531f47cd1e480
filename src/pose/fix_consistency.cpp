// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/fix_consistency.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/common/format.hpp"
#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

/// Messages by which a delay is known, and the least time between the receipts of samples (s): together they take a
/// second, in which a clock that counts seconds has shown all of its delays.
constexpr std::size_t kSamples = 50, kFixes = 5;
constexpr double kSamplesApart_s = 0.0199;
/// s. Stamps of fixes that are ahead of those of the IMU by more are a contradiction: a fix cannot be received before
/// its time, but samples of an IMU may be under way for as long.
constexpr double kMostLead_s = 0.2;
/// In standard deviations, besides.
constexpr double kLeadSigmas = 5.0;
/// s. GPS time is so far ahead of UTC since 2017 (IERS Bulletin C 52), and this is how exactly it must fit.
constexpr double kLeapSeconds_s = 18.0, kSameLead_s = 1.1;
/// Altitudes jump where they differ by more than this, and what errors and a climb explain. Heights above the ellipsoid
/// and above the sea differ by up to 106 m; a jump that is less harms little.
constexpr double kJump_m = 10.0, kClimb_m_s = 10.0;
/// Altitudes far off, after which they are no outliers.
constexpr int kFewestOff = 3;

double median_of(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

FixConsistency::FixConsistency() : imu_(kSamples, kSamplesApart_s), fixes_(kFixes, 0.0) {}

void FixConsistency::Delays::add(std::int64_t stamp_ns, std::int64_t received_ns) {
  if (received_ns == StampOrder::kNone) return;
  if (received_ns_ != StampOrder::kNone && std::abs(seconds_between(received_ns_, received_ns)) < apart_s_) return;
  received_ns_ = received_ns;
  const double delay_s = seconds_between(stamp_ns, received_ns);
  if (seconds_.size() < most_) {
    seconds_.push_back(delay_s);
  } else {
    seconds_[next_] = delay_s;
    next_ = (next_ + 1) % most_;
  }
}

FixConsistency::Lead FixConsistency::Delays::median() const {
  std::vector<double> values = seconds_;
  const double median_s = median_of(values);
  for (double& value : values) value = std::abs(value - median_s);
  // 1.48: the standard deviation of a normal distribution by its median deviation. That of the median is not less where
  // delays of messages one after another are alike, as those of a coarse clock.
  return {median_s, 1.48 * median_of(values)};
}

std::optional<FixConsistency::Lead> FixConsistency::lead() const {
  if (!imu_.is_known() || !fixes_.is_known()) return std::nullopt;
  const Lead of_imu = imu_.median(), of_fixes = fixes_.median();
  return Lead{of_imu.lead_s - of_fixes.lead_s, std::hypot(of_imu.sigma_s, of_fixes.sigma_s)};
}

void FixConsistency::add_altitude(std::int64_t stamp_ns, double altitude_m, double sigma_m) {
  if (!std::isfinite(altitude_m) || !(sigma_m >= 0.0)) return;
  const double since_s =
      altitude_stamp_ns_ == StampOrder::kNone ? 0.0 : std::abs(seconds_between(altitude_stamp_ns_, stamp_ns));
  const double jump_m = altitude_m - altitude_m_;
  const double most_m = kJump_m + kClimb_m_s * since_s + kLeadSigmas * std::hypot(sigma_m, altitude_sigma_m_);
  if (altitude_stamp_ns_ != StampOrder::kNone && std::abs(jump_m) > most_m) {
    jump_m_ = jump_m;
    if (++off_ < kFewestOff) return;
    has_jumped_ = true;
  }
  off_ = 0;
  altitude_stamp_ns_ = stamp_ns;
  altitude_m_ = altitude_m;
  altitude_sigma_m_ = sigma_m;
}

std::string FixConsistency::contradiction(double most_late_s) const {
  const std::optional<Lead> by = lead();
  if (by) {
    const double most_s = kLeadSigmas * by->sigma_s + (by->lead_s > 0.0 ? kMostLead_s : most_late_s);
    if (std::abs(by->lead_s) > most_s) {
      const bool is_leap = std::abs(std::abs(by->lead_s) - kLeapSeconds_s) < kSameLead_s;
      const char* const cause = !is_leap           ? "the clocks of both must be the same"
                                : by->lead_s > 0.0 ? "as GPS time is of UTC: fixes must be stamped in UTC"
                                                   : "as UTC is of GPS time: samples must be stamped in UTC";
      return formatted("the stamps of the fixes are %.*f s %s those of the IMU, by when both were received (%s)",
                       is_leap ? 0 : 1, std::abs(by->lead_s), by->lead_s > 0.0 ? "ahead of" : "behind", cause);
    }
  }
  if (!has_jumped_) return "";
  return formatted(
      "the altitude of the fixes jumps by %.1f m: does the receiver switch between heights above the ellipsoid "
      "and above the sea",
      jump_m_);
}

}  // namespace situation_awareness
