// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/markers/shown_markers.hpp"

namespace situation_awareness {
namespace {

using visualization_msgs::Marker;

Marker deletion(const std_msgs::Header& header, std::int32_t action) {
  Marker m;
  m.header = header;
  m.action = action;
  m.pose.orientation.w = 1.0;
  return m;
}

}  // namespace

visualization_msgs::MarkerArray ShownMarkers::update(const std_msgs::Header& header, std::vector<Marker> markers) {
  visualization_msgs::MarkerArray result;
  if (first_) result.markers.push_back(deletion(header, Marker::DELETEALL));
  first_ = false;
  std::set<Key> shown;
  for (Marker& m : markers) {
    shown.emplace(m.ns, m.id);
    result.markers.push_back(std::move(m));
  }
  for (const Key& key : shown_) {
    if (shown.count(key) != 0) continue;
    result.markers.push_back(deletion(header, Marker::DELETE));
    result.markers.back().ns = key.first;
    result.markers.back().id = key.second;
  }
  shown_ = std::move(shown);
  return result;
}

}  // namespace situation_awareness
