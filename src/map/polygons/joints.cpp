// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/joints.hpp"

#include <algorithm>

#include "situation_awareness/common/usual_room.hpp"

namespace situation_awareness {
namespace {

/// s. Time that counts: what was seen before it is forgotten.
constexpr double kMemory_s = 20.0;
/// Shares of that time at which two chains are joined, and come apart.
constexpr double kJoined = 0.6, kApart = 0.3;
/// s. Within so much the first impression is no decision yet.
constexpr double kFirst_s = 0.5;

/// s. Seen for so long to meet most of the time, two are one.
constexpr double kFirm_s = 1.0;
constexpr double kFirm = 0.6;

struct ByIds {
  bool operator()(const Joints::Joint& a, const Joints::Joint& b) const {
    return a.low != b.low ? a.low < b.low : a.high < b.high;
  }
};

Joints::Joint joint_of(std::uint64_t a, std::uint64_t b) {
  Joints::Joint joint;
  joint.low = std::min(a, b);
  joint.high = std::max(a, b);
  return joint;
}

}  // namespace

bool Joints::are_joined(std::uint64_t a, std::uint64_t b, bool meet) const {
  const Joint wanted = joint_of(a, b);
  const auto at = std::lower_bound(joints_.begin(), joints_.end(), wanted, ByIds());
  return at == joints_.end() || ByIds()(wanted, *at) ? meet : at->joined;
}

bool Joints::is_firm(std::uint64_t a, std::uint64_t b) const {
  const Joint wanted = joint_of(a, b);
  const auto at = std::lower_bound(joints_.begin(), joints_.end(), wanted, ByIds());
  return at != joints_.end() && !ByIds()(wanted, *at) && at->joined && at->seen_s >= kFirm_s && at->share > kFirm;
}

void Joints::see(std::uint64_t a, std::uint64_t b, bool meet) {
  const Joint wanted = joint_of(a, b);
  auto at = std::lower_bound(joints_.begin(), joints_.end(), wanted, ByIds());
  if (at == joints_.end() || ByIds()(wanted, *at)) {
    joints_.reserve(kUsualRoom);
    at = std::lower_bound(joints_.begin(), joints_.end(), wanted, ByIds());
    at = joints_.insert(at, wanted);
  }
  if (!at->is_seen) {
    seen_.reserve(kUsualRoom);
    seen_.emplace_back(at->low, at->high);
  }
  at->is_seen = true;
  at->met |= meet;
}

/// One that was never decided is as if it had not been seen at all.
void Joints::unsee(std::uint64_t low, std::uint64_t high) {
  const auto at = std::lower_bound(joints_.begin(), joints_.end(), joint_of(low, high), ByIds());
  if (at == joints_.end() || at->low != low || at->high != high) return;  // forgotten since
  at->is_seen = at->met = false;
  if (at->seen_s <= 0.0) joints_.erase(at);
}

/// Only what was seen is looked at: how many there are elsewhere says nothing.
void Joints::decide(double step_s) {
  for (const auto& [low, high] : seen_) {
    const auto at = std::lower_bound(joints_.begin(), joints_.end(), joint_of(low, high), ByIds());
    if (at == joints_.end() || at->low != low || at->high != high || !at->is_seen) continue;  // forgotten since
    Joint& joint = *at;
    joint.seen_s = std::min(joint.seen_s + step_s, kMemory_s);
    const double part = step_s < joint.seen_s ? step_s / joint.seen_s : 1.0;
    joint.share += part * ((joint.met ? 1.0 : 0.0) - joint.share);
    if (joint.seen_s < kFirst_s) {
      joint.joined = joint.share > 0.5;
    } else if (joint.share > kJoined) {
      joint.joined = true;
    } else if (joint.share < kApart) {
      joint.joined = false;
    }
    joint.is_seen = joint.met = false;
  }
  seen_.clear();
}

void Joints::forget(const std::vector<std::uint64_t>& ids) {
  const auto is_gone = [&](const Joint& joint) {
    return std::binary_search(ids.begin(), ids.end(), joint.low) ||
           std::binary_search(ids.begin(), ids.end(), joint.high);
  };
  joints_.erase(std::remove_if(joints_.begin(), joints_.end(), is_gone), joints_.end());
}

}  // namespace situation_awareness
