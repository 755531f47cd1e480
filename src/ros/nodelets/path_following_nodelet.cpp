// SPDX-License-Identifier: BSD-3-Clause
// safety, TF world -> base  ->  cmd_vel, path_error, path (once)
#include <cmath>
#include <cstdint>
#include <exception>
#include <optional>
#include <stdexcept>
#include <string>

#include <geometry_msgs/Twist.h>
#include <nav_msgs/Path.h>
#include <ros/param.h>
#include <ros/service_server.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"
#include "situation_awareness/path/path_following.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/safety.hpp"
#include "situation_awareness/ros/params/path_nodelet_params.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"
#include "situation_awareness/ros/transform_input.hpp"

namespace situation_awareness {

/// As read_path_nodelet_params. Of a stage that starts at once it is noted on the server that it has driven: one that
/// comes back after a crash finds it, and waits to be called. Noted here, it is among the parameters that a new master
/// gets, too.
PathNodeletParams read_path_following_params(const ParamReader& reader) {
  PathNodeletParams params = read_path_nodelet_params(reader);
  load_path(params.path_file);  // throws: a stage that does not start has not driven
  if (params.start_at_once && !params.has_driven) {
    const std::string name = reader.source().substr(reader.source().rfind(' ') + 1);  // of the private namespace
    ros::param::set(name + "/has_driven", true);
  }
  return params;
}

class PathFollowingStage {
 public:
  using Context = StageContext<SafetyVerdict>;
  static constexpr const char* kInput = "safety";
  static constexpr auto kReadParams = read_path_following_params;

  PathFollowingStage(Context& context, const PathNodeletParams& params)
      : context_(context),
        params_(params),
        following_(load_path(params.path_file), params.vehicle, params.path, params.path_file),
        command_(context.node().advertise<geometry_msgs::Twist>("cmd_vel", 10)),
        error_(context.node().advertise<PathError>("path_error", 20)),
        path_(context.node().advertise<nav_msgs::Path>("path", 1, /*latch=*/true)),
        transform_input_(tf_, context.node()) {
    if (params.start_at_once) start_at_once();
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report(status); });
    context.when_made([this] {
      path_.publish(path_to_msg(following_.path(), 0, params_.nodelet.world_frame));
      start_ = context_.private_node().advertiseService("start", &PathFollowingStage::start, this);
      stop_ = context_.private_node().advertiseService("stop", &PathFollowingStage::stop, this);
    });
    context.every(kPeriod_s, [this] { command(); });
  }

  /// A vehicle keeps the last command that it got. roscpp drops what its own thread has not sent when the publisher
  /// ends, and on a busy computer that thread waits for its turn.
  ~PathFollowingStage() {
    if (!drives_) return;
    for (int i = 0; i < kLastCommands; ++i) {
      command_.publish(geometry_msgs::Twist());
      ros::WallDuration(kSending_s).sleep();
    }
  }

  bool process(const SafetyVerdict& msg) {
    allowed_.reset();
    try {
      if (tf2_frame(msg.header.frame_id) != params_.nodelet.world_frame) {
        throw std::invalid_argument("safety in the frame " + msg.header.frame_id);
      }
      allowed_ = allowed_motion_from_msg(msg);
      verdict_stamp_ns_ = to_nanoseconds(msg.header.stamp);
    } catch (const std::exception& error) {
      return context_.drop(drop_reason::kBadMessage, error.what());
    }
    return true;
  }

 private:
  static constexpr double kPeriod_s = 0.02;
  static constexpr int kLastCommands = 10;
  static constexpr double kSending_s = 0.05;  ///< from one of them to the next

  bool is_fresh(std::int64_t stamp_ns, std::int64_t now_ns) const {
    return std::abs(seconds_between(stamp_ns, now_ns)) <= following_.params().timeout_s;
  }

  /// The pose now: that of the latest transform, moved on by the command since.
  std::optional<Pose2> pose_at(std::int64_t now_ns) {
    try {
      const auto msg = tf_.lookupTransform(params_.nodelet.world_frame, params_.base_frame, ros::Time(0));
      const std::int64_t stamp_ns = to_nanoseconds(msg.header.stamp);
      if (stamp_ns != 0 && !is_fresh(stamp_ns, now_ns)) {
        why_not_ = "the pose is old";
        return {};
      }
      const Eigen::Isometry3d T = isometry_from_msg(msg.transform);
      const Pose2 T_world_base{T.translation().head<2>(), std::atan2(T.linear()(1, 0), T.linear()(0, 0))};
      const double ahead_s = stamp_ns == 0 ? 0.0 : seconds_between(stamp_ns, now_ns);
      return T_world_base * exp_se2(ahead_s * Eigen::Vector3d(last_.speed_m_s, 0.0, last_.turn_rate_rad_s));
    } catch (const std::exception& error) {  // of tf2, or not a rotation
      why_not_ = error.what();
      return {};
    }
  }

  /// Does not throw: each step that may is caught.
  void command() {
    try {
      const double steady_s = (ros::SteadyTime::now() - begin_).toSec();
      const std::int64_t now_ns = to_nanoseconds(ros::Time::now());
      if (now_ns == 0 || now_ns == commanded_at_ns_) {  // simulated time that stands
        if (steady_s - commanded_at_s_ > following_.params().timeout_s) stand_still(steady_s);
        return;
      }
      commanded_at_ns_ = now_ns;
      commanded_at_s_ = steady_s;
      why_not_.clear();
      AllowedMotion allowed;
      const bool has_verdict = allowed_ && is_fresh(verdict_stamp_ns_, now_ns);
      if (has_verdict) allowed = *allowed_;
      const std::optional<Pose2> pose = pose_at(now_ns);
      const bool waits = following_.is_running() && (!has_verdict || !pose);
      if (waits) context_.diagnostics().counted({{pose ? "commands without a verdict" : "commands without a pose", 1}});
      if (waits && pose) why_not_ = "no verdict of the safety areas";
      const PathFollowingResult& result =
          pose && has_verdict ? following_.update(now_ns, *pose, allowed) : following_.brake(now_ns);
      last_ = result.command;
      if (pose)
        context_.publish(error_, path_error_to_msg(result, allowed.speed_m_s, now_ns, params_.nodelet.world_frame));
      state_ = result.state;
      transit_ = result.transit;
      across_m_ = result.error.across_m;
      drives_ = following_.is_running() || last_.speed_m_s != 0.0 || last_.turn_rate_rad_s != 0.0;
      if (drives_) standing_.drives(steady_s);
      if (!drives_ && !standing_.are_due(steady_s)) return;
      geometry_msgs::Twist msg;
      msg.linear.x = last_.speed_m_s;
      msg.angular.z = last_.turn_rate_rad_s;
      command_.publish(msg);
    } catch (const std::exception& error) {
      command_.publish(geometry_msgs::Twist());
      context_.drop(drop_reason::kError, error.what());
    }
  }

  void stand_still(double steady_s) {
    following_.halt();
    last_ = {};
    why_not_ = "time stands";
    if (standing_.are_due(steady_s)) command_.publish(geometry_msgs::Twist());
  }

  /// Not after a crash.
  void start_at_once() {
    if (params_.has_driven) {
      waits_after_crash_ = true;
      ROS_WARN_STREAM(context_.name() << ": has driven before and ended: waits for a call of ~start");
      return;
    }
    following_.start();
  }

  bool start(std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response) {
    following_.start();
    waits_after_crash_ = false;
    response.success = 1;
    response.message = "the vehicle drives as soon as pose and verdict are there";
    ROS_INFO_STREAM(context_.name() << ": started by a call of the service");
    return true;
  }

  bool stop(std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response) {
    following_.stop();
    response.success = 1;
    response.message = "the vehicle slows down and stands";
    ROS_INFO_STREAM(context_.name() << ": stopped by a call of the service");
    return true;
  }

  void report(StageDiagnostics::Status& status) {
    static constexpr const char* kStates[] = {"stopped", "turning", "driving", "waiting", "arrived", "off path"};
    status.add("state", kStates[static_cast<std::size_t>(state_)]);
    status.add("transit", transit_);
    status.add("error across [m]", across_m_);
    status.add("speed [m/s]", last_.speed_m_s);
    if (following_.is_running() && !why_not_.empty()) {
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, "stopped: " + why_not_);
    }
    if (waits_after_crash_) {
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, "has driven before and ended: waits for ~start");
    }
    if (state_ == PathFollowingResult::State::kOffPath) {
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, "too far from the path");
    }
  }

  Context& context_;
  PathNodeletParams params_;
  PathFollowing following_;
  std::optional<AllowedMotion> allowed_;
  std::int64_t verdict_stamp_ns_ = 0;
  std::int64_t commanded_at_ns_ = 0;
  const ros::SteadyTime begin_ = ros::SteadyTime::now();
  double commanded_at_s_ = 0.0;  ///< since then
  StandingCommands standing_;
  bool waits_after_crash_ = false;
  Velocity last_;
  PathFollowingResult::State state_ = PathFollowingResult::State::kStopped;
  int transit_ = 0;
  double across_m_ = 0.0;
  bool drives_ = false;
  std::string why_not_;
  ros::Publisher command_, error_, path_;
  ros::ServiceServer start_, stop_;
  tf2_ros::Buffer tf_;
  TransformInput transform_input_;
};

using PathFollowingNodelet = StageNodelet<PathFollowingStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::PathFollowingNodelet, nodelet::Nodelet)
