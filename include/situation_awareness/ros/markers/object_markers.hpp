// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <visualization_msgs/MarkerArray.h>

#include "situation_awareness/map/objects/objects.hpp"

namespace situation_awareness {

/// Style of a map: the estimate filled in each element's own colour, the truth as dark outlines around it.
enum class MarkerStyle { kEstimate, kTruth };

/// Markers of successive maps; deletes those of removed elements. Namespaces: object (the ellipse), velocity (its
/// motion in 1 s, if it moves), id, position_uncertainty (95 % ellipse of the centre).
class ObjectMarkers {
 public:
  explicit ObjectMarkers(MarkerStyle style = MarkerStyle::kEstimate) : style_(style) {}

  /// The markers that update the display to `objects`. `labels` replaces the ids, or is empty.
  visualization_msgs::MarkerArray update(const Objects& objects, const std::string& world_frame,
                                         const std::vector<std::string>& labels = {});

 private:
  using Key = std::pair<std::string, std::int32_t>;  ///< namespace and id of a marker

  MarkerStyle style_;
  bool first_ = true;  ///< an earlier run may have left markers in the viewer
  std::set<Key> shown_;
};

}  // namespace situation_awareness
