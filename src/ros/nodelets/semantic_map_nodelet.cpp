// SPDX-License-Identifier: BSD-3-Clause
// segments, pose, objects, targets  ->  semantic_map, semantic_map/updates, downlink/semantic_map, semantic_map_markers
#include <cstddef>
#include <exception>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include <ros/service.h>
#include <std_srvs/Trigger.h>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/TargetArray.h"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/pipeline/map_pipeline.hpp"
#include "situation_awareness/ros/convert/grid.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/segments.hpp"
#include "situation_awareness/ros/map_output.hpp"
#include "situation_awareness/ros/params/map_nodelet_params.hpp"
#include "situation_awareness/ros/pose_covariance_input.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"

namespace situation_awareness {

class SemanticMapStage {
 public:
  using Context = PoseCovarianceInput::Context;
  /// How far from the stamp of a scan that of the message on `pose` may be whose covariance is its own: that of
  /// safety/max_pose_age_s. No source is recorded, and its sensitivity was not measured.
  static constexpr double kMaxPoseAge_s = 0.5;
  static constexpr const char* kInput = "segments";
  static constexpr auto kReadParams = read_map_nodelet_params;

  SemanticMapStage(Context& context, const MapNodeletParams& params)
      : context_(context),
        world_frame_(params.nodelet.world_frame),
        kinds_(map_kinds_of(params.kinds)),
        pose_covariance_(params.scan_pose.covariance()),
        pipeline_(params.pipeline, kinds_),
        output_(
            context, params.nodelet, pipeline_,
            [&context](const ros::Publisher& publisher, MapUpdate msg) { context.publish(publisher, std::move(msg)); },
            [this] { reset_layers(); }),
        input_(context, {world_frame_, params.scan_pose.pose_timeout_s,
                         static_cast<std::size_t>(params.nodelet.queue_size), kMaxPoseAge_s}) {
    order_.trust();  // segmentation has judged them
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report(status); });
    if (!kinds_.targets) return;
    context.when_made([this] {
      targets_.emplace(context_.node(), "targets",
                       [this](const auto& msg, const ros::SteadyTime& /*arrival*/) { take(*msg); });
    });
  }

  bool process(const CovariedSegments& covaried) {
    if (output_.passes_over()) return false;
    const SegmentArray& msg = *covaried.msg;
    if (tf2_frame(msg.header.frame_id) != world_frame_) {
      return context_.drop(drop_reason::kBadMessage, "segments in the frame " + msg.header.frame_id);
    }
    Segments segments;
    try {
      segments = segments_from_msg(msg);
    } catch (const std::exception& error) {
      return context_.drop(drop_reason::kBadMessage, error.what());
    }
    if (!output_.is_next(order_.judge(segments.stamp_ns))) return false;
    ++(covaried.base ? with_covariance_ : without_covariance_);
    if (kinds_.objects) ++(covaried.objects ? with_objects_ : without_objects_);
    try {
      output_.publish(pipeline_.process(
          segments, kinds_.objects && covaried.objects ? &*covaried.objects : nullptr,
          covaried.base ? covariance_at(segments.T_world_level.translation_m, *covaried.base) : pose_covariance_));
    } catch (const std::invalid_argument& error) {
      return context_.drop(drop_reason::kBadMessage, error.what());
    }
    context_.diagnostics().counted(pipeline_.layers().chain_update().reasons);
    return true;
  }

 private:
  /// Stages that map objects and targets would tell of those that are out of sight again.
  void reset_layers() {
    for (const auto& [is_mapped, stage] : {std::pair(kinds_.objects, "mapping"), {kinds_.targets, "grid_mapping"}}) {
      if (!is_mapped) continue;
      std_srvs::Trigger reset;
      const std::string service = context_.node().resolveName(stage + std::string("/reset"));
      if (!ros::service::call(service, reset)) throw std::runtime_error(service + " is not available");
    }
  }

  /// Does not throw.
  void take(const TargetArray& msg) {
    try {
      if (tf2_frame(msg.header.frame_id) != world_frame_) {
        return context_.diagnostics().counted({{"targets in another frame", 1}});
      }
      if (!output_.passes_over()) output_.publish(pipeline_.take(grid_targets_from_msg(msg)));
    } catch (const std::exception& error) {
      context_.drop(drop_reason::kBadMessage, error.what());
    }
  }

  void report(StageDiagnostics::Status& status) {
    status.add("scans with the covariance of pose", with_covariance_);
    status.add("scans with that of pose_sigma_m", without_covariance_);
    if (!kinds_.objects) return;
    status.add("scans with the map of objects", with_objects_);
    status.add("scans without it", without_objects_);
  }

  Context& context_;
  std::string world_frame_;
  MapKinds kinds_;
  Eigen::Matrix3d pose_covariance_;
  StampOrder order_;
  MapPipeline pipeline_;
  std::size_t with_covariance_ = 0, without_covariance_ = 0, with_objects_ = 0, without_objects_ = 0;
  MapOutput output_;
  PoseCovarianceInput input_;
  std::optional<TimedSubscriber<TargetArray>> targets_;
};

using SemanticMapNodelet = StageNodelet<SemanticMapStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::SemanticMapNodelet, nodelet::Nodelet)
