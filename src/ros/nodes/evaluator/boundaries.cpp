// SPDX-License-Identifier: BSD-3-Clause
// The boundaries of `semantic_map/updates`, `odometry` and `fix` against the truth. A flight ends by `flight_done`, or
// when its `mission` is done.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <geometry_msgs/PoseStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/NavSatFix.h>
#include <std_msgs/Empty.h>

#include "situation_awareness/MissionStatus.h"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/evaluation/boundary_evaluation.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/path/large_obstacles.hpp"
#include "situation_awareness/pose/local_world.hpp"
#include "situation_awareness/ros/convert/navigation_sensors.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/time.hpp"

#include "../simulated_robot.hpp"
#include "evaluation.hpp"

namespace situation_awareness {
namespace {

constexpr double kLastMapOfFlight_s = 0.5;  ///< after the end of the flight: the map of its last scan has come
constexpr double kLarge_m = 2.5;            ///< diagonal from which on outlines of lines are judged, too
constexpr std::size_t kEveryPose = 10;      ///< so many poses per one that is compared

struct BoundaryEvaluatorParams {
  std::string world = kDefaultWorld;
  int rounds = 0;
  double duration_s = 0.0;
  double max_duration_s = 600.0;
  double max_hausdorff_m = 3.0;
  double max_mean_m = 2.0;
  double max_area_part = 0.04;
  double min_in_envelope_part = 0.98;
  double max_position_part = 1.0;
  double min_clearance_m = 1.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("world", self.world, "name of a world in models/worlds, or a path: its outlines are the truth");
    visit("rounds", self.rounds, Bounds{0, 1000}, "", "of the world's rounds those that are flown; 0: all");
    visit("duration_s", self.duration_s, Bounds{0.0, 1e6}, "s",
          "simulated time after which the boundaries are judged; 0: when flight_done comes, or mission is done");
    visit("max_duration_s", self.max_duration_s, Bounds{1.0, 1e6}, "s", "a flight that takes longer has got lost");
    visit("max_hausdorff_m", self.max_hausdorff_m, Bounds{0.0, 1e3}, "m", "largest Hausdorff distance");
    visit("max_mean_m", self.max_mean_m, Bounds{0.0, 1e3}, "m", "largest mean distance");
    visit("max_area_part", self.max_area_part, Bounds{0.0, 1e3}, "", "largest error of an area, over that");
    visit("min_in_envelope_part", self.min_in_envelope_part, Bounds{0.0, 1.0}, "",
          "least part of all outlines in the 99 % envelopes");
    visit("max_position_part", self.max_position_part, Bounds{0.0, 1e3}, "",
          "largest RMS error of the positions, over that of the fixes");
    visit("min_clearance_m", self.min_clearance_m, Bounds{0.0, 1e3}, "m", "least true distance from what stands");
  }
};

/// Errors in the plane.
struct Errors {
  std::size_t count = 0;
  double square_sum = 0.0;

  void add(double error) {
    ++count;
    square_sum += error * error;
  }
  double rms() const { return std::sqrt(square_sum / static_cast<double>(count)); }  ///< NaN without any
};

class BoundaryEvaluator : public Evaluation {
 public:
  explicit BoundaryEvaluator(const EvaluationInputs& inputs)
      : params_(inputs.params.read<BoundaryEvaluatorParams>(inputs.on_unknown_key)),
        node_(inputs.node),
        world_(inputs.world) {
    if (!world_.origin()) throw std::runtime_error(world_.path() + ": it has no world_origin");
    true_pose_ = node_.subscribe("true_pose", 500, &BoundaryEvaluator::on_true_pose, this);
    odometry_ = node_.subscribe("odometry", 500, &BoundaryEvaluator::on_odometry, this);
    fix_ = node_.subscribe("fix", 100, &BoundaryEvaluator::on_fix, this);
    updates_ = node_.subscribe("semantic_map/updates", 20, &BoundaryEvaluator::on_update, this);
    done_ = node_.subscribe<std_msgs::Empty>("flight_done", 1, [this](const std_msgs::EmptyConstPtr&) {
      if (params_.duration_s == 0.0) end_after(kLastMapOfFlight_s);
    });
    mission_ = node_.subscribe<MissionStatus>("mission", 20, [this](const MissionStatusConstPtr& msg) {
      latest_mission_ = msg;
      if (params_.duration_s == 0.0 && msg->state == MissionStatus::DONE) end_after(kLastMapOfFlight_s);
    });
  }

  void report(Verdict& verdict) const override {
    const std::vector<TrueObstacle> all_obstacles = obstacles();
    const std::vector<BoundaryScore> scores = score_boundaries(all_obstacles, near(all_obstacles));
    std::printf("%s", format_table(scores).c_str());
    BoundaryScore worst;
    double inside = 0.0;
    std::size_t closed = 0, boundaries = 0;
    for (const BoundaryScore& score : scores) {
      // max keeps its first argument where the other one is NaN
      const auto raise = [](double& most, double value) { most = std::isnan(value) ? value : std::max(value, most); };
      raise(worst.hausdorff_m, score.hausdorff_m);
      raise(worst.mean_m, score.mean_m);
      raise(worst.area_part, std::abs(score.area_part));
      inside += score.in_envelope_part / static_cast<double>(scores.size());
      closed += score.closed ? 1 : 0;
      boundaries += score.boundaries;
    }
    if (position_.count > 0) {
      std::printf("position, RMS: %.2f m (%zu poses), by GPS alone %.2f m (%zu fixes); yaw, RMS: %.2f deg\n",
                  position_.rms(), position_.count, fixes_.rms(), fixes_.count, degrees(yaw_.rms()));
    }
    if (latest_mission_) {
      std::printf("mission: %u boundaries done, %u boundaries and places given up; %s\n", latest_mission_->done,
                  latest_mission_->given_up, latest_mission_->reason.c_str());
    }
    if (!finished_) verdict.fail("the flight did not come to its end");
    const auto all = static_cast<double>(scores.size());
    verdict.at_least("obstacles with a closed boundary", static_cast<double>(closed), all);
    verdict.at_most("boundaries", static_cast<double>(boundaries), all);
    verdict.at_most("largest Hausdorff distance", worst.hausdorff_m, params_.max_hausdorff_m, "m");
    verdict.at_most("largest mean distance", worst.mean_m, params_.max_mean_m, "m");
    verdict.at_most("largest error of an area", 100.0 * worst.area_part, 100.0 * params_.max_area_part, "%");
    verdict.at_least("outlines in the 99 % envelopes", inside, params_.min_in_envelope_part);
    if (position_.count > 0) {  // else the pose is the true one
      verdict.at_most("RMS of the position over that of GPS", position_.rms() / fixes_.rms(),
                      params_.max_position_part);
    }
    verdict.at_least("least distance from what stands", least_clearance_m_, params_.min_clearance_m, "m");
  }

 private:
  /// The boundaries that are of these: where all are flown around, every one counts.
  Splinegons near(const std::vector<TrueObstacle>& obstacles) const {
    Splinegons result;
    result.boundaries = outlines_of_large_obstacles(map_.map(), kLarge_m);
    if (params_.rounds == 0) return result;
    const auto is_elsewhere = [&](const Splinegon& boundary) {
      constexpr double kNear_m = 5.0;
      return std::none_of(obstacles.begin(), obstacles.end(), [&](const TrueObstacle& obstacle) {
        return std::any_of(obstacle.outline_world_m.begin(), obstacle.outline_world_m.end(),
                           [&](const Eigen::Vector2d& p_m) { return distance_m(boundary, p_m) < kNear_m; });
      });
    };
    result.boundaries.erase(std::remove_if(result.boundaries.begin(), result.boundaries.end(), is_elsewhere),
                            result.boundaries.end());
    return result;
  }

  /// The objects around which it flies.
  std::vector<TrueObstacle> obstacles() const {
    constexpr int kSides = 720;  // of an ellipse: of 10 m they are 0.1 mm off it
    std::vector<Eigen::Vector3d> rounds = world_.rounds();
    if (params_.rounds > 0) rounds.resize(std::min(rounds.size(), static_cast<std::size_t>(params_.rounds)));
    std::vector<TrueObstacle> result;
    for (const TrueObject& object : world_.objects_at(0.0)) {
      const Eigen::Vector2d& at_m = object.T_world_object.translation_m;
      if (std::any_of(rounds.begin(), rounds.end(),
                      [&](const Eigen::Vector3d& round) { return (round.head<2>() - at_m).norm() < round.z(); })) {
        result.push_back({world_.names()[object.id - 1],
                          object.ellipse_world ? points_on(*object.ellipse_world, kSides) : object.footprint_world_m});
      }
    }
    return result;
  }

  void on_true_pose(const geometry_msgs::PoseStampedConstPtr& msg) {
    truths_.add(to_nanoseconds(msg->header.stamp), pose2_of(msg->pose));
    if (begin_.isZero()) {
      begin_ = msg->header.stamp;
      things_ = world_.outlines_at(0.0, msg->pose.position.z);
    }
    measure_clearance({msg->pose.position.x, msg->pose.position.y});
    const double since_s = (msg->header.stamp - begin_).toSec();
    if (params_.duration_s > 0.0 && since_s >= params_.duration_s) end_after(kLastMapOfFlight_s);
    if (since_s > params_.max_duration_s) ros::shutdown();
    compare();
  }

  void measure_clearance(const Eigen::Vector2d& p_m) {
    for (const TrueOutline& thing : things_) {
      if (thing.can_move || !thing.is_there) continue;
      const std::vector<Eigen::Vector2d>& points = thing.points_world_m;
      for (std::size_t i = 0; i < points.size(); ++i) {
        const Eigen::Vector2d way_m = points[(i + 1) % points.size()] - points[i];
        const double part = std::clamp((p_m - points[i]).dot(way_m) / std::max(way_m.squaredNorm(), 1e-12), 0.0, 1.0);
        least_clearance_m_ = std::min(least_clearance_m_, (points[i] + part * way_m - p_m).norm());
      }
    }
  }

  void on_odometry(const nav_msgs::OdometryConstPtr& msg) {
    if (received_poses_++ % kEveryPose == 0) poses_.push_back(msg);
    if (poses_.size() > kMaxWaiting) poses_.pop_front();
  }

  void on_fix(const sensor_msgs::NavSatFixConstPtr& msg) {
    waiting_fixes_.push_back(msg);
    if (waiting_fixes_.size() > kMaxWaiting) waiting_fixes_.pop_front();
  }

  void on_update(const MapUpdateConstPtr& msg) {
    if (!finished_) apply(*msg, map_);
  }

  void compare() {
    while (!poses_.empty()) {
      const auto truth = truths_.at(to_nanoseconds(poses_.front()->header.stamp));
      if (!truth) break;
      const Pose2 pose = pose2_of(poses_.front()->pose.pose);
      position_.add((pose.translation_m - truth->translation_m).norm());
      yaw_.add(wrap_to_pi(pose.yaw_rad - truth->yaw_rad));
      poses_.pop_front();
    }
    while (!waiting_fixes_.empty()) {
      const auto truth = truths_.at(to_nanoseconds(waiting_fixes_.front()->header.stamp));
      if (!truth) break;
      const GeodeticFix fix = fix_from_msg(*waiting_fixes_.front());
      waiting_fixes_.pop_front();
      if (!fix.is_fix || !is_valid(fix.position)) continue;
      const WorldOrigin& origin = *world_.origin();
      const Eigen::Vector3d p_m =
          local_position({origin.latitude_deg, origin.longitude_deg, origin.altitude_m}, fix.position);
      fixes_.add((p_m.head<2>() - truth->translation_m).norm());
    }
  }

  void end_after(double seconds) {
    if (end_) return;
    end_ = node_.createTimer(
        ros::Duration(seconds),
        [this](const ros::TimerEvent&) {
          finished_ = true;
          ros::shutdown();
        },
        /*oneshot=*/true);
  }

  BoundaryEvaluatorParams params_;
  ros::NodeHandle node_;
  const World& world_;
  ros::Time begin_;
  bool finished_ = false;
  MapReplica map_;
  TruePoses truths_;
  std::deque<nav_msgs::OdometryConstPtr> poses_;
  std::deque<sensor_msgs::NavSatFixConstPtr> waiting_fixes_;
  std::size_t received_poses_ = 0;
  Errors position_, yaw_, fixes_;
  std::vector<TrueOutline> things_;
  double least_clearance_m_ = std::numeric_limits<double>::infinity();
  MissionStatusConstPtr latest_mission_;
  ros::Subscriber true_pose_, odometry_, fix_, updates_, done_, mission_;
  ros::Timer end_;
};

}  // namespace

std::unique_ptr<Evaluation> evaluate_boundaries(const EvaluationInputs& inputs) {
  return std::make_unique<BoundaryEvaluator>(inputs);
}

}  // namespace situation_awareness
