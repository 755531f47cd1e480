// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/bag_player.hpp"

#include <algorithm>
#include <cstdio>
#include <stdexcept>
#include <utility>

#include <tf2/exceptions.h>

#include "situation_awareness/ros/bag/progress.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/scan_check.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kAuthority = "bag";
// Frames of the poses that are given, whatever they are called in the bag.
constexpr const char* kWorld = "world";
constexpr const char* kBase = "base";
constexpr const char* kSensor = "sensor";
constexpr std::size_t kMaxWaiting = 10000;  // ten seconds of the fastest scanner

/// "a, b, c"
template <class Texts>
std::string list(const Texts& texts) {
  std::string text;
  for (const std::string& item : texts) text += (text.empty() ? "" : ", ") + item;
  return text;
}

}  // namespace

BagPlayer::BagPlayer(const BagOptions& options, const Poses& poses)
    : options_(options),
      recording_(options.bags),
      source_({tf2_frame(poses.base_frame), poses.are_given, poses.are_given ? 0.0 : poses.scan_offset_s}),
      tf_(transform_cache_time(options.tf_timeout_s)),
      given_(transform_cache_time(options.tf_timeout_s)) {
  options_.world_frame = tf2_frame(options_.world_frame);
  make_queue("", 0.0);  // throws where the options are none of a queue
  if (poses.scan_offset_s == source_.scan_offset_s) return;
  on_summary([] { return std::vector<std::string>{"scan_pose_offset_s is not used: it is for poses by TF"}; });
}

void BagPlayer::other_version(const std::string& topic) {
  throw std::runtime_error("topic " + topic + " holds another version of its message type");
}

/// The topic's name in the bag.
std::string BagPlayer::find_topic(const std::string& wanted, const std::string& datatype) const {
  std::set<std::string> of_type;
  std::string other_type;
  const std::string bare = tf2_frame(wanted);
  for (const auto& [topic, type] : recording_.topics()) {
    if (type == datatype) {
      of_type.insert(topic);
    } else if (tf2_frame(topic) == bare) {
      other_type = type;
    }
  }
  for (const std::string& topic : of_type) {
    if (tf2_frame(topic) == bare) return topic;
  }
  throw std::runtime_error(recording_name(options_.bags) + ": topic " + wanted +
                           (other_type.empty() ? " is not in the bag" : " is of type " + other_type) +
                           "; topics of type " + datatype + ": " + (of_type.empty() ? "none" : list(of_type)));
}

void BagPlayer::add_transforms(const tf2_msgs::TFMessage& msg, bool is_static) {
  if (options_.static_sensor) return;
  for (geometry_msgs::TransformStamped transform : msg.transforms) {
    transform.header.frame_id = tf2_frame(transform.header.frame_id);
    transform.child_frame_id = tf2_frame(transform.child_frame_id);
    frames_.insert(transform.header.frame_id);
    frames_.insert(transform.child_frame_id);
    tf_.setTransform(transform, kAuthority, is_static);
  }
}

void BagPlayer::add_pose(geometry_msgs::TransformStamped T_world_base) {
  if (first_pose_.isZero()) first_pose_ = T_world_base.header.stamp;
  last_pose_ = T_world_base.header.stamp;
  T_world_base.header.frame_id = kWorld;
  T_world_base.child_frame_id = kBase;
  given_.setTransform(T_world_base, kAuthority, false);
}

void BagPlayer::forget_poses() {
  given_.clear();  // what is later would block them
  is_mounted_ = false;
}

Eigen::Isometry3d BagPlayer::T_world_base_at(std::int64_t stamp_ns) const {
  const ros::Time stamp = to_ros_time(stamp_ns);
  return source_.are_given ? transform_at(given_, kWorld, kBase, stamp)
                           : transform_at(tf_, options_.world_frame, source_.base_frame, stamp);
}

Eigen::Isometry3d BagPlayer::T_world_base_of_scan(std::int64_t stamp_ns) const {
  return T_world_base_at(stamp_ns + nanoseconds(source_.scan_offset_s));
}

/// Where the sensor is on the base, as TF knows it now.
void BagPlayer::mount() {
  why_not_mounted_ = situation_awareness::mount(tf_, source_.base_frame, sensor_frame_, given_, kBase, kSensor);
  is_mounted_ = why_not_mounted_.empty();
}

void BagPlayer::use_when_posed(const Taken& taken, const ros::Time& recorded, Use use, double pose_offset_s) {
  if (options_.static_sensor && sensor_frame_ != taken.frame) {
    tf_.setTransform(transform_to_msg(Eigen::Isometry3d::Identity(), 0, options_.world_frame, taken.frame), kAuthority,
                     true);
  }
  sensor_frame_ = taken.frame;
  if (!source_.are_given) {
    queue_of(taken.frame, pose_offset_s).add(std::move(use), taken, to_nanoseconds(recorded));
    return;
  }
  queue_of(kSensor, pose_offset_s).add(std::move(use), {kSensor, taken.first, taken.last}, to_nanoseconds(recorded));
  mount();  // it may have changed
}

void BagPlayer::dropped(const std::string& reason, const std::string& detail) {
  drop(reason);
  if (reason != drop_reason::kNoTransform) return;
  if (!source_.are_given) {
    why_no_transform_ = detail;
  } else if (!is_mounted_) {
    why_no_transform_ = why_not_mounted_;
  } else if (first_pose_.isZero()) {
    why_no_transform_ = "of " + source_.base_frame + ": it has no pose";
  } else {
    char text[96];
    std::snprintf(text, sizeof text, ": its poses are from %.3f to %.3f s", first_pose_.toSec(), last_pose_.toSec());
    why_no_transform_ = "of " + source_.base_frame + text;
  }
}

void BagPlayer::play() {
  const auto start = std::chrono::steady_clock::now();
  play_all();
  wall_s_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void BagPlayer::play_all() {
  const std::string tf = tf2_frame(options_.tf_topic), tf_static = static_topic_of(tf);
  recording_.read({"/" + tf_static, tf_static}, [this](const rosbag::MessageInstance& instance) {
    add_transforms(*read<tf2_msgs::TFMessage>(instance), true);
    return true;
  });
  for (const std::string& topic : {"/" + tf, tf}) {
    subscriptions_[topic] = [this](const auto& instance) {
      add_transforms(*read<tf2_msgs::TFMessage>(instance), false);
    };
  }
  std::vector<std::string> topics;
  for (const auto& [topic, take] : subscriptions_) topics.push_back(topic);
  const Recording::Extent measured = recording_.extent_of(measured_topic_);
  recorded_s_ = measured.duration_s;
  Progress progress(measured.messages, noun_);
  recording_.read(topics, [this, &progress](const rosbag::MessageInstance& instance) {
    subscriptions_.at(instance.getTopic())(instance);
    release(to_nanoseconds(instance.getTime()));
    progress.at(measurements_);
    return true;
  });
  release(kEndOfTime_ns);
}

std::unique_ptr<BagPlayer::SensorQueue> BagPlayer::make_queue(const std::string& frame, double pose_offset_s) {
  const TransformQueueParams params{source_.are_given ? kWorld : options_.world_frame, options_.tf_timeout_s,
                                    kMaxWaiting, pose_offset_s, source_.are_given ? "" : source_.base_frame};
  const auto on_drop = [this](const char* reason, const std::string& detail) { dropped(reason, detail); };
  return std::make_unique<SensorQueue>(
      SensorQueue{frame, TransformQueue<Use>(source_.are_given ? given_ : tf_, params, on_drop)});
}

TransformQueue<BagPlayer::Use>& BagPlayer::queue_of(const std::string& frame, double pose_offset_s) {
  for (const auto& of : queues_) {
    if (of->frame == frame) return of->queue;
  }
  queues_.push_back(make_queue(frame, pose_offset_s));
  return queues_.back()->queue;
}

void BagPlayer::release(std::int64_t now_ns) {
  if (source_.are_given && !is_mounted_ && !sensor_frame_.empty()) mount();
  for (const auto& of : queues_) release(*of, now_ns);
}

void BagPlayer::release(SensorQueue& of, std::int64_t now_ns) {
  if (now_ns != kEndOfTime_ns) of.queue.receive(now_ns, now_ns);
  while (const auto ready = of.queue.next(now_ns)) {
    // The first sensor of which a measurement is used after a restart tells it for all.
    if (ready->begins_anew && ++of.restarts > restarts_) {
      restarts_ = of.restarts;
      restart_();
    }
    try {
      const std::string reason = ready->item(ready->T_world_sensor, ready->T_world_sensor_end);
      if (reason.empty()) {
        ++used_;
      } else {
        drop(reason);
      }
    } catch (const tf2::TransformException& error) {  // of this measurement alone
      dropped(drop_reason::kNoTransform, error.what());
    }
  }
}

/// What may help where there are no transforms.
std::string BagPlayer::transforms_hint() const {
  std::set<std::string> others = recording_.transform_topics();
  others.erase("/" + tf2_frame(options_.tf_topic));
  const std::string others_hint =
      others.empty() ? "" : "; it has others on " + list(others) + ": --tf-topic reads them";
  if (!frames_.empty()) return "; the bag has the frames " + list(frames_) + others_hint;
  const std::string none = "; the bag has no transforms on " + options_.tf_topic;
  if (!others.empty() || source_.are_given) return none + others_hint;
  return none + ": use --static-sensor if the sensor stands still";
}

void BagPlayer::check_mapped(const std::string& why_not) const {
  if (used_ > 0 && why_not.empty()) return;
  std::string sentence =
      recording_name(options_.bags) + ": nothing mapped of " + std::to_string(measurements_) + " " + noun_;
  if (!why_not.empty()) throw std::runtime_error(sentence + ": " + why_not);
  for (const auto& [reason, count] : dropped_) {
    sentence += ", " + std::to_string(count) + " dropped: " + reason;
    if (reason == drop_reason::kNoTransform) sentence += " " + why_no_transform_;
  }
  if (dropped_.of(drop_reason::kNoTransform) > 0) sentence += transforms_hint();
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
  for (const std::string& sentence : warnings()) {
    std::fprintf(stderr, "%s: warning: %s\n", recording_name(options_.bags).c_str(), sentence.c_str());
  }
}

std::vector<std::string> BagPlayer::warnings() const {
  std::vector<std::string> sentences;
  for (const auto& some : warnings_) {
    for (std::string& sentence : some()) sentences.push_back(std::move(sentence));
  }
  return sentences;
}

}  // namespace situation_awareness
