// SPDX-License-Identifier: BSD-3-Clause
// scan, TF world -> lidar, map  ->  segments, segment_points (for the eye)
#include <deque>
#include <memory>
#include <string>
#include <utility>

#include <sensor_msgs/LaserScan.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>
#include <boost/make_shared.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/SegmentationConfig.h"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/ros/backlog.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/segments.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/map_subscriber.hpp"
#include "situation_awareness/ros/master_watch.hpp"
#include "situation_awareness/ros/params/live_params.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"
#include "situation_awareness/ros/transform_age.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "situation_awareness/segments/divide.hpp"
#include "situation_awareness/segments/segmentation.hpp"

namespace situation_awareness {

class SegmentationNodelet : public StageNodelet {
 private:
  using Live = LiveParams<SegmentationConfig, RangeLimiterParams, SegmentationParams>;

  struct Waiting {
    sensor_msgs::LaserScanConstPtr msg;
    ros::WallTime since;
    ros::Time arrival;  ///< in ROS time
  };

  void start() override {
    ros::NodeHandle& node = getNodeHandle();  // one callback at a time
    params_ = read_nodelet_params(ParamReader(getPrivateNodeHandle()));
    master_ = std::make_unique<MasterWatch>(getPrivateNodeHandle());
    order_ = std::make_unique<StampOrder>(params_.pipeline.objects.reset_time_jump_s);
    diagnostics_ = std::make_unique<StageDiagnostics>(node, getPrivateNodeHandle(), getName());
    diagnostics_->unknown_parameters(params_.unknown);
    diagnostics_->on_report([this](StageDiagnostics::Status& status) { master_->report(status); });
    diagnostics_->on_report([this](StageDiagnostics::Status& status) { transform_age_->report(status); });
    transform_age_ = std::make_unique<TransformAge>(tf_, params_.world_frame);
    const bool own_thread = true;
    listener_ = std::make_unique<tf2_ros::TransformListener>(tf_, node, own_thread, ros::TransportHints().tcpNoDelay());
    segments_publisher_ = node.advertise<sensor_msgs::PointCloud2>("segment_points", 5);
    array_publisher_ = node.advertise<SegmentArray>("segments", 20);
    backlog_ = std::make_unique<Backlog<sensor_msgs::LaserScan>>(
        node, *diagnostics_, [this](const sensor_msgs::LaserScanConstPtr& msg) { handle(*msg); });
    scan_subscriber_ =
        node.subscribe("scan", kTakeAll, &SegmentationNodelet::on_scan, this, ros::TransportHints().tcpNoDelay());
    diagnostics_->watch(scan_subscriber_, [this] { return without_transform_.size() + backlog_->waiting(); });
    map_ = std::make_unique<MapSubscriber>(node, params_.world_frame, *diagnostics_);
    live_ = std::make_unique<Live>(getPrivateNodeHandle(), getName(), params_.pipeline.scan, params_.pipeline.segments,
                                   [this](const RangeLimiterParams& scan, const SegmentationParams& segments) {
                                     params_.pipeline.scan = scan;
                                     params_.pipeline.segments = segments;
                                   });
    // Transforms come by another way than scans, so arrival of a scan alone would leave the latest one waiting.
    const ros::WallDuration poll_period(0.005);
    timer_ = node.createWallTimer(poll_period, [this](const ros::WallTimerEvent&) { release(); });
  }

  void on_scan(const ros::MessageEvent<sensor_msgs::LaserScan const>& event) {
    const sensor_msgs::LaserScanConstPtr msg = event.getConstMessage();
    try {
      diagnostics_->received();
      const std::string defect = scan_msg_defect(*msg);
      if (!defect.empty()) return diagnostics_->dropped(defect);
      switch (order_->judge(to_nanoseconds(msg->header.stamp))) {
        case StampOrder::Verdict::kRefused:
          return diagnostics_->dropped(drop_reason::kStamp);
        case StampOrder::Verdict::kRestart:
          for (; !without_transform_.empty(); without_transform_.pop_front()) {
            diagnostics_->dropped(drop_reason::kRestart);
          }
          backlog_->drop_all(drop_reason::kRestart);
          tf_.clear();  // what it holds is of a later time and would shut out what is to come
          map_->forget();
          break;
        case StampOrder::Verdict::kNext:
          break;
      }
      transform_age_->scan_arrived(tf2_frame(msg->header.frame_id));
      without_transform_.push_back({msg, ros::WallTime::now(), event.getReceiptTime()});
    } catch (const std::exception& error) {
      diagnostics_->dropped(drop_reason::kError, error.what());
    }
    release();
    if (without_transform_.size() > static_cast<std::size_t>(params_.queue_size)) {
      // Not the oldest: where transforms are later than the queue is long, it is the next to get its own.
      without_transform_.erase(without_transform_.end() - 2);
      diagnostics_->dropped(drop_reason::kQueueFull);
    }
  }

  ros::Time last_beam_of(const sensor_msgs::LaserScan& msg) const {
    return params_.deskew ? time_of_last_beam(msg) : msg.header.stamp;
  }

  bool has_transform(const sensor_msgs::LaserScan& msg, std::string* why = nullptr) const {
    const std::string frame = tf2_frame(msg.header.frame_id);
    return tf_.canTransform(params_.world_frame, frame, msg.header.stamp, why) &&
           tf_.canTransform(params_.world_frame, frame, last_beam_of(msg), why);
  }

  Eigen::Isometry3d T_world_lidar_at(const sensor_msgs::LaserScan& msg, const ros::Time& time) const {
    return isometry_from_msg(tf_.lookupTransform(params_.world_frame, tf2_frame(msg.header.frame_id), time).transform);
  }

  /// Let go on what has its transform, in order; drop what will not get it any more.
  void release() {
    const ros::WallDuration timeout(params_.tf_timeout_s);
    for (; !without_transform_.empty(); without_transform_.pop_front()) {
      const Waiting& waiting = without_transform_.front();
      try {
        // Transforms come in order: where a later scan has its own, that of an earlier one will not come. They come at
        // any time, on another thread, so the later scan is asked about first.
        const bool overtaken = without_transform_.size() > 1 && has_transform(*without_transform_.back().msg);
        std::string why;
        if (has_transform(*waiting.msg, &why)) {
          transform_age_->scan_waited(waiting.since);
          backlog_->add(waiting.msg, waiting.arrival);
          continue;
        }
        if (!overtaken && ros::WallTime::now() - waiting.since < timeout) return;
        diagnostics_->dropped(drop_reason::kNoTransform,
                              "from " + params_.world_frame + " to " + waiting.msg->header.frame_id + ": " + why);
      } catch (const std::exception& error) {
        diagnostics_->dropped(drop_reason::kError, error.what());
      }
    }
  }

  void handle(const sensor_msgs::LaserScan& msg) {
    try {
      process(msg);
    } catch (const std::exception& error) {
      diagnostics_->dropped(drop_reason::kError, error.what());
    }
  }

  void process(const sensor_msgs::LaserScan& msg) {
    const ros::WallTime start = ros::WallTime::now();
    Eigen::Isometry3d T_world_lidar, T_world_lidar_end;
    try {
      T_world_lidar = T_world_lidar_at(msg, msg.header.stamp);
      T_world_lidar_end = T_world_lidar_at(msg, last_beam_of(msg));
    } catch (const std::exception& error) {
      return diagnostics_->dropped(drop_reason::kBadTransform, error.what());
    }
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
    array_publisher_.publish(boost::make_shared<SegmentArray>(segments_to_msg(segments, params_.world_frame)));
    if (segments_publisher_.getNumSubscribers() > 0) {
      segments_publisher_.publish(
          boost::make_shared<sensor_msgs::PointCloud2>(segments_to_cloud(segments, params_.world_frame)));
    }
    diagnostics_->processed(msg.header.stamp, start);
  }

  NodeletParams params_;
  std::unique_ptr<Live> live_;
  std::unique_ptr<StampOrder> order_;
  std::unique_ptr<StageDiagnostics> diagnostics_;
  std::unique_ptr<MasterWatch> master_;
  tf2_ros::Buffer tf_;
  std::unique_ptr<TransformAge> transform_age_;
  std::unique_ptr<tf2_ros::TransformListener> listener_;
  std::deque<Waiting> without_transform_;
  std::unique_ptr<Backlog<sensor_msgs::LaserScan>> backlog_;
  std::unique_ptr<MapSubscriber> map_;
  ros::Publisher segments_publisher_, array_publisher_;
  ros::Subscriber scan_subscriber_;
  ros::WallTimer timer_;
};

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::SegmentationNodelet, nodelet::Nodelet)
