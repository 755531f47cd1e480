// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/turn_consistency.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "situation_awareness/common/format.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// Time between angles that are kept, and their number: of more than a second, by which fixes may be late.
constexpr double kStep_s = 0.01;
constexpr std::size_t kSteps = 200;
/// A gap of the rates, after which the angle is not known any more.
constexpr double kGap_s = 1.0;
/// Length of a leg (m), and by standard deviations of a fix: its course is known to 0.2 rad. Slower ones have none.
constexpr double kLeg_m = 2.0, kLegSigmas = 10.0, kSlow_s = 10.0;
constexpr double kWindow_s = 60.0;
constexpr std::size_t kMostLegs = 256, kFewestLegs = 8;
/// What is said is of this time at least, in which the course had this standard deviation, four times that of a leg.
constexpr double kLeast_s = 8.0, kLeastTurn_rad = 0.5;
/// Squared correlation from which on one depends on the other.
constexpr double kDepends = 0.9;
/// Ratios beyond these are a contradiction. Not less than a half: a vehicle that keeps its heading while it circles has
/// the drift of the gyroscope in proportion to its course. In a banked turn the rate about the base's z is less than
/// that about the vertical.
constexpr double kMost = 2.0, kLeast = -0.5;

/// What drivers do that makes the rates turn otherwise than the course.
struct Cause {
  double ratio;
  const char* text;
};
constexpr std::array<Cause, 3> kCauses = {{{degrees(1.0), "as rates in deg/s do: rad/s are expected"},
                                           {-1.0,
                                            "as rates about an axis that points down do (x ahead, y to the "
                                            "right, z down: NED): positive to the left is expected"},
                                           {degrees(-1.0),
                                            "as rates in deg/s about an axis that points down do (NED): "
                                            "rad/s are expected, positive to the left"}}};
/// A ratio is that of a cause within this share of it, or so many standard errors.
constexpr double kSameRatio = 0.1, kSameSigmas = 3.0;

}  // namespace

TurnConsistency::TurnConsistency() {
  turned_.reserve(kSteps);
  legs_.reserve(kMostLegs);
}

void TurnConsistency::clear() {
  turned_.clear();
  next_ = 0;
  latest_ = {};
  has_rate_ = false;
  anchor_.reset();
  legs_.clear();
}

void TurnConsistency::add_rate(std::int64_t stamp_ns, double rate_rad_s) {
  if (!std::isfinite(rate_rad_s)) return;
  const double step_s = has_rate_ ? seconds_between(latest_.stamp_ns, stamp_ns) : 0.0;
  if (step_s < 0.0 || step_s > kGap_s) clear();
  if (has_rate_) latest_.angle_rad += 0.5 * step_s * (rate_rad_s_ + rate_rad_s);
  latest_.stamp_ns = stamp_ns;
  rate_rad_s_ = rate_rad_s;
  has_rate_ = true;
  if (!turned_.empty()) {
    const Turned& before = turned_[(next_ + turned_.size() - 1) % turned_.size()];
    if (seconds_between(before.stamp_ns, stamp_ns) < kStep_s) return;
  }
  if (turned_.size() < kSteps) {
    turned_.push_back(latest_);
  } else {
    turned_[next_] = latest_;
    next_ = (next_ + 1) % kSteps;
  }
}

std::optional<double> TurnConsistency::turned_at(std::int64_t stamp_ns) const {
  for (std::size_t i = turned_.size(); i-- > 0;) {  // from the latest on
    const Turned& at = turned_[(next_ + i) % turned_.size()];
    if (at.stamp_ns > stamp_ns) continue;
    const Turned& after = i + 1 < turned_.size() ? turned_[(next_ + i + 1) % turned_.size()] : latest_;
    const double span_s = seconds_between(at.stamp_ns, after.stamp_ns), part_s = seconds_between(at.stamp_ns, stamp_ns);
    if (part_s > std::max(span_s, kGap_s)) return std::nullopt;
    return span_s > 0.0 ? at.angle_rad + std::min(part_s / span_s, 1.0) * (after.angle_rad - at.angle_rad)
                        : at.angle_rad;
  }
  return std::nullopt;
}

void TurnConsistency::add_fix(std::int64_t stamp_ns, const Eigen::Vector2d& p_world_m, double sigma_m) {
  const std::optional<double> turned_rad = turned_at(stamp_ns);
  if (!turned_rad || !p_world_m.allFinite() || !(sigma_m >= 0.0)) return;
  const Anchor here{stamp_ns, p_world_m, *turned_rad, sigma_m};
  if (!anchor_ || stamp_ns < anchor_->stamp_ns || seconds_between(anchor_->stamp_ns, stamp_ns) > kSlow_s) {
    anchor_ = here;
    return;
  }
  const Eigen::Vector2d way_m = p_world_m - anchor_->p_world_m;
  if (way_m.norm() < std::max(kLeg_m, kLegSigmas * std::max(sigma_m, anchor_->sigma_m))) return;
  double course_rad = std::atan2(way_m.y(), way_m.x());
  if (!legs_.empty()) course_rad = legs_.back().course_rad + wrap_to_pi(course_rad - legs_.back().course_rad);
  if (legs_.size() == kMostLegs) legs_.erase(legs_.begin());
  legs_.push_back({stamp_ns, course_rad, 0.5 * (anchor_->turned_rad + *turned_rad)});
  const auto recent = std::find_if(legs_.begin(), legs_.end(), [stamp_ns](const Leg& leg) {
    return seconds_between(leg.stamp_ns, stamp_ns) <= kWindow_s;
  });
  legs_.erase(legs_.begin(), recent);
  anchor_ = here;
}

std::optional<TurnConsistency::Fit> TurnConsistency::fit() const {
  if (legs_.size() < kFewestLegs || seconds_between(legs_.front().stamp_ns, legs_.back().stamp_ns) < kLeast_s) {
    return std::nullopt;
  }
  const auto count = static_cast<double>(legs_.size());
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Leg& leg : legs_) mean += Eigen::Vector2d(leg.course_rad, leg.turned_rad) / count;
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  for (const Leg& leg : legs_) {
    const Eigen::Vector2d off = Eigen::Vector2d(leg.course_rad, leg.turned_rad) - mean;
    covariance += off * off.transpose() / count;
  }
  const double of_course = covariance(0, 0), of_both = covariance(0, 1), of_rates = covariance(1, 1);
  if (of_course < kLeastTurn_rad * kLeastTurn_rad || of_both * of_both < kDepends * of_course * of_rates) {
    return std::nullopt;
  }
  const double residual = std::max(of_rates - of_both * of_both / of_course, 0.0);
  return Fit{of_both / of_course, std::sqrt(residual / of_course / (count - 2.0))};
}

std::optional<double> TurnConsistency::ratio() const {
  const std::optional<Fit> turns = fit();
  return turns ? std::optional<double>(turns->ratio) : std::nullopt;
}

std::string TurnConsistency::contradiction() const {
  const std::optional<Fit> turns = fit();
  if (!turns || (turns->ratio < kMost && turns->ratio > kLeast)) return "";
  const char* cause = "rad/s, positive to the left?";
  for (const Cause& known : kCauses) {
    const double off = std::abs(turns->ratio - known.ratio);
    if (off < std::max(kSameRatio * std::abs(known.ratio), kSameSigmas * turns->sigma)) cause = known.text;
  }
  return formatted(
      "the rates of the IMU and the fixes contradict each other: the rates turn %.3g times as far as the "
      "course by the fixes (%s)",
      turns->ratio, cause);
}

}  // namespace situation_awareness
