// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/map_subscriber.hpp"

#include <exception>
#include <utility>

#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/scan_check.hpp"

namespace situation_awareness {

MapSubscriber::MapSubscriber(StageContextBase& context, const std::string& world_frame)
    : world_frame_(world_frame), context_(context) {
  context_.when_made([this] {
    subscriber_ =
        context_.node().subscribe("objects", 1, &MapSubscriber::on_map, this, ros::TransportHints().tcpNoDelay());
  });
}

void MapSubscriber::on_map(const MappedObjectArrayConstPtr& msg) {
  try {
    if (tf2_frame(msg->header.frame_id) != world_frame_) {
      return context_.diagnostics().dropped(drop_reason::kBadMap, "a map in the frame " + msg->header.frame_id);
    }
    map_ = objects_from_msg(*msg);
  } catch (const std::exception& error) {
    context_.diagnostics().dropped(drop_reason::kBadMap, error.what());
  }
}

const std::vector<ExpectedOutline>& MapSubscriber::outlines_at(std::int64_t stamp_ns, const Pose2& T_world_level) {
  if (!map_.objects.empty() && map_.stamp_ns > stamp_ns) {
    context_.diagnostics().counted({{"map of a later time", 1}});
    clear();
  }
  if (map_.stamp_ns < latest_scan_ns_) context_.diagnostics().counted({{"map of the scan before not there yet", 1}});
  latest_scan_ns_ = stamp_ns;
  outlines_level_ =
      situation_awareness::outlines_at(stamp_ns, T_world_level, map_, kMaxMapAge_s, std::move(outlines_level_));
  return outlines_level_;
}

}  // namespace situation_awareness
