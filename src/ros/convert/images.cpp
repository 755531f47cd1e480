// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/images.hpp"

#include <cstddef>
#include <cstring>
#include <vector>

#include <sensor_msgs/image_encodings.h>

#include "situation_awareness/ros/convert/labels.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

/// An image without its data.
sensor_msgs::Image image_msg(int width, int height, const std::string& encoding, std::int64_t stamp_ns,
                             const std::string& camera_frame) {
  sensor_msgs::Image msg;
  msg.header.stamp = to_ros_time(stamp_ns);
  msg.header.frame_id = camera_frame;
  msg.width = static_cast<std::uint32_t>(width);
  msg.height = static_cast<std::uint32_t>(height);
  msg.encoding = encoding;
  const int bits =
      sensor_msgs::image_encodings::numChannels(encoding) * sensor_msgs::image_encodings::bitDepth(encoding);
  msg.step = static_cast<std::uint32_t>(bits / 8) * msg.width;
  return msg;
}

sensor_msgs::Image labels_to_msg(const std::vector<std::uint16_t>& labels, const LabelImage& image,
                                 const std::string& camera_frame) {
  sensor_msgs::Image msg =
      image_msg(image.width, image.height, sensor_msgs::image_encodings::MONO16, image.stamp_ns, camera_frame);
  msg.data.reserve(2 * labels.size());
  for (const std::uint16_t label : labels) {
    msg.data.push_back(static_cast<std::uint8_t>(label & 0xFFU));
    msg.data.push_back(static_cast<std::uint8_t>(label >> 8U));
  }
  return msg;
}

}  // namespace

sensor_msgs::CameraInfo camera_info_to_msg(int width, int height, double focal_length_px, std::int64_t stamp_ns,
                                           const std::string& camera_frame) {
  return camera_to_msg({width, height, focal_length_px, focal_length_px, 0.5 * (width - 1), 0.5 * (height - 1)},
                       stamp_ns, camera_frame);
}

sensor_msgs::Image picture_to_msg(const Picture& picture, std::int64_t stamp_ns, const std::string& camera_frame) {
  sensor_msgs::Image msg =
      image_msg(picture.width, picture.height, sensor_msgs::image_encodings::RGB8, stamp_ns, camera_frame);
  msg.data = picture.rgb;
  return msg;
}

sensor_msgs::Image objects_image_to_msg(const LabelImage& image, const std::string& camera_frame) {
  return labels_to_msg(image.objects, image, camera_frame);
}

sensor_msgs::Image classes_image_to_msg(const LabelImage& image, const std::string& camera_frame) {
  return labels_to_msg(image.classes, image, camera_frame);
}

sensor_msgs::Image soft_labels_to_msg(const LabelImage& image, const std::vector<bool>& is_class, int block_px,
                                      const std::string& camera_frame) {
  const int width = image.width / block_px, height = image.height / block_px;
  const int left = (image.width - width * block_px) / 2, top = (image.height - height * block_px) / 2;
  std::vector<float> shares(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0.0F);
  for (int v = 0; v < height * block_px; ++v) {
    for (int u = 0; u < width * block_px; ++u) {
      const auto pixel = static_cast<std::size_t>(v + top) * static_cast<std::size_t>(image.width) +
                         static_cast<std::size_t>(u + left);
      if (!is_class[image.classes[pixel]]) continue;
      const auto block = static_cast<std::size_t>(v / block_px) * static_cast<std::size_t>(width) +
                         static_cast<std::size_t>(u / block_px);
      shares[block] += 1.0F / static_cast<float>(block_px * block_px);
    }
  }
  sensor_msgs::Image msg =
      image_msg(width, height, sensor_msgs::image_encodings::TYPE_32FC1, image.stamp_ns, camera_frame);
  msg.data.resize(sizeof(float) * shares.size());
  std::memcpy(msg.data.data(), shares.data(), msg.data.size());  // processors of ROS have the low byte first
  return msg;
}

sensor_msgs::CameraInfo labels_info_to_msg(const LabelImage& image, int block_px, const std::string& camera_frame) {
  const int width = image.width / block_px, height = image.height / block_px;
  sensor_msgs::CameraInfo msg =
      camera_info_to_msg(width, height, image.focal_length_px / block_px, image.stamp_ns, camera_frame);
  // The optical axis passes through the image's centre, which is off that of the blocks where odd pixels are left out.
  const auto center_px = [block_px](int size, int blocks) {
    const int before = (size - blocks * block_px) / 2;
    return (0.5 * size - before) / block_px - 0.5;
  };
  msg.K[2] = msg.P[2] = center_px(image.width, width);
  msg.K[5] = msg.P[6] = center_px(image.height, height);
  return msg;
}

}  // namespace situation_awareness
