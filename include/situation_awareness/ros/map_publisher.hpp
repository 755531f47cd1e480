// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <ros/publisher.h>
#include <visualization_msgs/MarkerArray.h>
#include <boost/make_shared.hpp>

#include "situation_awareness/common/rate_limit.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"
#include "situation_awareness/ros/stage_context.hpp"

namespace situation_awareness {

/// Publishes a map of any kind: the topic of its name, the same with a limited rate below downlink/ (for other hosts),
/// and markers (for display). `Kind` is as for MapServices, and has
///
///     static constexpr const char* kMarkersTopic = "object_markers";
///     using Markers = ObjectMarkers;  // visualization_msgs::MarkerArray update(const Value&, const std::string&
///     frame)
template <class Kind>
class MapPublisher {
 public:
  MapPublisher(StageContextBase& context, const NodeletParams& params)
      : world_frame_(params.world_frame),
        downlink_limit_(params.downlink_rate_hz),
        publisher_(context.node().advertise<typename Kind::Message>(Kind::kName, 20)),
        markers_publisher_(context.node().advertise<visualization_msgs::MarkerArray>(Kind::kMarkersTopic, 5)),
        // A queue of one: messages delayed by a broken link are outdated.
        downlink_publisher_(
            context.node().advertise<typename Kind::Message>(std::string("downlink/") + Kind::kName, 1)) {}

  void publish(const typename Kind::Value& value) {
    const auto msg = boost::make_shared<const typename Kind::Message>(Kind::to_msg(value, world_frame_));
    publisher_.publish(msg);
    if (downlink_limit_.passes(steady_now_ns())) downlink_publisher_.publish(msg);
    if (markers_publisher_.getNumSubscribers() == 0) return;
    markers_publisher_.publish(
        boost::make_shared<const visualization_msgs::MarkerArray>(markers_.update(value, world_frame_)));
  }

 private:
  std::string world_frame_;
  typename Kind::Markers markers_;
  RateLimit downlink_limit_;
  ros::Publisher publisher_, markers_publisher_, downlink_publisher_;
};

}  // namespace situation_awareness
