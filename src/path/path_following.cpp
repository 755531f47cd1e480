// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/path_following.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// 1/s. Gain of turns on the spot.
constexpr double kTurnOnSpotGain_1_s = 1.5;

using FollowingState = PathFollowingResult::State;

constexpr double kLimitStep_m = 0.05;
constexpr double kMostLimits = 200'000.0;
// So that the vehicle gets to the end of a path, where its speed by the square root goes to zero: a quarter of the
// usual tolerance in a period of 0.1 s.
constexpr double kCreep_m_s = 0.03;
constexpr double kLongestPeriod_s = 0.2;  // of calls; after a longer pause speeds change as in this time
constexpr double kAtRest_m_s = 0.02;
// Beyond this error of heading a turn keeps its direction, whatever noise says of the shorter way.
constexpr double kBehind_rad = 2.6;

double towards(double from, double to, double least_step, double most_step) {
  return std::clamp(to, from + least_step, from + most_step);
}

}  // namespace

FollowingError following_error(const Pose2& T_world_reference, const Pose2& T_world_base) {
  const Pose2 error = inverse(T_world_reference) * T_world_base;
  return {error.translation_m.x(), error.translation_m.y(), wrap_to_pi(error.yaw_rad)};
}

void PathFollowingParams::validate() const {
  check_bounds(*this, "path");
  if (!(turn_to_rad < turn_from_rad)) {
    throw std::invalid_argument("path.turn_to_rad must be less than path.turn_from_rad");
  }
}

Velocity controlled(const FollowingError& error, const Velocity& reference) {
  const double u1r = reference.speed_m_s;
  return {u1r - kGainAlong_1_m * std::abs(u1r) * error.along_m,
          reference.turn_rate_rad_s - kGainAcross_1_m2 * u1r * error.across_m -
              kGainHeading_1_m * std::abs(u1r) * std::tan(error.heading_rad)};
}

PathFollowing::PathFollowing(const Path& path, const VehicleParams& vehicle, const PathFollowingParams& params,
                             const std::string& source)
    : vehicle_(vehicle), params_(params) {
  vehicle_.validate();
  params_.validate();
  ways_.emplace_back(path, source);
  if (!path.closed) ways_.emplace_back(reversed(path), source);
  limit_step_m_ = std::max(kLimitStep_m, ways_.front().length_m() / kMostLimits);
  limits_m_s_.resize(ways_.size());
  for (std::size_t i = 0; i < ways_.size(); ++i) tabulate_limits(i);
}

/// By the file, the vehicle and the bends, and from the end on so that the vehicle can slow down in time.
void PathFollowing::tabulate_limits(std::size_t direction) {
  const SplinePath& way = ways_[direction];
  std::vector<double>& limits_m_s = limits_m_s_[direction];
  const auto count = static_cast<std::size_t>(std::ceil(way.length_m() / limit_step_m_)) + 1;
  for (std::size_t i = 0; i < count; ++i) {
    const PathPoint point = way.at(std::min(static_cast<double>(i) * limit_step_m_, way.length_m() * (1.0 - 1e-12)));
    const double bend_1_m = std::abs(point.curvature_1_m);
    double limit_m_s = std::min(vehicle_.max_speed_m_s, way.speed_m_s(point.segment).value_or(1e9));
    if (bend_1_m > 1e-9) {
      // A fifth of the turn rate is left for corrections.
      limit_m_s = std::min({limit_m_s, std::sqrt(params_.lateral_acceleration_m_s2 / bend_1_m),
                            0.8 * vehicle_.max_turn_rate_rad_s / bend_1_m});
    }
    limits_m_s.push_back(limit_m_s);
  }
  if (!way.closed()) limits_m_s.back() = 0.0;
  const int rounds = way.closed() ? 2 : 1;
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t i = count - 1; i-- > 0;) {
      const double next_m_s = limits_m_s[i + 1];
      const double step_m = std::min(limit_step_m_, way.length_m() - static_cast<double>(i) * limit_step_m_);
      limits_m_s[i] = std::min(limits_m_s[i], std::sqrt(next_m_s * next_m_s + 2.0 * vehicle_.slowing_m_s2 * step_m));
    }
    if (way.closed()) limits_m_s.back() = std::min(limits_m_s.back(), limits_m_s.front());
  }
}

double PathFollowing::speed_limit_m_s(double way_m) const {
  const std::vector<double>& limits_m_s = limits_m_s_[result_.there ? 0 : 1];
  const auto i = std::min(static_cast<std::size_t>(std::max(way_m, 0.0) / limit_step_m_), limits_m_s.size() - 1);
  const double next_m_s = limits_m_s[std::min(i + 1, limits_m_s.size() - 1)];
  const double to_next_m = std::max(static_cast<double>(i + 1) * limit_step_m_ - way_m, 0.0);
  double limit_m_s = std::min(limits_m_s[i], std::sqrt(next_m_s * next_m_s + 2.0 * vehicle_.slowing_m_s2 * to_next_m));
  const double left_m = way().length_m() - way_m;
  if (!way().closed() || is_last()) {
    limit_m_s = std::min(limit_m_s, std::sqrt(2.0 * vehicle_.slowing_m_s2 * std::max(left_m, 0.0)));
  }
  return std::max(limit_m_s, std::min(kCreep_m_s, vehicle_.max_speed_m_s));
}

void PathFollowing::start() {
  running_ = true;
  located_ = false;
  result_.state = FollowingState::kStopped;
  result_.transit = 0;
  pause_left_s_ = 0.0;
  turn_sign_ = 0.0;
}

void PathFollowing::stop() { running_ = false; }

void PathFollowing::locate(const Pose2& T_world_base) {
  if (located_) {
    result_.way_m = way().nearest_m(T_world_base.translation_m, result_.way_m);
  } else {
    const double way_m = ways_.front().nearest_m(T_world_base.translation_m);
    const bool there = ways_.front().closed() || way_m < 0.5 * ways_.front().length_m();
    located_ = true;
    begin_transit(T_world_base, there);
  }
  result_.error = following_error(way().at(result_.way_m).pose(), T_world_base);
}

void PathFollowing::begin_transit(const Pose2& T_world_base, bool there) {
  result_.there = there;
  result_.way_m = way().nearest_m(T_world_base.translation_m);
  result_.error = following_error(way().at(result_.way_m).pose(), T_world_base);
  turn_sign_ = 0.0;
}

/// Of an open path, or at the end of a round.
bool PathFollowing::at_the_end(double way_before_m) const {
  const bool is_near = way().length_m() - result_.way_m <= params_.goal_tolerance_m;
  const bool is_round = way().closed() && way_before_m - result_.way_m > 0.5 * way().length_m();
  return way().closed() ? is_round || (is_last() && is_near) : is_near;
}

double PathFollowing::period_since(std::int64_t stamp_ns) {
  const double period_s = stamp_ns_ ? seconds_between(*stamp_ns_, stamp_ns) : 0.0;
  stamp_ns_ = stamp_ns;
  return std::clamp(period_s, 0.0, kLongestPeriod_s);
}

const PathFollowingResult& PathFollowing::brake(std::int64_t stamp_ns) {
  command(0.0, vehicle_.braking_m_s2, 0.0, period_since(stamp_ns));
  if (!running_) result_.state = FollowingState::kStopped;
  return result_;
}

const PathFollowingResult& PathFollowing::update(std::int64_t stamp_ns, const Pose2& T_world_base,
                                                 const AllowedMotion& allowed) {
  const double period_s = period_since(stamp_ns);
  const double before_m = result_.way_m;
  const bool was_located = located_;
  locate(T_world_base);
  const bool is_allowed = result_.command.speed_m_s <= allowed.speed_m_s;
  const double slowing_m_s2 = is_allowed ? vehicle_.slowing_m_s2 : vehicle_.braking_m_s2;
  if (!running_) {
    if (result_.state != FollowingState::kArrived) result_.state = FollowingState::kStopped;
    command(0.0, slowing_m_s2, 0.0, period_s);
    return result_;
  }
  if (std::hypot(result_.error.along_m, result_.error.across_m) > params_.max_error_m) {
    result_.state = FollowingState::kOffPath;
    command(0.0, vehicle_.braking_m_s2, 0.0, period_s);
    return result_;
  }
  if (result_.state == FollowingState::kWaiting) {
    pause_left_s_ -= period_s;
    command(0.0, slowing_m_s2, 0.0, period_s);
    if (pause_left_s_ > 0.0) return result_;
    ++result_.transit;
    begin_transit(T_world_base, !result_.there);
    result_.state = FollowingState::kTurning;
    return result_;
  }
  if (was_located && at_the_end(before_m)) {
    if (is_last()) {
      running_ = false;
      result_.state = FollowingState::kArrived;
    } else if (way().closed()) {
      ++result_.transit;
    } else {
      pause_left_s_ = params_.pause_s;
      result_.state = FollowingState::kWaiting;
    }
    if (!way().closed() || !running_) {
      command(0.0, slowing_m_s2, 0.0, period_s);
      return result_;
    }
  }
  const double limit_rad = turn_sign_ != 0.0 ? params_.turn_to_rad : params_.turn_from_rad;
  if (std::abs(result_.error.heading_rad) > limit_rad) {
    turn(allowed.may_turn, slowing_m_s2, period_s);
  } else {
    turn_sign_ = 0.0;
    drive(allowed.speed_m_s, slowing_m_s2, period_s);
  }
  return result_;
}

void PathFollowing::drive(double allowed_m_s, double slowing_m_s2, double period_s) {
  result_.state = FollowingState::kDriving;
  const double limit_m_s = std::min(speed_limit_m_s(result_.way_m), std::max(allowed_m_s, 0.0));
  const double before_m_s = result_.command.speed_m_s;
  const double u1r = towards(before_m_s, limit_m_s, -slowing_m_s2 * period_s, vehicle_.acceleration_m_s2 * period_s);

  // The reference moves as the vehicle does along the path: it is the nearest point.
  const PathPoint reference = way().at(result_.way_m);
  const double kappa = reference.curvature_1_m;
  const double ahead_m_s =
      u1r * std::cos(result_.error.heading_rad) / std::max(1.0 - kappa * result_.error.across_m, 0.2);
  // The vehicle heads for the path at no more than 45 degrees, whatever its distance.
  const double most_across_m = kGainHeading_1_m / kGainAcross_1_m2;
  FollowingError error = result_.error;
  error.across_m = std::clamp(error.across_m, -most_across_m, most_across_m);
  Velocity wanted = controlled(error, {u1r, 0.0});
  wanted.turn_rate_rad_s += kappa * ahead_m_s;

  double speed_m_s = std::clamp(wanted.speed_m_s, 0.0, std::max(limit_m_s, u1r));
  // Slower where the vehicle cannot turn as fast as that, so that it stays on its way.
  const double most_rad_s = vehicle_.max_turn_rate_rad_s;
  if (std::abs(wanted.turn_rate_rad_s) > most_rad_s) speed_m_s *= most_rad_s / std::abs(wanted.turn_rate_rad_s);
  command(speed_m_s, slowing_m_s2, wanted.turn_rate_rad_s, period_s);
}

void PathFollowing::turn(bool may_turn, double slowing_m_s2, double period_s) {
  result_.state = FollowingState::kTurning;
  const double error_rad = result_.error.heading_rad;
  if (turn_sign_ == 0.0 || std::abs(error_rad) < kBehind_rad) turn_sign_ = error_rad > 0.0 ? -1.0 : 1.0;
  const bool stands = result_.command.speed_m_s < kAtRest_m_s;
  double rate_rad_s = 0.0;
  if (may_turn && stands) {
    rate_rad_s = std::min({kTurnOnSpotGain_1_s * std::abs(error_rad), vehicle_.max_turn_rate_rad_s,
                           std::sqrt(vehicle_.turn_acceleration_rad_s2 * std::abs(error_rad))});
  }
  command(0.0, slowing_m_s2, turn_sign_ * rate_rad_s, period_s);
}

void PathFollowing::command(double speed_m_s, double slowing_m_s2, double turn_rate_rad_s, double period_s) {
  Velocity& now = result_.command;
  now.speed_m_s = towards(now.speed_m_s, speed_m_s, -slowing_m_s2 * period_s, vehicle_.acceleration_m_s2 * period_s);
  const double step_rad_s = vehicle_.turn_acceleration_rad_s2 * period_s;
  turn_rate_rad_s = std::clamp(turn_rate_rad_s, -vehicle_.max_turn_rate_rad_s, vehicle_.max_turn_rate_rad_s);
  now.turn_rate_rad_s = towards(now.turn_rate_rad_s, turn_rate_rad_s, -step_rad_s, step_rad_s);
}

}  // namespace situation_awareness
