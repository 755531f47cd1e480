// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include "situation_awareness/image/image.hpp"

namespace situation_awareness {

/// Reason why an image is not one of soft labels; empty if it is. The texts are fixed, for counters.
std::string labels_msg_defect(const sensor_msgs::Image& msg);

/// Reason why a camera cannot be used for an image; empty if it can. The texts are fixed, for counters.
std::string camera_info_msg_defect(const sensor_msgs::CameraInfo& info, const sensor_msgs::Image& image);

/// The camera of a message without defect: K of an image that is not distorted.
PinholeCamera camera_from_msg(const sensor_msgs::CameraInfo& info);

/// Labels of messages without defect; numbers out of [0, 1] are as they are there.
SoftLabels labels_from_msg(const sensor_msgs::Image& msg, const sensor_msgs::CameraInfo& info);

}  // namespace situation_awareness
