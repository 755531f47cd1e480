// SPDX-License-Identifier: BSD-3-Clause
// scan, TF world -> lidar, map  ->  segments, segment_points (for the eye)
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <string>

#include <sensor_msgs/LaserScan.h>
#include <std_msgs/Header.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>
#include <boost/make_shared.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/ros/backlog.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/segments.hpp"
#include "situation_awareness/ros/map_subscriber.hpp"
#include "situation_awareness/ros/master_watch.hpp"
#include "situation_awareness/ros/params/live_params.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"
#include "situation_awareness/ros/timed_subscriber.hpp"
#include "situation_awareness/ros/transform_age.hpp"
#include "situation_awareness/ros/transform_queue.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "situation_awareness/segments/divide.hpp"
#include "situation_awareness/segments/segmentation.hpp"

namespace situation_awareness {

class SegmentationNodelet : public StageNodelet {
 private:
  using Live = LiveParams<RangeLimiterParams, SegmentationParams>;

  struct Arrived {
    sensor_msgs::LaserScanConstPtr msg;
    ros::SteadyTime at;
  };

  struct PosedScan {
    std_msgs::Header header;
    sensor_msgs::LaserScanConstPtr msg;
    Eigen::Isometry3d T_world_lidar, T_world_lidar_end;
  };

  void start() override {
    ros::NodeHandle& node = getNodeHandle();  // one callback at a time
    params_ = read_nodelet_params(ParamReader(getPrivateNodeHandle()));
    master_ = std::make_unique<MasterWatch>(getPrivateNodeHandle());
    diagnostics_ = std::make_unique<StageDiagnostics>(node, getPrivateNodeHandle(), getName());
    diagnostics_->unknown_parameters(params_.unknown);
    diagnostics_->on_report([this](StageDiagnostics::Status& status) { master_->report(status); });
    diagnostics_->on_report([this](StageDiagnostics::Status& status) { transform_age_->report(status); });
    transform_age_ = std::make_unique<TransformAge>(tf_, params_.world_frame);
    const bool own_thread = true;
    listener_ = std::make_unique<tf2_ros::TransformListener>(tf_, node, own_thread, ros::TransportHints().tcpNoDelay());
    segments_publisher_ = node.advertise<sensor_msgs::PointCloud2>("segment_points", 5);
    array_publisher_ = node.advertise<SegmentArray>("segments", 20);
    const TransformQueueParams queue_params{params_.world_frame, params_.tf_timeout_s,
                                            static_cast<std::size_t>(params_.queue_size),
                                            params_.pipeline.objects.reset_time_jump_s};
    queue_ = std::make_unique<TransformQueue<Arrived>>(
        tf_, queue_params,
        [this](const char* reason, const std::string& detail) { diagnostics_->dropped(reason, detail); });
    backlog_ = std::make_unique<Backlog<PosedScan>>(
        node, *diagnostics_, [this](const boost::shared_ptr<const PosedScan>& scan, const ros::SteadyTime& arrival) {
          handle(*scan, arrival);
        });
    scan_subscriber_ = std::make_unique<TimedSubscriber<sensor_msgs::LaserScan>>(
        node, "scan",
        [this](const sensor_msgs::LaserScanConstPtr& msg, const ros::SteadyTime& arrival) { on_scan(msg, arrival); });
    diagnostics_->watch(scan_subscriber_->subscriber(), [this] { return queue_->waiting() + backlog_->waiting(); });
    map_ = std::make_unique<MapSubscriber>(node, params_.world_frame, *diagnostics_);
    live_ = std::make_unique<Live>(getPrivateNodeHandle(), getName(), params_.pipeline.scan, params_.pipeline.segments,
                                   [this](const RangeLimiterParams& scan, const SegmentationParams& segments) {
                                     params_.pipeline.scan = scan;
                                     params_.pipeline.segments = segments;
                                   });
    // Transforms come by another way than scans, so arrival of a scan alone would leave the latest one waiting.
    const ros::WallDuration poll_period(0.005);
    timer_ = node.createSteadyTimer(poll_period, [this](const ros::SteadyTimerEvent&) { release(); });
  }

  void on_scan(const sensor_msgs::LaserScanConstPtr& msg, const ros::SteadyTime& arrival) {
    try {
      diagnostics_->received();
      const std::string defect = scan_msg_defect(*msg);
      if (!defect.empty()) return diagnostics_->dropped(defect);
      const Taken when = taken(*msg, params_.deskew);
      const StampOrder::Verdict verdict = queue_->add({msg, arrival}, when, steady_now_ns());
      if (verdict == StampOrder::Verdict::kRestart) {
        backlog_->drop_all(drop_reason::kRestart);
        map_->forget();
      }
      if (verdict != StampOrder::Verdict::kRefused) transform_age_->scan_arrived(when.frame);
    } catch (const std::exception& error) {
      diagnostics_->dropped(drop_reason::kError, error.what());
    }
    release();
  }

  static std::int64_t steady_now_ns() { return static_cast<std::int64_t>(ros::SteadyTime::now().toNSec()); }

  /// Let go on what has its transforms.
  void release() {
    try {
      while (const std::optional<Posed<Arrived>> ready = queue_->next(steady_now_ns())) {
        transform_age_->scan_waited(ready->waited_s);
        const PosedScan scan{ready->item.msg->header, ready->item.msg, ready->T_world_sensor,
                             ready->T_world_sensor_end};
        backlog_->add(boost::make_shared<const PosedScan>(scan), ready->item.at);
      }
    } catch (const std::exception& error) {
      diagnostics_->dropped(drop_reason::kError, error.what());
    }
  }

  void handle(const PosedScan& scan, const ros::SteadyTime& arrival) {
    try {
      process(*scan.msg, scan.T_world_lidar, scan.T_world_lidar_end, arrival);
    } catch (const std::exception& error) {
      diagnostics_->dropped(drop_reason::kError, error.what());
    }
  }

  void process(const sensor_msgs::LaserScan& msg, const Eigen::Isometry3d& T_world_lidar,
               const Eigen::Isometry3d& T_world_lidar_end, const ros::SteadyTime& arrival) {
    const ros::SteadyTime start = ros::SteadyTime::now();
    const Scan scan = scan_from_msg(msg);
    const std::string defect = projection_defect(scan, T_world_lidar, T_world_lidar_end);
    if (!defect.empty()) return diagnostics_->dropped(defect);
    if (!(scan.time_increment_s == msg.time_increment)) diagnostics_->counted({{"time increment ignored", 1}});

    const Scan limited = limit_range(scan, T_world_lidar, params_.pipeline.scan);
    const Points points = project_horizontally(limited, T_world_lidar, T_world_lidar_end);
    const Segments segments =
        divide(segment(points, params_.pipeline.segments), map_->outlines_at(points.stamp_ns, points.T_world_level),
               params_.pipeline.segments);

    diagnostics_->counted(segments.refused);
    const double unknown_before_s = 0.0;
    const auto array = boost::make_shared<SegmentArray>(segments_to_msg(segments, params_.world_frame));
    array->latency = latency_s(unknown_before_s, arrival);
    array_publisher_.publish(array);
    if (segments_publisher_.getNumSubscribers() > 0) {
      segments_publisher_.publish(
          boost::make_shared<sensor_msgs::PointCloud2>(segments_to_cloud(segments, params_.world_frame)));
    }
    diagnostics_->processed(msg.header.stamp, start, latency_s(unknown_before_s, arrival));
  }

  NodeletParams params_;
  std::unique_ptr<Live> live_;
  std::unique_ptr<StageDiagnostics> diagnostics_;
  std::unique_ptr<MasterWatch> master_;
  tf2_ros::Buffer tf_;
  std::unique_ptr<TransformAge> transform_age_;
  std::unique_ptr<tf2_ros::TransformListener> listener_;
  std::unique_ptr<TransformQueue<Arrived>> queue_;
  std::unique_ptr<Backlog<PosedScan>> backlog_;
  std::unique_ptr<MapSubscriber> map_;
  ros::Publisher segments_publisher_, array_publisher_;
  std::unique_ptr<TimedSubscriber<sensor_msgs::LaserScan>> scan_subscriber_;
  ros::SteadyTimer timer_;
};

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::SegmentationNodelet, nodelet::Nodelet)
