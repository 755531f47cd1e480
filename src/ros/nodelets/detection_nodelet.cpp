// SPDX-License-Identifier: BSD-3-Clause
// segments, objects  ->  detections, hit_labels (for rviz)
#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <sensor_msgs/PointCloud2.h>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/pipeline/arrivals.hpp"
#include "situation_awareness/pipeline/hit_labels.hpp"
#include "situation_awareness/pipeline/unmapped_segments.hpp"
#include "situation_awareness/ros/convert/detections.hpp"
#include "situation_awareness/ros/convert/hit_labels.hpp"
#include "situation_awareness/ros/convert/segments.hpp"
#include "situation_awareness/ros/map_subscriber.hpp"
#include "situation_awareness/ros/params/object_nodelet_params.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"

namespace situation_awareness {

class DetectionStage {
 public:
  using Context = StageContext<SegmentArray>;
  static constexpr const char* kInput = "segments";
  static constexpr auto kReadParams = read_object_nodelet_params;

  DetectionStage(Context& context, const ObjectNodeletParams& params)
      : context_(context),
        detector_(make_detector(params.pipeline.detections)),
        publisher_(context.node().advertise<DetectionArray>("detections", 20)),
        labels_publisher_(context.node().advertise<sensor_msgs::PointCloud2>("hit_labels", 5)),
        map_(context, params.nodelet.world_frame) {
    context.diagnostics().on_report([this, detections = params.pipeline.detections](StageDiagnostics::Status& status) {
      const std::string path = model_path(detections);
      status.add("detector", detections.detector);
      status.add("model", path.empty() ? "none" : path);
      status.add("model SHA-256", path.empty() ? "none" : detector_->model_sha256());
    });
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) {
      status.add("compact segments on no map", worst_.on_no_map);
      status.add("compact segment on no map for [s]", worst_.for_s);
      status.add("compact segment on no map for, since the start [s]", worst_.longest_s);
      worst_.on_no_map = 0;
      worst_.for_s = 0.0;
    });
    context.serve_live(
        [this](const DetectionParams& detections) {
          detector_->set_min_p_ellipse(detections.min_p_ellipse);
          detector_->set_fit(detections.fit);
        },
        params.pipeline.detections);
  }

  bool process(const SegmentArray& msg) {
    Segments segments;
    try {
      segments = segments_from_msg(msg);
    } catch (const std::exception& error) {
      return context_.drop(drop_reason::kBadMessage, error.what());
    }
    map_.receive();
    follow_unmapped();
    const std::vector<ExpectedOutline>& known_level = map_.outlines_at(segments.stamp_ns, segments.T_world_level);
    detections_ = arrivals_.mark(segments, detector_->detect(segments, known_level, std::move(detections_)));
    context_.publish(publisher_, detections_to_msg(detections_, msg.header.frame_id));
    if (labels_publisher_.getNumSubscribers() > 0) {
      labels_ = label_hits(segments, detections_, map_.latest(), std::move(labels_));
      context_.publish(labels_publisher_, hit_labels_to_cloud(segments, labels_, msg.header.frame_id));
    }
    context_.diagnostics().counted(detections_.refused);
    segments_ = std::move(segments);
    return true;
  }

 private:
  /// Of the scan before, if its map has come meanwhile.
  void follow_unmapped() {
    if (segments_.points.empty() || map_.latest().stamp_ns != segments_.stamp_ns) return;
    const Unmapped& unmapped = unmapped_.add(segments_, map_.latest());
    worst_.on_no_map = std::max(worst_.on_no_map, unmapped.on_no_map);
    worst_.for_s = std::max(worst_.for_s, unmapped.for_s);
    worst_.longest_s = unmapped.longest_s;
  }

  Context& context_;
  std::unique_ptr<ProbableDetector> detector_;
  ros::Publisher publisher_, labels_publisher_;
  MapSubscriber map_;
  Arrivals arrivals_;
  Detections detections_;         // kept for its memory
  std::vector<HitLabel> labels_;  // the same
  Segments segments_;             // of the latest scan
  UnmappedSegments unmapped_;
  Unmapped worst_;  // since the latest report
};

using DetectionNodelet = StageNodelet<DetectionStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::DetectionNodelet, nodelet::Nodelet)
