// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/check/camera.hpp"

#include <algorithm>

#include "situation_awareness/common/format.hpp"
#include "situation_awareness/ros/convert/cloud.hpp"
#include "situation_awareness/ros/convert/compressed_image.hpp"
#include "situation_awareness/ros/convert/labels.hpp"

namespace situation_awareness {
namespace {

/// So many compressed images are decoded to know their format.
constexpr std::size_t kDecoded = 3;

}  // namespace

void ImageFormat::look_at(const sensor_msgs::Image& image) {
  ++images_;
  const std::string not_labels = labels_msg_defect(image);
  const std::string defect = not_labels.empty() ? "" : image_msg_defect(image);
  if (!defect.empty()) {
    ++defects_[defect];
    return;
  }
  if (first_) return;
  are_labels_ = not_labels.empty();
  first_ = image;
  first_->data.clear();
}

void ImageFormat::report_format(TopicReport& report) const {
  add_defects(defects_, images_, "messages", "publish them in an encoding that is read (docs/ros.md)", report);
  if (first_) {
    report.facts.push_back(formatted("%u x %u pixels, %s, read as %s", first_->width, first_->height,
                                     first_->encoding.c_str(), are_labels_ ? "labels" : "a picture, for the network"));
    if (!are_labels_ && report.topic.find("label") != std::string::npos) {
      report.findings.push_back({"labels are 32FC1, and these images are " + first_->encoding +
                                     ": they are taken for pictures, which the network labels",
                                 "publish the probability of the class as 32FC1"});
    }
  }
}

void CompressedImageTopicCheck::look(const sensor_msgs::CompressedImage& msg) {
  if (stamps_.count() <= kDecoded) look_at(*decompressed(msg));
}

void CameraInfoTopicCheck::look(const sensor_msgs::CameraInfo& msg) {
  if (!first_) first_ = msg;
}

void CameraInfoTopicCheck::add_to(TopicReport& report) const {
  if (!first_) return;
  const bool is_distorted = std::any_of(first_->D.begin(), first_->D.end(), [](double d) { return d != 0.0; });
  std::string line =
      formatted("%u x %u pixels, focal length %.1f px (K), %.1f px rectified (P), %s", first_->width, first_->height,
                first_->K[0], first_->P[0], is_distorted ? "distorted, model " : "not distorted");
  if (is_distorted) line += first_->distortion_model;
  report.facts.push_back(line);
  if (!(first_->K[0] > 0.0)) {
    report.findings.push_back(
        {"the camera is not calibrated: its focal length is not positive", "calibrate it (camera_calibration)"});
  }
}

void CloudTopicCheck::look(const sensor_msgs::PointCloud2& msg) {
  const std::string defect = cloud_msg_defect(msg);
  if (!defect.empty()) {
    ++defects_[defect];
    return;
  }
  if (good_ == 0) {
    rows_ = msg.height;
    columns_ = msg.width;
    for (const sensor_msgs::PointField& field : msg.fields) fields_ += (fields_.empty() ? "" : " ") + field.name;
  }
  ++good_;
  const CloudMsgTimes times = cloud_msg_times(msg, times_);
  const CloudTimes range = times.times();
  if (range.last_s > range.first_s) {
    ++with_times_;
    longest_s_ = std::max(longest_s_, range.last_s - range.first_s);
  }
}

void CloudTopicCheck::add_to(TopicReport& report) const {
  add_defects(defects_, stamps_.count(), "messages", "mend the driver's message", report);
  if (good_ == 0) return;
  report.facts.push_back(formatted("%zu x %zu points, fields %s", rows_, columns_, fields_.c_str()));
  report.facts.push_back(with_times_ > 0 ? formatted("times of points, %.1f ms from first to last", 1e3 * longest_s_)
                                         : "no times of points: all are taken at the stamp");
  if (rows_ == 1) {
    report.findings.push_back({"the clouds have no rows: they do not say where the sensor met nothing",
                               "let the driver organize them (Velodyne: organize_cloud:=true), so that free space is "
                               "known"});
  }
}

}  // namespace situation_awareness
