// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/transform_queue.hpp"

#include <algorithm>

#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"

namespace situation_awareness {

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
  return transforms.canTransform(world_frame, taken.frame, taken.first) &&
         (taken.last == taken.first || transforms.canTransform(world_frame, taken.frame, taken.last));
}

std::string missing_transform(const tf2::BufferCore& transforms, const std::string& world_frame, const Taken& taken) {
  std::string why;
  if (transforms.canTransform(world_frame, taken.frame, taken.first, &why)) {
    transforms.canTransform(world_frame, taken.frame, taken.last, &why);
  }
  return "from " + world_frame + " to " + taken.frame + ": " + why;
}

Eigen::Isometry3d transform_at(const tf2::BufferCore& transforms, const std::string& world_frame,
                               const std::string& frame, const ros::Time& time) {
  ros::Time at = time;
  // Just before a transform it is interpolated towards that, while the transform itself is looked up in another way
  // once a later one is there: the last digits would tell which came first.
  if (!time.isZero()) at.fromNSec(time.toNSec() - 1);
  if (!time.isZero() && !transforms.canTransform(world_frame, frame, at)) at = time;  // the first
  return isometry_from_msg(transforms.lookupTransform(world_frame, frame, at).transform);
}

}  // namespace situation_awareness
