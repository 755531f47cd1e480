// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/polygon_pipeline.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "support/level_scene.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::polygon_pipeline_test {
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

ObjectPipelineParams shipped_objects() {
  return load_object_pipeline_params(kSource + "/cfg/polygons.yaml", kSource + "/models", [](const UnknownKey&) {});
}

/// A scanner at the origin of a room, with something in it, and both maps. On the map of polygons nothing has to wait
/// because its place was watched: what is kept off it is so because of the map of objects.
class Room {
 public:
  explicit Room(std::uint64_t seed, bool with_objects = true)
      : random_(seed),
        pipeline_(params(), with_objects ? std::optional(shipped_objects()) : std::nullopt),
        walls_({{{5.0, -4.0}, {5.0, 4.0}}, {{5.0, 4.0}, {-4.0, 4.0}}, {{-4.0, -4.0}, {5.0, -4.0}}}) {}

  void see(const std::vector<Ellipse>& ellipses, const std::vector<Box>& boxes) {
    LevelScene scene;
    scene.walls = walls_;
    scene.ellipses = ellipses;
    for (const Box& box : boxes) {
      const std::array<Eigen::Vector2d, 4> at = corners(box);
      for (std::size_t i = 0; i < at.size(); ++i) scene.walls.push_back({at[i], at[(i + 1) % at.size()]});
    }
    Scan scan = scene.scan(&random_);
    scan.stamp_ns = stamp_ns_ += nanoseconds(kPeriod_s);
    const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    result_ = pipeline_.process(scan, T, T, 1e-8 * Eigen::Matrix3d::Identity());
    polygons_ = pipeline_.map().polygons(std::move(polygons_));
  }

  /// The longest chain that is not of a wall, in all.
  double longest_inside_m() const {
    double longest_m = 0.0;
    for (const Chain& chain : polygons_.chains) {
      double length_m = 0.0;
      for (std::size_t i = 0; i + 1 < chain.vertices.size(); ++i) {
        const Eigen::Vector2d& a_m = chain.vertices[i].p_world_m;
        const Eigen::Vector2d& b_m = chain.vertices[i + 1].p_world_m;
        if (std::max(off_walls_m(a_m), off_walls_m(b_m)) > 0.1) length_m += (b_m - a_m).norm();
      }
      longest_m = std::max(longest_m, length_m);
    }
    return longest_m;
  }

  static double off_walls_m(const Eigen::Vector2d& p_m) {
    return std::min({std::abs(p_m.x() - 5.0), std::abs(p_m.y() - 4.0), std::abs(p_m.y() + 4.0)});
  }

  const Object* object_at(const Eigen::Vector2d& p_m) const {
    for (const Object& object : pipeline_.objects()->objects.objects) {
      if ((object.ellipse_world.center_m - p_m).norm() < 0.25) return &object;
    }
    return nullptr;
  }

  const PolygonPipelineResult& result() const { return result_; }
  const PolygonPipeline& pipeline() const { return pipeline_; }
  static constexpr double kPeriod_s = 0.04;

 private:
  static PolygonPipelineParams params() {
    PolygonPipelineParams params = shipped();
    params.polygons.park_s = 0.0;
    return params;
  }

  Random random_;
  PolygonPipeline pipeline_;
  std::vector<LevelScene::Wall> walls_;
  std::int64_t stamp_ns_ = 1'000'000'000;
  PolygonPipelineResult result_;
  Polygons polygons_;
};

TEST(PolygonPipeline, WhoWalksLeavesNoChain) {
  int on_movers = 0;
  for (const bool with_objects : {true, false}) {
    Room room(1, with_objects);
    for (int i = 0; i < 25; ++i) room.see({}, {});
    double longest_m = 0.0;
    for (int i = 0; i < 125; ++i) {  // 5 s at 1 m/s
      const double t_s = Room::kPeriod_s * i;
      room.see({{{2.5, -2.5 + t_s}, 0.3, 0.25, 0.15}}, {});
      if (t_s > 1.0) longest_m = std::max(longest_m, room.longest_inside_m());
      if (with_objects) on_movers += room.result().update.on_movers;
    }
    if (with_objects) {
      EXPECT_LE(longest_m, 0.1);
      EXPECT_EQ(room.pipeline().movers().set_off(), 1U);
    }
    for (int i = 0; i < 50; ++i) room.see({}, {});
    EXPECT_LE(room.longest_inside_m(), 0.1);
  }
  EXPECT_GT(on_movers, 1000);
}

TEST(PolygonPipeline, WhatParksIsAChainAfterTenSecondsNotAfterThree) {
  Room room(2);
  for (int i = 0; i < 25; ++i) room.see({}, {});
  Box box{{2.5, -2.0}, 0.4, 0.3, 0.2};
  for (; box.center_m.y() < 0.5; box.center_m.y() += 0.6 * Room::kPeriod_s) room.see({}, {box});
  ASSERT_EQ(room.pipeline().movers().set_off(), 1U);
  double chain_after_s = 0.0;
  for (int i = 0; i < 375 && chain_after_s == 0.0; ++i) {  // 15 s
    room.see({}, {box});
    if (room.longest_inside_m() > 0.3) chain_after_s = Room::kPeriod_s * i;
  }
  EXPECT_GT(chain_after_s, 9.0);
  EXPECT_LT(chain_after_s, 13.0);
  EXPECT_NE(room.object_at(box.center_m), nullptr);
}

// It comes nearer, so that it hides where it stood: no beam can tell that the place is free.
TEST(PolygonPipeline, WhatSetsOffLeavesNoChainWhereItStoodThoughItHidesThePlace) {
  for (const bool with_objects : {true, false}) {
    Room room(3, with_objects);
    Box box{{3.5, 0.3}, 0.3, 0.3, 0.2};
    for (int i = 0; i < 100; ++i) room.see({}, {box});
    EXPECT_GT(room.longest_inside_m(), 0.3);
    const Eigen::Vector2d step_m(-0.5 * Room::kPeriod_s, 0.0);
    for (int i = 0; i < 50; ++i) {  // 2 s
      box.center_m += step_m;
      room.see({}, {box});
    }
    if (!with_objects) {
      EXPECT_GT(room.longest_inside_m(), 0.1) << "else this test shows nothing";
      continue;
    }
    EXPECT_LE(room.longest_inside_m(), 0.1);
    const Object* object = room.object_at(box.center_m);
    ASSERT_NE(object, nullptr);
    EXPECT_GT(object->p_moving, 0.9);
    EXPECT_EQ(room.pipeline().movers().set_off(), 1U);
  }
}

TEST(PolygonPipeline, WhatStandsBesideAMoverStays) {
  Room room(4);
  const Box box{{3.0, 1.0}, 0.0, 0.2, 0.2};
  for (int i = 0; i < 100; ++i) room.see({}, {box});
  for (int i = 0; i < 125; ++i) {  // past it, and 1 m from the wall
    room.see({{{2.4, -2.5 + 1.0 * Room::kPeriod_s * i}, 0.3, 0.2, 0.15}}, {box});
    EXPECT_GT(room.longest_inside_m(), 0.3) << i;
  }
}

TEST(PolygonPipeline, RefusesAScanThatIsNone) {
  PolygonPipeline pipeline(shipped());
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  EXPECT_NE(refusal_of([&] { pipeline.process(Scan{}, T, T, Eigen::Matrix3d::Zero()); }), "");
}

}  // namespace
}  // namespace situation_awareness::polygon_pipeline_test
