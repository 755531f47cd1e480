// SPDX-License-Identifier: BSD-3-Clause
// odometry, targets, grid, semantic_map/updates  ->  go_to, scout, scout_markers, flight_done
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include <geometry_msgs/PoseStamped.h>
#include <nav_msgs/OccupancyGrid.h>
#include <nav_msgs/Odometry.h>
#include <ros/publisher.h>
#include <ros/service_server.h>
#include <ros/subscriber.h>
#include <ros/time.h>
#include <std_msgs/Empty.h>
#include <std_srvs/Trigger.h>
#include <visualization_msgs/MarkerArray.h>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/TargetArray.h"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/map/grid/elevation_file.hpp"
#include "situation_awareness/path/scouting.hpp"
#include "situation_awareness/ros/convert/grid.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scouting.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/markers/scout_markers.hpp"
#include "situation_awareness/ros/mission_memory.hpp"
#include "situation_awareness/ros/params/scout_nodelet_params.hpp"
#include "situation_awareness/ros/receipt.hpp"
#include "situation_awareness/ros/semantic_map_input.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"

namespace situation_awareness {

class ScoutStage {
 public:
  using Context = StageContext<nav_msgs::Odometry>;
  static constexpr const char* kInput = "odometry";
  static constexpr auto kReadParams = read_scout_nodelet_params;

  ScoutStage(Context& context, const ScoutNodeletParams& params)
      : context_(context),
        params_(params),
        before_(mission_begin_from(params.resume)),
        map_(context, params.nodelet.world_frame),
        go_to_(context.node().advertise<geometry_msgs::PoseStamped>("go_to", 5)),
        status_(context.node().advertise<ScoutStatus>("scout", 20)),
        markers_(context.node().advertise<visualization_msgs::MarkerArray>("scout_markers", 5)),
        done_(context.node().advertise<std_msgs::Empty>("flight_done", 1, /*latch=*/true)) {
    params.scouting.validate();
    if (!params.elevation.dem.empty()) {
      const auto file = std::make_shared<ElevationFile>(elevation_source(params.elevation, "origin"));
      ground_ = [file](double x_world_m, double y_world_m) {
        return file->around({x_world_m, y_world_m}, kGround_m, kGroundPixel_m)->at(x_world_m, y_world_m);
      };
    }
    context.keep_all();
    order_.trust();  // a stamp far from now is dropped, and the mission's clock takes no single jump
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report(status); });
    context.when_made([this] {
      ros::NodeHandle& node = context_.node();
      const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
      targets_sub_ = node.subscribe("targets", 20, &ScoutStage::on_targets, this, hints);
      grid_sub_ = node.subscribe("grid", 1, &ScoutStage::on_grid, this, hints);
      start_ = context_.private_node().advertiseService("start", &ScoutStage::start, this);
      go_home_ = context_.private_node().advertiseService("go_home", &ScoutStage::go_home, this);
    });
  }

  bool process(const nav_msgs::Odometry& msg) {
    const std::string defect = odometry_msg_defect(msg);
    if (!defect.empty()) return context_.drop(defect);
    if (tf2_frame(msg.header.frame_id) != params_.nodelet.world_frame ||
        tf2_frame(msg.child_frame_id) != params_.base_frame) {
      return context_.drop("odometry of other frames", msg.header.frame_id + " -> " + msg.child_frame_id);
    }
    const Eigen::Isometry3d T_world_base = isometry_from_msg(transform_from_odometry(msg).transform);
    const std::int64_t stamp_ns = to_nanoseconds(msg.header.stamp);
    const double delay_s = (ros::Time::now() - msg.header.stamp).toSec();
    if (std::abs(delay_s) > kMostDelay_s) {
      return context_.drop("odometry of another time", std::to_string(delay_s) + " s late");
    }
    const StampOrder::Verdict verdict = order_.judge(stamp_ns, receipt_ns());
    if (verdict == StampOrder::Verdict::kRefused) return context_.drop(drop_reason::kStamp);
    if (verdict == StampOrder::Verdict::kRestart) set_back();
    odometry_at_ = ros::SteadyTime::now();
    const StampedPose& pose = poses_[latest_pose_ = (latest_pose_ + 1) % poses_.size()] = {
        stamp_ns, T_world_base.translation(), pose2_of(T_world_base).yaw_rad};
    if (last_ns_) {
      const double since_s = seconds_between(*last_ns_, stamp_ns);
      if (since_s >= 0.0 && since_s < kPeriod_s - kEarly_s) return true;
    }
    last_ns_ = stamp_ns;
    if (!scouting_ && !begin_mission(pose)) {
      context_.publish(status_, scouting_to_msg(step_, stamp_ns, params_.nodelet.world_frame));
      return true;
    }
    ScoutingInput input;
    input.stamp_ns = stamp_ns;
    input.p_world_m = pose.p_world_m;
    input.yaw_rad = pose.yaw_rad;
    input.targets = &targets_;
    input.sees = has_targets_ && std::abs(seconds_between(targets_.stamp_ns, stamp_ns)) <= params_.timeout_s;
    if (has_new_grid_) input.grid = &grid_;
    if (takes_obstacles(stamp_ns)) input.obstacles = &obstacles_;
    step_ = scouting_->step(input);
    has_new_grid_ = false;
    context_.publish(go_to_, go_to_msg(step_, stamp_ns, params_.nodelet.world_frame));
    context_.publish(status_, scouting_to_msg(step_, stamp_ns, params_.nodelet.world_frame));
    if (step_.state == ScoutingState::kDone && !is_done_) {
      is_done_ = true;
      begin_.is_over = true;
      remember(context_.private_node(), begin_);
      done_.publish(std_msgs::Empty());
      ROS_INFO_STREAM(context_.name() << ": home after " << step_.elapsed_s << " s with " << step_.targets
                                      << " targets and " << step_.close_ups << " close-ups");
    }
    if (markers_.getNumSubscribers() > 0) {
      markers_.publish(
          scout_markers(*scouting_, step_, pose.p_world_m, ground_, stamp_ns, params_.nodelet.world_frame));
    }
    return true;
  }

 private:
  static constexpr double kGround_m = 500.0;      // around a place, whose ground is looked at at once
  static constexpr double kGroundPixel_m = 0.5;   // no finer
  static constexpr double kPeriod_s = 0.25;       // between steps of the mission, at least
  static constexpr double kMapPeriod_s = 2.0;     // between looks at the maps of what stands around, at least
  static constexpr double kEarly_s = 1e-3;        // round-off of stamps
  static constexpr double kMostPoseAge_s = 0.15;  // against an image
  static constexpr double kMostDelay_s = 0.5;     // of odometry: at 6 m/s it is 3 m off

  struct StampedPose {
    std::int64_t stamp_ns = 0;
    Eigen::Vector3d p_world_m = Eigen::Vector3d::Zero();
    double yaw_rad = 0.0;
  };

  /// A mission that a crash interrupted goes on, home where it was and with what is left of its budget; one that was
  /// over stays so. Else home is here, with the first targets.
  bool begin_mission(const StampedPose& pose) {
    step_ = {};
    const double spent_s = before_ ? seconds_between(before_->stamp_ns, pose.stamp_ns) : -1.0;
    const bool is_recent = spent_s >= 0.0 && spent_s < params_.scouting.budget_s;
    if (is_recent && before_->is_over) {
      step_.reason = "the mission was over before the stage was started again";
      return false;
    }
    if (is_recent) {
      begin_ = *before_;
      scouting_.emplace(params_.scouting, begin_.p_world_m, ground_, spent_s);
      return true;
    }
    if (!has_targets_) {
      step_.reason = "no targets yet";
      return false;
    }
    begin_ = {pose.p_world_m, pose.stamp_ns, false};
    remember(context_.private_node(), begin_);
    scouting_.emplace(params_.scouting, begin_.p_world_m, ground_);
    return true;
  }

  /// From where it is, with what it knows.
  void begin() {
    scouting_.reset();
    last_ns_.reset();
    obstacles_ns_.reset();
    is_done_ = false;
  }

  /// The time was set back. Home, budget and all that was found stay: a vehicle that flies is where it is, whatever its
  /// clock says. A new mission begins by the service `start` alone.
  void set_back() {
    last_ns_.reset();
    obstacles_ns_.reset();
    poses_.fill({});
    context_.diagnostics().counted({{"time jumped back: the mission goes on", 1}});
  }

  /// Each image that was mapped has its targets.
  void on_targets(const TargetArrayConstPtr& msg) {
    try {
      check_frame(msg->header.frame_id, "targets");
      GridTargets targets = grid_targets_from_msg(*msg);
      if (last_ns_ && std::abs(seconds_between(targets.stamp_ns, *last_ns_)) > params_.timeout_s) {
        context_.drop("targets of another time");
        return;
      }
      targets_ = std::move(targets);
      has_targets_ = true;
    } catch (const std::exception& error) {
      context_.drop(drop_reason::kBadMap, error.what());
      return;
    }
    if (!scouting_) return;
    const StampedPose& pose = *std::min_element(poses_.begin(), poses_.end(), [&](const auto& a, const auto& b) {
      return std::abs(seconds_between(a.stamp_ns, targets_.stamp_ns)) <
             std::abs(seconds_between(b.stamp_ns, targets_.stamp_ns));
    });
    if (std::abs(seconds_between(pose.stamp_ns, targets_.stamp_ns)) > kMostPoseAge_s) {
      context_.diagnostics().counted({{"images without odometry", 1}});
      return;
    }
    scouting_->add_image(pose.p_world_m, pose.yaw_rad);
  }

  void on_grid(const nav_msgs::OccupancyGridConstPtr& msg) {
    try {
      check_frame(msg->header.frame_id, "grid");
      grid_ = grid_from_msg(*msg);
      has_new_grid_ = true;
    } catch (const std::exception& error) {
      context_.drop(drop_reason::kBadMap, error.what());
    }
  }

  void check_frame(const std::string& frame_id, const char* kind) const {
    if (tf2_frame(frame_id) != params_.nodelet.world_frame) {
      throw std::invalid_argument(std::string(kind) + " in the frame " + frame_id);
    }
  }

  /// Whether there are other obstacles than before.
  bool takes_obstacles(std::int64_t stamp_ns) {
    if (obstacles_ns_ && (map_.taken() == updates_taken_ || seconds_between(*obstacles_ns_, stamp_ns) < kMapPeriod_s)) {
      return false;
    }
    if (!obstacles_ns_ && map_.taken() == 0) return false;
    obstacles_ns_ = stamp_ns;
    updates_taken_ = map_.taken();
    obstacles_.clear();
    for (const Feature& feature : map_.map()->features) obstacles_.add(feature);
    return true;
  }

  bool start(std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response) {
    before_.reset();
    begin();
    response.success = 1;
    response.message = "a new mission begins where the vehicle is";
    ROS_INFO_STREAM(context_.name() << ": " << response.message);
    return true;
  }

  bool go_home(std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response) {
    if (scouting_) scouting_->go_home();
    response.success = scouting_ ? 1 : 0;
    response.message = scouting_ ? "on the way home" : "there is no mission yet";
    ROS_INFO_STREAM(context_.name() << ": " << response.message);
    return true;
  }

  void report(StageDiagnostics::Status& status) {
    status.add("state", name_of(step_.state));
    status.add("reason", step_.reason);
    status.add("budget left [s]", step_.left_s);
    status.add("way home [s]", step_.home_s);
    status.add("targets", step_.targets);
    status.add("close-ups", step_.close_ups);
    status.add("targets not found yet", step_.expected_left);
    if (!last_ns_) return;
    const auto warn = [&status](const std::string& text) {
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, text);
    };
    if (!has_targets_) {
      warn("no targets yet");
    } else if (std::abs(seconds_between(targets_.stamp_ns, *last_ns_)) > params_.timeout_s) {
      warn("targets are old: the camera sees nothing more");
    }
    if ((ros::SteadyTime::now() - odometry_at_).toSec() > params_.timeout_s) {
      warn("no odometry: the vehicle is left at its last goal");
    }
    if (scouting_ && step_.state == ScoutingState::kHold) warn("holding: " + step_.reason);
    if (scouting_ && !is_done_ && step_.home_s > step_.left_s) warn("the budget is not enough for the way home");
  }

  Context& context_;
  ScoutNodeletParams params_;
  std::function<double(double, double)> ground_;  ///< empty: level
  std::optional<Scouting> scouting_;
  std::optional<MissionBegin> before_;  ///< of the mission that ran when the stage ended, if one did
  MissionBegin begin_;
  StampOrder order_;
  std::array<StampedPose, 256> poses_;
  std::size_t latest_pose_ = 0;
  SemanticMapInput map_;
  GridTargets targets_;
  SemanticGrid grid_;
  Obstacles obstacles_;
  bool has_targets_ = false, has_new_grid_ = false, is_done_ = false;
  std::optional<std::int64_t> last_ns_, obstacles_ns_;
  std::uint64_t updates_taken_ = 0;  ///< by the obstacles
  ros::SteadyTime odometry_at_;      ///< the latest that was used
  ScoutingStep step_;
  ros::Publisher go_to_, status_, markers_, done_;
  ros::Subscriber targets_sub_, grid_sub_;
  ros::ServiceServer start_, go_home_;
};

using ScoutNodelet = StageNodelet<ScoutStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::ScoutNodelet, nodelet::Nodelet)
