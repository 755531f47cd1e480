// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/map_inputs.hpp"

#include <exception>
#include <stdexcept>

#include <ros/transport_hints.h>

#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/convert/polygons.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/splinegons.hpp"

namespace situation_awareness {

MapInputs::MapInputs(StageContextBase& context, const std::string& world_frame)
    : context_(context), world_frame_(world_frame) {
  context.when_made([this] {
    ros::NodeHandle& node = context_.node();
    const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
    splinegons_sub_ = node.subscribe("splinegons", 2, &MapInputs::on_splinegons, this, hints);
    polygons_sub_ = node.subscribe("polygons", 2, &MapInputs::on_polygons, this, hints);
    objects_sub_ = node.subscribe("objects", 2, &MapInputs::on_objects, this, hints);
  });
}

template <class Message, class Take>
void MapInputs::take(const Message& msg, const char* kind, const Take& take) {
  try {
    if (tf2_frame(msg.header.frame_id) != world_frame_) {
      throw std::invalid_argument(std::string(kind) + " in the frame " + msg.header.frame_id);
    }
    take();
    ++taken_;
  } catch (const std::exception& error) {
    context_.drop(drop_reason::kBadMap, error.what());
  }
}

void MapInputs::on_splinegons(const SplinegonArrayConstPtr& msg) {
  take(*msg, "splinegons", [&] {
    splinegons_ = splinegons_from_msg(*msg);
    has_splinegons_ = true;
  });
}

void MapInputs::on_polygons(const PolygonArrayConstPtr& msg) {
  take(*msg, "polygons", [&] {
    polygons_ = polygons_from_msg(*msg);
    has_polygons_ = true;
  });
}

void MapInputs::on_objects(const MappedObjectArrayConstPtr& msg) {
  take(*msg, "objects", [&] {
    objects_ = objects_from_msg(*msg);
    has_objects_ = true;
  });
}

}  // namespace situation_awareness
