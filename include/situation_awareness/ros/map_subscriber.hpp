// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <ros/subscriber.h>

#include "situation_awareness/MappedObjectArray.h"
#include "situation_awareness/geometry/expected_outline.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/ros/direct_queue.hpp"
#include "situation_awareness/ros/stage_context.hpp"

namespace situation_awareness {

/// The latest `objects`, for the expected outlines in the next scan. It is received on the thread that delivers it, so
/// that it wakes no stage. All calls are on the callback queue of its stage; `context` must outlive it.
class MapSubscriber {
 public:
  MapSubscriber(StageContextBase& context, const std::string& world_frame);

  /// Uses the latest map that has come. Those that are refused are counted.
  void receive();

  /// The expected outlines in a scan, in its level frame. A map of a later time is not used: time was reset. Counts
  /// scans that come before the map of the previous one. The result is overwritten by the next call.
  const std::vector<ExpectedOutline>& outlines_at(std::int64_t stamp_ns, const Pose2& T_world_level);

  const Objects& latest() const { return map_; }

  /// Discards the map after a reset of time.
  void clear() {
    receive();
    map_ = {};
    latest_scan_ns_ = 0;
  }

 private:
  void on_map(const MappedObjectArrayConstPtr& msg);

  std::string world_frame_;
  StageContextBase& context_;
  Objects map_;
  std::int64_t latest_scan_ns_ = 0;
  std::vector<ExpectedOutline> outlines_level_;  ///< kept for its memory
  std::mutex mutex_;                             ///< of what has arrived
  std::optional<Objects> arrived_;
  std::vector<std::string> defects_;
  DirectQueue queue_;
  ros::Subscriber subscriber_;  ///< ends before its queue
};

}  // namespace situation_awareness
