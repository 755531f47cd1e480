// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <boost/shared_ptr.hpp>

#include "situation_awareness/ros/convert/poses.hpp"

namespace situation_awareness {

/// The first message of a topic in the bag, with or without its leading slash; null where there is none. Throws as
/// rosbag::Bag.
template <class Message>
boost::shared_ptr<Message> first_message(const std::string& bag_path, const std::string& topic) {
  rosbag::Bag bag(bag_path, rosbag::bagmode::Read);
  const std::string bare = tf2_frame(topic);
  for (const rosbag::MessageInstance& instance :
       rosbag::View(bag, rosbag::TopicQuery(std::vector<std::string>{bare, "/" + bare}))) {
    if (const auto msg = instance.instantiate<Message>()) return msg;
  }
  return nullptr;
}

}  // namespace situation_awareness
