// SPDX-License-Identifier: BSD-3-Clause
// What the parts of the node `evaluator` share.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <iterator>
#include <map>
#include <memory>
#include <optional>

#include <ros/node_handle.h>

#include "situation_awareness/MapUpdate.h"
#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/map_replica.hpp"
#include "situation_awareness/ros/convert/map.hpp"
#include "situation_awareness/ros/params/param_reader.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

/// Prints each figure beside its bound, and knows whether all bounds were met. A figure that is NaN meets none.
class Verdict {
 public:
  void at_most(const char* what, double value, double bound, const char* unit = "") {
    judge(what, value, bound, value <= bound, unit);
  }
  void at_least(const char* what, double value, double bound, const char* unit = "") {
    judge(what, value, bound, value >= bound, unit);
  }
  /// Whatever the figures are.
  void fail(const char* why) {
    std::printf("%s\n", why);
    is_met_ = false;
  }
  bool is_met() const { return is_met_; }

 private:
  void judge(const char* what, double value, double bound, bool is_met, const char* unit) {
    is_met_ = is_met_ && is_met;
    std::printf("%-42s %8.3f %-4s (bound %.3f) %s\n", what, value, unit, bound, is_met ? "met" : "NOT MET");
  }

  bool is_met_ = true;
};

/// Messages without their counterpart that are kept.
constexpr std::size_t kMaxWaiting = 500;

/// A comparison of the messages that come with the truth of a simulated world. It shuts ROS down when it has ended.
class Evaluation {
 public:
  virtual ~Evaluation() = default;

  /// Prints a table, then the figures that have bounds.
  virtual void report(Verdict& verdict) const = 0;
};

/// A parameter that there is not for the robot of the world is told to `on_unknown_key`. The world is used as long as
/// the evaluation.
struct EvaluationInputs {
  ros::NodeHandle node;
  ParamReader params;
  OnUnknownKey on_unknown_key;
  const World& world;
};

/// All features of the one map, at the stamp of each scan.
std::unique_ptr<Evaluation> evaluate_features(const EvaluationInputs& inputs);
/// The boundaries of large obstacles, and the pose by GPS and INS.
std::unique_ptr<Evaluation> evaluate_boundaries(const EvaluationInputs& inputs);
/// The targets that a camera finds.
std::unique_ptr<Evaluation> evaluate_targets(const EvaluationInputs& inputs);
/// The pose and what stands on the one map, transit by transit.
std::unique_ptr<Evaluation> evaluate_transits(const EvaluationInputs& inputs);

/// The latest true poses by their stamps.
class TruePoses {
 public:
  void add(std::int64_t stamp_ns, const Pose2& pose) {
    poses_[stamp_ns] = pose;
    if (poses_.size() > kMost) poses_.erase(poses_.begin());
  }
  void clear() { poses_.clear(); }

  /// Whether the truth of a time has come, or a later one.
  bool has_come(std::int64_t stamp_ns) const { return !poses_.empty() && stamp_ns <= poses_.rbegin()->first; }
  /// Nothing where no truth has that stamp.
  std::optional<Pose2> with_stamp(std::int64_t stamp_ns) const {
    const auto found = poses_.find(stamp_ns);
    return found == poses_.end() ? std::nullopt : std::optional(found->second);
  }
  /// Between the truth before and that after a time; the first one before that, and nothing after the last one.
  std::optional<Pose2> at(std::int64_t stamp_ns) const {
    const auto after = poses_.lower_bound(stamp_ns);
    if (after == poses_.end()) return std::nullopt;
    if (after->first == stamp_ns || after == poses_.begin()) return after->second;
    const auto& [before_ns, before] = *std::prev(after);
    const double part = static_cast<double>(stamp_ns - before_ns) / static_cast<double>(after->first - before_ns);
    return Pose2{before.translation_m + part * (after->second.translation_m - before.translation_m),
                 before.yaw_rad + part * wrap_to_pi(after->second.yaw_rad - before.yaw_rad)};
  }

 private:
  static constexpr std::size_t kMost = 2000;  ///< 40 s of 50 per second

  std::map<std::int64_t, Pose2> poses_;
};

/// Applies an update to the map; false, with a word about it, where that is not possible.
inline bool apply(const MapUpdate& msg, MapReplica& map) {
  try {
    return map.apply(map_delta_from_msg(msg)) == MapReplica::Verdict::kTaken;
  } catch (const std::exception& error) {
    ROS_ERROR_STREAM_THROTTLE(5.0, "evaluator: the map is not used: " << error.what());
    return false;
  }
}

}  // namespace situation_awareness
