// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <ros/time.h>
#include <std_msgs/Header.h>
#include <Eigen/Core>

#include "situation_awareness/MappedObjectArray.h"
#include "situation_awareness/SegmentArray.h"
#include "situation_awareness/estimation/pose_covariances.hpp"
#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/ros/stage_context.hpp"
#include "situation_awareness/ros/timed_subscriber.hpp"

namespace situation_awareness {

/// Not checked.
BasePose base_pose_from_msg(const geometry_msgs::PoseWithCovarianceStamped& msg);

/// Of the error of the pose of a sensor at `p_world_m` that is fixed to the base: an error of the base's yaw moves it.
Eigen::Matrix3d covariance_at(const Eigen::Vector2d& p_world_m, const BasePose& base);

/// Segments with the pose that localisation has for their scan, and the map of objects after it.
struct CovariedSegments {
  std_msgs::Header header;
  double latency = 0.0;
  SegmentArrayConstPtr msg;
  std::optional<BasePose> base;    ///< none: `pose` never had a publisher
  std::optional<Objects> objects;  ///< none: there is no map of objects, or not of this scan
};

/// The input of a stage that needs segments and, where something publishes `pose` or `objects`, the pose's covariance
/// and the map of objects at the same stamp, for which they wait up to `pose_timeout_s`. Once `pose` has a publisher,
/// segments whose pose it does not tell are dropped (PoseCovariances). All calls are on the callback
/// queue of its stage, without a lock; `context` must outlive it.
class PoseCovarianceInput {
 public:
  using Context = StageContext<SegmentArray, CovariedSegments>;

  struct Params {
    std::string world_frame;
    double pose_timeout_s;
    std::size_t queue_size;
    double max_pose_age_s;  ///< PoseCovariances
  };

  PoseCovarianceInput(Context& context, Params params);
  PoseCovarianceInput(const PoseCovarianceInput&) = delete;
  PoseCovarianceInput& operator=(const PoseCovarianceInput&) = delete;

 private:
  struct Waiting {
    SegmentArrayConstPtr msg;
    ros::SteadyTime arrival;
  };

  void take(const geometry_msgs::PoseWithCovarianceStamped& msg);
  void take(const MappedObjectArray& msg);
  void release();
  void enqueue_first(std::optional<Objects> objects);

  Context& context_;
  Params params_;
  std::deque<Waiting> waiting_;
  std::function<void()> release_waiting_;
  PoseCovariances poses_;
  std::map<std::uint64_t, Objects> objects_;  ///< by their stamp in ns
  std::optional<TimedSubscriber<geometry_msgs::PoseWithCovarianceStamped>> pose_subscriber_;
  std::optional<TimedSubscriber<MappedObjectArray>> objects_subscriber_;
};

}  // namespace situation_awareness
