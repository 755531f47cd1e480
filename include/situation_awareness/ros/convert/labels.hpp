// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include "situation_awareness/image/image.hpp"

namespace situation_awareness {

/// Reason why an image is not one of soft labels; empty if it is. The texts are fixed, for counters.
std::string labels_msg_defect(const sensor_msgs::Image& msg);

/// Reason why an image is not one of colours or greys of 8 bits; empty if it is. The texts are fixed, for counters.
std::string image_msg_defect(const sensor_msgs::Image& msg);

/// Reason why a camera cannot be used for an image; empty if it can. The texts are fixed, for counters.
std::string camera_info_msg_defect(const sensor_msgs::CameraInfo& info, const sensor_msgs::Image& image);

/// The camera of a message without defect: K of an image that is not distorted.
PinholeCamera camera_from_msg(const sensor_msgs::CameraInfo& info);

/// Labels of messages without defect; numbers out of [0, 1] are as they are there.
SoftLabels labels_from_msg(const sensor_msgs::Image& msg, const sensor_msgs::CameraInfo& info);

/// The image of messages without defect: of rgb8, bgr8, rgba8, bgra8 or mono8.
ColorImage image_from_msg(const sensor_msgs::Image& msg, const sensor_msgs::CameraInfo& info);

/// Labels as 32FC1, and their camera, whose D is 0 and whose R is the identity.
sensor_msgs::Image labels_to_msg(const SoftLabels& labels, const std::string& camera_frame);
sensor_msgs::CameraInfo camera_to_msg(const PinholeCamera& camera, std::int64_t stamp_ns,
                                      const std::string& camera_frame);

}  // namespace situation_awareness
