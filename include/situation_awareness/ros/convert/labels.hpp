// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include "situation_awareness/image/image.hpp"

namespace situation_awareness {

/// Reason why an image is not one of soft labels with this camera, or the camera cannot be used; empty if all is well.
/// The texts are fixed, for counters.
std::string labels_msg_defect(const sensor_msgs::Image& msg, const sensor_msgs::CameraInfo& info);

/// The camera of a message without defect: K of an image that is not distorted.
PinholeCamera camera_from_msg(const sensor_msgs::CameraInfo& info);

/// Labels of messages without defect; numbers out of [0, 1] are as they are there.
SoftLabels labels_from_msg(const sensor_msgs::Image& msg, const sensor_msgs::CameraInfo& info);

}  // namespace situation_awareness
