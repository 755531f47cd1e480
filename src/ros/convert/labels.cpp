// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/labels.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include <boost/endian/conversion.hpp>

#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

constexpr std::uint32_t kMaxEdge = 8192;
constexpr const char* kFloat = "32FC1";

/// Where red, green and blue are in a pixel of `bytes`.
struct ColorEncoding {
  const char* name;
  std::uint32_t bytes;
  std::uint32_t red, green, blue;
};
constexpr ColorEncoding kColorEncodings[] = {
    {"rgb8", 3, 0, 1, 2}, {"bgr8", 3, 2, 1, 0}, {"rgba8", 4, 0, 1, 2}, {"bgra8", 4, 2, 1, 0}, {"mono8", 1, 0, 0, 0}};

/// Null: another one.
const ColorEncoding* encoding_of(const sensor_msgs::Image& msg) {
  for (const ColorEncoding& encoding : kColorEncodings) {
    if (msg.encoding == encoding.name) return &encoding;
  }
  return nullptr;
}

std::string size_defect(const sensor_msgs::Image& msg, std::size_t bytes) {
  if (msg.width < 1 || msg.height < 1) return "image without pixels";
  if (msg.width > kMaxEdge || msg.height > kMaxEdge) return "image of more than 8192 pixels across";
  if (msg.step < msg.width * bytes || msg.data.size() < std::size_t{msg.step} * msg.height) {
    return "image with too little data";
  }
  return "";
}

}  // namespace

std::string labels_msg_defect(const sensor_msgs::Image& msg) {
  if (msg.encoding != kFloat) return "labels are not 32FC1";
  return size_defect(msg, sizeof(float));
}

std::string image_msg_defect(const sensor_msgs::Image& msg) {
  const ColorEncoding* const encoding = encoding_of(msg);
  if (encoding == nullptr) return "image is not rgb8, bgr8, rgba8, bgra8 or mono8";
  return size_defect(msg, encoding->bytes);
}

std::string camera_info_msg_defect(const sensor_msgs::CameraInfo& info, const sensor_msgs::Image& image) {
  if (info.width != image.width || info.height != image.height) return "camera_info of another size";
  for (const double number : {info.K[0], info.K[2], info.K[4], info.K[5]}) {
    if (!std::isfinite(number)) return "camera_info with a matrix that is not finite";
  }
  if (info.K[0] <= 0.0 || info.K[4] <= 0.0) return "camera_info without focal length";
  return "";
}

PinholeCamera camera_from_msg(const sensor_msgs::CameraInfo& info) {
  return {static_cast<int>(info.width), static_cast<int>(info.height), info.K[0], info.K[4], info.K[2], info.K[5]};
}

SoftLabels labels_from_msg(const sensor_msgs::Image& msg, const sensor_msgs::CameraInfo& info) {
  SoftLabels labels;
  labels.stamp_ns = to_nanoseconds(msg.header.stamp);
  labels.camera = camera_from_msg(info);
  labels.probability.reserve(std::size_t{msg.width} * msg.height);
  for (std::uint32_t row = 0; row < msg.height; ++row) {
    const std::uint8_t* const begin = &msg.data[std::size_t{row} * msg.step];
    for (std::uint32_t column = 0; column < msg.width; ++column) {
      std::uint32_t bits = 0;
      std::memcpy(&bits, begin + sizeof(float) * column, sizeof bits);
      if (msg.is_bigendian != 0) {
        boost::endian::big_to_native_inplace(bits);
      } else {
        boost::endian::little_to_native_inplace(bits);
      }
      float probability = 0.0F;
      std::memcpy(&probability, &bits, sizeof probability);
      labels.probability.push_back(probability);
    }
  }
  return labels;
}

ColorImage image_from_msg(const sensor_msgs::Image& msg, const sensor_msgs::CameraInfo& info) {
  const ColorEncoding& encoding = *encoding_of(msg);
  ColorImage image;
  image.stamp_ns = to_nanoseconds(msg.header.stamp);
  image.camera = camera_from_msg(info);
  image.rgb.reserve(3 * std::size_t{msg.width} * msg.height);
  for (std::uint32_t row = 0; row < msg.height; ++row) {
    const std::uint8_t* pixel = &msg.data[std::size_t{row} * msg.step];
    for (std::uint32_t column = 0; column < msg.width; ++column, pixel += encoding.bytes) {
      image.rgb.push_back(pixel[encoding.red]);
      image.rgb.push_back(pixel[encoding.green]);
      image.rgb.push_back(pixel[encoding.blue]);
    }
  }
  return image;
}

sensor_msgs::Image labels_to_msg(const SoftLabels& labels, const std::string& camera_frame) {
  sensor_msgs::Image msg;
  msg.header.stamp = to_ros_time(labels.stamp_ns);
  msg.header.frame_id = camera_frame;
  msg.width = static_cast<std::uint32_t>(labels.camera.width);
  msg.height = static_cast<std::uint32_t>(labels.camera.height);
  msg.encoding = kFloat;
  msg.step = static_cast<std::uint32_t>(sizeof(float)) * msg.width;
  msg.data.resize(sizeof(float) * labels.probability.size());
  std::memcpy(msg.data.data(), labels.probability.data(),
              msg.data.size());  // processors of ROS have the low byte first
  return msg;
}

sensor_msgs::CameraInfo camera_to_msg(const PinholeCamera& camera, std::int64_t stamp_ns,
                                      const std::string& camera_frame) {
  sensor_msgs::CameraInfo msg;
  msg.header.stamp = to_ros_time(stamp_ns);
  msg.header.frame_id = camera_frame;
  msg.width = static_cast<std::uint32_t>(camera.width);
  msg.height = static_cast<std::uint32_t>(camera.height);
  msg.distortion_model = "plumb_bob";
  msg.D.assign(5, 0.0);
  const double fx = camera.fx_px, fy = camera.fy_px, cx = camera.cx_px, cy = camera.cy_px;
  msg.K = {fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0};
  msg.R = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  msg.P = {fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0};
  return msg;
}

}  // namespace situation_awareness
