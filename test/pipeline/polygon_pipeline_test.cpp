// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/polygon_pipeline.hpp"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "situation_awareness/common/params_yaml.hpp"
#include "support/level_scene.hpp"
#include "support/refusal.hpp"

namespace situation_awareness {
namespace {

const std::string kSource = SITUATION_AWARENESS_SOURCE_DIR;

PolygonPipelineParams shipped() {
  const std::string path = kSource + "/cfg/polygons.yaml";
  return params_from_yaml<PolygonPipelineParams>(read_text_file(path), path, refuse);
}

TEST(PolygonPipeline, TheShippedParametersAreThoseOfTheStructsExceptForTheRange) {
  PolygonPipelineParams defaults;
  defaults.scan.max_range_m = 20.0;
  EXPECT_EQ(yaml_from_params(shipped()), yaml_from_params(defaults));
}

TEST(PolygonPipeline, MapsAWallWhereThePoseSaysItIs) {
  LevelScene scene;
  scene.walls.push_back({{2.0, -1.0}, {2.0, 1.0}});
  PolygonPipeline pipeline(shipped());
  Eigen::Isometry3d T_world_lidar = Eigen::Isometry3d::Identity();
  T_world_lidar.translation() << 5.0, 3.0, 0.4;
  T_world_lidar.rotate(Eigen::AngleAxisd(0.5 * kPi, Eigen::Vector3d::UnitZ()));
  Scan scan = scene.scan();
  for (int i = 0; i < 20; ++i) {
    scan.stamp_ns = 40'000'000 * (i + 1);
    pipeline.process(scan, T_world_lidar, T_world_lidar, Eigen::Matrix3d::Zero());
  }
  const Polygons polygons = pipeline.map().polygons();
  ASSERT_EQ(polygons.chains.size(), 1U);
  ASSERT_EQ(polygons.chains[0].vertices.size(), 2U);
  // 2 m ahead, which is along y; its right end is at a greater x.
  EXPECT_NEAR(polygons.chains[0].vertices[0].p_world_m.x(), 6.0, 0.02);
  EXPECT_NEAR(polygons.chains[0].vertices[1].p_world_m.x(), 4.0, 0.02);
  for (const ChainVertex& vertex : polygons.chains[0].vertices) EXPECT_NEAR(vertex.p_world_m.y(), 5.0, 1e-3);
}

TEST(PolygonPipeline, RefusesAScanThatIsNone) {
  PolygonPipeline pipeline(shipped());
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  EXPECT_NE(refusal_of([&] { pipeline.process(Scan{}, T, T, Eigen::Matrix3d::Zero()); }), "");
}

}  // namespace
}  // namespace situation_awareness
