// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/mission.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <optional>
#include <stdexcept>
#include <vector>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

/// m/s. Of a slower vehicle the course says nothing.
constexpr double kCourseSpeed_m_s = 0.5;
constexpr double kPoseSpacing_m = 0.5;
constexpr double kMostPathPoses = 4000.0;
/// Cosine of the tilt from which on a scanner's plane does not show what is around, |z| of its axis.
constexpr double kUprightScanner = 0.7;

geometry_msgs::PoseStamped pose_of_path(const std_msgs::Header& header, const Pose2& pose) {
  geometry_msgs::PoseStamped msg;
  msg.header = header;
  msg.pose.position.x = pose.translation_m.x();
  msg.pose.position.y = pose.translation_m.y();
  msg.pose.orientation.z = std::sin(0.5 * pose.yaw_rad);
  msg.pose.orientation.w = std::cos(0.5 * pose.yaw_rad);
  return msg;
}

}  // namespace

void take_odometry(const nav_msgs::Odometry& msg, MissionInput& input) {
  const Eigen::Isometry3d T = isometry_from_msg(transform_from_odometry(msg).transform);
  const Eigen::Vector3d v_base(msg.twist.twist.linear.x, msg.twist.twist.linear.y, msg.twist.twist.linear.z);
  const Eigen::Vector3d v_world = T.linear() * v_base;
  if (!v_world.allFinite()) throw std::invalid_argument("the twist is not finite");
  input.stamp_ns = to_nanoseconds(msg.header.stamp);
  input.T_world_base = pose2_of(T);
  input.speed_m_s = v_world.head<2>().norm();
  if (input.speed_m_s > kCourseSpeed_m_s) input.T_world_base.yaw_rad = std::atan2(v_world.y(), v_world.x());
  input.covariance_world = planar_covariance(msg.pose);
  if (!input.covariance_world.allFinite() || (input.covariance_world.diagonal().array() < 0.0).any()) {
    throw std::invalid_argument("the covariance is not finite, or a variance is negative");
  }
}

bool free_beams_from_msg(const sensor_msgs::LaserScan& msg, const Eigen::Isometry3d& T_world_lidar, FreeBeams& beams) {
  const double upright = T_world_lidar.linear()(2, 2);
  const double step_rad = std::copysign(1.0, upright) * static_cast<double>(msg.angle_increment);
  if (!(std::abs(upright) >= kUprightScanner) || !std::isfinite(step_rad) || step_rad == 0.0 ||
      !std::isfinite(msg.angle_min) || !std::isfinite(msg.range_max) || !(msg.range_max > 0.0F) ||
      msg.ranges.size() < 2) {
    return false;
  }
  const Eigen::Vector2d ahead = T_world_lidar.linear().col(0).head<2>();
  beams.T_world_sensor = {T_world_lidar.translation().head<2>(), std::atan2(ahead.y(), ahead.x())};
  beams.step_rad = std::abs(step_rad);
  // Of a tilted beam the part over the ground, that of the steepest one.
  const double reach_m = static_cast<double>(msg.range_max) * std::abs(upright);
  beams.free_m.clear();
  beams.hits_world_m.clear();
  for (std::size_t i = 0; i < msg.ranges.size(); ++i) {
    const float range = msg.ranges[i];
    const bool says_nothing = std::isnan(range) || range < msg.range_min;
    beams.free_m.push_back(says_nothing ? 0.0 : std::min(static_cast<double>(range) * std::abs(upright), reach_m));
    if (says_nothing || !(range < msg.range_max)) continue;
    const double angle_rad =
        static_cast<double>(msg.angle_min) + static_cast<double>(i) * static_cast<double>(msg.angle_increment);
    const Eigen::Vector3d beam =
        T_world_lidar.linear() * Eigen::Vector3d(std::cos(angle_rad), std::sin(angle_rad), 0.0);
    beams.hits_world_m.emplace_back(T_world_lidar.translation().head<2>() +
                                    static_cast<double>(range) * beam.head<2>());
  }
  beams.from_rad = std::copysign(1.0, upright) * static_cast<double>(msg.angle_min);
  if (step_rad < 0.0) {
    beams.from_rad += step_rad * static_cast<double>(msg.ranges.size() - 1);
    std::reverse(beams.free_m.begin(), beams.free_m.end());
    std::reverse(beams.hits_world_m.begin(), beams.hits_world_m.end());
  }
  return true;
}

nav_msgs::Path path_to_msg(const SegmentPath& path, std::int64_t stamp_ns, const std::string& world_frame) {
  nav_msgs::Path msg;
  msg.header.stamp = to_ros_time(stamp_ns);
  msg.header.frame_id = world_frame;
  if (path.segments.empty()) return msg;
  const auto steps = static_cast<int>(std::ceil(std::min(path.length_m / kPoseSpacing_m, kMostPathPoses)));
  for (int i = 0; i <= steps; ++i) {
    msg.poses.push_back(pose_of_path(msg.header, place_at(path, path.length_m * i / std::max(steps, 1)).pose));
  }
  return msg;
}

MissionStatus mission_to_msg(const MissionStep& step, double clearance_m, std::int64_t stamp_ns,
                             const std::string& world_frame) {
  static_assert(static_cast<int>(MissionState::kDone) == MissionStatus::DONE);
  static_assert(static_cast<int>(MissionState::kHold) == MissionStatus::HOLD);
  MissionStatus msg;
  msg.header.stamp = to_ros_time(stamp_ns);
  msg.header.frame_id = world_frame;
  msg.state = static_cast<std::uint8_t>(step.state);
  msg.reason = step.reason;
  msg.target = step.target;
  msg.laps = step.laps;
  msg.done = static_cast<std::uint32_t>(step.done);
  msg.given_up = static_cast<std::uint32_t>(step.given_up);
  msg.curvature = step.curvature_1_m;
  msg.clearance = clearance_m;
  return msg;
}

void plan_dubins(const PlanDubins::Request& request, PlanDubins::Response& response) {
  const auto end_of = [](const geometry_msgs::Pose2D& pose, bool is_free, double radius_m) {
    DubinsEnd end{{pose.x, pose.y}, std::nullopt, radius_m};
    if (!is_free) end.yaw_rad = pose.theta;
    return end;
  };
  try {
    const DubinsPath path =
        shortest_dubins_path(end_of(request.start, request.start_heading_is_free != 0, request.start_radius),
                             end_of(request.goal, request.goal_heading_is_free != 0, request.goal_radius));
    if (request.max_curvature < 0.0 || !std::isfinite(request.max_curvature)) {
      throw std::invalid_argument("max_curvature must be finite and not negative");
    }
    const double step_m = request.step == 0.0 ? kPoseSpacing_m : request.step;
    if (!(step_m > 0.0) || path.length_m / step_m > 1e5) {
      throw std::invalid_argument("step must be positive and give at most 1e5 poses");
    }
    const double max_curvature_1_m =
        request.max_curvature > 0.0 ? request.max_curvature : std::numeric_limits<double>::infinity();
    if (!may_turn(request.start_radius, max_curvature_1_m) || !may_turn(request.goal_radius, max_curvature_1_m)) {
      throw std::invalid_argument("a radius is below 1 / max_curvature: there is no path");
    }
    std::vector<Pose2> poses;
    sample(path, step_m, poses);
    response.word = name_of(path.word);
    response.length = path.length_m;
    response.header.frame_id = request.frame_id;
    for (const Pose2& pose : poses) response.poses.push_back(pose_of_path(response.header, pose));
    response.success = 1;
  } catch (const std::exception& error) {
    response.success = 0;
    response.message = error.what();
  }
}

}  // namespace situation_awareness
