// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include <sensor_msgs/PointCloud2.h>

#include "situation_awareness/cloud/cloud.hpp"
#include "situation_awareness/ros/transform_queue.hpp"
#include "situation_awareness/scan/cloud_slice.hpp"
#include "situation_awareness/scan/cloud_times.hpp"

namespace situation_awareness {

/// The format of drivers of 3D LIDARs: fields x, y, z, intensity (float32), ring (uint16) and time (float32, s after
/// the stamp), height and width being the cloud's rows and columns. Points without a return have NaN in x, y, z.
sensor_msgs::PointCloud2 cloud_to_msg(const Cloud& cloud, const std::string& sensor_frame);

/// Why a cloud from a driver or a bag cannot be used: empty text if it can. The texts are fixed, so they can be
/// counted.
std::string cloud_msg_defect(const sensor_msgs::PointCloud2& msg);

/// What a cloud without a defect says of the times of its points.
struct CloudMsgTimes {
  bool has_field = false;               ///< of times, by its name: time, t, timestamp, or another of "time"
  std::optional<CloudTimeScale> scale;  ///< none without a field, and where it cannot be one of times

  CloudTimes times() const;  ///< of the cloud that is made of the message
};

/// `reader`: of the clouds of one sensor, in order.
CloudMsgTimes cloud_msg_times(const sensor_msgs::PointCloud2& msg, CloudTimeReader& reader);

/// By the times of its points, or its stamp alone.
Taken taken(const sensor_msgs::PointCloud2& msg, const CloudMsgTimes& times, bool deskew);
Taken taken(const sensor_msgs::PointCloud2& msg, bool deskew);  // as the first of its sensor

/// A cloud without a defect, structured where the message is. Times that are none are NaN, without a field all are 0;
/// intensities that are not float32 are left out.
Cloud cloud_from_msg(const sensor_msgs::PointCloud2& msg, const CloudMsgTimes& times);
Cloud cloud_from_msg(const sensor_msgs::PointCloud2& msg);  // as the first of its sensor

}  // namespace situation_awareness
