// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/scan_order.hpp"

#include <algorithm>
#include <cmath>

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
/// Windows are independent, scans in them are not. An order is known from so many of them on, if it fits better by so
/// many standard errors, and by this part of the misfit: a scanner that hardly turns has a difference of nearly 0.
constexpr std::size_t kMinOrderWindows = 6;
constexpr double kMinOrderSigmas = 4.0;
constexpr double kMinOrderPreference = 0.05;

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
  if (is_matched) {
    preference_ += (match[1].misfit_m - match[0].misfit_m) / (match[1].misfit_m + match[0].misfit_m);
    ++scans_;
  }
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

void ScanOrderEstimator::begin_window(const std::array<const Points*, 2>& both) {
  for (std::size_t i = 0; i < 2; ++i) {
    matched_[i].key.set(*both[i]);
    matched_[i].T_key_level = Pose2();
    matched_[i].T_world_level = both[i]->T_world_level;
  }
  has_key_ = true;
  key_ns_ = latest_ns_;
  preference_ = 0.0;
  scans_ = 0;
  most_turn_rad_ = 0.0;
  add_turn(both);
}

void ScanOrderEstimator::finish_window() {
  if (scans_ < kMinOrderScans || most_turn_rad_ < kMinTurnOfSweep_rad) return;
  const double mean_of_window = preference_ / scans_;
  sum_ += mean_of_window;
  sum_squares_ += mean_of_window * mean_of_window;
  ++windows_;
  if (windows_ < kMinOrderWindows) return;
  const auto n = static_cast<double>(windows_);
  const double mean = sum_ / n;
  const double standard_error = std::sqrt(std::max(sum_squares_ / n - mean * mean, 0.0) / (n - 1.0));
  if (std::abs(mean) < kMinOrderPreference || std::abs(mean) < kMinOrderSigmas * standard_error) return;
  order_ = mean > 0.0 ? Order::kAsSaid : Order::kReversed;
}

}  // namespace situation_awareness
