// SPDX-License-Identifier: BSD-3-Clause
// scan, TF world -> base and lidar, odom, pose, polygons, objects  ->  safety, safety_areas (for display)
#include <array>
#include <cmath>
#include <cstdint>
#include <exception>
#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/service_server.h>
#include <sensor_msgs/LaserScan.h>
#include <situation_awareness/PolygonArray.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>
#include <visualization_msgs/MarkerArray.h>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/path/local_maps.hpp"
#include "situation_awareness/path/safety_areas.hpp"
#include "situation_awareness/path/spline_path.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/polygons.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/safety.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/map_subscriber.hpp"
#include "situation_awareness/ros/markers/safety_markers.hpp"
#include "situation_awareness/ros/params/path_nodelet_params.hpp"
#include "situation_awareness/ros/posed_input.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"
#include "situation_awareness/scan/range_limiter.hpp"

namespace situation_awareness {

class SafetyAreasStage {
 public:
  using Input = PosedInput<sensor_msgs::LaserScan>;
  using Context = Input::Context;
  static constexpr const char* kInput = "scan";
  static constexpr auto kReadParams = read_path_nodelet_params;

  SafetyAreasStage(Context& context, const PathNodeletParams& params)
      : context_(context),
        params_(params),
        path_(load_path(params.path_file), params.path_file),
        areas_(load_path(params.path_file), params.pipeline.vehicle, params.pipeline.safety, params.path_file),
        publisher_(context.node().advertise<SafetyVerdict>("safety", 20)),
        markers_(context.node().advertise<visualization_msgs::MarkerArray>("safety_areas", 5)),
        objects_(context, params.nodelet.world_frame),
        listener_(tf_, context.node(), true, ros::TransportHints().tcpNoDelay()),
        input_(
            context, params.nodelet, params.reset_time_jump_s, 0.0,
            {scan_msg_defect, [this](const sensor_msgs::LaserScan& msg) { return taken(msg, params_.nodelet.deskew); },
             [this] { restart(); }}) {
    params_.pipeline.scan.validate();
    load_local_maps_of_path();
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report(status); });
    context.when_made([this] {
      odometry_ = context_.node().subscribe("odom", 20, &SafetyAreasStage::take_odometry, this);
      pose_ = context_.node().subscribe("pose", 20, &SafetyAreasStage::take_pose, this);
      if (!params_.local_maps_file.empty()) {
        save_ = context_.private_node().advertiseService("save_local_maps", &SafetyAreasStage::save, this);
      }
      polygons_subscriber_ = context_.node().subscribe("polygons", 5, &SafetyAreasStage::take_polygons, this);
    });
  }

  bool process(const PosedMessage<sensor_msgs::LaserScan>& posed) {
    const Scan scan = scan_from_msg(*posed.msg);
    const std::string defect = projection_defect(scan, posed.T_world_sensor, posed.T_world_sensor_end);
    if (!defect.empty()) return context_.drop(defect);
    Eigen::Isometry3d T_sensor_base;
    try {
      const auto msg = tf_.lookupTransform(tf2_frame(posed.header.frame_id), params_.base_frame, ros::Time(0));
      T_sensor_base = isometry_from_msg(msg.transform);
    } catch (const tf2::TransformException& error) {
      return context_.drop(drop_reason::kNoTransform, error.what());
    } catch (const std::invalid_argument& error) {
      return context_.drop(drop_reason::kBadTransform, error.what());
    }
    limited_ = limit_range(scan, posed.T_world_sensor, params_.pipeline.scan, std::move(limited_));
    points_ = project_horizontally(limited_, posed.T_world_sensor, posed.T_world_sensor_end, std::move(points_));
    const SafetyDecision& decision =
        areas_.update(points_, vehicle_at(posed.T_world_sensor * T_sensor_base), polygons_, objects_.latest());
    ++verdicts_[static_cast<std::size_t>(decision.verdict)];
    decision_ = &decision;
    context_.publish(publisher_, safety_to_msg(decision, points_.height_world_m, params_.nodelet.world_frame));
    if (markers_.getNumSubscribers() > 0) {
      context_.publish(markers_, safety_markers(decision, points_.height_world_m, params_.nodelet.world_frame));
    }
    return true;
  }

 private:
  static constexpr double kMostAge_s = 0.5;  // of speed and covariance, against the scan

  VehicleState vehicle_at(const Eigen::Isometry3d& T_world_base) {
    VehicleState state;
    state.T_world_base = {T_world_base.translation().head<2>(),
                          std::atan2(T_world_base.linear()(1, 0), T_world_base.linear()(0, 0))};
    const double m2 = params_.pose_sigma_m * params_.pose_sigma_m;
    state.covariance_world.diagonal() << m2, m2, params_.pose_sigma_rad * params_.pose_sigma_rad;
    if (has_pose_ && std::abs(seconds_between(pose_stamp_ns_, points_.stamp_ns)) <= kMostAge_s) {
      state.covariance_world = covariance_;
    }
    // What is not measured may be as fast as the vehicle can.
    state.speed_m_s = params_.pipeline.vehicle.max_speed_m_s;
    if (has_speed_ && std::abs(seconds_between(speed_stamp_ns_, points_.stamp_ns)) <= kMostAge_s) {
      state.speed_m_s = speed_m_s_;
    } else {
      context_.diagnostics().counted({{"scans without a speed", 1}});
    }
    return state;
  }

  void take_odometry(const nav_msgs::Odometry& msg) {
    const auto& velocity = msg.twist.twist.linear;
    if (!std::isfinite(velocity.x) || !std::isfinite(velocity.y)) {
      return context_.diagnostics().counted({{"odometry not used", 1}});
    }
    speed_m_s_ = std::hypot(velocity.x, velocity.y);
    speed_stamp_ns_ = to_nanoseconds(msg.header.stamp);
    has_speed_ = true;
  }

  void take_pose(const geometry_msgs::PoseWithCovarianceStamped& msg) {
    const Eigen::Matrix3d covariance = planar_covariance(msg.pose);
    const bool is_of_world = tf2_frame(msg.header.frame_id) == params_.nodelet.world_frame;
    if (!is_of_world || !covariance.allFinite() || (covariance.diagonal().array() < 0.0).any()) {
      return context_.diagnostics().counted({{"pose not used", 1}});
    }
    covariance_ = covariance;
    pose_stamp_ns_ = to_nanoseconds(msg.header.stamp);
    has_pose_ = true;
  }

  void take_polygons(const PolygonArray& msg) {
    try {
      if (tf2_frame(msg.header.frame_id) != params_.nodelet.world_frame) {
        throw std::invalid_argument("polygons in the frame " + msg.header.frame_id);
      }
      polygons_ = polygons_from_msg(msg);
    } catch (const std::exception& error) {
      context_.drop(drop_reason::kBadMap, error.what());
    }
  }

  /// What the transit begins with, if there was one before.
  void load_local_maps_of_path() {
    if (params_.local_maps_file.empty()) return;
    if (!std::ifstream(params_.local_maps_file)) {
      ROS_INFO_STREAM(context_.name() << ": there is no " << params_.local_maps_file << " yet");
      return;
    }
    polygons_ = polygons_of(load_local_maps(params_.local_maps_file, path_.segments()), path_);
  }

  bool save(std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response) {
    try {
      save_local_maps(local_maps(path_, polygons_, params_.local_map_reach_m), params_.local_maps_file);
      response.success = 1;
      response.message = "saved to " + params_.local_maps_file;
      ROS_INFO_STREAM(context_.name() << ": local maps " << response.message);
    } catch (const std::exception& error) {
      response.success = 0;
      response.message = error.what();
      ROS_WARN_STREAM(context_.name() << ": refused: " << response.message);
    }
    return true;
  }

  void restart() {
    areas_.reset();
    objects_.clear();
    polygons_ = {};
    has_speed_ = has_pose_ = false;
  }

  void report(StageDiagnostics::Status& status) {
    status.add("policy", name_of(areas_.params().policy));
    for (const auto verdict :
         {SafetyDecision::Verdict::kFullSpeed, SafetyDecision::Verdict::kSlow, SafetyDecision::Verdict::kStop}) {
      status.add(std::string("verdict: ") + name_of(verdict), verdicts_[static_cast<std::size_t>(verdict)]);
    }
    status.add("chains", polygons_.chains.size());
    if (decision_ == nullptr) return;
    status.add("verdict", name_of(decision_->verdict));
    status.add("kind", name_of(decision_->kind));
    status.add("id", decision_->id);
    status.add("allowed speed [m/s]", decision_->allowed_speed_m_s);
    status.add("hits that count", decision_->counted);
    status.add("hits on known chains ignored", decision_->ignored);
  }

  Context& context_;
  PathNodeletParams params_;
  SplinePath path_;
  SafetyAreas areas_;
  Scan limited_;
  Points points_;
  Polygons polygons_;
  double speed_m_s_ = 0.0;
  std::int64_t speed_stamp_ns_ = 0, pose_stamp_ns_ = 0;
  bool has_speed_ = false, has_pose_ = false;
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();
  std::array<std::uint64_t, 3> verdicts_{};
  const SafetyDecision* decision_ = nullptr;
  ros::Publisher publisher_, markers_;
  ros::Subscriber odometry_, pose_, polygons_subscriber_;
  ros::ServiceServer save_;
  MapSubscriber objects_;
  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener listener_;
  Input input_;
};

using SafetyAreasNodelet = StageNodelet<SafetyAreasStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::SafetyAreasNodelet, nodelet::Nodelet)
