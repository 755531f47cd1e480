// SPDX-License-Identifier: BSD-3-Clause
// detections  ->  map, markers (for the eye), downlink/objects (for other hosts)
#include <memory>
#include <string>

#include <boost/make_shared.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/common/rate_limit.hpp"
#include "situation_awareness/ros/backlog.hpp"
#include "situation_awareness/ros/convert/detections.hpp"
#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/map_report.hpp"
#include "situation_awareness/ros/map_services.hpp"
#include "situation_awareness/ros/markers/object_markers.hpp"
#include "situation_awareness/ros/master_watch.hpp"
#include "situation_awareness/ros/params/live_params.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"
#include "situation_awareness/ros/timed_subscriber.hpp"

namespace situation_awareness {

class MappingNodelet : public StageNodelet {
 private:
  using Live = LiveParams<ObjectMapParams>;

  void start() override {
    ros::NodeHandle& node = getNodeHandle();  // one callback at a time
    const NodeletParams params = read_nodelet_params(ParamReader(getPrivateNodeHandle()));
    world_frame_ = params.world_frame;
    master_ = std::make_unique<MasterWatch>(getPrivateNodeHandle());
    map_ = std::make_unique<ObjectMap>(params.pipeline.objects);
    diagnostics_ = std::make_unique<StageDiagnostics>(node, getPrivateNodeHandle(), getName());
    diagnostics_->unknown_parameters(params.unknown);
    diagnostics_->on_report([this](StageDiagnostics::Status& status) { master_->report(status); });
    diagnostics_->on_report([this](StageDiagnostics::Status& status) { report_map(*map_, nis_, status); });
    map_publisher_ = node.advertise<EllipseMap>("objects", 20);
    markers_publisher_ = node.advertise<visualization_msgs::MarkerArray>("object_markers", 5);
    // A queue of one: what a broken link holds up is out of date when it comes back.
    downlink_publisher_ = node.advertise<EllipseMap>("downlink/objects", 1);
    downlink_limit_ = std::make_unique<RateLimit>(params.downlink_rate_hz);
    services_ = std::make_unique<MapServices>(node, getPrivateNodeHandle(), getName(), world_frame_, *map_,
                                              *diagnostics_, [this](const Objects& objects) { publish(objects); });
    backlog_ = std::make_unique<Backlog<DetectionArray>>(
        node, *diagnostics_,
        [this](const DetectionArrayConstPtr& msg, const ros::SteadyTime& arrival) { process(msg, arrival); });
    subscriber_ = std::make_unique<TimedSubscriber<DetectionArray>>(
        node, "detections", [this](const DetectionArrayConstPtr& msg, const ros::SteadyTime& arrival) {
          diagnostics_->received();
          backlog_->add(msg, arrival);
        });
    diagnostics_->watch(subscriber_->subscriber(), [this] { return backlog_->waiting(); });
    live_ = std::make_unique<Live>(getPrivateNodeHandle(), getName(), params.pipeline.objects,
                                   [this](const ObjectMapParams& objects) { map_->set_params(objects); });
  }

  void process(const DetectionArrayConstPtr& msg, const ros::SteadyTime& arrival) {
    const ros::SteadyTime start = ros::SteadyTime::now();
    if (services_->paused()) return diagnostics_->counted({{"passed over while paused", 1}});
    if (tf2_frame(msg->header.frame_id) != world_frame_) {
      return diagnostics_->dropped(drop_reason::kBadMessage, "detections in the frame " + msg->header.frame_id);
    }
    Detections detections;
    try {
      detections = detections_from_msg(*msg);
    } catch (const std::exception& error) {
      return diagnostics_->dropped(drop_reason::kBadMessage, error.what());
    }
    try {
      const ObjectMapUpdate update = map_->update(detections);
      diagnostics_->counted(update.reasons);
      nis_.add(update.matches, update.mahalanobis2);
      if (map_->stamp_ns() != detections.stamp_ns) return diagnostics_->dropped(drop_reason::kStamp);
      publish(map_->at(detections.stamp_ns));
      diagnostics_->processed(msg->header.stamp, start, latency_s(msg->latency, arrival));
    } catch (const std::exception& error) {
      diagnostics_->dropped(drop_reason::kError, error.what());
    }
  }

  void publish(const Objects& objects) {
    const auto map_msg = boost::make_shared<const EllipseMap>(objects_to_msg(objects, world_frame_));
    map_publisher_.publish(map_msg);
    const auto now_ns = static_cast<std::int64_t>(ros::SteadyTime::now().toNSec());
    if (downlink_limit_->passes(now_ns)) downlink_publisher_.publish(map_msg);
    if (markers_publisher_.getNumSubscribers() == 0) return;
    markers_publisher_.publish(
        boost::make_shared<visualization_msgs::MarkerArray>(markers_.update(objects, world_frame_)));
  }

  std::string world_frame_;
  std::unique_ptr<ObjectMap> map_;
  std::unique_ptr<Live> live_;
  NisMonitor nis_{kMeasurementSize};
  std::unique_ptr<StageDiagnostics> diagnostics_;
  std::unique_ptr<MapServices> services_;
  std::unique_ptr<MasterWatch> master_;
  std::unique_ptr<Backlog<DetectionArray>> backlog_;
  ObjectMarkers markers_{MarkerStyle::kEstimate};
  std::unique_ptr<RateLimit> downlink_limit_;
  ros::Publisher map_publisher_, markers_publisher_, downlink_publisher_;
  std::unique_ptr<TimedSubscriber<DetectionArray>> subscriber_;
};

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::MappingNodelet, nodelet::Nodelet)
