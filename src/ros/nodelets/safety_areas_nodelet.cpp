// SPDX-License-Identifier: BSD-3-Clause
// scan, TF world -> base and lidar, odom, pose, semantic_map/updates  ->  safety, safety_areas (for display)
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <exception>
#include <fstream>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/service_server.h>
#include <sensor_msgs/LaserScan.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <visualization_msgs/MarkerArray.h>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/estimation/pose_covariances.hpp"
#include "situation_awareness/path/local_maps.hpp"
#include "situation_awareness/path/safety_areas.hpp"
#include "situation_awareness/path/spline_path.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/safety.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/markers/safety_markers.hpp"
#include "situation_awareness/ros/params/path_nodelet_params.hpp"
#include "situation_awareness/ros/pose_covariance_input.hpp"
#include "situation_awareness/ros/posed_input.hpp"
#include "situation_awareness/ros/semantic_map_input.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"
#include "situation_awareness/ros/transform_input.hpp"
#include "situation_awareness/scan/range_limiter.hpp"

namespace situation_awareness {

class SafetyAreasStage {
 public:
  using Input = PosedInput<sensor_msgs::LaserScan>;
  using Context = Input::Context;
  static constexpr const char* kInput = "scan";
  static constexpr auto kReadParams = read_path_nodelet_params;
  /// Chains as near to a segment as this are on its local map. No source is recorded, and its sensitivity was not
  /// measured.
  static constexpr double kLocalMapReach_m = 3.0;

  SafetyAreasStage(Context& context, const PathNodeletParams& params)
      : context_(context),
        params_(params),
        path_(load_path(params.path_file), params.path_file),
        areas_(load_path(params.path_file), params.vehicle, params.safety, params.path_file),
        poses_(params.safety.max_pose_age_s),
        publisher_(context.node().advertise<SafetyVerdict>("safety", 20)),
        markers_(context.node().advertise<visualization_msgs::MarkerArray>("safety_areas", 5)),
        map_(context, params.nodelet.world_frame),
        transform_input_(tf_, context.node()),
        input_(
            context, params.nodelet, 0.0,
            {scan_msg_defect, [this](const sensor_msgs::LaserScan& msg) { return taken(msg, params_.nodelet.deskew); },
             [this] { restart(); },
             [this](const sensor_msgs::LaserScanConstPtr& msg) { return conventional(msg, params_.scan.scanner); }}) {
    params_.scan.validate();
    load_local_maps_of_path();
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report(status); });
    context.when_made([this] {
      odometry_ = context_.node().subscribe("odom", 20, &SafetyAreasStage::take_odometry, this);
      pose_ = context_.node().subscribe("pose", 20, &SafetyAreasStage::take_pose, this);
      if (!params_.local_maps_file.empty()) {
        save_ = context_.private_node().advertiseService("save_local_maps", &SafetyAreasStage::save, this);
      }
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
    limited_ = limit_range(scan, posed.T_world_sensor, params_.scan, std::move(limited_));
    points_ = project_horizontally(limited_, posed.T_world_sensor, posed.T_world_sensor_end, std::move(points_));
    const SafetyDecision& decision =
        areas_.update(points_, vehicle_at(posed.T_world_sensor * T_sensor_base), map(), posed.msg->ranges);
    for (const SafetyInput input : decision.missing) {
      context_.diagnostics().counted({{std::string("scans without ") + name_of(input), 1}});
    }
    ++verdicts_[static_cast<std::size_t>(decision.verdict)];
    decision_ = &decision;
    context_.publish(publisher_, safety_to_msg(decision, points_.height_world_m, params_.nodelet.world_frame));
    if (markers_.getNumSubscribers() > 0) {
      context_.publish(markers_, safety_markers(decision, points_.height_world_m, params_.nodelet.world_frame));
    }
    return true;
  }

 private:
  VehicleState vehicle_at(const Eigen::Isometry3d& T_world_base) {
    VehicleState state;
    state.T_world_base = {T_world_base.translation().head<2>(),
                          std::atan2(T_world_base.linear()(1, 0), T_world_base.linear()(0, 0))};
    if (pose_.getNumPublishers() > 0) poses_.expect();
    if (poses_.has_source()) {
      const std::optional<BasePose> pose = poses_.latest(points_.stamp_ns);
      state.covariance_world =
          pose ? pose->covariance_world : Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
    } else {
      const double m2 = params_.pose_sigma_m * params_.pose_sigma_m;
      state.covariance_world.diagonal() << m2, m2, params_.pose_sigma_rad * params_.pose_sigma_rad;
    }
    state.speed_m_s = speed_m_s_;
    state.speed_stamp_ns = speed_stamp_ns_;
    return state;
  }

  void take_odometry(const nav_msgs::Odometry& msg) {
    const auto& velocity = msg.twist.twist.linear;
    const double speed_m_s = std::hypot(velocity.x, velocity.y);
    if (!std::isfinite(speed_m_s)) return context_.diagnostics().counted({{"odometry not used", 1}});
    speed_m_s_ = speed_m_s;
    speed_stamp_ns_ = to_nanoseconds(msg.header.stamp);
  }

  void take_pose(const geometry_msgs::PoseWithCovarianceStamped& msg) {
    const bool is_of_world = tf2_frame(msg.header.frame_id) == params_.nodelet.world_frame;
    const std::int64_t stamp_ns = to_nanoseconds(msg.header.stamp);
    if (is_of_world && poses_.add(stamp_ns, base_pose_from_msg(msg))) return;
    if (!is_of_world) poses_.refuse(stamp_ns);
    context_.diagnostics().counted({{"pose not used", 1}});
  }

  /// The latest one, or what the transit begins with.
  const Map& map() const { return map_.map() != nullptr ? *map_.map() : first_map_; }

  /// What the transit begins with, if there was one before: nothing turns into it, and it explains no hit.
  void load_local_maps_of_path() {
    if (params_.local_maps_file.empty()) return;
    if (!std::ifstream(params_.local_maps_file)) {
      ROS_INFO_STREAM(context_.name() << ": there is no " << params_.local_maps_file << " yet");
      return;
    }
    first_map_ = map_of(load_local_maps(params_.local_maps_file, path_.segments()), path_);
  }

  bool save(std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response) {
    try {
      save_local_maps(local_maps(path_, map(), kLocalMapReach_m), params_.local_maps_file);
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
    first_map_ = {};
    poses_.restart();
    speed_m_s_ = std::numeric_limits<double>::quiet_NaN();
  }

  void report(StageDiagnostics::Status& status) {
    status.add("policy", name_of(decision_ != nullptr ? decision_->policy : areas_.params().policy));
    status.add("covariance of the pose", !poses_.has_source() ? "the default: pose never had a publisher"
                                         : decision_ != nullptr && lacks(SafetyInput::kCovariance)
                                             ? "none that can be used: the vehicle stops"
                                             : "that of pose");
    for (const auto verdict :
         {SafetyDecision::Verdict::kFullSpeed, SafetyDecision::Verdict::kSlow, SafetyDecision::Verdict::kStop}) {
      status.add(std::string("verdict: ") + name_of(verdict), verdicts_[static_cast<std::size_t>(verdict)]);
    }
    status.add("features", map().features.size());
    status.add("updates of the map", map_.taken());
    if (decision_ == nullptr) return;
    status.add("verdict", name_of(decision_->verdict));
    status.add("kind", name_of(decision_->kind));
    status.add("id", decision_->id);
    status.add("allowed speed [m/s]", decision_->allowed_speed_m_s);
    status.add("hits that count", decision_->counted);
    status.add("hits on known chains ignored", decision_->ignored);
    std::string missing;
    for (const SafetyInput input : decision_->missing)
      missing += (missing.empty() ? "" : ", ") + std::string(name_of(input));
    status.add("missing", missing.empty() ? "nothing" : missing);
    const auto warn = [&status](const std::string& text) {
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, text);
    };
    if (!missing.empty()) warn("without " + missing);
    const std::string stopped = decision_->kind == SafetyDecision::Kind::kContradiction ? "stopped: " : "";
    if (!areas_.scanner_has_seen_ahead()) {
      const std::string where = areas_.scanner_has_seen() ? " ahead" : "";
      warn(stopped + "the scanner has seen nothing" + where + " yet; it may be blind, or the place empty");
    } else if (!stopped.empty()) {
      warn(stopped + "scan and map contradict each other; the scanner may be blind, or the pose wrong");
    }
    if (decision_->kind == SafetyDecision::Kind::kFrozenScan) warn("stopped: the scanner's driver repeats itself");
  }

  bool lacks(SafetyInput input) const {
    return std::count(decision_->missing.begin(), decision_->missing.end(), input) > 0;
  }

  Context& context_;
  PathNodeletParams params_;
  SplinePath path_;
  SafetyAreas areas_;
  PoseCovariances poses_;
  Scan limited_;
  Points points_;
  Map first_map_;
  double speed_m_s_ = std::numeric_limits<double>::quiet_NaN();  ///< NaN: not known
  std::int64_t speed_stamp_ns_ = 0;
  std::array<std::uint64_t, 3> verdicts_{};
  const SafetyDecision* decision_ = nullptr;
  ros::Publisher publisher_, markers_;
  ros::Subscriber odometry_, pose_;
  ros::ServiceServer save_;
  SemanticMapInput map_;
  tf2_ros::Buffer tf_;
  TransformInput transform_input_;
  Input input_;
};

using SafetyAreasNodelet = StageNodelet<SafetyAreasStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::SafetyAreasNodelet, nodelet::Nodelet)
