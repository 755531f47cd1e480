// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <rosbag/bag.h>
#include <rosbag/exceptions.h>
#include <rosbag/message_instance.h>

namespace situation_awareness {

/// The name of a recording of these bags, for sentences: "a_0.bag", "a_0.bag and 2 more".
std::string recording_name(const std::vector<std::string>& bags);

/// The topic of static transforms beside that of the others: "/tf_static" of "/tf".
std::string static_topic_of(const std::string& tf_topic);

/// One recording of ROS 1: its bag, or the bags that it was split into, whose messages come in the order of their
/// times.
class Recording {
 public:
  /// Opens the bags. Throws std::runtime_error naming the file, what it is instead (no bag, cut short, a recording of
  /// ROS 2), and what makes a bag of it.
  explicit Recording(const std::vector<std::string>& paths);

  /// (topic, type) of each connection.
  std::set<std::pair<std::string, std::string>> topics() const;

  /// The topics of transforms, "/tf" or "/robot1/tf"; those of static ones are not listed beside them
  /// (static_topic_of).
  std::set<std::string> transform_topics() const;

  /// Number of the messages of a topic, and the time from the first to the last.
  struct Extent {
    std::size_t messages = 0;
    double duration_s = 0.0;
  };
  Extent extent_of(const std::string& topic) const;

  /// Calls `look` with the messages of these topics while it returns true. Throws std::runtime_error where they are
  /// damaged, or compressed in a way that ROS 1 does not read, and what `look` throws.
  void read(const std::vector<std::string>& topics,
            const std::function<bool(const rosbag::MessageInstance& instance)>& look) const;

 private:
  std::string defect_of(const rosbag::BagException& error) const;

  std::vector<std::string> paths_;
  std::deque<rosbag::Bag> bags_;
};

}  // namespace situation_awareness
