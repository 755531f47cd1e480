// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

namespace situation_awareness {

/// What image_transport adds to the topic of an image.
constexpr const char* kCompressedTransport = "/compressed";

/// Whether the topic is named as image_transport names compressed images.
bool is_compressed(const std::string& topic);

/// The topic's name without that.
std::string without_transport(const std::string& topic);

/// The image that was compressed. Where it cannot be read its encoding is kNotDecoded, and it has no pixels.
sensor_msgs::ImagePtr decompressed(const sensor_msgs::CompressedImage& msg);

}  // namespace situation_awareness
