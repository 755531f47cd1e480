// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/path/path.hpp"
#include "situation_awareness/path/spline_path.hpp"
#include "situation_awareness/path/vehicle.hpp"

namespace situation_awareness {

// Path following (docs/math/path.md; polygons paper, Sect. 5.2, eq. 6).
//
//   symbol     meaning                                                                    unit
//   x_e, y_e   the vehicle in the frame of the reference: error along and across it       m
//   theta_e    heading of the vehicle less that of the reference                          rad
//   u1r, u2r   speed and turn rate of the reference                                       m/s, rad/s
//   u1, u2     those of the vehicle                                                       m/s, rad/s
//   K1 to K3   gains                                                                      1/m, 1/m^2, 1/m

/// Error of a vehicle against a reference on its path.
struct FollowingError {
  double along_m = 0.0;      ///< x_e
  double across_m = 0.0;     ///< y_e, to the left positive
  double heading_rad = 0.0;  ///< theta_e, in [-pi, pi]
};

FollowingError following_error(const Pose2& T_world_reference, const Pose2& T_world_base);

/// Speed and turn rate of a vehicle.
struct Velocity {
  double speed_m_s = 0.0;
  double turn_rate_rad_s = 0.0;
};

/// Parameters of path following.
struct PathFollowingParams {
  double turn_from_rad = 0.8;
  double turn_to_rad = 0.05;
  double max_error_m = 1.0;
  double lateral_acceleration_m_s2 = 0.4;
  double goal_tolerance_m = 0.02;
  int transits = 1;
  double pause_s = 2.0;
  double timeout_s = 0.16;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("turn_from_rad", self.turn_from_rad, Bounds{0.1, 1.5}, "rad",
          "with a greater error of heading the vehicle stops and turns on the spot");
    visit("turn_to_rad", self.turn_to_rad, Bounds{0.005, 1.5}, "rad", "until the error is less than this");
    visit("max_error_m", self.max_error_m, Bounds{0.05, 100.0}, "m",
          "the vehicle stops where it is farther from the path");
    visit("lateral_acceleration_m_s2", self.lateral_acceleration_m_s2, Bounds{0.01, 20.0}, "m/s^2",
          "greatest acceleration across the path, in bends");
    visit("goal_tolerance_m", self.goal_tolerance_m, Bounds{0.001, 1.0}, "m",
          "a transit ends so near to the end of the path");
    visit("transits", self.transits, Bounds{0, 1000000}, "",
          "number of transits: there and back in turn on an open path, rounds of a closed one; 0: without end");
    visit("pause_s", self.pause_s, Bounds{0.0, 3600.0}, "s", "at the ends of an open path, between two transits");
    visit("timeout_s", self.timeout_s, Bounds{0.05, 10.0}, "s",
          "the vehicle brakes where pose or verdict of the safety areas are older than this; no longer than "
          "vehicle/reaction_s, within which the areas count on it");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// Gains of eq. 6: K1 of the error along the path in 1/m, K2 of that across it in 1/m^2, K3 of that of heading in 1/m.
/// No source is recorded, and their sensitivity was not measured.
constexpr double kGainAlong_1_m = 3.0, kGainAcross_1_m2 = 1.5, kGainHeading_1_m = 1.5;

/// u1 and u2 by eq. 6: u1 = u1r - K1 |u1r| x_e, u2 = u2r - K2 u1r y_e - K3 |u1r| tan theta_e. |theta_e| < pi / 2.
/// With the reference at the nearest point, which moves as the vehicle does, K2 y_e^2 / 2 + 1 - cos theta_e does not
/// grow.
Velocity controlled(const FollowingError& error, const Velocity& reference);

/// Where a vehicle on a path is, and what it is told.
struct PathFollowingResult {
  enum class State : std::uint8_t { kStopped, kTurning, kDriving, kWaiting, kArrived, kOffPath };

  State state = State::kStopped;
  Velocity command;
  FollowingError error;
  double way_m = 0.0;  ///< along the way of this transit
  int transit = 0;
  bool there = true;  ///< false: on the way back
};

/// What the safety areas allow.
struct AllowedMotion {
  double speed_m_s = 0.0;
  bool may_turn = false;  ///< on the spot
};

/// Leads a vehicle along a path, transit after transit. The reference is the point of the path that is nearest, so it
/// waits where the vehicle has to stop; it does not move, and gives no feedback, until the vehicle does. Where the
/// vehicle does not head along the way, it turns on the spot first.
class PathFollowing {
 public:
  /// Throws std::invalid_argument naming `source` or field and bound.
  PathFollowing(const Path& path, const VehicleParams& vehicle, const PathFollowingParams& params,
                const std::string& source = "path");

  /// Begins with the first transit, to that end of an open path which is farther.
  void start();

  /// The vehicle slows down and stands until start().
  void stop();

  bool is_running() const { return running_; }
  const PathFollowingParams& params() const { return params_; }

  /// The path in the direction of its file.
  const SplinePath& path() const { return ways_.front(); }

  /// What to do at a pose. Speeds change by no more than the vehicle's accelerations times the time since the call
  /// before; they go down by braking where they are above what is allowed, else as usual.
  const PathFollowingResult& update(std::int64_t stamp_ns, const Pose2& T_world_base, const AllowedMotion& allowed);

  /// The same without a pose: the vehicle brakes, and its transit goes on later.
  const PathFollowingResult& brake(std::int64_t stamp_ns);

  /// The vehicle was told zero meanwhile: speeds go on from there.
  void halt() { result_.command = {}; }

 private:
  const SplinePath& way() const { return ways_[result_.there ? 0 : 1]; }
  double speed_limit_m_s(double way_m) const;
  void tabulate_limits(std::size_t direction);
  void locate(const Pose2& T_world_base);
  void begin_transit(const Pose2& T_world_base, bool there);
  bool at_the_end(double way_before_m) const;
  bool is_last() const { return params_.transits > 0 && result_.transit + 1 >= params_.transits; }
  void drive(double allowed_m_s, double slowing_m_s2, double period_s);
  void turn(bool may_turn, double slowing_m_s2, double period_s);
  void command(double speed_m_s, double slowing_m_s2, double turn_rate_rad_s, double period_s);
  double period_since(std::int64_t stamp_ns);

  VehicleParams vehicle_;
  PathFollowingParams params_;
  std::vector<SplinePath> ways_;                 ///< there and, of an open path, back
  std::vector<std::vector<double>> limits_m_s_;  ///< of the speed along them, by steps of limit_step_m_
  double limit_step_m_ = 0.0;
  bool running_ = false;
  bool located_ = false;
  std::optional<std::int64_t> stamp_ns_;
  double pause_left_s_ = 0.0;
  double turn_sign_ = 0.0;  ///< of the turn on the spot that has begun; 0: none has
  PathFollowingResult result_;
};

/// When a vehicle that is not driven is told to stand: for some seconds at every occasion, from the start and from the
/// last command to drive on, since it keeps what it was told last, by whomever; then now and then. By the steady clock.
class StandingCommands {
 public:
  static constexpr double kOften_s = 3.0;
  static constexpr double kPeriod_s = 0.5;  ///< afterwards

  /// It is driven.
  void drives(double now_s) { begin_s_ = sent_s_ = now_s; }

  /// Whether it is to be told now.
  bool are_due(double now_s) {
    if (now_s - begin_s_ > kOften_s && now_s - sent_s_ < kPeriod_s) return false;
    sent_s_ = now_s;
    return true;
  }

 private:
  double begin_s_ = 0.0, sent_s_ = 0.0;
};

}  // namespace situation_awareness
