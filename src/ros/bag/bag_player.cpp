// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/bag_player.hpp"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include <ros/exception.h>
#include <rosbag/exceptions.h>
#include <rosbag/view.h>

#include "situation_awareness/ros/bag/progress.hpp"
#include "situation_awareness/ros/convert/poses.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kAuthority = "bag";
constexpr std::size_t kMaxWaiting = 10000;  // ten seconds of the fastest scanner

/// Calls `act`; errors of the bag itself are thrown with its path.
template <class Act>
void reading(const std::string& path, const Act& act) {
  try {
    act();
  } catch (const rosbag::BagException& error) {
    throw std::runtime_error(path + ": damaged, or no bag: " + error.what());
  } catch (const ros::Exception& error) {  // a message that is shorter than its type
    throw std::runtime_error(path + ": damaged: " + error.what());
  }
}

/// "a, b, c"
template <class Texts>
std::string list(const Texts& texts) {
  std::string text;
  for (const std::string& item : texts) text += (text.empty() ? "" : ", ") + item;
  return text;
}

}  // namespace

BagPlayer::BagPlayer(const BagOptions& options, double reset_time_jump_s, double pose_offset_s)
    : options_(options),
      transforms_(transform_cache_time(options.tf_timeout_s)),
      queue_(transforms_,
             {tf2_frame(options.world_frame), options.tf_timeout_s, kMaxWaiting, reset_time_jump_s, pose_offset_s},
             [this](const char* reason, const std::string& /*detail*/) { drop(reason); }) {
  options_.world_frame = tf2_frame(options_.world_frame);
  if (!std::filesystem::is_regular_file(options_.bag)) throw std::runtime_error(options_.bag + ": no such bag");
  reading(options_.bag, [this] { bag_.open(options_.bag, rosbag::bagmode::Read); });
}

void BagPlayer::other_version(const std::string& topic) {
  throw std::runtime_error("topic " + topic + " holds another version of its message type");
}

/// The topic's name in the bag.
std::string BagPlayer::find_topic(const std::string& wanted, const std::string& datatype) {
  std::set<std::string> of_type;
  std::string other_type;
  const std::string bare = tf2_frame(wanted);
  rosbag::View view(bag_);
  for (const rosbag::ConnectionInfo* connection : view.getConnections()) {
    if (connection->datatype == datatype) {
      of_type.insert(connection->topic);
    } else if (tf2_frame(connection->topic) == bare) {
      other_type = connection->datatype;
    }
  }
  for (const std::string& topic : of_type) {
    if (tf2_frame(topic) == bare) return topic;
  }
  throw std::runtime_error(options_.bag + ": topic " + wanted +
                           (other_type.empty() ? " is not in the bag" : " is of type " + other_type) +
                           "; topics of type " + datatype + ": " + (of_type.empty() ? "none" : list(of_type)));
}

void BagPlayer::add_transforms(const tf2_msgs::TFMessage& msg, bool is_static) {
  if (options_.static_sensor) return;
  for (const geometry_msgs::TransformStamped& transform : msg.transforms) {
    if (added_.count(tf2_frame(transform.child_frame_id)) == 0) set_transform(transform, is_static);
  }
}

void BagPlayer::add_transform(geometry_msgs::TransformStamped transform) {
  added_.insert(tf2_frame(transform.child_frame_id));
  set_transform(std::move(transform), false);
}

void BagPlayer::set_transform(geometry_msgs::TransformStamped transform, bool is_static) {
  transform.header.frame_id = tf2_frame(transform.header.frame_id);
  transform.child_frame_id = tf2_frame(transform.child_frame_id);
  frames_.insert(transform.header.frame_id);
  frames_.insert(transform.child_frame_id);
  transforms_.setTransform(transform, kAuthority, is_static);
}

void BagPlayer::use_when_posed(const Taken& taken, const ros::Time& recorded, Use use) {
  if (options_.static_sensor && sensor_frame_ != taken.frame) {
    transforms_.setTransform(transform_to_msg(Eigen::Isometry3d::Identity(), 0, options_.world_frame, taken.frame),
                             kAuthority, true);
  }
  sensor_frame_ = taken.frame;
  queue_.add(std::move(use), taken, to_nanoseconds(recorded));
}

void BagPlayer::play() {
  const auto start = std::chrono::steady_clock::now();
  reading(options_.bag, [this] { play_all(); });
  wall_s_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  check_used();
}

void BagPlayer::play_all() {
  for (const rosbag::MessageInstance& instance :
       rosbag::View(bag_, rosbag::TopicQuery(std::vector<std::string>{"/tf_static", "tf_static"}))) {
    add_transforms(*read<tf2_msgs::TFMessage>(instance), true);
  }
  for (const char* tf : {"/tf", "tf"}) {
    subscriptions_[tf] = [this](const auto& instance) { add_transforms(*read<tf2_msgs::TFMessage>(instance), false); };
  }
  std::vector<std::string> topics;
  for (const auto& [topic, take] : subscriptions_) topics.push_back(topic);
  rosbag::View measured(bag_, rosbag::TopicQuery(measured_topic_));
  if (measured.size() > 0) recorded_s_ = (measured.getEndTime() - measured.getBeginTime()).toSec();
  Progress progress(measured.size(), noun_);
  for (const rosbag::MessageInstance& instance : rosbag::View(bag_, rosbag::TopicQuery(topics))) {
    subscriptions_.at(instance.getTopic())(instance);
    release(to_nanoseconds(instance.getTime()));
    progress.at(measurements_);
  }
  release(kEndOfTime_ns);
}

void BagPlayer::release(std::int64_t now_ns) {
  if (now_ns != kEndOfTime_ns) queue_.receive(now_ns, now_ns);
  while (const auto ready = queue_.next(now_ns)) {
    if (ready->begins_anew) restart_();
    const std::string reason = ready->item(ready->T_world_sensor, ready->T_world_sensor_end);
    if (reason.empty()) {
      ++used_;
    } else {
      drop(reason);
    }
  }
}

void BagPlayer::check_used() const {
  if (used_ > 0) return;
  std::string sentence = options_.bag + ": nothing mapped of " + std::to_string(measurements_) + " " + noun_;
  for (const auto& [reason, count] : dropped_) {
    sentence += ", " + std::to_string(count) + " dropped: " + reason;
    if (reason == drop_reason::kNoTransform) sentence += " from " + options_.world_frame + " to " + sensor_frame_;
  }
  if (dropped_.of(drop_reason::kNoTransform) > 0) {
    sentence += frames_.empty() ? "; the bag has no transforms: use --static-sensor"
                                : "; the bag has the frames " + list(frames_);
  }
  throw std::runtime_error(sentence);
}

void BagPlayer::print_summary() const {
  std::printf("%zu %s, %zu mapped", measurements_, noun_.c_str(), used_);
  for (const auto& [reason, count] : dropped_) {
    std::printf(", %llu dropped: %s", static_cast<unsigned long long>(count), reason.c_str());
  }
  std::printf("\n");
  if (!durations_ms_.empty()) {
    std::vector<double> sorted = durations_ms_;
    std::sort(sorted.begin(), sorted.end());
    const auto quantile = [&sorted](double part) {
      return sorted[static_cast<std::size_t>(part * static_cast<double>(sorted.size() - 1) + 0.5)];
    };
    std::printf("each: p50 %.3f ms, p99 %.3f ms, max %.3f ms\n", quantile(0.5), quantile(0.99), quantile(1.0));
  }
  std::printf("%.1f s of %s in %.1f s: %.0f times real time\n", recorded_s_, noun_.c_str(), wall_s_,
              recorded_s_ / std::max(wall_s_, 1e-9));
}

}  // namespace situation_awareness
