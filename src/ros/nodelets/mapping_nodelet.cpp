// SPDX-License-Identifier: BSD-3-Clause
// detections  ->  objects, object_markers (for display), downlink/objects (for other hosts)
#include <string>
#include <utility>

#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/ros/convert/detections.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/map_publisher.hpp"
#include "situation_awareness/ros/map_services.hpp"
#include "situation_awareness/ros/nis_report.hpp"
#include "situation_awareness/ros/object_kind.hpp"
#include "situation_awareness/ros/object_report.hpp"
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
        publisher_(context, params.nodelet),
        services_(context, world_frame_, map_, [this](const Objects& objects) { publisher_.publish(objects); }) {
    map_.trust_stamps();  // segmentation has judged them
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report_objects(map_, status); });
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report_nis(nis_, status); });
    context.serve_live([this](const ObjectMapParams& objects) { map_.set_params(objects); }, params.pipeline.objects);
  }

  bool process(const DetectionArray& msg) {
    if (services_.passes_over()) return false;
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
    publisher_.publish(objects_);
    return true;
  }

 private:
  Context& context_;
  std::string world_frame_;
  ObjectMap map_;
  NisMonitor nis_{kMeasurementSize};
  MapPublisher<ObjectKind> publisher_;
  MapServices<ObjectKind> services_;
  ObjectMapUpdate update_;  // kept for its memory
  Objects objects_;         // the same
};

using MappingNodelet = StageNodelet<MappingStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::MappingNodelet, nodelet::Nodelet)
