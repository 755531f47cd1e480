// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/scan_order.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"

namespace situation_awareness {
namespace {

// Chosen on drives of test/system/pose_offset_test.cpp.

/// Between scans that are used, and at most: what lies between them is matched.
constexpr double kMinOrderPeriod_s = 0.07;
constexpr double kMaxOrderPeriod_s = 0.4;
/// Of a key scan to those that are matched with it.
constexpr double kMaxOrderWindow_s = 1.5;
constexpr double kMaxOrderTravel_m = 2.5;
constexpr double kMaxOrderTurn_rad = 1.5;
constexpr int kMinOrderScans = 3;
/// Of a scan of the window at least, within its sweep: an hour of standing says nothing, and is not to be averaged with
/// a minute of turning.
constexpr double kMinTurnOfSweep_rad = 0.006;
/// Windows are independent, scans in them are not. An order is known from so many of them on, if the preference is so
/// many standard errors from 0, and this part of what it is without noise of the key scan's hits: with 1 cm it is 0.27
/// for sweeps of 19 ms at up to 0.7 rad/s, and 0.65 for those of 67 ms. A scanner that hardly turns has nearly 0.
constexpr std::size_t kMinOrderWindows = 6;
constexpr double kMinOrderSigmas = 4.0;
constexpr double kMinOrderPreference = 0.15;
/// A hit that an order does not place, as none fits, is so far off.
constexpr double kUnplaced_m = 0.1;

}  // namespace

void ScanOrderEstimator::add(const Points& as_said, const Points& reversed) {
  if (order_ != Order::kUnknown) return;
  const double since_s = has_key_ ? seconds_between(latest_ns_, as_said.stamp_ns) : 0.0;
  if (has_key_ && since_s > 0.0 && since_s < kMinOrderPeriod_s) return;
  const std::array<const Points*, 2> both = {&as_said, &reversed};
  const bool goes_on = has_key_ && since_s > 0.0 && since_s <= kMaxOrderPeriod_s;
  latest_ns_ = as_said.stamp_ns;
  if (!goes_on) {
    finish_window();
    return begin_window(both);
  }
  add_turn(both);
  std::array<ScanMatch, 2> match;
  for (std::size_t i = 0; i < 2; ++i) {
    Matched& of = matched_[i];
    const Pose2 guess = of.T_key_level * (inverse(of.T_world_level) * both[i]->T_world_level);
    match[i] = of.key.match(*both[i], guess);
    of.T_key_level = match[i].is_valid ? match[i].T_key_level : guess;
    of.T_world_level = both[i]->T_world_level;
  }
  const bool is_matched = match[0].is_valid || match[1].is_valid;
  if (is_matched) compare(match);
  const Pose2& T_key_level = matched_[match[0].is_valid ? 0 : 1].T_key_level;
  const bool is_near = seconds_between(key_ns_, as_said.stamp_ns) < kMaxOrderWindow_s &&
                       T_key_level.translation_m.norm() < kMaxOrderTravel_m &&
                       std::abs(T_key_level.yaw_rad) < kMaxOrderTurn_rad;
  if (is_matched && is_near) return;
  finish_window();
  begin_window(both);
}

void ScanOrderEstimator::add_turn(const std::array<const Points*, 2>& both) {
  const double turn_rad = wrap_to_pi(both[1]->T_world_level.yaw_rad - both[0]->T_world_level.yaw_rad);
  most_turn_rad_ = std::max(most_turn_rad_, std::abs(turn_rad));
}

/// The offsets of a hit by the two orders, a and b, differ by what the turn within a sweep bends it and not by the
/// noise of its range. Where the driver's order is right, a is that noise, independent of the difference, so that the
/// squares b^2 - a^2 sum up to those of b - a; where the other one is, to their negative.
void ScanOrderEstimator::compare(std::array<ScanMatch, 2>& both) {
  for (ScanMatch& match : both) {
    std::sort(match.hits.begin(), match.hits.begin() + static_cast<std::ptrdiff_t>(match.count),
              [](const ScanMatch::Hit& a, const ScanMatch::Hit& b) { return a.beam < b.beam; });
  }
  const auto& [a, b] = both;
  for (std::size_t i = 0, j = 0; i < a.count || j < b.count;) {
    const bool has_a = i < a.count && (j == b.count || a.hits[i].beam <= b.hits[j].beam);
    const bool has_b = j < b.count && (i == a.count || b.hits[j].beam <= a.hits[i].beam);
    const double a_m = has_a ? static_cast<double>(a.hits[i++].offset_m) : kUnplaced_m;
    const double b_m = has_b ? static_cast<double>(b.hits[j++].offset_m) : kUnplaced_m;
    if ((!has_a && a.is_valid) || (!has_b && b.is_valid)) continue;  // an edge, at which chance decides
    gain_m2_ += b_m * b_m - a_m * a_m;
    difference_m2_ += (b_m - a_m) * (b_m - a_m);
  }
  ++scans_;
}

void ScanOrderEstimator::begin_window(const std::array<const Points*, 2>& both) {
  for (std::size_t i = 0; i < 2; ++i) {
    matched_[i].key.set(*both[i]);
    matched_[i].T_key_level = Pose2();
    matched_[i].T_world_level = both[i]->T_world_level;
  }
  has_key_ = true;
  key_ns_ = latest_ns_;
  gain_m2_ = difference_m2_ = 0.0;
  scans_ = 0;
  most_turn_rad_ = 0.0;
  add_turn(both);
}

void ScanOrderEstimator::finish_window() {
  if (scans_ < kMinOrderScans || most_turn_rad_ < kMinTurnOfSweep_rad) return;
  gain_m2_sum_ += gain_m2_;
  difference_m2_sum_ += difference_m2_;
  gain2_m4_ += gain_m2_ * gain_m2_;
  gain_difference_m4_ += gain_m2_ * difference_m2_;
  difference2_m4_ += difference_m2_ * difference_m2_;
  ++windows_;
  if (windows_ < kMinOrderWindows || !(difference_m2_sum_ > 0.0)) return;
  // 1 for the driver's order, -1 for the other one; its standard error by the spread of the windows about it.
  const double preference = gain_m2_sum_ / difference_m2_sum_;
  const auto n = static_cast<double>(windows_);
  const double squares_m4 =
      gain2_m4_ - 2.0 * preference * gain_difference_m4_ + preference * preference * difference2_m4_;
  const double standard_error = std::sqrt(std::max(squares_m4, 0.0) * n / (n - 1.0)) / difference_m2_sum_;
  if (std::abs(preference) < kMinOrderPreference || std::abs(preference) < kMinOrderSigmas * standard_error) return;
  order_ = preference > 0.0 ? Order::kAsSaid : Order::kReversed;
}

}  // namespace situation_awareness
