// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include <ros/message_traits.h>
#include <ros/time.h>
#include <rosbag/message_instance.h>
#include <boost/shared_ptr.hpp>

#include "situation_awareness/ros/check/report.hpp"
#include "situation_awareness/ros/check/stamp_statistics.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {

/// Looks at the messages of one topic of a recording.
class TopicCheck {
 public:
  explicit TopicCheck(std::string topic) : topic_(std::move(topic)) {}
  TopicCheck(const TopicCheck&) = delete;
  TopicCheck& operator=(const TopicCheck&) = delete;
  virtual ~TopicCheck() = default;

  virtual void add(const rosbag::MessageInstance& instance) = 0;
  virtual TopicReport report() const = 0;

  const std::string& topic() const { return topic_; }
  const StampStatistics& stamps() const { return stamps_; }
  /// Frame of the first message, as tf2 names it; empty if it has none.
  const std::string& frame() const { return frame_; }

 protected:
  StampStatistics stamps_;
  std::string frame_;
  std::set<std::string> other_frames_;

 private:
  std::string topic_;
};

/// Looks at the messages of a topic whose type has a header: their stamps and frames, and what a derived class adds.
template <class Message>
class MessageCheck : public TopicCheck {
 public:
  using TopicCheck::TopicCheck;

  void add(const rosbag::MessageInstance& instance) final {
    const boost::shared_ptr<const Message> msg = instance.instantiate<Message>();
    if (!msg) {
      ++of_another_version_;
      return;
    }
    stamps_.add(to_nanoseconds(msg->header.stamp), to_nanoseconds(instance.getTime()));
    const std::string frame = tf2_frame(msg->header.frame_id);
    if (stamps_.count() == 1) frame_ = frame;
    if (frame != frame_) other_frames_.insert(frame);
    look(*msg);
  }

  TopicReport report() const final {
    TopicReport report;
    report.topic = topic();
    report.type = ros::message_traits::datatype<Message>();
    stamps_.report(report);
    if (!report.facts.empty() && !frame_.empty()) report.facts.front() += ", frame " + frame_;
    if (of_another_version_ > 0) {
      report.findings.push_back({std::to_string(of_another_version_) + " messages are of another version of their type",
                                 "rosbag check names the rule that converts them (rosbag fix)"});
    }
    for (const std::string& other : other_frames_) {
      report.findings.push_back({"its frame is not always " + frame_ + " but also \"" + other + "\"",
                                 "let each sensor have a topic of its own"});
    }
    add_to(report);
    return report;
  }

 protected:
  virtual void look(const Message& msg) = 0;
  /// Appends what the messages have said.
  virtual void add_to(TopicReport& report) const = 0;

 private:
  std::size_t of_another_version_ = 0;
};

/// The check of a topic of this type; null for types of which no map can be made.
std::unique_ptr<TopicCheck> make_topic_check(const std::string& topic, const std::string& datatype);

}  // namespace situation_awareness
