// SPDX-License-Identifier: BSD-3-Clause
// map -> obstacles, for subscribers of obstacle_detector/Obstacles
#include <ros/ros.h>

#include "situation_awareness/ros/bridges/obstacle_detector.hpp"

int main(int argc, char** argv) {
  using namespace situation_awareness;
  ros::init(argc, argv, "obstacle_detector_bridge");
  ros::NodeHandle node;
  const ros::Publisher obstacles = node.advertise<obstacle_detector::Obstacles>("obstacles", 5);
  const ros::Subscriber map = node.subscribe<MappedObjectArray>(
      "objects", 1, [&](const MappedObjectArrayConstPtr& msg) { obstacles.publish(circles_from_map(*msg)); });
  ros::spin();
  return 0;
}
