// SPDX-License-Identifier: BSD-3-Clause
// All features of `semantic_map/updates` against the truth of the world at the stamp of each scan.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/evaluation/bodies.hpp"
#include "situation_awareness/evaluation/feature_evaluation.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/simulation.hpp"

#include "../simulated_robot.hpp"
#include "evaluation.hpp"

namespace situation_awareness {
namespace {

constexpr double kLargestBody_m = 6.0;  ///< diagonal of the box around it; what is larger and stands is a building
constexpr double kTouching_m = 0.05;    ///< walls this near to each other are one thing
constexpr double kLatest_s = 1e6;       ///< a simulation does not last so long: another clock

struct FeatureEvaluatorParams {
  std::string world = kDefaultWorld;
  double duration_s = 0.0;
  double min_recall = 0.95;
  double max_delay_s = 1.0;
  double max_false_s = 1.5;
  double max_center_rmse_m = 0.05;
  double max_velocity_rmse_m_s = 0.3;
  double min_on_map = 0.93;
  double max_outline_rms_m = 0.05;
  double max_features_per_thing = 1.2;
  double max_unexplained = 0.05;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("world", self.world, "name of a world in models/worlds, or a path: what is true");
    visit("duration_s", self.duration_s, Bounds{0.0, 1e6}, "s",
          "simulated time from the first scan that is compared; 0: until shutdown");
    visit("min_recall", self.min_recall, Bounds{0.0, 1.0}, "", "least part of the visible bodies that is on the map");
    visit("max_delay_s", self.max_delay_s, Bounds{0.0, 1e6}, "s",
          "longest time from the first visible scan of a body until it is on the map");
    visit("max_false_s", self.max_false_s, Bounds{0.0, 1e6}, "s", "longest duration of a false ellipse or box");
    visit("max_center_rmse_m", self.max_center_rmse_m, Bounds{0.0, 1e3}, "m",
          "largest RMSE of the centres of bodies that are no boxes");
    visit("max_velocity_rmse_m_s", self.max_velocity_rmse_m_s, Bounds{0.0, 1e3}, "m/s",
          "largest RMSE of the velocities of ellipses and boxes");
    visit("min_on_map", self.min_on_map, Bounds{0.0, 1.0}, "",
          "least part of the outlines that were seen within 10 cm of a feature");
    visit("max_outline_rms_m", self.max_outline_rms_m, Bounds{0.0, 1e3}, "m",
          "largest RMS distance of the outlines that were seen from the features");
    visit("max_features_per_thing", self.max_features_per_thing, Bounds{0.0, 1e3}, "", "most features of a true thing");
    visit("max_unexplained", self.max_unexplained, Bounds{0.0, 1.0}, "",
          "largest part of the features' length that is of nothing true");
  }
};

Eigen::AlignedBox2d box_around(const std::vector<Eigen::Vector2d>& points) {
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector2d& p : points) box.extend(p);
  return box;
}

/// The world in truth, as things.
class TrueScene {
 public:
  explicit TrueScene(const World& world)
      : world_(world), height_m_((world.robot_at(0.0).T_world_robot * world.T_robot_lidar()).translation().z()) {
    const std::vector<TrueObject> objects = world_.objects_at(0.0);
    for (Body& body : bodies_of(world_.names())) {
      const bool is_body = std::all_of(body.parts.begin(), body.parts.end(),
                                       [&](std::size_t part) { return can_be_body(objects[part]); });
      of_objects_.push_back({std::move(body), is_body});
    }
    group_scenery();
  }

  Scene at(std::int64_t stamp_ns) const {
    const double time_s = seconds_between(kSimulationStart_ns, stamp_ns);
    if (time_s < 0.0 || time_s > kLatest_s) throw std::runtime_error("the stamps are not those of a simulated clock");
    Scene scene;
    scene.stamp_ns = stamp_ns;
    const std::vector<TrueObject> objects = world_.objects_at(time_s);
    for (const ObjectThing& own : of_objects_) {
      SceneThing& thing = scene.things.emplace_back();
      thing.name = own.body.name;
      for (const std::size_t part : own.body.parts) {
        thing.outlines.push_back({objects[part].is_there, outline_of(objects[part])});
        if (own.is_body) thing.parts.push_back(true_part(objects[part]));
      }
    }
    const std::vector<TrueOutline> outlines = world_.outlines_at(time_s, height_m_);
    int walls = 0;
    for (const std::vector<std::size_t>& group : scenery_) {
      SceneThing& thing = scene.things.emplace_back();
      thing.name = group.size() > 1 ? "walls" : outlines[group.front()].thing;
      if (group.size() > 1 && ++walls > 1) thing.name += " " + std::to_string(walls);
      for (const std::size_t i : group) thing.outlines.push_back({outlines[i].is_there, outlines[i].points_world_m});
    }
    return scene;
  }

 private:
  struct ObjectThing {
    Body body;
    bool is_body = true;
  };

  /// Not a building, nor a mesh, whose middle is none of an ellipse or box.
  static bool can_be_body(const TrueObject& object) {
    if (!object.ellipse_world && object.footprint_world_m.size() != 4) return false;
    return box_around(outline_of(object)).diagonal().norm() <= kLargestBody_m;
  }

  static Object true_part(const TrueObject& object) {
    Object part;
    part.id = object.id;
    part.velocity_world_m_s = object.velocity_world_m_s;
    part.angular_velocity_rad_s = object.angular_velocity_rad_s;
    if (object.ellipse_world) {
      part.ellipse_world = *object.ellipse_world;
      return part;
    }
    const std::vector<Eigen::Vector2d>& corners = object.footprint_world_m;
    const Eigen::Vector2d along = 0.5 * (corners[1] - corners[0]), across = 0.5 * (corners[2] - corners[1]);
    const Eigen::Vector2d& longer = along.norm() >= across.norm() ? along : across;
    part.shape = Shape::kBox;
    part.box_world.center_m = 0.5 * (corners[0] + corners[2]);
    part.box_world.psi_rad = std::atan2(longer.y(), longer.x());
    part.box_world.half_length_m = std::max(along.norm(), across.norm());
    part.box_world.half_width_m = std::min(along.norm(), across.norm());
    part.ellipse_world = moment_equal_ellipse(part.box_world);
    return part;
  }

  /// What touches, and cannot move, is one thing.
  void group_scenery() {
    const std::vector<TrueOutline> outlines = world_.outlines_at(0.0, height_m_);
    const auto is_object = [this](const TrueOutline& outline) {
      return std::any_of(of_objects_.begin(), of_objects_.end(),
                         [&](const ObjectThing& thing) { return thing.body.name == outline.thing; });
    };
    for (std::size_t i = 0; i < outlines.size(); ++i) {
      if (is_object(outlines[i])) continue;
      std::vector<std::size_t> group{i};
      const auto touches = [&](const std::vector<std::size_t>& other) {
        return !outlines[i].can_move && std::any_of(other.begin(), other.end(), [&](std::size_t k) {
          return !outlines[k].can_move &&
                 box_around(outlines[i].points_world_m).exteriorDistance(box_around(outlines[k].points_world_m)) <=
                     kTouching_m;
        });
      };
      for (auto other = scenery_.begin(); other != scenery_.end();) {
        if (!touches(*other)) {
          ++other;
          continue;
        }
        group.insert(group.end(), other->begin(), other->end());
        other = scenery_.erase(other);
      }
      std::sort(group.begin(), group.end());
      scenery_.push_back(std::move(group));
    }
  }

  const World& world_;
  double height_m_;
  std::vector<ObjectThing> of_objects_;
  std::vector<std::vector<std::size_t>> scenery_;  ///< places in World::outlines_at
};

class FeatureEvaluator : public Evaluation {
 public:
  explicit FeatureEvaluator(const EvaluationInputs& inputs)
      : params_(inputs.params.read<FeatureEvaluatorParams>(inputs.on_unknown_key)),
        truth_(inputs.world),
        tf_listener_(tf_) {
    ros::NodeHandle node = inputs.node;
    scan_subscriber_ = node.subscribe("scan", 200, &FeatureEvaluator::on_scan, this);
    map_subscriber_ = node.subscribe("semantic_map/updates", 200, &FeatureEvaluator::on_update, this);
  }

  void report(Verdict& verdict) const override {
    const FeatureScore score = evaluation_.score();
    std::printf("%s", format_table(score).c_str());
    verdict.at_least("visible bodies on the map", score.bodies.recall, params_.min_recall);
    verdict.at_most("longest delay of a visible body", score.bodies.max_delay_s, params_.max_delay_s, "s");
    verdict.at_most("longest duration of a false body", score.bodies.longest_false_s, params_.max_false_s, "s");
    verdict.at_most("centre RMSE, without boxes", score.center_rmse_m, params_.max_center_rmse_m, "m");
    verdict.at_most("velocity RMSE", score.bodies.velocity_rmse_m_s, params_.max_velocity_rmse_m_s, "m/s");
    verdict.at_least("outlines on the map, of those seen", score.on_map_part, params_.min_on_map);
    verdict.at_most("RMS distance of the outlines", score.outline_rms_m, params_.max_outline_rms_m, "m");
    verdict.at_most("features per thing", score.features_per_thing, params_.max_features_per_thing);
    verdict.at_most("features' length that is of nothing", score.unexplained_part, params_.max_unexplained);
    if (score.bodies.scans == 0) verdict.fail("nothing was compared: there was no scan with a map of its stamp");
  }

 private:
  void on_scan(const sensor_msgs::LaserScanConstPtr& msg) {
    scans_[msg->header.stamp] = msg;
    compare();
  }

  void on_update(const MapUpdateConstPtr& msg) {
    if (apply(*msg, replica_)) maps_[msg->header.stamp] = {msg->header.frame_id, replica_.map()};
    compare();
  }

  /// Compares each map with the scan of its stamp once that has a pose.
  void compare() try {
    if (!ros::ok()) return;  // the run is over, later messages were still in transit
    for (auto map = maps_.begin(); map != maps_.end();) {
      const auto scan = scans_.find(map->first);
      if (scan == scans_.end()) {
        ++map;
        continue;
      }
      const sensor_msgs::LaserScan& msg = *scan->second;
      const std::string world_frame = tf2_frame(map->second.frame), frame = tf2_frame(msg.header.frame_id);
      if (!tf_.canTransform(world_frame, frame, time_of_last_beam(msg))) break;
      const auto pose_at = [&](const ros::Time& time) {
        return isometry_from_msg(tf_.lookupTransform(world_frame, frame, time).transform);
      };
      const Points points =
          project_horizontally(scan_from_msg(msg), pose_at(msg.header.stamp), pose_at(time_of_last_beam(msg)));
      evaluation_.add(truth_.at(to_nanoseconds(map->first)), points, map->second.map);
      if (first_.isZero()) first_ = map->first;
      if (params_.duration_s > 0.0 && (map->first - first_).toSec() >= params_.duration_s) return ros::shutdown();
      scans_.erase(scans_.begin(), std::next(scan));  // stamps increase: earlier ones are complete
      map = maps_.erase(maps_.begin(), std::next(map));
    }
    while (scans_.size() > kMaxWaiting) scans_.erase(scans_.begin());
    while (maps_.size() > kMaxWaiting) maps_.erase(maps_.begin());
  } catch (const std::exception& error) {
    ROS_ERROR_STREAM_THROTTLE(5.0, "evaluator: " << error.what());
    maps_.clear();
  }

  struct StampedMap {
    std::string frame;
    Map map;
  };

  FeatureEvaluatorParams params_;
  TrueScene truth_;
  FeatureEvaluation evaluation_;
  MapReplica replica_;
  std::map<ros::Time, sensor_msgs::LaserScanConstPtr> scans_;  ///< without their counterpart yet, as the maps
  std::map<ros::Time, StampedMap> maps_;
  ros::Time first_;
  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener tf_listener_;
  ros::Subscriber scan_subscriber_, map_subscriber_;
};

}  // namespace

std::unique_ptr<Evaluation> evaluate_features(const EvaluationInputs& inputs) {
  return std::make_unique<FeatureEvaluator>(inputs);
}

}  // namespace situation_awareness
