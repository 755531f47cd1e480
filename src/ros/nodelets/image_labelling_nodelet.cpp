// SPDX-License-Identifier: BSD-3-Clause
// image, image_info  ->  labels, camera_info (of the labels)
#include <optional>
#include <string>

#include <ros/publisher.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/pipeline/image_labelling.hpp"
#include "situation_awareness/ros/camera_report.hpp"
#include "situation_awareness/ros/convert/camera.hpp"
#include "situation_awareness/ros/convert/labels.hpp"
#include "situation_awareness/ros/image_subscriber.hpp"
#include "situation_awareness/ros/params/image_labelling_nodelet_params.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"
#include "situation_awareness/ros/timed_subscriber.hpp"

namespace situation_awareness {

class ImageLabellingStage {
 public:
  using Context = StageContext<sensor_msgs::Image, sensor_msgs::Image, ImageSubscriber>;
  static constexpr const char* kInput = "image";
  static constexpr auto kReadParams = read_image_labelling_nodelet_params;

  ImageLabellingStage(Context& context, const ImageLabellingNodeletParams& params)
      : context_(context),
        camera_(params.image_kind, context.node().resolveName(kInput)),
        labelling_(params.labelling, params.model_folder),
        labels_publisher_(context.node().advertise<sensor_msgs::Image>("labels", 5)),
        info_publisher_(context.node().advertise<sensor_msgs::CameraInfo>("camera_info", 5)) {
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) {
      status.add("model", labelling_.model_path());
      status.add("model SHA-256", labelling_.model_sha256());
      status.add("image_info", image_info_ ? "received" : "none yet");
      report(camera_.model(), status);
    });
    context.when_made([this] {
      info_.emplace(context_.node(), "image_info",
                    [this](const auto& msg, const ros::SteadyTime& /*arrival*/) { image_info_ = msg; });
    });
  }

  bool process(const sensor_msgs::Image& msg) {
    std::string defect = image_msg_defect(msg);
    if (!defect.empty()) return context_.drop(defect);
    if (!image_info_) return context_.drop("no camera_info");
    const CameraModel& model = camera_.take(*image_info_, msg);
    if (!model.defect.empty()) return context_.drop(model.defect);
    SoftLabels labels = labelling_.label(image_from_msg(msg, model.camera));
    defect = camera_.undistort(labels);
    if (!defect.empty()) return context_.drop(defect);
    // The camera first: who gets the labels has it.
    context_.publish(info_publisher_, camera_to_msg(labels.camera, labels.stamp_ns, msg.header.frame_id));
    context_.publish(labels_publisher_, labels_to_msg(labels, msg.header.frame_id));
    return true;
  }

 private:
  Context& context_;
  ImageCamera camera_;
  ImageLabelling labelling_;
  sensor_msgs::CameraInfoConstPtr image_info_;  ///< the latest
  ros::Publisher labels_publisher_, info_publisher_;
  std::optional<TimedSubscriber<sensor_msgs::CameraInfo>> info_;
};

using ImageLabellingNodelet = StageNodelet<ImageLabellingStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::ImageLabellingNodelet, nodelet::Nodelet)
