// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/check/topic_check.hpp"

#include "situation_awareness/ros/check/camera.hpp"
#include "situation_awareness/ros/check/motion.hpp"
#include "situation_awareness/ros/check/scans.hpp"

namespace situation_awareness {

std::unique_ptr<TopicCheck> make_topic_check(const std::string& topic, const std::string& datatype) {
  if (datatype == "sensor_msgs/LaserScan") return std::make_unique<ScanTopicCheck>(topic);
  if (datatype == "sensor_msgs/PointCloud2") return std::make_unique<CloudTopicCheck>(topic);
  if (datatype == "sensor_msgs/Image") return std::make_unique<ImageTopicCheck>(topic);
  if (datatype == "sensor_msgs/CompressedImage") return std::make_unique<CompressedImageTopicCheck>(topic);
  if (datatype == "sensor_msgs/CameraInfo") return std::make_unique<CameraInfoTopicCheck>(topic);
  if (datatype == "sensor_msgs/Imu") return std::make_unique<ImuTopicCheck>(topic);
  if (datatype == "sensor_msgs/NavSatFix") return std::make_unique<FixTopicCheck>(topic);
  if (datatype == "nav_msgs/Odometry") return std::make_unique<OdometryTopicCheck>(topic);
  return nullptr;
}

}  // namespace situation_awareness
