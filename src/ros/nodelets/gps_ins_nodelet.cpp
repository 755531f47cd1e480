// SPDX-License-Identifier: BSD-3-Clause
// imu, fix, altitude, heading, TF base -> imu and antenna  ->  odometry, pose, TF world -> base
#include <algorithm>
#include <cstdint>
#include <exception>
#include <optional>
#include <string>
#include <utility>

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/service_server.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/navigation_sensors.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/gps_ins_input.hpp"
#include "situation_awareness/ros/gps_ins_report.hpp"
#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"
#include "situation_awareness/ros/receipt.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"
#include "situation_awareness/ros/timed_subscriber.hpp"
#include "situation_awareness/ros/transform_input.hpp"

namespace situation_awareness {

class GpsInsStage {
 public:
  using Context = StageContext<sensor_msgs::Imu>;
  static constexpr const char* kInput = "imu";
  static constexpr auto kReadParams = read_gps_ins_nodelet_params;

  GpsInsStage(Context& context, const GpsInsNodeletParams& params)
      : context_(context),
        params_(params),
        input_(params, tf_),
        report_(context.name(), input_),
        odometry_(context.node().advertise<nav_msgs::Odometry>("odometry", 50)),
        pose_(context.node().advertise<geometry_msgs::PoseWithCovarianceStamped>("pose", 50)),
        transform_input_(tf_, context.node()) {
    context.keep_all();
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report_.report(status); });
    context.when_made([this] {
      subscribe(fix_, "fix", [this](const auto& fix) { input_.add_fix(fix, receipt_ns()); });
      subscribe(altitude_, "altitude", [this](const auto& altitude) { input_.add_altitude(altitude); });
      if (params_.use_heading) {
        subscribe(heading_, "heading", [this](const auto& heading) { input_.add_heading(heading); });
      }
      reset_ = context_.private_node().advertiseService("reset", &GpsInsStage::reset, this);
    });
  }

  bool process(const sensor_msgs::Imu& msg) {
    if (is_ahead_of_clock(msg.header.stamp, params_.nodelet.max_stamp_ahead_s)) {
      return context_.drop(drop_reason::kAheadOfClock);
    }
    const std::string reason = input_.add_imu(msg, receipt_ns());
    report_.add();
    if (!reason.empty()) return context_.drop(reason, input_.detail());
    const GpsIns& filter = *input_.filter();
    if (!filter.is_ready()) return context_.drop("pose not ready", filter.reason());
    if (is_due(filter.stamp_ns())) publish(filter.pose());
    return true;
  }

 private:
  template <class Message, class Add>
  void subscribe(std::optional<TimedSubscriber<Message>>& subscriber, const char* topic, Add add) {
    subscriber.emplace(context_.node(), topic, [this, topic, add](const auto& msg, const ros::SteadyTime&) {
      try {
        if (is_ahead_of_clock(msg->header.stamp, params_.nodelet.max_stamp_ahead_s)) {
          context_.diagnostics().counted({{std::string(topic) + " not used: " + drop_reason::kAheadOfClock, 1}});
          return;
        }
        add(*msg);
      } catch (const std::exception& error) {
        ROS_WARN_STREAM_THROTTLE(5.0, context_.name() << ": " << topic << ": " << error.what());
        context_.diagnostics().counted({{std::string(topic) + " not used: error", 1}});
      }
    });
  }

  /// At the rate that is set on average, whatever that of the samples is.
  bool is_due(std::int64_t stamp_ns) {
    const std::int64_t period_ns = nanoseconds(1.0 / params_.rate_hz);
    if (stamp_ns < due_ns_ && due_ns_ - stamp_ns <= period_ns) return false;  // else time started again
    due_ns_ = std::max(due_ns_ + period_ns, stamp_ns);
    if (due_ns_ - stamp_ns > period_ns) due_ns_ = stamp_ns + period_ns;
    return true;
  }

  void publish(const GpsInsPose& pose) {
    if (!pose.is_ready) return;
    if (params_.publish_tf) {
      broadcaster_.sendTransform(
          transform_to_msg(pose.T_world_base, pose.stamp_ns, params_.nodelet.world_frame, params_.base_frame));
    }
    nav_msgs::Odometry odometry = odometry_to_msg(pose, params_.nodelet.world_frame, params_.base_frame);
    geometry_msgs::PoseWithCovarianceStamped msg;
    msg.header = odometry.header;
    msg.pose = odometry.pose;
    context_.publish(pose_, std::move(msg));
    context_.publish(odometry_, std::move(odometry));
  }

  bool reset(std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response) {
    if (input_.filter() != nullptr) input_.filter()->reset();
    response.success = 1;
    response.message = "the pose was forgotten, the origin was not; it starts anew with the next samples and fixes";
    ROS_INFO_STREAM(context_.name() << ": " << response.message);
    return true;
  }

  Context& context_;
  GpsInsNodeletParams params_;
  tf2_ros::Buffer tf_;  ///< for the places of the sensors on the base
  GpsInsInput input_;
  GpsInsReport report_;
  std::int64_t due_ns_ = 0;
  ros::Publisher odometry_, pose_;
  tf2_ros::TransformBroadcaster broadcaster_;
  TransformInput transform_input_;
  std::optional<TimedSubscriber<sensor_msgs::NavSatFix>> fix_;
  std::optional<TimedSubscriber<geometry_msgs::PoseWithCovarianceStamped>> altitude_;
  std::optional<TimedSubscriber<sensor_msgs::Imu>> heading_;
  ros::ServiceServer reset_;
};

using GpsInsNodelet = StageNodelet<GpsInsStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::GpsInsNodelet, nodelet::Nodelet)
