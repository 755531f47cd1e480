// SPDX-License-Identifier: BSD-3-Clause
// detections  ->  objects
#include <cstdint>
#include <string>
#include <utility>

#include <ros/publisher.h>
#include <std_srvs/Trigger.h>
#include <boost/make_shared.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/MappedObjectArray.h"
#include "situation_awareness/map/objects/object_map.hpp"
#include "situation_awareness/ros/convert/detections.hpp"
#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/nis_report.hpp"
#include "situation_awareness/ros/object_report.hpp"
#include "situation_awareness/ros/params/object_nodelet_params.hpp"
#include "situation_awareness/ros/services.hpp"
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
        publisher_(context.node().advertise<MappedObjectArray>("objects", 20)),
        services_(context) {
    map_.trust_stamps();  // segmentation has judged them
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report_objects(map_, status); });
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report_nis(nis_, status); });
    context.when_made([this] {
      services_.add<std_srvs::Trigger>(context_.private_node(), "reset",
                                       [this](const auto& /*request*/, auto& response) { response.message = reset(); });
    });
    context.serve_live([this](const ObjectMapParams& objects) { map_.set_params(objects); }, params.pipeline.objects);
  }

  bool process(const DetectionArray& msg) {
    if (tf2_frame(msg.header.frame_id) != world_frame_) {
      return context_.drop(drop_reason::kBadMessage, "detections in the frame " + msg.header.frame_id);
    }
    Detections detections;
    try {
      detections = detections_from_msg(msg);
    } catch (const std::exception& error) {
      return context_.drop(drop_reason::kBadMessage, error.what());
    }
    update_ = map_.update(detections, std::move(update_));
    context_.diagnostics().counted(update_.reasons);
    nis_.add(update_.matches, update_.mahalanobis2);
    if (map_.stamp_ns() != detections.stamp_ns) return context_.drop(drop_reason::kStamp);
    objects_ = map_.at(detections.stamp_ns, std::move(objects_));
    publish();
    return true;
  }

 private:
  /// An empty map is published at once, so that the other stages forget theirs.
  std::string reset() {
    const std::string forgotten = count_of(map_.size(), "element");
    const std::int64_t latest_ns = map_.stamp_ns();
    map_.reset();
    if (latest_ns != ObjectMap::kNoStamp) {
      objects_ = map_.at(latest_ns, std::move(objects_));
      publish();
    }
    return "the map of objects was reset: " + forgotten + " forgotten";
  }

  void publish() {
    publisher_.publish(boost::make_shared<const MappedObjectArray>(objects_to_msg(objects_, world_frame_)));
  }

  Context& context_;
  std::string world_frame_;
  ObjectMap map_;
  NisMonitor nis_{kMeasurementSize};
  ros::Publisher publisher_;
  Services services_;
  ObjectMapUpdate update_;  // kept for its memory
  Objects objects_;         // the same
};

using MappingNodelet = StageNodelet<MappingStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::MappingNodelet, nodelet::Nodelet)
