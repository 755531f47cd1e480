// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <std_msgs/Header.h>
#include <visualization_msgs/MarkerArray.h>

namespace situation_awareness {

/// Keeps a viewer in step with successive sets of markers.
class ShownMarkers {
 public:
  /// What makes a viewer show `markers` and nothing else: these, and the deletion of those of earlier calls that are
  /// not among them. The first call deletes what an earlier run may have left.
  visualization_msgs::MarkerArray update(const std_msgs::Header& header,
                                         std::vector<visualization_msgs::Marker> markers);

 private:
  using Key = std::pair<std::string, std::int32_t>;  ///< namespace and id of a marker

  bool first_ = true;
  std::set<Key> shown_;
};

}  // namespace situation_awareness
