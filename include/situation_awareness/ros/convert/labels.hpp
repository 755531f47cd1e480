// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include "situation_awareness/image/image.hpp"
#include "situation_awareness/ros/convert/camera.hpp"

namespace situation_awareness {

/// Encoding of an image whose file cannot be read (ros/convert/compressed_image.hpp).
constexpr const char* kNotDecoded = "not decoded";

/// Reason why an image is not one of soft labels; empty if it is. The texts are fixed, for counters.
std::string labels_msg_defect(const sensor_msgs::Image& msg);

/// Reason why an image is not one of colours or greys; empty if it is. The texts are fixed, for counters.
std::string image_msg_defect(const sensor_msgs::Image& msg);

/// Labels of a message without defect; numbers out of [0, 1] are as they are there.
SoftLabels labels_from_msg(const sensor_msgs::Image& msg, const PinholeCamera& camera);
SoftLabels labels_from_msg(const sensor_msgs::Image& msg, const sensor_msgs::CameraInfo& info);

/// The image of a message without defect.
ColorImage image_from_msg(const sensor_msgs::Image& msg, const PinholeCamera& camera);
ColorImage image_from_msg(const sensor_msgs::Image& msg, const sensor_msgs::CameraInfo& info);

/// Labels as 32FC1, and their camera, whose D is 0 and whose R is the identity.
sensor_msgs::Image labels_to_msg(const SoftLabels& labels, const std::string& camera_frame);
sensor_msgs::CameraInfo camera_to_msg(const PinholeCamera& camera, std::int64_t stamp_ns,
                                      const std::string& camera_frame);

}  // namespace situation_awareness
