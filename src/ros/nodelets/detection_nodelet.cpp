// SPDX-License-Identifier: BSD-3-Clause
// segments, map  ->  detections
#include <memory>
#include <string>

#include <boost/make_shared.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/detections/refine.hpp"
#include "situation_awareness/ros/backlog.hpp"
#include "situation_awareness/ros/convert/detections.hpp"
#include "situation_awareness/ros/convert/segments.hpp"
#include "situation_awareness/ros/map_subscriber.hpp"
#include "situation_awareness/ros/master_watch.hpp"
#include "situation_awareness/ros/params/live_params.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"
#include "situation_awareness/ros/timed_subscriber.hpp"

namespace situation_awareness {

class DetectionNodelet : public StageNodelet {
 private:
  using Live = LiveParams<DetectionParams>;

  void start() override {
    ros::NodeHandle& node = getNodeHandle();  // one callback at a time
    const NodeletParams params = read_nodelet_params(ParamReader(getPrivateNodeHandle()));
    master_ = std::make_unique<MasterWatch>(getPrivateNodeHandle());
    detector_ = make_detector(params.pipeline.detections);
    diagnostics_ = std::make_unique<StageDiagnostics>(node, getPrivateNodeHandle(), getName());
    diagnostics_->unknown_parameters(params.unknown);
    diagnostics_->on_report([this](StageDiagnostics::Status& status) { master_->report(status); });
    diagnostics_->on_report([this, detections = params.pipeline.detections](StageDiagnostics::Status& status) {
      const std::string path = model_path(detections);
      status.add("detector", detections.detector);
      status.add("model", path.empty() ? "none" : path);
      status.add("model SHA-256", path.empty() ? "none" : detector_->model_sha256());
    });
    map_ = std::make_unique<MapSubscriber>(node, params.world_frame, *diagnostics_);
    publisher_ = node.advertise<DetectionArray>("detections", 20);
    backlog_ = std::make_unique<Backlog<SegmentArray>>(
        node, *diagnostics_,
        [this](const SegmentArrayConstPtr& msg, const ros::SteadyTime& arrival) { process(msg, arrival); });
    subscriber_ = std::make_unique<TimedSubscriber<SegmentArray>>(
        node, "segments", [this](const SegmentArrayConstPtr& msg, const ros::SteadyTime& arrival) {
          diagnostics_->received();
          backlog_->add(msg, arrival);
        });
    diagnostics_->watch(subscriber_->subscriber(), [this] { return backlog_->waiting(); });
    live_ = std::make_unique<Live>(getPrivateNodeHandle(), getName(), params.pipeline.detections,
                                   [this](const DetectionParams& detections) {
                                     detector_->set_min_p_ellipse(detections.min_p_ellipse);
                                     detector_->set_fit(detections.fit);
                                     fit_ = detections.fit;
                                   });
  }

  void process(const SegmentArrayConstPtr& msg, const ros::SteadyTime& arrival) {
    const ros::SteadyTime start = ros::SteadyTime::now();
    Segments segments;
    try {
      segments = segments_from_msg(*msg);
    } catch (const std::exception& error) {
      return diagnostics_->dropped(drop_reason::kBadMessage, error.what());
    }
    try {
      const Detections detections = refine(detector_->detect(segments), segments,
                                           map_->outlines_at(segments.stamp_ns, segments.T_world_level), fit_);
      const auto array = boost::make_shared<DetectionArray>(detections_to_msg(detections, msg->header.frame_id));
      array->latency = latency_s(msg->latency, arrival);
      publisher_.publish(array);
      diagnostics_->counted(detections.refused);
      diagnostics_->processed(msg->header.stamp, start, latency_s(msg->latency, arrival));
    } catch (const std::exception& error) {
      diagnostics_->dropped(drop_reason::kError, error.what());
    }
  }

  EllipseFitParams fit_;
  std::unique_ptr<ProbableDetector> detector_;
  std::unique_ptr<Live> live_;
  std::unique_ptr<StageDiagnostics> diagnostics_;
  std::unique_ptr<MasterWatch> master_;
  std::unique_ptr<MapSubscriber> map_;
  std::unique_ptr<Backlog<SegmentArray>> backlog_;
  ros::Publisher publisher_;
  std::unique_ptr<TimedSubscriber<SegmentArray>> subscriber_;
};

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::DetectionNodelet, nodelet::Nodelet)
