// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/PointCloud2.h>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/ros/check/topic_check.hpp"
#include "situation_awareness/scan/cloud_times.hpp"

namespace situation_awareness {

/// Size and encoding of images.
class ImageFormat {
 public:
  /// Labels, one number per pixel, not colours or greys.
  bool are_labels() const { return are_labels_; }
  /// The first that can be used, without its pixels.
  const std::optional<sensor_msgs::Image>& first() const { return first_; }

 protected:
  ~ImageFormat() = default;
  void look_at(const sensor_msgs::Image& image);
  void report_format(TopicReport& report) const;

 private:
  bool are_labels_ = false;
  std::optional<sensor_msgs::Image> first_;
  Counters defects_;
  std::size_t images_ = 0;
};

class ImageTopicCheck : public MessageCheck<sensor_msgs::Image>, public ImageFormat {
 public:
  using MessageCheck::MessageCheck;

 protected:
  void look(const sensor_msgs::Image& msg) override { look_at(msg); }
  void add_to(TopicReport& report) const override { report_format(report); }
};

class CompressedImageTopicCheck : public MessageCheck<sensor_msgs::CompressedImage>, public ImageFormat {
 public:
  using MessageCheck::MessageCheck;

 protected:
  void look(const sensor_msgs::CompressedImage& msg) override;
  void add_to(TopicReport& report) const override { report_format(report); }
};

/// The cameras of a topic.
class CameraInfoTopicCheck : public MessageCheck<sensor_msgs::CameraInfo> {
 public:
  using MessageCheck::MessageCheck;

  const std::optional<sensor_msgs::CameraInfo>& first() const { return first_; }

 protected:
  void look(const sensor_msgs::CameraInfo& msg) override;
  void add_to(TopicReport& report) const override;

 private:
  std::optional<sensor_msgs::CameraInfo> first_;
};

/// Structure and times of the clouds of a topic.
class CloudTopicCheck : public MessageCheck<sensor_msgs::PointCloud2> {
 public:
  using MessageCheck::MessageCheck;

  /// Number of clouds that can be used.
  std::size_t good() const { return good_; }

 protected:
  void look(const sensor_msgs::PointCloud2& msg) override;
  void add_to(TopicReport& report) const override;

 private:
  Counters defects_;
  CloudTimeReader times_;
  std::size_t good_ = 0, with_times_ = 0;
  std::size_t rows_ = 0, columns_ = 0;  ///< of the first that can be used
  std::string fields_;
  double longest_s_ = 0.0;  ///< from the first point to the last
};

}  // namespace situation_awareness
