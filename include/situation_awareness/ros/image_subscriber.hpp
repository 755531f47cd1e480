// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>

#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <ros/time.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

#include "situation_awareness/ros/convert/compressed_image.hpp"
#include "situation_awareness/ros/timed_subscriber.hpp"

namespace situation_awareness {

/// A TimedSubscriber of images that may be compressed: a topic that ends in /compressed, after it is resolved, has
/// sensor_msgs/CompressedImage.
class ImageSubscriber {
 public:
  using Take = std::function<void(const sensor_msgs::ImageConstPtr&, const ros::SteadyTime&)>;

  /// As that of TimedSubscriber.
  ImageSubscriber(ros::NodeHandle& node, const std::string& topic, Take take) {
    if (is_compressed(node.resolveName(topic))) {
      compressed_.emplace(node, topic, [take = std::move(take)](const auto& msg, const ros::SteadyTime& arrival) {
        take(decompressed(*msg), arrival);
      });
    } else {
      images_.emplace(node, topic, std::move(take));
    }
  }

  const ros::Subscriber& subscriber() const { return images_ ? images_->subscriber() : compressed_->subscriber(); }

 private:
  std::optional<TimedSubscriber<sensor_msgs::Image>> images_;
  std::optional<TimedSubscriber<sensor_msgs::CompressedImage>> compressed_;
};

}  // namespace situation_awareness
