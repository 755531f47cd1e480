// SPDX-License-Identifier: BSD-3-Clause
// `pose` and the map of `semantic_map/updates` against the truth, transit by transit.
#include <algorithm>
#include <cmath>
#include <deque>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include "situation_awareness/Transit.h"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/evaluation/transit_evaluation.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/time.hpp"

#include "../simulated_robot.hpp"
#include "evaluation.hpp"

namespace situation_awareness {
namespace {

constexpr double kLastMapOfTransit_s = 1.0;  ///< after the end of a transit: the map of its last scan has come
constexpr std::size_t kEveryScan = 5;        ///< so many scans per one that marks what was seen
constexpr double kSpacing_m = 0.1;           ///< of the places along a boundary

struct TransitEvaluatorParams {
  std::string world = kDefaultWorld;
  bool localization = true;
  std::string base_frame = "base_link";
  double max_transit_s = 180.0;
  double max_mean_distance_m = 0.006;
  double max_distance_m = 0.06;
  double max_false_m = 0.1;
  double min_coverage = 0.98;
  double min_found = 0.97;
  double max_position_rms_m = 0.0035;
  double max_yaw_rms_rad = 0.0015;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("world", self.world, "name of a world in models/worlds, or a path: its robot is a unicycle");
    visit("localization", self.localization, "judge the poses, too");
    visit("base_frame", self.base_frame, "frame of the vehicle");
    visit("max_transit_s", self.max_transit_s, Bounds{1.0, 1e6}, "s", "a vehicle that takes longer has got stuck");
    visit("max_mean_distance_m", self.max_mean_distance_m, Bounds{0.0, 1e3}, "m",
          "largest mean distance of the chains from the truth, of any transit");
    visit("max_distance_m", self.max_distance_m, Bounds{0.0, 1e3}, "m",
          "greatest distance of a chain from the truth, of any transit");
    visit("max_false_m", self.max_false_m, Bounds{0.0, 1e3}, "m", "longest false chains after any transit");
    visit("min_coverage", self.min_coverage, Bounds{0.0, 1.0}, "", "least part of what was seen that is on the map");
    visit("min_found", self.min_found, Bounds{0.0, 1.0}, "",
          "least part of the things in sight that are on the map, and of those gone that are not, of all transits");
    visit("max_position_rms_m", self.max_position_rms_m, Bounds{0.0, 1e3}, "m", "largest RMS error of the positions");
    visit("max_yaw_rms_rad", self.max_yaw_rms_rad, Bounds{0.0, 10.0}, "rad", "largest RMS error of the yaws");
  }
};

std::vector<TransitThing> things_of(const Transit& transit) {
  std::vector<TransitThing> things;
  for (const ThingOutline& outline : transit.outlines) {
    auto thing = std::find_if(things.begin(), things.end(),
                              [&outline](const TransitThing& known) { return known.name == outline.thing; });
    if (thing == things.end()) {
      things.push_back({outline.thing, false, false, outline.thing.rfind("reflector", 0) == 0, {}});
      thing = std::prev(things.end());
    }
    thing->is_there = thing->is_there || outline.is_there;
    thing->can_move = thing->can_move || outline.can_move;
    thing->outlines_world_m.emplace_back();
    for (const geometry_msgs::Point& p : outline.vertices) thing->outlines_world_m.back().emplace_back(p.x, p.y);
  }
  return things;
}

/// Polylines and boundaries.
Polygons chains_of(MapLayers& layers) {
  Polygons chains = std::move(layers.polygons);
  for (const Splinegon& boundary : layers.boundaries.boundaries) {
    Chain& chain = chains.chains.emplace_back();
    chain.id = boundary.id;
    chain.closed = boundary.closed;
    chain.vertices = lines_along(boundary, kSpacing_m);
  }
  return chains;
}

/// The outlines of standing bodies.
Polygons bodies_of(const MapLayers& layers) {
  Polygons outlines;
  for (const Object& object : layers.objects.objects) {
    if (object.p_moving >= 0.5 || object.object_class == ObjectClass::kPerson) continue;
    Chain& chain = outlines.chains.emplace_back();
    chain.id = object.id;
    chain.closed = true;
    for (const Eigen::Vector2d& p_world_m : outline_world(object)) chain.vertices.push_back({p_world_m, 0.0});
  }
  return outlines;
}

class TransitEvaluator : public Evaluation {
 public:
  explicit TransitEvaluator(const EvaluationInputs& inputs)
      : params_(inputs.params.read<TransitEvaluatorParams>(inputs.on_unknown_key)),
        node_(inputs.node),
        tf_listener_(tf_) {
    transit_ = node_.subscribe("transit", 20, &TransitEvaluator::on_transit, this);
    true_pose_ = node_.subscribe("true_pose", 500, &TransitEvaluator::on_true_pose, this);
    scan_ = node_.subscribe("scan", 500, &TransitEvaluator::on_scan, this);
    pose_ = node_.subscribe("pose", 500, &TransitEvaluator::on_pose, this);
    updates_ = node_.subscribe("semantic_map/updates", 20, &TransitEvaluator::on_update, this);
    watch_ = node_.createTimer(ros::Duration(1.0), [this](const ros::TimerEvent&) { watch(); });
  }

  void report(Verdict& verdict) const override {
    std::printf("%s", format_table(scores_).c_str());
    TransitScore worst;
    std::size_t right = 0, all = 0;
    worst.coverage = 1.0;
    for (const TransitScore& score : scores_) {
      // max keeps its first argument where the other one is NaN
      const auto raise = [](double& most, double value) { most = std::isnan(value) ? value : std::max(value, most); };
      raise(worst.mean_distance_m, score.mean_distance_m);
      raise(worst.max_distance_m, score.max_distance_m);
      raise(worst.false_m, score.false_m);
      raise(worst.position_rms_m, score.position_rms_m);
      raise(worst.yaw_rms_rad, score.yaw_rms_rad);
      worst.coverage = std::min(score.coverage, worst.coverage);
      all += score.in_sight.size() + score.gone.size();
      right += score.in_sight.size() - score.missed.size() + score.gone.size() - score.gone_left.size();
    }
    if (!finished_) verdict.fail("the vehicle has not come to the end of the last transit");
    verdict.at_most("largest mean distance of chains", 100.0 * worst.mean_distance_m,
                    100.0 * params_.max_mean_distance_m, "cm");
    verdict.at_most("greatest distance of a chain", 100.0 * worst.max_distance_m, 100.0 * params_.max_distance_m, "cm");
    verdict.at_most("longest false chains", worst.false_m, params_.max_false_m, "m");
    verdict.at_least("least coverage", worst.coverage, params_.min_coverage);
    verdict.at_least("things found, or found to have gone", static_cast<double>(right) / static_cast<double>(all),
                     params_.min_found);
    if (params_.localization) {
      verdict.at_most("largest RMS error of the position", 1e3 * worst.position_rms_m, 1e3 * params_.max_position_rms_m,
                      "mm");
      verdict.at_most("largest RMS error of the yaw", 1e3 * worst.yaw_rms_rad, 1e3 * params_.max_yaw_rms_rad, "mrad");
    }
  }

 private:
  void on_transit(const TransitConstPtr& msg) try {
    if (msg->docked) {
      if (!is_driving_ || msg->number != number_) return;
      is_driving_ = false;
      end_ = node_.createTimer(
          ros::Duration(kLastMapOfTransit_s),
          [this, duration_s = msg->duration_s, is_last = msg->number == msg->transits](const ros::TimerEvent&) {
            end(duration_s, is_last);
          },
          /*oneshot=*/true);
      return;
    }
    evaluation_.begin(static_cast<int>(msg->number), things_of(*msg));
    is_driving_ = true;
    number_ = msg->number;
    begin_ = msg->header.stamp;
    truths_.clear();
    scans_.clear();
    poses_.clear();
  } catch (const std::exception& error) {
    ROS_ERROR_STREAM("evaluator: transit " << msg->number << ": " << error.what());
  }

  void on_true_pose(const geometry_msgs::PoseStampedConstPtr& msg) {
    const Pose2 pose = pose2_of(msg->pose);
    truths_.add(to_nanoseconds(msg->header.stamp), pose);
    evaluation_.add_motion(to_nanoseconds(msg->header.stamp), pose);
    compare();
  }

  void on_scan(const sensor_msgs::LaserScanConstPtr& msg) {
    if (received_scans_++ % kEveryScan == 0) scans_.push_back(msg);
    compare();
  }

  void on_pose(const geometry_msgs::PoseWithCovarianceStampedConstPtr& msg) {
    poses_.push_back(msg);
    compare();
  }

  void on_update(const MapUpdateConstPtr& msg) { apply(*msg, map_); }

  void compare() try {
    while (!scans_.empty()) {
      const sensor_msgs::LaserScan& msg = *scans_.front();
      const auto first = truths_.at(to_nanoseconds(msg.header.stamp)),
                 last = truths_.at(to_nanoseconds(time_of_last_beam(msg)));
      if (!first || !last) break;
      const geometry_msgs::TransformStamped mounting =
          tf_.lookupTransform(params_.base_frame, tf2_frame(msg.header.frame_id), ros::Time(0));
      const Eigen::Isometry3d T = isometry_from_msg(mounting.transform);
      const Pose2 T_base_lidar{T.translation().head<2>(), std::atan2(T(1, 0), T(0, 0))};
      evaluation_.add_scan(scan_from_msg(msg), *first * T_base_lidar, *last * T_base_lidar);
      scans_.pop_front();
    }
    while (!poses_.empty()) {
      const geometry_msgs::PoseWithCovarianceStamped& msg = *poses_.front();
      const std::int64_t stamp_ns = to_nanoseconds(msg.header.stamp);
      if (!truths_.has_come(stamp_ns)) break;
      if (const auto truth = truths_.with_stamp(stamp_ns)) {
        evaluation_.add_pose(pose2_of(msg.pose.pose), planar_covariance(msg.pose), *truth);
      }
      poses_.pop_front();
    }
    while (scans_.size() > kMaxWaiting) scans_.pop_front();
    while (poses_.size() > kMaxWaiting) poses_.pop_front();
  } catch (const std::exception& error) {
    ROS_ERROR_STREAM_THROTTLE(5.0, "evaluator: " << error.what());
    scans_.clear();
    poses_.clear();
  }

  void end(double duration_s, bool is_last) {
    const bool is_of_transit = map_.has_map() && map_.map().stamp_ns >= to_nanoseconds(begin_);
    MapLayers layers = is_of_transit ? layers_of(map_.map()) : MapLayers{};
    const Polygons bodies = bodies_of(layers);
    scores_.push_back(evaluation_.end(duration_s, chains_of(layers), bodies));
    finished_ = is_last;
    if (is_last) ros::shutdown();
  }

  void watch() {
    if (!is_driving_ || begin_.isZero() || (ros::Time::now() - begin_).toSec() < params_.max_transit_s) return;
    ROS_ERROR_STREAM("evaluator: transit " << number_ << " takes more than " << params_.max_transit_s << " s");
    is_driving_ = false;
    end((ros::Time::now() - begin_).toSec(), false);
    ros::shutdown();
  }

  TransitEvaluatorParams params_;
  ros::NodeHandle node_;
  TransitEvaluation evaluation_;
  std::vector<TransitScore> scores_;
  bool is_driving_ = false, finished_ = false;
  std::uint32_t number_ = 0;
  ros::Time begin_;
  TruePoses truths_;  ///< of this transit
  std::size_t received_scans_ = 0;
  std::deque<sensor_msgs::LaserScanConstPtr> scans_;
  std::deque<geometry_msgs::PoseWithCovarianceStampedConstPtr> poses_;
  MapReplica map_;
  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener tf_listener_;
  ros::Subscriber transit_, true_pose_, scan_, pose_, updates_;
  ros::Timer watch_, end_;
};

}  // namespace

std::unique_ptr<Evaluation> evaluate_transits(const EvaluationInputs& inputs) {
  return std::make_unique<TransitEvaluator>(inputs);
}

}  // namespace situation_awareness
