// SPDX-License-Identifier: BSD-3-Clause
// map -> obstacles, for subscribers of costmap_converter/ObstacleArrayMsg
#include <ros/ros.h>

#include "situation_awareness/ros/bridges/costmap_converter.hpp"

int main(int argc, char** argv) {
  using namespace situation_awareness;
  ros::init(argc, argv, "costmap_converter_bridge");
  ros::NodeHandle node;
  const ros::Publisher obstacles = node.advertise<costmap_converter::ObstacleArrayMsg>("obstacles", 5);
  const ros::Subscriber map = node.subscribe<MappedObjectArray>(
      "objects", 1, [&](const MappedObjectArrayConstPtr& msg) { obstacles.publish(obstacle_array_from_map(*msg)); });
  ros::spin();
  return 0;
}
