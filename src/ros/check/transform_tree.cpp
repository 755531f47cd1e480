// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/check/transform_tree.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/common/format.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

/// A transform changes by more than rounding: in m, and in quaternion components.
constexpr double kChange = 1e-3;

bool differs(const geometry_msgs::Transform& a, const geometry_msgs::Transform& b) {
  const double moved = std::abs(a.translation.x - b.translation.x) + std::abs(a.translation.y - b.translation.y) +
                       std::abs(a.translation.z - b.translation.z);
  const double turned = std::abs(a.rotation.x * b.rotation.x + a.rotation.y * b.rotation.y +
                                 a.rotation.z * b.rotation.z + a.rotation.w * b.rotation.w);
  return moved > kChange || turned < std::cos(kChange);
}

/// "robot1/odom" is named odom.
bool is_named(const std::string& frame, const std::string& name) {
  return frame == name ||
         (frame.size() > name.size() && frame.compare(frame.size() - name.size(), name.size(), name) == 0 &&
          frame[frame.size() - name.size() - 1] == '/');
}

}  // namespace

void TransformTree::add(const tf2_msgs::TFMessage& msg, bool is_static, std::int64_t received_ns) {
  for (const geometry_msgs::TransformStamped& transform : msg.transforms) {
    const std::string parent = tf2_frame(transform.header.frame_id);
    const auto [entry, is_new] = by_child_.try_emplace(tf2_frame(transform.child_frame_id));
    Edge& edge = entry->second;
    if (is_new) {
      edge.parent = parent;
      edge.first = transform.transform;
    }
    if (parent != edge.parent) {
      edge.other_parents.insert(parent);
      continue;
    }
    edge.is_static = is_static;
    edge.changes = edge.changes || differs(edge.first, transform.transform);
    edge.stamps.add(to_nanoseconds(transform.header.stamp), received_ns);
  }
}

bool TransformTree::has(const std::string& frame) const {
  return std::any_of(by_child_.begin(), by_child_.end(),
                     [&frame](const auto& edge) { return edge.first == frame || edge.second.parent == frame; });
}

std::vector<std::string> TransformTree::chain(const std::string& frame) const {
  std::vector<std::string> chain{frame};
  while (true) {
    const auto edge = by_child_.find(chain.back());
    if (edge == by_child_.end()) return chain;
    const std::string& parent = edge->second.parent;
    if (std::find(chain.begin(), chain.end(), parent) != chain.end()) return chain;  // a loop
    chain.push_back(parent);
  }
}

std::string TransformTree::world_of(const std::string& frame) const {
  const std::vector<std::string> chain = this->chain(frame);
  for (const char* name : {"map", "world", "odom"}) {
    for (auto above = chain.begin() + 1; above != chain.end(); ++above) {
      if (is_named(*above, name)) return *above;
    }
  }
  const bool moves = std::any_of(chain.begin(), chain.end() - 1,
                                 [this](const std::string& child) { return by_child_.at(child).changes; });
  return moves ? chain.back() : "";
}

void TransformTree::report(TopicReport& report) const {
  for (const auto& [child, edge] : by_child_) {
    std::string line = edge.parent + " -> " + child;
    const double period_s = edge.stamps.period_s();
    if (edge.is_static) {
      line += ", static";
    } else if (period_s > 0.0) {
      line += formatted(", %.4g Hz%s", 1.0 / period_s, edge.changes ? "" : ", always the same");
    }
    report.facts.push_back(line);
    for (const std::string& other : edge.other_parents) {
      report.findings.push_back({child + " is a child of " + edge.parent + " and of " + other,
                                 "a frame has one parent: stop one of the two publishers"});
    }
  }
}

}  // namespace situation_awareness
