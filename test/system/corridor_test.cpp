// SPDX-License-Identifier: BSD-3-Clause
// The corridor in a closed loop, without ROS: a vehicle is steered by the pose that its reflectors and its odometry
// give, and the map of polygons is compared with the truth after each transit.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <iterator>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/evaluation/transit_evaluation.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/pipeline/polygon_pipeline.hpp"
#include "situation_awareness/pose/reflector_map.hpp"
#include "situation_awareness/sim/scanner.hpp"
#include "situation_awareness/sim/sensors.hpp"
#include "situation_awareness/sim/transits.hpp"
#include "situation_awareness/sim/wheel_odometry.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness::corridor_test {
namespace {

const std::string kSource = SITUATION_AWARENESS_SOURCE_DIR;
constexpr double kStep_s = 0.02;  ///< from odometry to odometry; scans are processed at multiples of it
constexpr double kSpeed_m_s = 0.5;

std::vector<TransitThing> things_of(const World& world) {
  std::vector<TransitThing> things;
  for (const TrueOutline& outline :
       world.outlines_at(world.vehicle()->time_s(), world.T_robot_lidar().translation().z())) {
    auto thing = std::find_if(things.begin(), things.end(),
                              [&outline](const TransitThing& known) { return known.name == outline.thing; });
    if (thing == things.end()) {
      things.push_back({outline.thing, false, outline.can_move, outline.thing.rfind("reflector", 0) == 0, {}});
      thing = std::prev(things.end());
    }
    thing->is_there = thing->is_there || outline.is_there;
    thing->outlines_world_m.push_back(outline.points_world_m);
  }
  return things;
}

/// A drive of some transits.
class Drive {
 public:
  Drive(int transits, int seed)
      : world_(kSource + "/models/worlds/corridor.xml"),
        sensors_(sensors_of(world_)),
        transits_(world_, with_transits(transits)),
        scanner_(world_, world_.T_robot_lidar(), sensors_.scanners.at(0).params, static_cast<std::uint64_t>(seed)),
        odometry_(world_, Eigen::Isometry3d::Identity(), sensors_.odometries.at(0).params,
                  static_cast<std::uint64_t>(seed)),
        pipeline_(load_reflector_map(kSource + "/models/worlds/corridor.reflectors.yaml"), params()) {}

  std::vector<TransitScore> run() {
    std::vector<TransitScore> scores;
    bool was_docked = true;
    for (int step = 0; !transits_.done() && step < 100000; ++step) {
      transits_.advance(step * kStep_s);
      const OdometrySample sample = odometry_.next();
      T_odom_base_[sample.stamp_ns] = sample.T_odom_base;
      pipeline_.localization().add_odometry(sample.stamp_ns, sample.T_odom_base);
      if (transits_.docked() != was_docked) {
        was_docked = transits_.docked();
        if (!was_docked) evaluation_.begin(transits_.transit(), things_of(world_));
        if (was_docked) {
          scores.push_back(evaluation_.end(transits_.end_s() - transits_.begin_s(), polygons_));
        }
      }
      if (!was_docked) evaluation_.add_motion(sample.stamp_ns, true_base(seconds_between(0, sample.stamp_ns)));
      // A scan has ended, and there is odometry of later.
      while (scanner_.next_time_s() + scanner_.params().sweep_s <= step * kStep_s + 1e-9) {
        if (was_docked || scanner_.next_time_s() < transits_.begin_s()) {
          scanner_.skip();
        } else {
          take_scan();
        }
      }
    }
    return scores;
  }

 private:
  static TransitsParams with_transits(int transits) {
    TransitsParams params;
    params.transits = transits;
    return params;
  }

  static PolygonPipelineParams params() {
    const std::string file = kSource + "/cfg/polygons.yaml";
    return params_from_yaml<PolygonPipelineParams>(read_text_file(file), file);
  }

  Pose2 true_base(double time_s) const {
    const Eigen::Isometry3d T = world_.robot_at(time_s).T_world_robot;
    return {T.translation().head<2>(), std::atan2(T(1, 0), T(0, 0))};
  }

  Pose2 odometry_at(std::int64_t stamp_ns) const {
    const auto after = T_odom_base_.lower_bound(stamp_ns);
    if (after == T_odom_base_.begin() || after->first == stamp_ns) return after->second;
    const auto& [before_ns, before] = *std::prev(after);
    const double part = static_cast<double>(stamp_ns - before_ns) / static_cast<double>(after->first - before_ns);
    return {before.translation_m + part * (after->second.translation_m - before.translation_m),
            before.yaw_rad + part * wrap_to_pi(after->second.yaw_rad - before.yaw_rad)};
  }

  void take_scan() {
    const ScannerSample sample = scanner_.next();
    const std::int64_t stamp_ns = sample.scan.stamp_ns;
    OdometryScan placed;
    placed.T_odom_base = odometry_at(stamp_ns);
    placed.T_odom_base_end = odometry_at(stamp_ns + nanoseconds(scanner_.params().sweep_s));
    placed.T_base_lidar = world_.T_robot_lidar();
    const bool is_known = pipeline_.process(sample.scan, placed);
    const auto in_plane = [](const Eigen::Isometry3d& T) {
      return Pose2{T.translation().head<2>(), std::atan2(T(1, 0), T(0, 0))};
    };
    evaluation_.add_scan(sample.scan, in_plane(sample.T_world_lidar), in_plane(sample.T_world_lidar_end));
    if (!is_known) return;
    pipeline_.pipeline().map().update_due_chains();
    polygons_ = pipeline_.pipeline().map().latest_polygons(std::move(polygons_));
    const LocalizedPose pose = pipeline_.localization().pose();
    evaluation_.add_pose(pose.T_world_base.x, pose.covariance_world, true_base(seconds_between(0, stamp_ns)));
    steer(pose.T_world_base.x);
  }

  /// Along the middle of the corridor to the dock ahead.
  void steer(const Pose2& T_world_base) {
    const Eigen::Vector2d& dock = world_.docks()[static_cast<std::size_t>(transits_.transit()) % 2];
    const bool is_back = transits_.transit() % 2 == 0;
    const double error_rad = wrap_to_pi(T_world_base.yaw_rad - (is_back ? kPi : 0.0));
    const double left_m = (is_back ? -1.0 : 1.0) * T_world_base.translation_m.y();
    const double ahead_m = (is_back ? -1.0 : 1.0) * (dock.x() - T_world_base.translation_m.x());
    transits_.command(std::clamp(ahead_m, 0.0, kSpeed_m_s), ahead_m > 0.2 ? -1.5 * error_rad - 0.8 * left_m : 0.0);
  }

  World world_;
  WorldSensors sensors_;
  Transits transits_;
  SimulatedScanner scanner_;
  SimulatedOdometry odometry_;
  ReflectorPolygonPipeline pipeline_;
  TransitEvaluation evaluation_;
  Polygons polygons_;
  std::map<std::int64_t, Pose2> T_odom_base_;
};

TEST(Corridor, PoseAndMapAreTheTruthWhileThingsComeAndGo) {
  const std::vector<TransitScore> scores = Drive(3, 1).run();
  ASSERT_EQ(scores.size(), 3U) << "the vehicle has got lost";
  std::cout << format_table(scores);
  for (const TransitScore& score : scores) {
    EXPECT_LT(score.duration_s, 30.0);
    EXPECT_EQ(score.stops, 0);
    EXPECT_LT(score.position_rms_m, 0.0035);
    EXPECT_LT(score.yaw_rms_rad, 0.0015);
    EXPECT_LT(score.nees, 6.0);
    EXPECT_LT(score.mean_distance_m, 0.006);
    EXPECT_LE(score.false_m, 0.1);  // the person walks through transit 3
    EXPECT_GE(score.coverage, 0.98);
    EXPECT_TRUE(score.missed.empty());
    EXPECT_TRUE(score.gone_left.empty());
  }
  EXPECT_EQ(scores[0].in_sight.size(), 12U);
  EXPECT_EQ(scores[1].appeared.size(), 4U);
  EXPECT_EQ(scores[2].gone, (std::vector<std::string>{"box_goes", "box_was_here"}));  // hidden_goes is hidden
}

}  // namespace
}  // namespace situation_awareness::corridor_test
