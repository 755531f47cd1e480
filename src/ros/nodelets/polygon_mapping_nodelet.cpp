// SPDX-License-Identifier: BSD-3-Clause
// segments, pose, objects  ->  polygons, polygon_markers (for display), downlink/polygons (for other hosts)
#include <algorithm>
#include <cstddef>
#include <exception>
#include <string>
#include <utility>

#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/pipeline/moving_objects.hpp"
#include "situation_awareness/polylines/polyline_extraction.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/segments.hpp"
#include "situation_awareness/ros/map_publisher.hpp"
#include "situation_awareness/ros/map_services.hpp"
#include "situation_awareness/ros/params/polygon_nodelet_params.hpp"
#include "situation_awareness/ros/polygon_kind.hpp"
#include "situation_awareness/ros/pose_covariance_input.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"

namespace situation_awareness {

class PolygonMappingStage {
 public:
  using Context = PoseCovarianceInput::Context;
  static constexpr const char* kInput = "segments";
  static constexpr auto kReadParams = read_polygon_nodelet_params;

  PolygonMappingStage(Context& context, const PolygonNodeletParams& params)
      : context_(context),
        world_frame_(params.nodelet.world_frame),
        polyline_params_(params.pipeline.polylines),
        pose_covariance_(params.scan_pose.covariance()),
        movers_(params.pipeline.movers),
        map_(params.pipeline.polygons, params.pipeline.chain_states, params.reset_time_jump_s),
        publisher_(context, params.nodelet),
        services_(context, world_frame_, map_, [this](const Polygons& polygons) { publisher_.publish(polygons); }),
        input_(context, {world_frame_, params.scan_pose.pose_timeout_s,
                         static_cast<std::size_t>(params.nodelet.queue_size), params.max_pose_age_s}) {
    polyline_params_.validate();
    map_.trust_stamps();  // segmentation has judged them
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report(status); });
  }

  bool process(const CovariedSegments& covaried) {
    if (services_.passes_over()) return false;
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
    polylines_ = extract_polylines(segments, polyline_params_, std::move(polylines_));
    context_.diagnostics().counted(polylines_.refused);
    ++(covaried.base ? with_covariance_ : without_covariance_);
    if (covaried.objects) movers_.add(*covaried.objects, segments.free_space, segments.T_world_level);
    ++(covaried.objects ? with_objects_ : without_objects_);
    update_ = map_.update(
        polylines_,
        covaried.base ? covariance_at(segments.T_world_level.translation_m, *covaried.base) : pose_covariance_,
        movers_.at(segments.stamp_ns), std::move(update_));
    hits_on_movers_ += static_cast<std::size_t>(update_.on_movers);
    if (update_.reasons.of(TimedPolygonMap::kCannotBeUsed) > 0) {
      return context_.drop(drop_reason::kBadMessage, "numbers that are no place near the world's origin");
    }
    context_.diagnostics().counted(update_.reasons);
    if (update_.reasons.of(TimedPolygonMap::kRepeats) + update_.reasons.of(TimedPolygonMap::kGoesBack) > 0)
      return context_.drop(drop_reason::kStamp);
    publisher_.publish(map_.polygons());
    return true;
  }

 private:
  void report(StageDiagnostics::Status& status) {
    const auto in_state = [this](ChainState state) {
      const std::vector<Chain>& chains = map_.polygons().chains;
      return std::count_if(chains.begin(), chains.end(), [state](const Chain& chain) { return chain.state == state; });
    };
    status.add("chains", map_.size());
    status.add("walls", in_state(ChainState::kWall));
    status.add("known", in_state(ChainState::kKnown));
    status.add("new", in_state(ChainState::kNew));
    status.add("doubted", in_state(ChainState::kDoubted));
    status.add("elements", map_.elements());
    status.add("scans with the covariance of pose", with_covariance_);
    status.add("scans with that of pose_sigma_m", without_covariance_);
    status.add("scans with the map of objects", with_objects_);
    status.add("scans without it", without_objects_);
    status.add("movers", movers_.count());
    status.add("things that set off", movers_.set_off());
    status.add("hits on movers", hits_on_movers_);
  }

  Context& context_;
  std::string world_frame_;
  PolylineParams polyline_params_;
  Eigen::Matrix3d pose_covariance_;
  MovingObjects movers_;
  TimedPolygonMap map_;
  Polylines polylines_;
  PolygonMapUpdate update_;
  std::size_t with_covariance_ = 0, without_covariance_ = 0;
  std::size_t with_objects_ = 0, without_objects_ = 0, hits_on_movers_ = 0;
  MapPublisher<PolygonKind> publisher_;
  MapServices<PolygonKind> services_;
  PoseCovarianceInput input_;
};

using PolygonMappingNodelet = StageNodelet<PolygonMappingStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::PolygonMappingNodelet, nodelet::Nodelet)
