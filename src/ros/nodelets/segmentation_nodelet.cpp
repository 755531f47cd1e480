// SPDX-License-Identifier: BSD-3-Clause
// scan, TF world -> lidar, objects  ->  segments, segment_points (for the eye)
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include <sensor_msgs/LaserScan.h>
#include <std_msgs/Header.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>
#include <boost/make_shared.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/segments.hpp"
#include "situation_awareness/ros/map_subscriber.hpp"
#include "situation_awareness/ros/params/object_nodelet_params.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"
#include "situation_awareness/ros/transform_age.hpp"
#include "situation_awareness/ros/transform_queue.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "situation_awareness/segments/divide.hpp"
#include "situation_awareness/segments/lines.hpp"
#include "situation_awareness/segments/segmentation.hpp"

namespace situation_awareness {

/// A scan with the poses of the lidar at its first and its last beam.
struct PosedScan {
  std_msgs::Header header;
  sensor_msgs::LaserScanConstPtr msg;
  Eigen::Isometry3d T_world_lidar, T_world_lidar_end;
};

class SegmentationStage {
 public:
  using Context = StageContext<sensor_msgs::LaserScan, PosedScan>;
  static constexpr const char* kInput = "scan";
  static constexpr auto kReadParams = read_object_nodelet_params;

  SegmentationStage(Context& context, const ObjectNodeletParams& params)
      : context_(context),
        params_(params),
        transform_age_(tf_, params.nodelet.world_frame),
        queue_(tf_,
               {params.nodelet.world_frame, params.nodelet.tf_timeout_s,
                static_cast<std::size_t>(params.nodelet.queue_size), params.pipeline.objects.reset_time_jump_s},
               [this](const char* reason, const std::string& detail) { context_.drop(reason, detail); }),
        array_publisher_(context.node().advertise<SegmentArray>("segments", 20)),
        points_publisher_(context.node().advertise<sensor_msgs::PointCloud2>("segment_points", 5)),
        map_(context, params.nodelet.world_frame),
        listener_(tf_, context.node(), true, ros::TransportHints().tcpNoDelay()) {  // on a thread of its own
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { transform_age_.report(status); });
    context.serve_live(
        [this](const RangeLimiterParams& scan, const SegmentationParams& segments) {
          params_.pipeline.scan = scan;
          params_.pipeline.segments = segments;
        },
        params.pipeline.scan, params.pipeline.segments);
    context.on_arrival(
        [this](const sensor_msgs::LaserScanConstPtr& msg, const ros::SteadyTime& arrival) { take(msg, arrival); },
        [this] { return queue_.waiting(); });
    // Transforms come by another way than scans, so arrival of a scan alone would leave the latest one waiting.
    context.every(0.005, [this] { release(); });
  }
  SegmentationStage(const SegmentationStage&) = delete;
  SegmentationStage& operator=(const SegmentationStage&) = delete;

  bool process(const PosedScan& posed) {
    const Scan scan = scan_from_msg(*posed.msg);
    const std::string defect = projection_defect(scan, posed.T_world_lidar, posed.T_world_lidar_end);
    if (!defect.empty()) return context_.drop(defect);
    if (!(scan.time_increment_s == posed.msg->time_increment)) {
      context_.diagnostics().counted({{"time increment ignored", 1}});
    }

    const Scan limited = limit_range(scan, posed.T_world_lidar, params_.pipeline.scan);
    const Points points = project_horizontally(limited, posed.T_world_lidar, posed.T_world_lidar_end);
    const Segments segments =
        with_straight_pieces(divide(segment(points, params_.pipeline.segments),
                                    map_.outlines_at(points.stamp_ns, points.T_world_level), params_.pipeline.segments),
                             params_.pipeline.segments, params_.pipeline.detections.fit.range_sigma_m);

    context_.diagnostics().counted(segments.refused);
    context_.publish(array_publisher_, segments_to_msg(segments, params_.nodelet.world_frame));
    if (points_publisher_.getNumSubscribers() > 0) {
      context_.publish(points_publisher_, segments_to_cloud(segments, params_.nodelet.world_frame));
    }
    return true;
  }

 private:
  struct Arrived {
    sensor_msgs::LaserScanConstPtr msg;
    ros::SteadyTime at;
  };

  void take(const sensor_msgs::LaserScanConstPtr& msg, const ros::SteadyTime& arrival) {
    const std::string defect = scan_msg_defect(*msg);
    if (!defect.empty()) return context_.diagnostics().dropped(defect);
    const Taken when = taken(*msg, params_.nodelet.deskew);
    const StampOrder::Verdict verdict = queue_.add({msg, arrival}, when, steady_now_ns());
    if (verdict == StampOrder::Verdict::kRestart) {
      context_.drop_enqueued(drop_reason::kRestart);
      map_.forget();
    }
    if (verdict != StampOrder::Verdict::kRefused) transform_age_.scan_arrived(when.frame);
    release();
  }

  static std::int64_t steady_now_ns() { return static_cast<std::int64_t>(ros::SteadyTime::now().toNSec()); }

  /// Lets go on what has its transforms. Throws nothing.
  void release() {
    try {
      while (const std::optional<Posed<Arrived>> ready = queue_.next(steady_now_ns())) {
        transform_age_.scan_waited(ready->waited_s);
        const PosedScan posed{ready->item.msg->header, ready->item.msg, ready->T_world_sensor,
                              ready->T_world_sensor_end};
        context_.enqueue(boost::make_shared<const PosedScan>(posed), ready->item.at);
      }
    } catch (const std::exception& error) {
      context_.drop(drop_reason::kError, error.what());
    }
  }

  Context& context_;
  ObjectNodeletParams params_;
  tf2_ros::Buffer tf_;
  TransformAge transform_age_;
  TransformQueue<Arrived> queue_;
  ros::Publisher array_publisher_, points_publisher_;
  MapSubscriber map_;
  tf2_ros::TransformListener listener_;
};

using SegmentationNodelet = StageNodelet<SegmentationStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::SegmentationNodelet, nodelet::Nodelet)
