// SPDX-License-Identifier: BSD-3-Clause
// detections  ->  objects, object_markers (for the eye), downlink/objects (for other hosts)
#include <string>

#include <boost/make_shared.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/common/rate_limit.hpp"
#include "situation_awareness/ros/convert/detections.hpp"
#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/map_report.hpp"
#include "situation_awareness/ros/map_services.hpp"
#include "situation_awareness/ros/markers/object_markers.hpp"
#include "situation_awareness/ros/params/object_nodelet_params.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"

namespace situation_awareness {

class MappingStage {
 public:
  using Context = StageContext<DetectionArray>;
  static constexpr const char* kInput = "detections";
  static constexpr auto kReadParams = read_object_nodelet_params;

  MappingStage(Context& context, const ObjectNodeletParams& params)
      : context_(context),
        world_frame_(params.nodelet.world_frame),
        map_(params.pipeline.objects),
        downlink_limit_(params.nodelet.downlink_rate_hz),
        publisher_(context.node().advertise<EllipseMap>("objects", 20)),
        markers_publisher_(context.node().advertise<visualization_msgs::MarkerArray>("object_markers", 5)),
        // A queue of one: what a broken link holds up is out of date when it comes back.
        downlink_publisher_(context.node().advertise<EllipseMap>("downlink/objects", 1)),
        services_(context, world_frame_, map_, [this](const Objects& objects) { publish(objects); }) {
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report_map(map_, nis_, status); });
    context.serve_live([this](const ObjectMapParams& objects) { map_.set_params(objects); }, params.pipeline.objects);
  }

  bool process(const DetectionArray& msg) {
    if (services_.paused()) {
      context_.diagnostics().counted({{"passed over while paused", 1}});
      return false;
    }
    if (tf2_frame(msg.header.frame_id) != world_frame_) {
      return context_.drop(drop_reason::kBadMessage, "detections in the frame " + msg.header.frame_id);
    }
    Detections detections;
    try {
      detections = detections_from_msg(msg);
    } catch (const std::exception& error) {
      return context_.drop(drop_reason::kBadMessage, error.what());
    }
    const ObjectMapUpdate update = map_.update(detections);
    context_.diagnostics().counted(update.reasons);
    nis_.add(update.matches, update.mahalanobis2);
    if (map_.stamp_ns() != detections.stamp_ns) return context_.drop(drop_reason::kStamp);
    publish(map_.at(detections.stamp_ns));
    return true;
  }

 private:
  void publish(const Objects& objects) {
    const auto msg = boost::make_shared<const EllipseMap>(objects_to_msg(objects, world_frame_));
    publisher_.publish(msg);
    const auto now_ns = static_cast<std::int64_t>(ros::SteadyTime::now().toNSec());
    if (downlink_limit_.passes(now_ns)) downlink_publisher_.publish(msg);
    if (markers_publisher_.getNumSubscribers() == 0) return;
    context_.publish(markers_publisher_, markers_.update(objects, world_frame_));
  }

  Context& context_;
  std::string world_frame_;
  ObjectMap map_;
  NisMonitor nis_{kMeasurementSize};
  ObjectMarkers markers_{MarkerStyle::kEstimate};
  RateLimit downlink_limit_;
  ros::Publisher publisher_, markers_publisher_, downlink_publisher_;
  MapServices services_;
};

using MappingNodelet = StageNodelet<MappingStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::MappingNodelet, nodelet::Nodelet)
