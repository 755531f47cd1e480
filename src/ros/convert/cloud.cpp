// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/cloud.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include <sensor_msgs/point_cloud2_iterator.h>

#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {

sensor_msgs::PointCloud2 cloud_to_msg(const Cloud& cloud, const std::string& sensor_frame) {
  using sensor_msgs::PointField;
  sensor_msgs::PointCloud2 msg;
  msg.header.stamp = to_ros_time(cloud.stamp_ns);
  msg.header.frame_id = sensor_frame;
  sensor_msgs::PointCloud2Modifier modifier(msg);
  modifier.setPointCloud2Fields(6, "x", 1, PointField::FLOAT32, "y", 1, PointField::FLOAT32, "z", 1,
                                PointField::FLOAT32, "intensity", 1, PointField::FLOAT32, "ring", 1, PointField::UINT16,
                                "time", 1, PointField::FLOAT32);
  modifier.resize(cloud.points.size());
  msg.height = static_cast<std::uint32_t>(cloud.rows);
  msg.width = static_cast<std::uint32_t>(cloud.columns);
  msg.row_step = msg.width * msg.point_step;
  msg.is_dense = std::none_of(cloud.points.begin(), cloud.points.end(),
                              [](const CloudPoint& point) { return std::isnan(point.x_m); });

  // The fields are packed as by drivers, so most floats are unaligned and must not be bound to references.
  std::uint8_t* to = msg.data.data();
  const auto put = [&to](auto value) {
    std::memcpy(to, &value, sizeof value);
    to += sizeof value;
  };
  for (const CloudPoint& point : cloud.points) {
    put(point.x_m);
    put(point.y_m);
    put(point.z_m);
    put(point.intensity);
    put(point.ring);
    put(point.time_s);
  }
  return msg;
}

}  // namespace situation_awareness
