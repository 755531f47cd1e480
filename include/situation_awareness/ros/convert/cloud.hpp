// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include <sensor_msgs/PointCloud2.h>

#include "situation_awareness/cloud/cloud.hpp"
#include "situation_awareness/ros/transform_queue.hpp"
#include "situation_awareness/scan/cloud_slice.hpp"

namespace situation_awareness {

/// The format of drivers of 3D LIDARs: fields x, y, z, intensity (float32), ring (uint16) and time (float32, s after
/// the stamp), height and width being the cloud's rows and columns. Points without a return have NaN in x, y, z.
sensor_msgs::PointCloud2 cloud_to_msg(const Cloud& cloud, const std::string& sensor_frame);

/// Why a cloud from a driver or a bag cannot be used: empty text if it can. The texts are fixed, so they can be
/// counted.
std::string cloud_msg_defect(const sensor_msgs::PointCloud2& msg);

/// When the first and the last point of a cloud without a defect were taken, after its stamp. From the first of the
/// fields that drivers have for it: time, t, timestamp, offset_time; whole numbers are ns after the stamp, others s
/// after it or, where that cannot be, s or ns of the clock. Both 0 without such a field; none where what it says cannot
/// be: not finite, or more than a second from the stamp.
std::optional<CloudTimes> cloud_msg_times(const sensor_msgs::PointCloud2& msg);

/// By the times of its points, or its stamp alone.
Taken taken(const sensor_msgs::PointCloud2& msg, bool deskew);

/// A cloud without a defect, structured where the message is. Times are taken as they are, also those that times_of
/// refuses; intensities that are not float32 are left out.
Cloud cloud_from_msg(const sensor_msgs::PointCloud2& msg);

}  // namespace situation_awareness
