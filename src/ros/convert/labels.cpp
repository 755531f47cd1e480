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

}  // namespace

std::string labels_msg_defect(const sensor_msgs::Image& msg) {
  if (msg.encoding != kFloat) return "labels are not 32FC1";
  if (msg.width < 1 || msg.height < 1) return "image without pixels";
  if (msg.width > kMaxEdge || msg.height > kMaxEdge) return "image of more than 8192 pixels across";
  if (msg.step < msg.width * sizeof(float) || msg.data.size() < std::size_t{msg.step} * msg.height) {
    return "image with too little data";
  }
  return "";
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

}  // namespace situation_awareness
