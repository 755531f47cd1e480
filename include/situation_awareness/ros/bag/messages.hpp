// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <boost/shared_ptr.hpp>

#include "situation_awareness/ros/convert/poses.hpp"

namespace situation_awareness {

/// Calls `look` with the messages of a topic in the bag, with or without its leading slash, while it returns true.
/// Throws as rosbag::Bag.
template <class Message, class Look>
void for_each_message(const std::string& bag_path, const std::string& topic, const Look& look) {
  rosbag::Bag bag(bag_path, rosbag::bagmode::Read);
  const std::string bare = tf2_frame(topic);
  for (const rosbag::MessageInstance& instance :
       rosbag::View(bag, rosbag::TopicQuery(std::vector<std::string>{bare, "/" + bare}))) {
    const boost::shared_ptr<const Message> msg = instance.instantiate<Message>();
    if (msg && !look(msg)) return;
  }
}

}  // namespace situation_awareness
