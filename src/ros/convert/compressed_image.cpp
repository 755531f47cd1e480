// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/compressed_image.hpp"

#include <cstdint>
#include <cstring>
#include <utility>

#include <boost/endian/conversion.hpp>
#include <boost/make_shared.hpp>

#include "situation_awareness/image/decoding.hpp"
#include "situation_awareness/ros/convert/labels.hpp"

namespace situation_awareness {
namespace {

/// `format`: the encoding that was compressed, and ";" with how; or how alone. Other than colours, a pattern of them
/// is compressed as it is.
std::string encoding_of(const DecodedImage& image, const std::string& format) {
  const std::string bits = image.bytes == 1 ? "8" : "16";
  if (image.bytes == 4) return image.channels == 1 ? "32FC1" : kNotDecoded;
  if (image.channels == 3) return "bgr" + bits;
  if (image.channels == 4) return "bgra" + bits;
  const std::string before = format.substr(0, format.find(';'));
  const bool is_bayer = before.rfind("bayer_", 0) == 0 && before.size() > bits.size() &&
                        before.compare(before.size() - bits.size(), bits.size(), bits) == 0;
  return is_bayer ? before : "mono" + bits;
}

}  // namespace

bool is_compressed(const std::string& topic) {
  const std::size_t end = std::strlen(kCompressedTransport);
  return topic.size() > end && topic.compare(topic.size() - end, end, kCompressedTransport) == 0;
}

std::string without_transport(const std::string& topic) {
  return is_compressed(topic) ? topic.substr(0, topic.size() - std::strlen(kCompressedTransport)) : topic;
}

sensor_msgs::ImagePtr decompressed(const sensor_msgs::CompressedImage& msg) {
  const auto image = boost::make_shared<sensor_msgs::Image>();
  image->header = msg.header;
  DecodedImage decoded = decode_image(msg.data);
  image->encoding = decoded.data.empty() ? kNotDecoded : encoding_of(decoded, msg.format);
  if (image->encoding == kNotDecoded) return image;
  image->width = static_cast<std::uint32_t>(decoded.width);
  image->height = static_cast<std::uint32_t>(decoded.height);
  image->step = image->width * static_cast<std::uint32_t>(decoded.channels * decoded.bytes);
  image->is_bigendian = boost::endian::order::native == boost::endian::order::big ? 1 : 0;
  image->data = std::move(decoded.data);
  return image;
}

}  // namespace situation_awareness
