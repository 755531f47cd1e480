// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/pose_covariance_input.hpp"

#include <cmath>
#include <exception>
#include <utility>

#include <boost/make_shared.hpp>

#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/scan_check.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kNoCovariance = "no covariance of the pose";
constexpr std::size_t kMaps = 20;  // that are remembered for segments that come later

template <class Message>
bool is_published(const std::optional<TimedSubscriber<Message>>& subscriber) {
  return subscriber && subscriber->subscriber().getNumPublishers() > 0;
}

}  // namespace

BasePose base_pose_from_msg(const geometry_msgs::PoseWithCovarianceStamped& msg) {
  BasePose pose;
  pose.translation_world_m = {msg.pose.pose.position.x, msg.pose.pose.position.y};
  pose.covariance_world = planar_covariance(msg.pose);
  return pose;
}

Eigen::Matrix3d covariance_at(const Eigen::Vector2d& p_world_m, const BasePose& base) {
  const Eigen::Vector2d lever_m = p_world_m - base.translation_world_m;
  Eigen::Matrix3d J_sensor_base = Eigen::Matrix3d::Identity();
  J_sensor_base.topRightCorner<2, 1>() << -lever_m.y(), lever_m.x();
  return J_sensor_base * base.covariance_world * J_sensor_base.transpose();
}

PoseCovarianceInput::PoseCovarianceInput(Context& context, Params params)
    : context_(context), params_(std::move(params)), poses_(params_.max_pose_age_s) {
  context.on_arrival(
      [this](const SegmentArrayConstPtr& msg, const ros::SteadyTime& arrival) {
        if (waiting_.size() >= params_.queue_size) {
          context_.drop(drop_reason::kQueueFull);
          waiting_.pop_back();
        }
        waiting_.push_back({msg, arrival});
        release_waiting_();
      },
      [this] { return waiting_.size(); });
  context.when_made([this] {
    pose_subscriber_.emplace(context_.node(), "pose",
                             [this](const auto& msg, const ros::SteadyTime& /*arrival*/) { take(*msg); });
    objects_subscriber_.emplace(context_.node(), "objects",
                                [this](const auto& msg, const ros::SteadyTime& /*arrival*/) { take(*msg); });
  });
  release_waiting_ = context.poll([this] {
    release();
    return !waiting_.empty();
  });
}

void PoseCovarianceInput::take(const geometry_msgs::PoseWithCovarianceStamped& msg) {
  const auto stamp_ns = static_cast<std::int64_t>(msg.header.stamp.toNSec());
  if (tf2_frame(msg.header.frame_id) != params_.world_frame) {
    poses_.refuse(stamp_ns);
    context_.diagnostics().counted({{"pose in another frame", 1}});
  } else if (!poses_.add(stamp_ns, base_pose_from_msg(msg))) {
    context_.diagnostics().counted({{"pose that cannot be used", 1}});
  }
  release();
}

void PoseCovarianceInput::take(const MappedObjectArray& msg) {
  try {
    if (tf2_frame(msg.header.frame_id) != params_.world_frame) {
      return context_.diagnostics().counted({{"objects in another frame", 1}});
    }
    // After a restart of time the first ones are those of the time before.
    if (!objects_.empty() && msg.header.stamp.toNSec() < objects_.begin()->first) objects_.clear();
    objects_[msg.header.stamp.toNSec()] = objects_from_msg(msg);
    if (objects_.size() > kMaps) objects_.erase(objects_.begin());
  } catch (const std::exception&) {
    return context_.diagnostics().counted({{"objects that cannot be used", 1}});
  }
  release();
}

/// Enqueues the segments that have what they need, in the order in which they came. Does not throw.
void PoseCovarianceInput::release() {
  try {
    while (!waiting_.empty()) {
      const Waiting& first = waiting_.front();
      const std::uint64_t stamp_ns = first.msg->header.stamp.toNSec();
      if (is_published(pose_subscriber_)) poses_.expect();
      const auto objects = objects_.find(stamp_ns);
      const bool waits_for_pose = !poses_.has(static_cast<std::int64_t>(stamp_ns)) && is_published(pose_subscriber_);
      const bool waits_for_objects = objects == objects_.end() && is_published(objects_subscriber_);
      if (waits_for_pose || waits_for_objects) {
        if ((ros::SteadyTime::now() - first.arrival).toSec() < params_.pose_timeout_s) return;
        if (waits_for_pose) context_.diagnostics().counted({{"no pose of that stamp", 1}});
        if (waits_for_objects) context_.diagnostics().counted({{"no objects of that stamp", 1}});
      }
      enqueue_first(objects != objects_.end() ? std::optional(objects->second) : std::nullopt);
    }
  } catch (const std::exception& error) {
    context_.drop(drop_reason::kError, error.what());
  }
}

void PoseCovarianceInput::enqueue_first(std::optional<Objects> objects) {
  const Waiting first = waiting_.front();
  waiting_.pop_front();
  const std::optional<BasePose> base = poses_.at(static_cast<std::int64_t>(first.msg->header.stamp.toNSec()));
  if (poses_.has_source() && !base) {
    context_.drop(kNoCovariance);
    return;
  }
  context_.enqueue(boost::make_shared<const CovariedSegments>(
                       CovariedSegments{first.msg->header, first.msg->latency, first.msg, base, std::move(objects)}),
                   first.arrival);
}

}  // namespace situation_awareness
