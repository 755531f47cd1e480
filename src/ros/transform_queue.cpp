// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/transform_queue.hpp"

#include <algorithm>
#include <exception>

#include <geometry_msgs/TransformStamped.h>

#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"

namespace situation_awareness {
namespace {

/// The frame that a frame's latest transforms lead to.
std::string root_of(const tf2::BufferCore& transforms, std::string frame) {
  constexpr int kMostFrames = 1000;  // transforms may go in a circle
  std::string parent;
  for (int i = 0; i < kMostFrames && transforms._getParent(frame, ros::Time(), parent); ++i) frame = parent;
  return frame;
}

}  // namespace

Taken taken(const sensor_msgs::LaserScan& msg, bool deskew) {
  return {tf2_frame(msg.header.frame_id), msg.header.stamp, deskew ? time_of_last_beam(msg) : msg.header.stamp};
}

Taken later(const Taken& taken, double offset_s) {
  const auto moved = [offset_ns = nanoseconds(offset_s)](const ros::Time& time) {
    // Zero is the latest transform to tf2.
    return to_ros_time(std::clamp<std::int64_t>(to_nanoseconds(time) + offset_ns, 1, to_nanoseconds(ros::TIME_MAX)));
  };
  return {taken.frame, moved(taken.first), moved(taken.last)};
}

ros::Duration transform_cache_time(double timeout_s) { return ros::Duration(10.0 + 2.0 * timeout_s); }

bool has_transforms(const tf2::BufferCore& transforms, const std::string& world_frame, const Taken& taken) {
  return taken.frame == world_frame ||
         (transforms.canTransform(world_frame, taken.frame, taken.first) &&
          (taken.last == taken.first || transforms.canTransform(world_frame, taken.frame, taken.last)));
}

std::string missing_transform(const tf2::BufferCore& transforms, const std::string& world_frame, const Taken& taken) {
  const std::string from_to = "from " + world_frame + " to " + taken.frame + ": ";
  const std::string unconnected = from_to + "TF does not connect " + world_frame + " with " + taken.frame;
  for (const std::string& frame : {world_frame, taken.frame}) {
    if (!transforms._frameExists(frame)) return unconnected + ", it has no frame " + frame;
  }
  if (root_of(transforms, world_frame) != root_of(transforms, taken.frame)) return unconnected;
  std::string why;
  if (transforms.canTransform(world_frame, taken.frame, taken.first, &why)) {
    transforms.canTransform(world_frame, taken.frame, taken.last, &why);
  }
  return from_to + why;
}

Eigen::Isometry3d transform_at(const tf2::BufferCore& transforms, const std::string& world_frame,
                               const std::string& frame, const ros::Time& time) {
  if (frame == world_frame) return Eigen::Isometry3d::Identity();
  ros::Time at = time;
  // Just before a transform it is interpolated towards that, while the transform itself is looked up in another way
  // once a later one is there: the last digits would tell which came first.
  if (!time.isZero()) at.fromNSec(time.toNSec() - 1);
  if (!time.isZero() && !transforms.canTransform(world_frame, frame, at)) at = time;  // the first
  return isometry_from_msg(transforms.lookupTransform(world_frame, frame, at).transform);
}

std::string mount(const tf2::BufferCore& tf, const std::string& base_frame, const std::string& sensor_frame,
                  tf2::BufferCore& poses, const std::string& base_name, const std::string& sensor_name) {
  const Taken now{sensor_frame, ros::Time(), ros::Time()};  // zero: the latest transform
  if (!has_transforms(tf, base_frame, now)) return missing_transform(tf, base_frame, now);
  geometry_msgs::TransformStamped transform;
  transform.transform.rotation.w = 1.0;
  try {
    if (sensor_frame != base_frame) transform = tf.lookupTransform(base_frame, sensor_frame, ros::Time());
    isometry_from_msg(transform.transform);  // checks it
  } catch (const std::exception& error) {
    return error.what();
  }
  transform.header.frame_id = base_name;
  transform.child_frame_id = sensor_name;
  poses.setTransform(transform, "TF", true);
  return "";
}

}  // namespace situation_awareness
