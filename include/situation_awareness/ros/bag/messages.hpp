// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <rosbag/message_instance.h>
#include <boost/shared_ptr.hpp>

#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/recording.hpp"
#include "situation_awareness/ros/convert/poses.hpp"

namespace situation_awareness {

/// Calls `look` with the messages of a topic in the recording, with or without its leading slash, while it returns
/// true. Throws as Recording.
template <class Message, class Look>
void for_each_message(const BagOptions& options, const std::string& topic, const Look& look) {
  const std::string bare = tf2_frame(topic);
  Recording(options.bags).read({bare, "/" + bare}, [&look](const rosbag::MessageInstance& instance) {
    const boost::shared_ptr<const Message> msg = instance.instantiate<Message>();
    return !msg || look(msg);
  });
}

}  // namespace situation_awareness
