// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/labels.hpp"

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include <boost/endian/conversion.hpp>

#include "situation_awareness/image/decoding.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

constexpr std::uint32_t kMaxEdge = 8192;
constexpr const char* kFloat = "32FC1";
constexpr const char* kUnreadable = "compressed image that cannot be read";

/// Where red, green and blue are in the numbers of a pixel, or how they are coded in them.
struct ColorEncoding {
  const char* name;
  std::uint32_t numbers;  ///< of a pixel
  std::uint32_t bytes;    ///< of a number
  std::uint32_t red, green, blue;
  std::optional<ColorCoding> coding = {};
};
// Names without an order of colours are OpenCV's, of which cv_bridge makes such messages.
constexpr ColorEncoding kColorEncodings[] = {
    {"rgb8", 3, 1, 0, 1, 2},
    {"bgr8", 3, 1, 2, 1, 0},
    {"rgba8", 4, 1, 0, 1, 2},
    {"bgra8", 4, 1, 2, 1, 0},
    {"mono8", 1, 1, 0, 0, 0},
    {"8UC1", 1, 1, 0, 0, 0},
    {"8UC3", 3, 1, 2, 1, 0},
    {"8UC4", 4, 1, 2, 1, 0},
    {"rgb16", 3, 2, 0, 1, 2},
    {"bgr16", 3, 2, 2, 1, 0},
    {"rgba16", 4, 2, 0, 1, 2},
    {"bgra16", 4, 2, 2, 1, 0},
    {"mono16", 1, 2, 0, 0, 0},
    {"bayer_rggb8", 1, 1, 0, 0, 0, ColorCoding::kBayerRggb},
    {"bayer_bggr8", 1, 1, 0, 0, 0, ColorCoding::kBayerBggr},
    {"bayer_gbrg8", 1, 1, 0, 0, 0, ColorCoding::kBayerGbrg},
    {"bayer_grbg8", 1, 1, 0, 0, 0, ColorCoding::kBayerGrbg},
    {"bayer_rggb16", 1, 2, 0, 0, 0, ColorCoding::kBayerRggb},
    {"bayer_bggr16", 1, 2, 0, 0, 0, ColorCoding::kBayerBggr},
    {"bayer_gbrg16", 1, 2, 0, 0, 0, ColorCoding::kBayerGbrg},
    {"bayer_grbg16", 1, 2, 0, 0, 0, ColorCoding::kBayerGrbg},
    {"yuv422", 2, 1, 0, 0, 0, ColorCoding::kUyvy},
    {"uyvy", 2, 1, 0, 0, 0, ColorCoding::kUyvy},
    {"yuv422_yuy2", 2, 1, 0, 0, 0, ColorCoding::kYuyv},
    {"yuyv", 2, 1, 0, 0, 0, ColorCoding::kYuyv},
};

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

/// The high bytes of the numbers of an image of two bytes each, rounded, without gaps between rows.
std::vector<std::uint8_t> in_8_bits(const sensor_msgs::Image& msg, std::uint32_t numbers) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(std::size_t{msg.width} * numbers * msg.height);
  for (std::uint32_t row = 0; row < msg.height; ++row) {
    const std::uint8_t* const begin = &msg.data[std::size_t{row} * msg.step];
    for (const std::uint8_t* at = begin; at < begin + std::size_t{2} * msg.width * numbers; at += 2) {
      const int number = msg.is_bigendian != 0 ? at[0] * 256 + at[1] : at[1] * 256 + at[0];
      bytes.push_back(static_cast<std::uint8_t>((number + 128) / 257));
    }
  }
  return bytes;
}

}  // namespace

std::string labels_msg_defect(const sensor_msgs::Image& msg) {
  if (msg.encoding == kNotDecoded) return kUnreadable;
  if (msg.encoding != kFloat) return "labels are not 32FC1";
  return size_defect(msg, sizeof(float));
}

std::string image_msg_defect(const sensor_msgs::Image& msg) {
  if (msg.encoding == kNotDecoded) return kUnreadable;
  const ColorEncoding* const encoding = encoding_of(msg);
  if (encoding == nullptr) return "image is not of rgb, bgr, mono, bayer or yuv422";
  std::string defect = size_defect(msg, encoding->numbers * encoding->bytes);
  if (!defect.empty() || !encoding->coding || is_size_of(*encoding->coding, msg.width, msg.height)) return defect;
  return "image of a size that its encoding does not have";
}

SoftLabels labels_from_msg(const sensor_msgs::Image& msg, const PinholeCamera& camera) {
  SoftLabels labels;
  labels.stamp_ns = to_nanoseconds(msg.header.stamp);
  labels.camera = camera;
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

SoftLabels labels_from_msg(const sensor_msgs::Image& msg, const sensor_msgs::CameraInfo& info) {
  return labels_from_msg(msg, camera_model(info, msg, ImageKind::kAuto).camera);
}

ColorImage image_from_msg(const sensor_msgs::Image& msg, const PinholeCamera& camera) {
  const ColorEncoding& encoding = *encoding_of(msg);
  ColorImage image;
  image.stamp_ns = to_nanoseconds(msg.header.stamp);
  image.camera = camera;
  const std::uint8_t* data = msg.data.data();
  std::size_t step = msg.step;
  std::vector<std::uint8_t> bytes;
  if (encoding.bytes == 2) {
    bytes = in_8_bits(msg, encoding.numbers);
    data = bytes.data();
    step = std::size_t{msg.width} * encoding.numbers;
  }
  if (encoding.coding) {
    image.rgb = rgb_of(data, static_cast<int>(msg.width), static_cast<int>(msg.height), step, *encoding.coding);
    return image;
  }
  image.rgb.reserve(3 * std::size_t{msg.width} * msg.height);
  for (std::uint32_t row = 0; row < msg.height; ++row) {
    const std::uint8_t* pixel = data + row * step;
    for (std::uint32_t column = 0; column < msg.width; ++column, pixel += encoding.numbers) {
      image.rgb.push_back(pixel[encoding.red]);
      image.rgb.push_back(pixel[encoding.green]);
      image.rgb.push_back(pixel[encoding.blue]);
    }
  }
  return image;
}

ColorImage image_from_msg(const sensor_msgs::Image& msg, const sensor_msgs::CameraInfo& info) {
  return image_from_msg(msg, camera_model(info, msg, ImageKind::kAuto).camera);
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
