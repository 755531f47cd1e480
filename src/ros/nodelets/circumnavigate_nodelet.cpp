// SPDX-License-Identifier: BSD-3-Clause
// odometry, semantic_map/updates, scan, TF base -> lidar  ->  cmd_vel, mission, path, mission_markers
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <geometry_msgs/Twist.h>
#include <nav_msgs/Odometry.h>
#include <nav_msgs/Path.h>
#include <ros/publisher.h>
#include <ros/service_server.h>
#include <ros/subscriber.h>
#include <ros/time.h>
#include <sensor_msgs/LaserScan.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <visualization_msgs/MarkerArray.h>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/path/circumnavigation.hpp"
#include "situation_awareness/ros/convert/mission.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/mission_memory.hpp"
#include "situation_awareness/ros/params/circumnavigate_nodelet_params.hpp"
#include "situation_awareness/ros/receipt.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/semantic_map_input.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"
#include "situation_awareness/ros/transform_input.hpp"

namespace situation_awareness {

class CircumnavigateStage {
 public:
  using Context = StageContext<nav_msgs::Odometry>;
  static constexpr const char* kInput = "odometry";
  static constexpr auto kReadParams = read_circumnavigate_nodelet_params;

  CircumnavigateStage(Context& context, const CircumnavigateNodeletParams& params)
      : context_(context),
        params_(params),
        begin_(mission_begin_from(params.resume)),
        map_(context, params.nodelet.world_frame),
        command_(context.node().advertise<geometry_msgs::Twist>("cmd_vel", 10)),
        status_(context.node().advertise<MissionStatus>("mission", 20)),
        path_(context.node().advertise<nav_msgs::Path>("path", 1, /*latch=*/true)),
        markers_(context.node().advertise<visualization_msgs::MarkerArray>("mission_markers", 5)),
        transform_input_(tf_, context.node()) {
    params.scan.validate();
    if (params.lost_turn_rate_rad_s == 0.0) throw std::invalid_argument("lost_turn_rate_rad_s must not be 0");
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report(status); });
    begin_mission();
    context.every(kLostCheck_s, [this] { turn_if_lost(); });
    context.when_made([this] {
      ros::NodeHandle& node = context_.node();
      const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
      scan_sub_ = node.subscribe("scan", 2, &CircumnavigateStage::on_scan, this, hints);
      plan_ = node.advertiseService("plan_dubins", &CircumnavigateStage::on_plan, this);
      start_ = context_.private_node().advertiseService("start", &CircumnavigateStage::start, this);
    });
  }

  bool process(const nav_msgs::Odometry& msg) {
    const std::string defect = odometry_msg_defect(msg);
    if (!defect.empty()) return context_.drop(defect);
    if (tf2_frame(msg.header.frame_id) != params_.nodelet.world_frame ||
        tf2_frame(msg.child_frame_id) != params_.base_frame) {
      return context_.drop("odometry of other frames", msg.header.frame_id + " -> " + msg.child_frame_id);
    }
    MissionInput input;
    try {
      take_odometry(msg, input);
      input.heading_rad = pose2_of(isometry_from_msg(transform_from_odometry(msg).transform)).yaw_rad;
    } catch (const std::invalid_argument& error) {
      return context_.drop(drop_reason::kBadMessage, error.what());
    }
    const double delay_s = (ros::Time::now() - msg.header.stamp).toSec();
    if (std::abs(delay_s) > kMostDelay_s) {
      return context_.drop("odometry of another time", std::to_string(delay_s) + " s late");
    }
    const StampOrder::Verdict verdict = order_.judge(input.stamp_ns, receipt_ns());
    if (verdict == StampOrder::Verdict::kRefused) return context_.drop(drop_reason::kStamp);
    if (verdict == StampOrder::Verdict::kRestart) set_back();
    odometry_at_ = ros::SteadyTime::now();
    odometry_time_ = ros::Time::now();
    poses_[latest_pose_ = (latest_pose_ + 1) % poses_.size()] = {
        input.stamp_ns, isometry_from_msg(transform_from_odometry(msg).transform)};
    if (last_ns_ && !is_lost_) {
      const double since_s = seconds_between(*last_ns_, input.stamp_ns);
      if (since_s < kPeriod_s - kEarly_s) return true;
      if (since_s > kLongestStep_s) context_.diagnostics().counted({{"steps more than 0.3 s apart", 1}});
    }
    last_ns_ = input.stamp_ns;
    is_lost_ = false;
    step(input);
    return true;
  }

 private:
  static constexpr double kLostCheck_s = 0.02;
  static constexpr double kPeriod_s = 0.1;        // between steps of the mission, at least
  static constexpr double kEarly_s = 1e-3;        // round-off of stamps
  static constexpr double kLongestStep_s = 0.3;   // of Circumnavigation
  static constexpr double kMostPoseAge_s = 0.15;  // against a scan
  static constexpr double kMostDelay_s = 0.5;     // of odometry and scans: at 5 m/s they are 2.5 m off

  struct StampedPose {
    std::int64_t stamp_ns = 0;
    Eigen::Isometry3d T_world_base = Eigen::Isometry3d::Identity();
  };

  void step(MissionInput& input) {
    stepped_at_ = ros::SteadyTime::now();
    input.map = map_.map();
    if (has_beams_ && are_beams_of_base_ == !input.has_pose) input.sight = &beams_;
    has_beams_ = false;
    const MissionStep& step = mission_->step(input);
    has_stepped_ = true;
    if (!begin_) {
      begin_ = MissionBegin{};
      begin_->p_world_m.head<2>() = input.T_world_base.translation_m;
      begin_->stamp_ns = input.stamp_ns;
      remember(context_.private_node(), *begin_);
    }
    state_ = step.state;
    reason_ = step.reason;
    std::size_t nearest = 0;
    clearance_m_ = distance_m(mission_->obstacles(), input.T_world_base.translation_m, &nearest);
    send(step.speed_m_s, step.curvature_1_m * step.speed_m_s);
    context_.publish(status_, mission_to_msg(step, clearance_m_, input.stamp_ns, params_.nodelet.world_frame));
    if (step.path_number != path_number_) {
      path_number_ = step.path_number;
      path_.publish(path_to_msg(mission_->path(), input.stamp_ns, params_.nodelet.world_frame));
    }
    if (markers_.getNumSubscribers() > 0) publish_markers(input.stamp_ns, input.T_world_base.translation_m, nearest);
  }

  void send(double speed_m_s, double turn_rate_rad_s) {
    geometry_msgs::Twist command;
    command.linear.x = speed_m_s;
    command.angular.z = turn_rate_rad_s;
    command_.publish(command);
  }

  /// Since the latest odometry that was used. Where time is simulated, by that; where that stands still, too, by the
  /// steady clock after the timeout.
  double without_odometry_s() const {
    const double steady_s = (ros::SteadyTime::now() - odometry_at_).toSec();
    if (!ros::Time::isSimTime()) return steady_s;
    const double simulated_s = (ros::Time::now() - odometry_time_).toSec();
    return simulated_s >= kLongestStep_s ? simulated_s : steady_s >= params_.timeout_s ? steady_s : 0.0;
  }

  /// A vehicle that cannot stop gets a command, whatever comes: before the first odometry a turn, later that of the
  /// mission by dead reckoning.
  void turn_if_lost() {
    const double since_step_s = (ros::SteadyTime::now() - stepped_at_).toSec();
    if (!has_stepped_) {
      if (since_step_s < kPeriod_s) return;
      stepped_at_ = ros::SteadyTime::now();
      send(0.0, params_.lost_turn_rate_rad_s);
      return;
    }
    const double since_s = without_odometry_s();
    if (since_s < kLongestStep_s || since_step_s < kPeriod_s) return;
    if (!is_lost_) context_.diagnostics().counted({{"no odometry", 1}});
    is_lost_ = true;
    MissionInput input;
    input.has_pose = false;
    input.stamp_ns = order_.latest_ns() + nanoseconds(since_s);
    step(input);
  }

  /// The time was set back. The mission goes on, with all that it knows: a vehicle that flies is where it is, whatever
  /// its clock says. Maps of the old time get old, so it holds until there are others.
  void set_back() {
    has_beams_ = false;
    last_ns_.reset();
    poses_.fill({});
    context_.diagnostics().counted({{"time jumped back: the mission goes on", 1}});
  }

  /// What was free around the first pose of a mission is so for the one that goes on after a crash, not around it.
  void begin_mission() {
    std::optional<Eigen::Vector2d> start_m;
    if (begin_) start_m = begin_->p_world_m.head<2>();
    mission_.emplace(params_.mission, params_.search.places, start_m);
  }

  bool start(std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response) {
    begin_.reset();
    begin_mission();
    has_stepped_ = is_lost_ = false;
    last_ns_.reset();
    path_number_ = 0;
    response.success = 1;
    response.message = "a new mission begins where the vehicle is";
    ROS_INFO_STREAM(context_.name() << ": " << response.message);
    return true;
  }

  void on_scan(const sensor_msgs::LaserScanConstPtr& sent) {
    if (order_.latest_ns() == StampOrder::kNone) return;
    const sensor_msgs::LaserScanConstPtr msg = conventional(sent, params_.scan.scanner);
    const std::string defect = scan_msg_defect(*msg);
    if (!defect.empty()) return scan_not_used(defect);
    if (std::abs((ros::Time::now() - msg->header.stamp).toSec()) > kMostDelay_s)
      return scan_not_used("of another time");
    try {
      const auto mounted = tf_.lookupTransform(params_.base_frame, tf2_frame(msg->header.frame_id), ros::Time(0));
      Eigen::Isometry3d T_beams_lidar = isometry_from_msg(mounted.transform);
      if (!is_lost_) {
        // The odometry whose time is nearest to the middle of the scan.
        const double half_s = 0.5 * static_cast<double>(msg->time_increment) * static_cast<double>(msg->ranges.size());
        const std::int64_t middle_ns =
            to_nanoseconds(msg->header.stamp) + (std::abs(half_s) < 1.0 ? nanoseconds(half_s) : 0);  // not finite: 0
        const StampedPose& pose = *std::min_element(poses_.begin(), poses_.end(), [&](const auto& a, const auto& b) {
          return std::abs(seconds_between(a.stamp_ns, middle_ns)) < std::abs(seconds_between(b.stamp_ns, middle_ns));
        });
        if (std::abs(seconds_between(pose.stamp_ns, middle_ns)) > kMostPoseAge_s) return scan_not_used("no odometry");
        T_beams_lidar = pose.T_world_base * T_beams_lidar;
      }
      if (!free_beams_from_msg(*msg, T_beams_lidar, beams_)) {
        has_beams_ = false;
        return scan_not_used("tilt or limits");
      }
      has_beams_ = true;
      are_beams_of_base_ = is_lost_;
      scan_ns_ = to_nanoseconds(msg->header.stamp);
    } catch (const tf2::TransformException&) {
      scan_not_used(drop_reason::kNoTransform);
    } catch (const std::exception&) {  // not a rotation
      scan_not_used(drop_reason::kBadTransform);
    }
  }

  void scan_not_used(const std::string& reason) { context_.diagnostics().counted({{"scans not used: " + reason, 1}}); }

  bool on_plan(PlanDubins::Request& request, PlanDubins::Response& response) {
    plan_dubins(request, response);
    return true;
  }

  void publish_markers(std::int64_t stamp_ns, const Eigen::Vector2d& p_world_m, std::size_t nearest) {
    visualization_msgs::MarkerArray array;
    const auto begin = [&](const char* ns, float r, float g, float b, double width_m) -> visualization_msgs::Marker& {
      array.markers.emplace_back();
      visualization_msgs::Marker& marker = array.markers.back();
      marker.header.stamp = to_ros_time(stamp_ns);
      marker.header.frame_id = params_.nodelet.world_frame;
      marker.ns = ns;
      marker.type = visualization_msgs::Marker::LINE_STRIP;
      marker.action = visualization_msgs::Marker::ADD;
      marker.pose.orientation.w = 1.0;
      marker.scale.x = width_m;
      marker.color.r = r;
      marker.color.g = g;
      marker.color.b = b;
      marker.color.a = 1.0F;
      return marker;
    };
    const auto add = [&](const char* ns, const SegmentPath& path, float r, float g, float b, double width_m) {
      visualization_msgs::Marker& marker = begin(ns, r, g, b, width_m);
      for (const geometry_msgs::PoseStamped& pose : path_to_msg(path, stamp_ns, params_.nodelet.world_frame).poses) {
        marker.points.push_back(pose.pose.position);
      }
      if (marker.points.size() < 2) marker.action = visualization_msgs::Marker::DELETE;
    };
    add("path", mission_->path(), 0.1F, 0.6F, 1.0F, 0.3);
    add("way_out", mission_->way_out(), 1.0F, 0.6F, 0.1F, 0.15);
    add("orbit", mission_->orbit(), 0.4F, 0.8F, 0.4F, 0.15);
    // To what is nearest, red where that is nearer than the clearance.
    const bool is_near = clearance_m_ < params_.mission.avoidance.clearance_m;
    visualization_msgs::Marker& line =
        begin("clearance", is_near ? 0.9F : 0.4F, is_near ? 0.1F : 0.4F, is_near ? 0.1F : 0.4F, 0.1);
    visualization_msgs::Marker text = line;
    text.ns = "clearance_text";
    text.type = visualization_msgs::Marker::TEXT_VIEW_FACING;
    text.scale.z = 2.0;
    if (std::isfinite(clearance_m_)) {
      const Curve& curve = mission_->obstacles().pieces()[nearest].curve;
      const Eigen::Vector2d to_m = point_at(curve, nearest_m(curve, p_world_m)), middle_m = 0.5 * (p_world_m + to_m);
      line.points.resize(2);
      line.points[0].x = p_world_m.x();
      line.points[0].y = p_world_m.y();
      line.points[1].x = to_m.x();
      line.points[1].y = to_m.y();
      text.pose.position.x = middle_m.x();
      text.pose.position.y = middle_m.y();
      std::array<char, 32> metres{};
      std::snprintf(metres.data(), metres.size(), "%.1f m", clearance_m_);
      text.text = metres.data();
    } else {
      line.action = text.action = visualization_msgs::Marker::DELETE;
    }
    array.markers.push_back(text);
    markers_.publish(array);
  }

  void report(StageDiagnostics::Status& status) {
    status.add("state", name_of(state_));
    status.add("reason", reason_);
    status.add("clearance [m]", clearance_m_);
    const std::vector<Splinegon>& boundaries = mission_->boundaries();
    status.add("boundaries", boundaries.size());
    status.add("closed", std::count_if(boundaries.begin(), boundaries.end(),
                                       [](const Splinegon& boundary) { return boundary.closed; }));
    if (!last_ns_) return;
    const auto warn = [&status](const std::string& text) {
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, text);
    };
    const Map* map = map_.map();
    if (map == nullptr) {
      warn("no map yet");
    } else if (seconds_between(map->stamp_ns, *last_ns_) > params_.mission.max_map_age_s) {
      warn("the map is old");
    }
    if (seconds_between(scan_ns_, *last_ns_) > params_.mission.max_scan_age_s)
      warn("no scan: nothing more is seen to be free");
    if (state_ == MissionState::kHold) warn("holding: " + reason_);
  }

  Context& context_;
  CircumnavigateNodeletParams params_;
  std::optional<Circumnavigation> mission_;
  std::optional<MissionBegin> begin_;
  StampOrder order_;
  std::array<StampedPose, 64> poses_;
  std::size_t latest_pose_ = 0;
  SemanticMapInput map_;
  FreeBeams beams_;
  bool has_beams_ = false, are_beams_of_base_ = false;  ///< in its frame, for want of a pose
  std::optional<std::int64_t> last_ns_;                 ///< of the latest step with a pose
  std::int64_t scan_ns_ = 0;
  bool has_stepped_ = false, is_lost_ = false;
  ros::SteadyTime odometry_at_, stepped_at_;  ///< the latest odometry that was used, the latest step
  ros::Time odometry_time_;
  MissionState state_ = MissionState::kHold;
  std::string reason_ = "no odometry yet";
  double clearance_m_ = 0.0;
  std::uint64_t path_number_ = 0;
  ros::Publisher command_, status_, path_, markers_;
  ros::Subscriber scan_sub_;
  ros::ServiceServer plan_, start_;
  tf2_ros::Buffer tf_;
  TransformInput transform_input_;
};

using CircumnavigateNodelet = StageNodelet<CircumnavigateStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::CircumnavigateNodelet, nodelet::Nodelet)
