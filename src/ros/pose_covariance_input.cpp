// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/pose_covariance_input.hpp"

#include <array>
#include <cmath>
#include <exception>
#include <stdexcept>

#include <boost/make_shared.hpp>

#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/scan_check.hpp"

namespace situation_awareness {
namespace {

/// Poses that are remembered for segments that come later.
constexpr std::size_t kPoses = 200;

}  // namespace

BasePose base_pose_from_msg(const geometry_msgs::PoseWithCovarianceStamped& msg) {
  // Index in the message's (x, y, z, roll, pitch, yaw).
  constexpr std::array<std::size_t, 3> kPlanar = {0, 1, 5};
  BasePose pose;
  pose.translation_world_m = {msg.pose.pose.position.x, msg.pose.pose.position.y};
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      pose.covariance_world(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) =
          msg.pose.covariance[6 * kPlanar[row] + kPlanar[column]];
    }
  }
  if (!pose.translation_world_m.allFinite() || !pose.covariance_world.allFinite()) {
    throw std::invalid_argument("a pose is not finite");
  }
  if (!(pose.covariance_world.diagonal().minCoeff() >= 0.0)) {
    throw std::invalid_argument("a variance of a pose is negative");
  }
  return pose;
}

Eigen::Matrix3d covariance_at(const Eigen::Vector2d& p_world_m, const BasePose& base) {
  const Eigen::Vector2d lever_m = p_world_m - base.translation_world_m;
  Eigen::Matrix3d J_sensor_base = Eigen::Matrix3d::Identity();
  J_sensor_base.topRightCorner<2, 1>() << -lever_m.y(), lever_m.x();
  return J_sensor_base * base.covariance_world * J_sensor_base.transpose();
}

PoseCovarianceInput::PoseCovarianceInput(Context& context, const PolygonNodeletParams& params)
    : context_(context),
      world_frame_(params.nodelet.world_frame),
      timeout_s_(params.pose_timeout_s),
      queue_size_(static_cast<std::size_t>(params.nodelet.queue_size)) {
  context.on_arrival(
      [this](const SegmentArrayConstPtr& msg, const ros::SteadyTime& arrival) {
        if (waiting_.size() >= queue_size_) {
          context_.drop(drop_reason::kQueueFull);
          waiting_.pop_back();
        }
        waiting_.push_back({msg, arrival});
        release();
      },
      [this] { return waiting_.size(); });
  context.when_made([this] {
    subscriber_.emplace(context_.node(), "pose",
                        [this](const auto& msg, const ros::SteadyTime& /*arrival*/) { take(*msg); });
  });
  context.every(0.005, [this] { release(); });
}

void PoseCovarianceInput::take(const geometry_msgs::PoseWithCovarianceStamped& msg) {
  try {
    if (tf2_frame(msg.header.frame_id) != world_frame_) {
      return context_.diagnostics().counted({{"pose in another frame", 1}});
    }
    const BasePose pose = base_pose_from_msg(msg);
    // After a restart of time the first ones are those of the time before.
    if (!poses_.empty() && msg.header.stamp.toNSec() < poses_.begin()->first) poses_.clear();
    poses_[msg.header.stamp.toNSec()] = pose;
    if (poses_.size() > kPoses) poses_.erase(poses_.begin());
  } catch (const std::exception&) {
    return context_.diagnostics().counted({{"pose that cannot be used", 1}});
  }
  release();
}

/// Enqueues the segments that have what they need, in the order in which they came. Does not throw.
void PoseCovarianceInput::release() {
  try {
    while (!waiting_.empty()) {
      const Waiting& first = waiting_.front();
      const auto pose = poses_.find(first.msg->header.stamp.toNSec());
      if (pose != poses_.end()) {
        enqueue_first(pose->second);
      } else if (!subscriber_ || subscriber_->subscriber().getNumPublishers() == 0) {
        enqueue_first(std::nullopt);
      } else if ((ros::SteadyTime::now() - first.arrival).toSec() >= timeout_s_) {
        context_.diagnostics().counted({{"no pose of that stamp", 1}});
        enqueue_first(std::nullopt);
      } else {
        return;
      }
    }
  } catch (const std::exception& error) {
    context_.drop(drop_reason::kError, error.what());
  }
}

void PoseCovarianceInput::enqueue_first(const std::optional<BasePose>& base) {
  const Waiting first = waiting_.front();
  waiting_.pop_front();
  context_.enqueue(boost::make_shared<const CovariedSegments>(
                       CovariedSegments{first.msg->header, first.msg->latency, first.msg, base}),
                   first.arrival);
}

}  // namespace situation_awareness
