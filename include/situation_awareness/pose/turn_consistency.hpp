// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

/// Compares the turns that a gyroscope measures with those of the course by fixes, over the last minute and without a
/// filter: rates in deg/s, about an axis that points down, or fixes with their coordinates exchanged contradict the
/// course, whatever a filter makes of them. A vehicle need not head where it goes: where both do not depend on each
/// other, or hardly, nothing is said. Time and memory are bounded; no allocation after the first minute.
class TurnConsistency {
 public:
  TurnConsistency();

  /// About the vertical, counter-clockwise positive (rad/s). Stamps that go back begin anew.
  void add_rate(std::int64_t stamp_ns, double rate_rad_s);

  /// East and north of the vehicle (m), with the standard deviation of the worse of them; a fix may be late by a
  /// second.
  void add_fix(std::int64_t stamp_ns, const Eigen::Vector2d& p_world_m, double sigma_m);

  /// How many times as far the rates turn as the course does; none where the course tells too little, or does not
  /// depend on them linearly.
  std::optional<double> ratio() const;

  /// One sentence if they contradict each other, with what makes such a ratio, else empty.
  std::string contradiction() const;

 private:
  struct Turned {
    std::int64_t stamp_ns;
    double angle_rad;
  };
  struct Anchor {
    std::int64_t stamp_ns;
    Eigen::Vector2d p_world_m;
    double turned_rad, sigma_m;
  };
  /// Between two fixes.
  struct Leg {
    std::int64_t stamp_ns;  ///< of its end
    double course_rad;      ///< continuous
    double turned_rad;      ///< by the rates, at its middle
  };

  /// How many times as far the rates turn, and its standard error.
  struct Fit {
    double ratio, sigma;
  };

  std::optional<Fit> fit() const;
  std::optional<double> turned_at(std::int64_t stamp_ns) const;
  void clear();

  std::vector<Turned> turned_;  ///< a ring
  std::size_t next_ = 0;
  Turned latest_{};
  double rate_rad_s_ = 0.0;
  bool has_rate_ = false;
  std::optional<Anchor> anchor_;
  std::vector<Leg> legs_;
};

}  // namespace situation_awareness
