// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/semantic_map.hpp"

#include <algorithm>
#include <vector>

#include "chain_cover.hpp"
#include "semantic_map_parts.hpp"
#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

/// s. Between the traces of what moves, how long a chain may have been drawn before, and how long hits are of it after.
constexpr double kTraceEvery_s = 0.3, kDrawnBefore_s = 3.0, kHitAfter_s = 0.5;
/// s. Until something has passed by its own length hits are of it, for so long at most; at this speed at least.
constexpr double kMostHitAfter_s = 3.0, kLeastSpeed_m_s = 0.1;
/// s. Between the places where it was before it was known to move.
constexpr double kBackEvery_s = 0.5;
/// s. A trace is remembered for so long; and how many are.
constexpr double kRemembered_s = 60.0;
constexpr std::size_t kMostTraces = 500;
/// Part of a chain that is where something was: then it is of that.
constexpr double kIsOfTrace = 0.8;

}  // namespace

/// The rule of traces: a chain that was drawn of what moves, or of what has driven off from there, is none until it is
/// hit again.
void SemanticMap::leave_traces() {
  for (const ObjectEntry& object : objects_) {
    if (object.update != updates_ || !is_moving(object.latest)) continue;
    const Eigen::AlignedBox2d box = box_around(object.latest, 0.0);
    bool is_due = true;
    for (Trace& trace : traces_) {
      if (trace.id != object.id) continue;
      // What is slow still hits what it drew.
      if (trace.is_parked && box.intersects(box_around(trace.object, 0.0))) trace.until_ns = stamp_ns_;
      if (!trace.is_parked && seconds_between(trace.from_ns, stamp_ns_) < kDrawnBefore_s + kTraceEvery_s)
        is_due = false;
    }
    if (!is_due) continue;
    const bool is_first = std::none_of(traces_.begin(), traces_.end(), [&](const Trace& trace) {
      return trace.id == object.id && seconds_between(trace.until_ns, stamp_ns_) < kDrawnBefore_s;
    });
    const double speed_m_s = object.latest.velocity_world_m_s.norm();
    const double pass_s = extent_of(object.latest) / std::max(speed_m_s, kLeastSpeed_m_s);
    const double hit_s = std::clamp(pass_s, kHitAfter_s, kMostHitAfter_s);
    // It was followed only after it had come some way.
    for (double ago_s = is_first ? kDrawnBefore_s : 0.0; ago_s >= 0.0; ago_s -= kBackEvery_s) {
      Object there = object.latest;
      there.ellipse_world.center_m -= ago_s * there.velocity_world_m_s;
      there.box_world.center_m -= ago_s * there.velocity_world_m_s;
      const std::int64_t then_ns = stamp_ns_ - nanoseconds(ago_s);
      add_trace({object.id, there, then_ns - nanoseconds(kDrawnBefore_s), then_ns + nanoseconds(hit_s), false});
    }
  }
  traces_.erase(
      std::remove_if(traces_.begin(), traces_.end(),
                     [this](const Trace& trace) { return seconds_between(trace.until_ns, stamp_ns_) > kRemembered_s; }),
      traces_.end());
}

void SemanticMap::add_trace(const Trace& trace) {
  if (traces_.size() == kMostTraces) traces_.erase(traces_.begin());
  traces_.push_back(trace);
  look_at_traces_near(trace.object);
}

/// What was parked has driven off.
void SemanticMap::leave_parked(const ObjectEntry& object) {
  const auto parked = std::find_if(parked_.begin(), parked_.end(), [&](const Parked& p) { return p.id == object.id; });
  const bool was_lost = parked != parked_.end() && extent_of(parked->object) > extent_of(object.largest);
  const std::int64_t came_ns = was_lost ? parked->came_ns : object.came_ns;
  const std::int64_t from_ns = came_ns == kNever ? kNever : came_ns - nanoseconds(kDrawnBefore_s);
  add_trace({object.id, was_lost ? parked->object : object.largest, from_ns, stamp_ns_, true});
}

/// It stands there now.
void SemanticMap::forget_trace(const ObjectEntry& object) {
  const auto trace = std::find_if(traces_.begin(), traces_.end(), [&](const Trace& other) {
    return other.id == object.id && covers(other.object, object.latest.ellipse_world.center_m, 0.0);
  });
  if (trace == traces_.end()) return;
  const Object place = trace->object;
  traces_.erase(trace);
  look_at_traces_near(place);
}

void SemanticMap::look_at_traces_near(const Object& object) {
  find_near(box_around(object, params_.margin_m));
  const std::vector<Handle> near = near_;
  for (const Handle handle : near) look_at_traces(*find_chain(handle));
}

void SemanticMap::look_at_traces(ChainEntry& chain) {
  const auto was_there = [&](const Trace& trace) {
    if (chain.latest.first_seen_ns < trace.from_ns || chain.latest.last_seen_ns > trace.until_ns) return false;
    const double margin_m = margin_of(trace.object, params_.margin_m);
    if (!chain.box_world_m.intersects(box_around(trace.object, margin_m))) return false;
    return length_on(trace.object, chain.latest, margin_m) >= kIsOfTrace * chain.length_m;
  };
  const auto trace = chain.of_boundary == 0 ? std::find_if(traces_.begin(), traces_.end(), was_there) : traces_.end();
  const FeatureId of = trace != traces_.end() ? trace->id : 0;
  if ((of != 0) == (chain.trace_of != 0)) return;
  chain.trace_of = of;
  unsettle_near(chain.latest);
  touched_.push_back(chain.id);
  if (of != 0) {
    owners_[chain.id].reason = GoneReason::kLeft;
    merge(chain.id, of);
  } else {
    new_.push_back(chain.handle);
  }
}

}  // namespace situation_awareness
