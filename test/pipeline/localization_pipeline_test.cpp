// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/localization_pipeline.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "pose/reflector_world.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/pipeline/polygon_pipeline.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::localization_pipeline_test {
namespace {

const std::string kSource = SITUATION_AWARENESS_SOURCE_DIR;

PolygonPipelineParams shipped() {
  const std::string path = kSource + "/cfg/polygons.yaml";
  return params_from_yaml<PolygonPipelineParams>(read_text_file(path), path, refuse);
}

ReflectorMap four() {
  ReflectorMap map;
  for (const Eigen::Vector2d& center : {Eigen::Vector2d(4.0, 1.0), Eigen::Vector2d(-2.5, 3.2),
                                        Eigen::Vector2d(-1.5, -3.0), Eigen::Vector2d(3.0, -2.8)}) {
    map.reflectors.push_back({center, 0.05});
  }
  return map;
}

ReflectorWorld room() {
  ReflectorWorld world;
  world.add_room({-5.5, -4.5}, {5.5, 4.5});
  world.add(four());
  world.path = winding_path(0.5);
  world.sweep_s = 0.03;
  return world;
}

Eigen::Isometry3d mounting() {
  Eigen::Isometry3d T_base_lidar = Eigen::Isometry3d::Identity();
  T_base_lidar.translation() << 0.2, -0.05, 0.4;
  T_base_lidar.rotate(Eigen::AngleAxisd(radians(5.0), Eigen::Vector3d::UnitZ()));
  return T_base_lidar;
}

// The nodelet has the one, the offline tool the other.
TEST(LocalizationPipeline, ItsPosesAreThoseOfThePipelineOfPolygons) {
  const PolygonPipelineParams params = shipped();
  LocalizationPipeline alone(four(), params.reflectors, params.localization);
  ReflectorPolygonPipeline mapping(four(), params);
  ReflectorWorld world = room();
  world.T_base_lidar = {{0.2, -0.05}, radians(5.0)};
  DriftingWheels wheels(world.path, 1);
  Random random(2);
  Pose2 T_odom_base;
  int known = 0;
  for (int i = 0; i < 100; ++i) {
    const double time_s = 0.1 + 0.04 * i;
    while (wheels.next_time_s() < time_s + 0.045) {
      const auto [stamp_ns, T] = wheels.next();
      T_odom_base = T;
      alone.add_odometry(stamp_ns, T);
      mapping.localization().add_odometry(stamp_ns, T);
    }
    const Scan scan = world.scan(time_s, random);
    const bool is_known = alone.process(scan, mounting()).is_known;
    ASSERT_EQ(mapping.process(scan, {T_odom_base, T_odom_base, mounting()}), is_known);
    if (!is_known) continue;
    ++known;
    const LocalizedPose a = alone.localization().pose(), b = mapping.localization().pose();
    EXPECT_EQ(a.stamp_ns, b.stamp_ns);
    EXPECT_EQ(a.T_world_base.x.translation_m, b.T_world_base.x.translation_m);
    EXPECT_EQ(a.T_world_base.x.yaw_rad, b.T_world_base.x.yaw_rad);
    EXPECT_EQ(a.covariance_world, b.covariance_world);
  }
  EXPECT_GT(known, 90);
  // The scanner is where it was mounted, and what it saw is where it stands.
  const Pose2 T_world_level = alone.localization().pose().T_world_base.x * alone.T_base_level();
  ASSERT_FALSE(alone.sightings().sightings.empty());
  for (const ReflectorSighting& sighting : alone.sightings().sightings) {
    double nearest_m = 1.0;
    for (const Reflector& reflector : four().reflectors) {
      nearest_m = std::min(nearest_m, (T_world_level * sighting.center_level_m - reflector.center_world_m).norm());
    }
    EXPECT_LT(nearest_m, 0.05);
  }
}

TEST(LocalizationPipeline, RefusesWhatCannotBeUsed) {
  LocalizationPipeline pipeline(four(), {}, {});
  EXPECT_NE(refusal_of([&] { pipeline.process(Scan{}, mounting()); }), "");
  EXPECT_TRUE(names(refusal_of([&] {
                      ReflectorDetectionParams params;
                      params.max_range_m = -1.0;
                      LocalizationPipeline(four(), params, {});
                    }),
                    {"reflectors.max_range_m", "-1"}));
  EXPECT_NE(refusal_of([&] { LocalizationPipeline({}, {}, {}); }), "");
}

}  // namespace
}  // namespace situation_awareness::localization_pipeline_test
