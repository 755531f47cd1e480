// SPDX-License-Identifier: BSD-3-Clause
// scan, odom, TF base -> lidar, initialpose  ->  TF world -> odom, pose, reflectors (for display)
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <ros/service_server.h>
#include <situation_awareness/Relocate.h>
#include <tf2_ros/transform_broadcaster.h>
#include <visualization_msgs/MarkerArray.h>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/geometry/parse_pose2.hpp"
#include "situation_awareness/pipeline/localization_pipeline.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/markers/reflector_markers.hpp"
#include "situation_awareness/ros/nis_report.hpp"
#include "situation_awareness/ros/odometry_input.hpp"
#include "situation_awareness/ros/params/localization_nodelet_params.hpp"
#include "situation_awareness/ros/reflector_report.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"

namespace situation_awareness {

class ReflectorLocalizationStage {
 public:
  using Context = OdometryInput::Context;
  static constexpr const char* kInput = "scan";
  static constexpr auto kReadParams = read_localization_nodelet_params;

  ReflectorLocalizationStage(Context& context, const LocalizationNodeletParams& params)
      : context_(context),
        params_(params),
        pipeline_(load_reflector_map(params.reflector_file), params.pipeline.reflectors, params.pipeline.localization),
        report_(context.name(), pipeline_),
        pose_(context.node().advertise<geometry_msgs::PoseWithCovarianceStamped>("pose", 20)),
        markers_publisher_(context.node().advertise<visualization_msgs::MarkerArray>("reflectors", 5)),
        input_(context, params.nodelet, params.pipeline.scan.scanner, {params.odom_frame, params.base_frame},
               {[this](std::int64_t stamp_ns, const Pose2& T_odom_base, std::int64_t received_ns) {
                 return add(stamp_ns, T_odom_base, received_ns);
               }}) {
    pipeline_.localization().trust_scan_stamps();
    has_initial_ = !params.initial_pose.empty();
    if (has_initial_) initial_ = parse_pose2(params.initial_pose, "initial_pose");
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) {
      report_.report(status);
      report_nis(pipeline_.localization().nis_monitor(), status);
    });
    context.when_made([this] {
      initial_pose_ = context_.node().subscribe("initialpose", 5, &ReflectorLocalizationStage::take_initial_pose, this);
      relocate_ = context_.node().advertiseService("relocate", &ReflectorLocalizationStage::relocate, this);
    });
  }

  bool process(const OdometryPosedScan& posed) {
    Scan scan = scan_from_msg(*posed.msg);
    if (!params_.nodelet.deskew) scan.time_increment_s = 0.0;
    const std::string defect = projection_defect(scan, posed.T_odom_lidar, posed.T_odom_lidar_end);
    if (!defect.empty()) return context_.drop(defect);
    if (posed.msg->intensities.empty()) context_.diagnostics().counted({{"scans without intensities", 1}});

    const ReflectorUpdate& update = pipeline_.process(scan, posed.T_odom_base.inverse() * posed.T_odom_lidar);

    report_.add(update);
    if (markers_publisher_.getNumSubscribers() > 0) {
      context_.publish(markers_publisher_, markers_.update(pipeline_, update, params_.nodelet.world_frame));
    }
    if (!update.is_known) {
      // A scan that is not used leaves a pose that is known at an earlier stamp.
      return pipeline_.localization().is_known() ? context_.drop(update.reason)
                                                 : context_.drop("pose not known", update.reason);
    }
    const LocalizedPose pose = pipeline_.localization().pose();
    broadcast(pose, posed);
    context_.publish(pose_, pose_to_msg(pose, params_.nodelet.world_frame));
    return true;
  }

 private:
  OdometryTrack::Verdict add(std::int64_t stamp_ns, const Pose2& T_odom_base, std::int64_t received_ns) {
    const OdometryTrack::Verdict verdict = pipeline_.add_odometry(stamp_ns, T_odom_base, received_ns);
    if (has_initial_ && verdict != OdometryTrack::Verdict::kRefused) {
      set_pose(stamp_ns, {initial_, 0.0, 0.0});
      has_initial_ = false;
    }
    return verdict;
  }

  /// For the times of the first and the last beam, at which scans are projected, the same: in between TF interpolates,
  /// and what it has of later times would change what it says of these.
  void broadcast(const LocalizedPose& pose, const OdometryPosedScan& posed) {
    const Eigen::Isometry3d T_world_odom =
        isometry_in_plane(pose.T_world_base.x * inverse(pose2_of(posed.T_odom_base)));
    const std::int64_t last_ns = std::max(to_nanoseconds(taken(*posed.msg, params_.nodelet.deskew).last),
                                          pose.stamp_ns + nanoseconds(params_.tf_ahead_s));
    std::vector<geometry_msgs::TransformStamped> transforms;
    for (const std::int64_t stamp_ns : {pose.stamp_ns, last_ns}) {
      if (!transforms.empty() && stamp_ns == pose.stamp_ns) continue;
      transforms.push_back(transform_to_msg(T_world_odom, stamp_ns, params_.nodelet.world_frame, input_.frames().odom));
    }
    broadcaster_.sendTransform(transforms);
  }

  void set_pose(std::int64_t stamp_ns, const GivenPose& given) {
    pipeline_.localization().initial_pose(stamp_ns, given.T_world_base,
                                          given.sigma_m > 0.0 ? given.sigma_m : params_.initial_sigma_m,
                                          given.sigma_rad > 0.0 ? given.sigma_rad : params_.initial_sigma_rad);
    has_initial_ = false;
  }

  void take_initial_pose(const geometry_msgs::PoseWithCovarianceStamped& msg) {
    try {
      if (tf2_frame(msg.header.frame_id) != params_.nodelet.world_frame) {
        throw std::invalid_argument("it is in the frame " + msg.header.frame_id + ", not in " +
                                    params_.nodelet.world_frame);
      }
      const ros::Time stamp = msg.header.stamp.isZero() ? ros::Time::now() : msg.header.stamp;
      set_pose(to_nanoseconds(stamp), given_pose_from_msg(msg.pose));
      ROS_INFO_STREAM(context_.name() << ": localised anew from the pose on the topic initialpose");
    } catch (const std::exception& error) {
      ROS_WARN_STREAM(context_.name() << ": initialpose is not used: " << error.what());
      context_.diagnostics().counted({{"initialpose not used", 1}});
    }
  }

  bool relocate(Relocate::Request& request, Relocate::Response& response) {
    const double sum = request.pose.x + request.pose.y + request.pose.theta + request.sigma_m + request.sigma_rad;
    response.success = !request.has_pose || (std::isfinite(sum) && request.sigma_m >= 0.0 && request.sigma_rad >= 0.0);
    if (!response.success) {
      response.message = "pose and standard deviations must be finite numbers, the latter >= 0";
      ROS_WARN_STREAM(context_.name() << ": refused: " << response.message);
      return true;
    }
    if (request.has_pose) {
      set_pose(to_nanoseconds(ros::Time::now()),
               {{{request.pose.x, request.pose.y}, request.pose.theta}, request.sigma_m, request.sigma_rad});
      response.message = "the pose was forgotten; the next scan begins at the one given";
    } else {
      pipeline_.localization().relocate();
      has_initial_ = false;
      response.message = "the pose was forgotten; the next scans find it by the reflectors";
    }
    ROS_INFO_STREAM(context_.name() << ": " << response.message);
    return true;
  }

  Context& context_;
  LocalizationNodeletParams params_;
  LocalizationPipeline pipeline_;
  ReflectorReport report_;
  ReflectorMarkers markers_;
  ros::Publisher pose_, markers_publisher_;
  tf2_ros::TransformBroadcaster broadcaster_;
  bool has_initial_ = false;  ///< it waits for the first odometry
  Pose2 initial_;
  OdometryInput input_;
  ros::Subscriber initial_pose_;
  ros::ServiceServer relocate_;
};

using ReflectorLocalizationNodelet = StageNodelet<ReflectorLocalizationStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::ReflectorLocalizationNodelet, nodelet::Nodelet)
