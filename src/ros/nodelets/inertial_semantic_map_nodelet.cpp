// SPDX-License-Identifier: BSD-3-Clause
// scan, imu, fix, TF base -> lidar  ->  semantic_map, semantic_map/updates, semantic_map_markers
#include <string>
#include <utility>

#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/pipeline/map_pipeline.hpp"
#include "situation_awareness/pipeline/scanner_check.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/points/point_states.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/inertial_input.hpp"
#include "situation_awareness/ros/map_output.hpp"
#include "situation_awareness/ros/params/map_nodelet_params.hpp"
#include "situation_awareness/ros/point_report.hpp"
#include "situation_awareness/ros/pose_offset_report.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"
#include "situation_awareness/scan/range_limiter.hpp"

namespace situation_awareness {

/// Where a scan is by GPS and INS is known to centimetres once it is aligned with the map: all stages behind the pose
/// are one here.
class InertialSemanticMapStage {
 public:
  using Context = InertialInput::Context;
  static constexpr const char* kInput = "scan";
  static constexpr auto kReadParams = read_inertial_map_nodelet_params;

  InertialSemanticMapStage(Context& context, const MapNodeletParams& params)
      : context_(context),
        deskew_(params.nodelet.deskew),
        limits_(params.pipeline.layers.scan),
        check_(limits_.scanner, 0.0),
        pipeline_(params.pipeline, params.objects, map_kinds_of(params.kinds)),
        output_(
            context, params.nodelet, pipeline_,
            [&context](const ros::Publisher& publisher, MapUpdate msg) { context.publish(publisher, std::move(msg)); }),
        input_(context, gps_ins_params_of(params.nodelet, params.inertial), limits_.scanner) {
    order_.trust();  // the input has judged them
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) {
      report_scanner(check_, status);
      warn_of_no_hit(states_, status);
    });
  }

  bool process(const InertialScan& posed) {
    if (output_.passes_over()) return false;
    Scan scan = scan_from_msg(*posed.msg);
    if (!deskew_) scan.time_increment_s = 0.0;
    const std::string defect = projection_defect(scan, posed.T_odom_lidar, posed.T_odom_lidar_end);
    if (!defect.empty()) return context_.drop(defect);
    if (!output_.is_next(order_.judge(scan.stamp_ns))) return false;
    output_.publish(pipeline_.process(scan, posed.T_odom_lidar, posed.T_odom_lidar_end, posed.placement));
    context_.diagnostics().counted(pipeline_.layers().chain_update().reasons);
    states_.add(pipeline_.points());
    check_.add_ranges(posed.msg->ranges, posed.msg->range_max);
    limited_ = limit_range(scan, posed.T_odom_lidar, limits_, std::move(limited_));
    check_.add(limited_, pipeline_.points(), posed.T_odom_lidar, posed.T_odom_lidar_end);
    return true;
  }

 private:
  Context& context_;
  bool deskew_;
  RangeLimiterParams limits_;
  ScannerCheck check_;
  Scan limited_;  ///< kept for its memory
  StampOrder order_;
  MapPipeline pipeline_;
  PointStates states_;
  MapOutput output_;
  InertialInput input_;
};

using InertialSemanticMapNodelet = StageNodelet<InertialSemanticMapStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::InertialSemanticMapNodelet, nodelet::Nodelet)
