// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <sensor_msgs/PointCloud2.h>

#include "situation_awareness/cloud/cloud.hpp"

namespace situation_awareness {

/// The format of drivers of 3D LIDARs: fields x, y, z, intensity (float32), ring (uint16) and time (float32, s after
/// the stamp), height and width being the cloud's rows and columns. Points without a return have NaN in x, y, z.
sensor_msgs::PointCloud2 cloud_to_msg(const Cloud& cloud, const std::string& sensor_frame);

}  // namespace situation_awareness
