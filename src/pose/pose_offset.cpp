// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/pose_offset.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include <Eigen/LU>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"

namespace situation_awareness {
namespace {

// Chosen on flights in models/worlds with presets of scanners; test/pose and test/system hold what they must achieve.

/// Of scans that are matched; all others give their poses alone.
constexpr double kMinPeriod_s = 0.07;
/// Between scans; after a longer gap nothing is known of the motion in between.
constexpr double kMaxPeriod_s = 0.4;
/// Of the scans of a window: errors of poses grow with time, but slow changes of the motion need time to show.
constexpr double kMaxWindow_s = 5.0;
constexpr int kMinScans = 6;
/// A window ends when the motion in it gives the lag with this standard deviation, and another one begins.
constexpr double kEnough_s = 0.02;
/// Of a key scan to the scans that are placed by it.
constexpr double kMaxTravel_m = 2.5;
constexpr double kMaxTurn_rad = 1.5;
/// Of poses, added to that of the match.
constexpr double kPositionSigma_m = 0.01;
constexpr double kOffsetYawSigma_rad = 0.003;

/// Windows that are kept.
constexpr std::size_t kMaxWindows = 64;
/// A window that says less about the lag than this standard deviation is left out.
constexpr double kMaxWindowSigma_s = 0.3;
/// Fewer windows, counted by their weights, do not show their own spread. Below `kManyWindows` they show it badly:
/// three standard deviations are then as many times wider as Student's t has them beside its value for `kManyWindows`.
constexpr double kMinWindows = 4.0;
constexpr double kManyWindows = 6.0;
constexpr double kFewWindowsPower = 1.3;
/// Of the information about the lag that the motion promises, what the cost must have.
constexpr double kMinSeen = 0.5;
/// Of errors that all windows share: motion within a scan, and between two poses.
constexpr double kModelSigma_s = 0.003;
/// Beyond it the estimate is not known.
constexpr double kMaxSigma_s = 0.03;

/// Most poses that are kept: at the highest rate of scans.
constexpr double kMinPosePeriod_s = 0.01;

/// Of the four control points of a uniform cubic B-spline.
std::array<double, 4> spline_weights(double part) {
  const double rest = 1.0 - part, part2 = part * part, part3 = part2 * part;
  return {rest * rest * rest / 6.0, (3.0 * part3 - 6.0 * part2 + 4.0) / 6.0,
          (-3.0 * part3 + 3.0 * part2 + 3.0 * part + 1.0) / 6.0, part3 / 6.0};
}

Eigen::Matrix3d information_inverse(const Eigen::Matrix3d& information) {
  return (information + 1e-9 * information.trace() * Eigen::Matrix3d::Identity()).inverse();
}

}  // namespace

bool is_out_of_step(const PoseOffset& estimate, double used_offset_s) {
  constexpr double kSigmas = 3.0;
  constexpr double kMinDifference_s = 0.02;
  const double difference_s = std::abs(estimate.offset_s - used_offset_s);
  return estimate.is_known && difference_s > kSigmas * estimate.sigma_s && difference_s > kMinDifference_s;
}

PoseOffsetEstimator::PoseOffsetEstimator(double used_offset_s) : used_offset_s_(used_offset_s) {
  windows_.reserve(kMaxWindows);
}

void PoseOffsetEstimator::add(const Points& points) {
  const std::int64_t stamp_ns = points.stamp_ns;
  const double since_s = poses_.empty() ? 0.0 : seconds_between(poses_.back().stamp_ns, stamp_ns);
  if (!poses_.empty() && !(since_s > 0.0 && since_s <= kMaxPeriod_s)) {
    if (since_s <= 0.0) {  // time started again
      windows_.clear();
      oldest_window_ = 0;
      estimate_ = {};
    }
    poses_.clear();
    controls_.clear();
    placed_.clear();
    has_key_ = in_window_ = false;
  }
  if (poses_.empty() || since_s >= kMinPosePeriod_s) add_pose({stamp_ns, points.T_world_level});
  if (!has_key_ || seconds_between(last_.stamp_ns, stamp_ns) >= kMinPeriod_s) place(points);
  use_placed();
}

void PoseOffsetEstimator::add_pose(TimedPose pose) {
  if (!poses_.empty()) {  // continuous, for averages
    const double before_rad = poses_.back().T_world_level.yaw_rad;
    pose.T_world_level.yaw_rad = before_rad + wrap_to_pi(pose.T_world_level.yaw_rad - before_rad);
  }
  poses_.push_back(pose);
  if (poses_.size() >= 3) {
    const auto [before, middle, after] = std::tie(*(poses_.end() - 3), *(poses_.end() - 2), *(poses_.end() - 1));
    TimedPose control;
    control.stamp_ns = middle.stamp_ns + (after.stamp_ns - middle.stamp_ns - (middle.stamp_ns - before.stamp_ns)) / 4;
    control.T_world_level.translation_m =
        0.25 * (before.T_world_level.translation_m + after.T_world_level.translation_m) +
        0.5 * middle.T_world_level.translation_m;
    control.T_world_level.yaw_rad =
        0.25 * (before.T_world_level.yaw_rad + after.T_world_level.yaw_rad) + 0.5 * middle.T_world_level.yaw_rad;
    controls_.push_back(control);
    poses_.erase(poses_.begin());
  }
  const std::int64_t oldest_ns = (placed_.empty() ? pose.stamp_ns : placed_.front().stamp_ns) - nanoseconds(kMaxLag_s);
  std::size_t unused = 0;
  while (unused + 2 < controls_.size() && controls_[unused + 2].stamp_ns <= oldest_ns) ++unused;
  controls_.erase(controls_.begin(), controls_.begin() + static_cast<std::ptrdiff_t>(unused));
}

void PoseOffsetEstimator::place(const Points& points) {
  const TimedPose now{points.stamp_ns, points.T_world_level};
  if (has_key_) {
    const Pose2 guess = T_key_last_ * (inverse(last_.T_world_level) * now.T_world_level);
    const bool is_near = seconds_between(key_stamp_ns_, now.stamp_ns) <= kMaxWindow_s &&
                         guess.translation_m.norm() <= kMaxTravel_m && std::abs(guess.yaw_rad) <= kMaxTurn_rad;
    if (is_near) {
      const ScanMatch match = key_.match(points, guess);
      if (match.is_valid) {
        placed_.push_back({now.stamp_ns, false, match.T_key_level, match.information});
        last_ = now;
        T_key_last_ = match.T_key_level;
        return;
      }
    }
  }
  key_.set(points);
  key_stamp_ns_ = now.stamp_ns;
  has_key_ = true;
  last_ = now;
  T_key_last_ = Pose2();
  placed_.push_back({now.stamp_ns, true, Pose2(), Eigen::Matrix3d::Zero()});
}

bool PoseOffsetEstimator::pose_at(std::int64_t stamp_ns, double lag_s, Pose2& T_world_level) const {
  const std::int64_t time_ns = stamp_ns + nanoseconds(lag_s);
  const auto after = std::upper_bound(controls_.begin(), controls_.end(), time_ns,
                                      [](std::int64_t ns, const TimedPose& pose) { return ns < pose.stamp_ns; });
  if (after - controls_.begin() < 2 || controls_.end() - after < 2) return false;
  const auto control = after - 2;  // the first of four
  const double step_s = seconds_between(control[1].stamp_ns, control[2].stamp_ns);
  double part = seconds_between(control[1].stamp_ns, time_ns) / step_s;
  std::array<double, 4> weights = spline_weights(part);
  double time_s = 0.0;  // of the spline there, after control[1]
  for (std::size_t i = 0; i < 4; ++i) {
    time_s += weights[i] * seconds_between(control[1].stamp_ns, control[static_cast<std::ptrdiff_t>(i)].stamp_ns);
  }
  part += (seconds_between(control[1].stamp_ns, time_ns) - time_s) / step_s;
  weights = spline_weights(part);
  T_world_level.translation_m.setZero();
  T_world_level.yaw_rad = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Pose2& pose = control[static_cast<std::ptrdiff_t>(i)].T_world_level;
    T_world_level.translation_m += weights[i] * pose.translation_m;
    T_world_level.yaw_rad += weights[i] * pose.yaw_rad;
  }
  return true;
}

void PoseOffsetEstimator::use_placed() {
  if (controls_.size() < 2) return;
  const std::int64_t latest_ns = controls_[controls_.size() - 2].stamp_ns - nanoseconds(kMaxLag_s);
  std::size_t used = 0;
  for (; used < placed_.size() && placed_[used].stamp_ns < latest_ns; ++used) {
    if (placed_[used].is_key) {
      if (in_window_) finish_window();
      begin_window(placed_[used]);
    } else if (in_window_) {
      add_to_window(placed_[used]);
    }
  }
  placed_.erase(placed_.begin(), placed_.begin() + static_cast<std::ptrdiff_t>(used));
}

void PoseOffsetEstimator::begin_window(const Placed& key) {
  in_window_ = true;
  for (int lag = 0; lag < kLags; ++lag) {
    in_window_ = in_window_ && pose_at(key.stamp_ns, lag_s(lag), sums_.T_world_key[static_cast<std::size_t>(lag)]);
  }
  clear_sums();
}

void PoseOffsetEstimator::clear_sums() {
  sums_.scans = 0;
  sums_.information.setZero();
  sums_.weighted.fill(Eigen::Vector3d::Zero());
  sums_.squares.fill(0.0);
  sums_.change_weighted.setZero();
  sums_.change_squares = 0.0;
}

void PoseOffsetEstimator::add_to_window(const Placed& placed) {
  // The errors of match and pose are independent; in the frame of the key scan an error of its own pose is the same for
  // all scans.
  Eigen::Matrix3d Q = Eigen::Matrix3d::Zero();
  Q.diagonal() << kPositionSigma_m * kPositionSigma_m, kPositionSigma_m * kPositionSigma_m,
      kOffsetYawSigma_rad * kOffsetYawSigma_rad;
  const Eigen::Matrix3d of_both = placed.information * (Eigen::Matrix3d::Identity() + Q * placed.information).inverse();
  const Pose2 T_level_key = inverse(placed.T_key_level);
  const Eigen::Matrix3d Ad = adjoint_se2(T_level_key);
  const Eigen::Matrix3d W = Ad.transpose() * of_both * Ad;

  OfLags<Eigen::Vector3d> errors;
  for (std::size_t lag = 0; lag < kLags; ++lag) {
    Pose2 T_world_level;
    if (!pose_at(placed.stamp_ns, lag_s(static_cast<int>(lag)), T_world_level)) return;
    const Pose2 error = inverse(sums_.T_world_key[lag]) * T_world_level * T_level_key;
    errors[lag] << error.translation_m, wrap_to_pi(error.yaw_rad);
  }
  for (std::size_t lag = 0; lag < kLags; ++lag) {
    const Eigen::Vector3d weighted = W * errors[lag];
    sums_.weighted[lag] += weighted;
    sums_.squares[lag] += errors[lag].dot(weighted);
  }
  constexpr std::size_t kMiddle = kLags / 2, kStep = 5;
  const Eigen::Vector3d change =
      (errors[kMiddle + kStep] - errors[kMiddle - kStep]) / (2.0 * static_cast<double>(kStep) * kLagStep_s);
  const Eigen::Vector3d weighted = W * change;
  sums_.change_weighted += weighted;
  sums_.change_squares += change.dot(weighted);
  sums_.information += W;
  ++sums_.scans;
  if (sums_.scans < kMinScans) return;
  const bool is_enough = lag_information(information_inverse(sums_.information)) * kEnough_s * kEnough_s >= 1.0;
  if (!is_enough) return;
  // The next window may have the same key scan: its error, and that of its pose, is the same for all scans of a window.
  finish_window();
  clear_sums();
}

/// About the lag, with the error of the key scan's pose unknown: squares about the weighted mean.
double PoseOffsetEstimator::lag_information(const Eigen::Matrix3d& inverse) const {
  return sums_.change_squares - sums_.change_weighted.dot(inverse * sums_.change_weighted);
}

void PoseOffsetEstimator::finish_window() {
  if (sums_.scans < kMinScans) return;
  const Eigen::Matrix3d inverse = information_inverse(sums_.information);
  const double information = lag_information(inverse);
  if (!(information * kMaxWindowSigma_s * kMaxWindowSigma_s >= 1.0)) return;
  Window window;
  window.information_1_s2 = information;
  window.degrees_of_freedom = 3.0 * (sums_.scans - 1);
  for (std::size_t lag = 0; lag < kLags; ++lag) {
    window.cost[lag] = sums_.squares[lag] - sums_.weighted[lag].dot(inverse * sums_.weighted[lag]);
  }
  if (windows_.size() < kMaxWindows) {
    windows_.push_back(window);
  } else {
    windows_[oldest_window_] = window;
    oldest_window_ = (oldest_window_ + 1) % kMaxWindows;
  }
  update_estimate();
}

void PoseOffsetEstimator::update_estimate() {
  estimate_ = {};
  estimate_.windows = windows_.size();
  std::array<double, kMaxWindows> weights, levels, sorted;
  weights.fill(1.0);
  const std::size_t n = windows_.size();
  std::size_t best = 0;
  double offset_steps = 0.0, curvature = 0.0;
  constexpr int kRounds = 4;
  for (int round = 0; round < kRounds; ++round) {
    OfLags<double> cost;
    cost.fill(0.0);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t lag = 0; lag < kLags; ++lag) cost[lag] += weights[i] * windows_[i].cost[lag];
    }
    best = static_cast<std::size_t>(std::min_element(cost.begin(), cost.end()) - cost.begin());
    if (best == 0 || best + 1 == kLags) return;  // beyond the lags
    curvature = cost[best + 1] - 2.0 * cost[best] + cost[best - 1];
    offset_steps = 0.5 * (cost[best - 1] - cost[best + 1]) / curvature;
    // Windows with larger errors than most, such as jumps of the pose, have less weight.
    for (std::size_t i = 0; i < n; ++i) sorted[i] = levels[i] = windows_[i].cost[best] / windows_[i].degrees_of_freedom;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(n / 2),
                     sorted.begin() + static_cast<std::ptrdiff_t>(n));
    const double median = std::max(sorted[n / 2], std::numeric_limits<double>::min());
    for (std::size_t i = 0; i < n; ++i) weights[i] = 1.0 / (1.0 + levels[i] / median);
  }
  // Windows are independent, scans in them are not: the spread of the windows' slopes is that of the sum.
  double slopes2 = 0.0, total = 0.0, total2 = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const OfLags<double>& cost = windows_[i].cost;
    const double slope =
        0.5 * (cost[best + 1] - cost[best - 1]) + offset_steps * (cost[best + 1] - 2.0 * cost[best] + cost[best - 1]);
    slopes2 += weights[i] * weights[i] * slope * slope;
    const double information = weights[i] * windows_[i].information_1_s2;
    total += information;
    total2 += information * information;
  }
  const double effective = total * total / total2;
  // Poses that change by their noise alone promise information that the cost does not have.
  const bool is_seen = 0.5 * curvature >= kMinSeen * total * kLagStep_s * kLagStep_s;
  if (effective < kMinWindows || !is_seen) return;
  const double few = std::pow(std::max(kManyWindows / effective, 1.0), kFewWindowsPower);
  const double spread_s = few * kLagStep_s * std::sqrt(slopes2 * effective / (effective - 1.0)) / curvature;
  const double sigma_s = std::hypot(spread_s, kModelSigma_s);
  if (!(sigma_s <= kMaxSigma_s)) return;
  estimate_.is_known = true;
  estimate_.sigma_s = sigma_s;
  estimate_.offset_s = used_offset_s_ + lag_s(static_cast<int>(best)) + offset_steps * kLagStep_s;
}

}  // namespace situation_awareness
