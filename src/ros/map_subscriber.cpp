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
  context_.diagnostics().on_report([this](StageDiagnostics::Status&) { receive(); });
  context_.when_made([this] {
    ros::NodeHandle node = context_.node();
    node.setCallbackQueue(&queue_);
    subscriber_ = node.subscribe("objects", 1, &MapSubscriber::on_map, this, ros::TransportHints().tcpNoDelay());
  });
}

void MapSubscriber::on_map(const MappedObjectArrayConstPtr& msg) {
  std::string defect;
  try {
    if (tf2_frame(msg->header.frame_id) == world_frame_) {
      Objects map = objects_from_msg(*msg);
      const std::lock_guard<std::mutex> lock(mutex_);
      arrived_ = std::move(map);
      return;
    }
    defect = "a map in the frame " + msg->header.frame_id;
  } catch (const std::exception& error) {
    defect = error.what();
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  defects_.push_back(std::move(defect));
}

void MapSubscriber::receive() {
  std::vector<std::string> defects;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (arrived_) std::swap(map_, *arrived_);
    arrived_.reset();
    defects.swap(defects_);
  }
  for (const std::string& defect : defects) context_.diagnostics().dropped(drop_reason::kBadMap, defect);
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
