// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <geometry_msgs/Transform.h>
#include <tf2_msgs/TFMessage.h>

#include "situation_awareness/ros/check/report.hpp"
#include "situation_awareness/ros/check/stamp_statistics.hpp"

namespace situation_awareness {

/// The frames of the transforms of a recording, by tf2's names.
class TransformTree {
 public:
  void add(const tf2_msgs::TFMessage& msg, bool is_static, std::int64_t received_ns);

  bool empty() const { return by_child_.empty(); }
  bool has(const std::string& frame) const;

  /// From a frame up to its root, both included; the frame alone where no transform leads to it.
  std::vector<std::string> chain(const std::string& frame) const;

  /// The frame above this one that does not move with the robot: the one named map, world or odom (in this order, with
  /// any namespace), else the root if a transform in between changes; empty if there is none.
  std::string world_of(const std::string& frame) const;

  /// Appends a line for each transform.
  void report(TopicReport& report) const;

 private:
  struct Edge {
    std::string parent;
    bool is_static = false;
    geometry_msgs::Transform first;
    bool changes = false;
    StampStatistics stamps;
    std::set<std::string> other_parents;
  };

  std::map<std::string, Edge> by_child_;
};

}  // namespace situation_awareness
