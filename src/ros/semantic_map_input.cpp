// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/semantic_map_input.hpp"

#include <exception>
#include <stdexcept>

#include <ros/transport_hints.h>

#include "situation_awareness/ros/convert/map.hpp"
#include "situation_awareness/ros/convert/poses.hpp"

namespace situation_awareness {

SemanticMapInput::SemanticMapInput(StageContextBase& context, const std::string& world_frame)
    : context_(context), world_frame_(world_frame) {
  context.when_made([this] {
    // As many as the publisher keeps: one that is missed leaves the map as it is until the next whole one.
    constexpr std::uint32_t kQueue = 20;
    subscriber_ = context_.node().subscribe("semantic_map/updates", kQueue, &SemanticMapInput::on_update, this,
                                            ros::TransportHints().tcpNoDelay());
  });
}

void SemanticMapInput::on_update(const MapUpdate& msg) {
  try {
    if (tf2_frame(msg.header.frame_id) != world_frame_) {
      throw std::invalid_argument("a map in the frame " + msg.header.frame_id);
    }
    switch (replica_.apply(map_delta_from_msg(msg))) {
      case MapReplica::Verdict::kTaken:
        ++taken_;
        break;
      case MapReplica::Verdict::kMissed:
        context_.diagnostics().counted({{"updates of a map that is not known", 1}});
        break;
      case MapReplica::Verdict::kKnown:
        break;
    }
  } catch (const std::exception& error) {
    context_.drop(drop_reason::kBadMap, error.what());
  }
}

}  // namespace situation_awareness
