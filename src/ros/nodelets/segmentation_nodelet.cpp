// SPDX-License-Identifier: BSD-3-Clause
// scan, TF world -> lidar, objects  ->  segments
#include <string>
#include <utility>

#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/pipeline/scanner_check.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/points/point_states.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/segments.hpp"
#include "situation_awareness/ros/map_subscriber.hpp"
#include "situation_awareness/ros/params/object_nodelet_params.hpp"
#include "situation_awareness/ros/point_report.hpp"
#include "situation_awareness/ros/pose_offset_report.hpp"
#include "situation_awareness/ros/posed_input.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "situation_awareness/segments/divide.hpp"
#include "situation_awareness/segments/lines.hpp"
#include "situation_awareness/segments/segmentation.hpp"

namespace situation_awareness {

class SegmentationStage {
 public:
  using Input = PosedInput<sensor_msgs::LaserScan>;
  using Context = Input::Context;
  static constexpr const char* kInput = "scan";
  static constexpr auto kReadParams = read_object_nodelet_params;

  SegmentationStage(Context& context, const ObjectNodeletParams& params)
      : context_(context),
        params_(params),
        publisher_(context.node().advertise<SegmentArray>("segments", 20)),
        map_(context, params.nodelet.world_frame),
        check_(params.pipeline.scan.scanner, params.pipeline.scan_pose_offset_s),
        input_(
            context, params.nodelet, params.pipeline.scan_pose_offset_s,
            {scan_msg_defect, [this](const sensor_msgs::LaserScan& msg) { return taken(msg, params_.nodelet.deskew); },
             [this] { map_.clear(); },
             [this](const sensor_msgs::LaserScanConstPtr& msg) {
               return conventional(msg, params_.pipeline.scan.scanner);
             }}) {
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) {
      report_scanner(check_, status);
      report_pose_offset(check_, status);
      warn_of_no_hit(states_, status);
    });
    context.serve_live(
        [this](const RangeLimiterParams& scan, const SegmentationParams& segments) {
          params_.pipeline.scan = scan;
          params_.pipeline.segments = segments;
        },
        params.pipeline.scan, params.pipeline.segments);
  }

  bool process(const PosedMessage<sensor_msgs::LaserScan>& posed) {
    const Scan scan = scan_from_msg(*posed.msg);
    const std::string defect = projection_defect(scan, posed.T_world_sensor, posed.T_world_sensor_end);
    if (!defect.empty()) return context_.drop(defect);
    if (!(scan.time_increment_s == posed.msg->time_increment)) {
      context_.diagnostics().counted({{"time increment ignored", 1}});
    }

    limited_ = limit_range(scan, posed.T_world_sensor, params_.pipeline.scan, std::move(limited_));
    points_ = project_horizontally(limited_, posed.T_world_sensor, posed.T_world_sensor_end, std::move(points_));
    segments_ = segment(points_, params_.pipeline.segments, std::move(segments_));
    map_.receive();
    segments_ = divide(std::move(segments_), map_.outlines_at(points_.stamp_ns, points_.T_world_level),
                       params_.pipeline.segments);
    segments_ = with_straight_pieces(std::move(segments_), params_.pipeline.segments,
                                     params_.pipeline.detections.fit.range_sigma_m);

    context_.diagnostics().counted(segments_.refused);
    context_.publish(publisher_, segments_to_msg(segments_, params_.nodelet.world_frame));
    states_.add(points_);
    // After the output, which does not wait for it.
    check_.add_ranges(posed.msg->ranges, posed.msg->range_max);
    check_.add(limited_, points_, posed.T_world_sensor, posed.T_world_sensor_end);
    return true;
  }

 private:
  Context& context_;
  ObjectNodeletParams params_;
  ros::Publisher publisher_;
  MapSubscriber map_;
  ScannerCheck check_;
  PointStates states_;
  Input input_;
  // Kept for their memory:
  Scan limited_;
  Points points_;
  Segments segments_;
};

using SegmentationNodelet = StageNodelet<SegmentationStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::SegmentationNodelet, nodelet::Nodelet)
