// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "allocations.hpp"
#include "path/safety_scene.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/path/avoidance.hpp"
#include "situation_awareness/path/circumnavigation.hpp"
#include "situation_awareness/path/dubins.hpp"
#include "situation_awareness/path/path_following.hpp"
#include "situation_awareness/path/safety_areas.hpp"

namespace situation_awareness::path_allocation_test {
namespace {

// Among unknown and known things and movers, there and back.
TEST(Allocation, NoneForSafetyAreasAndPathFollowingAfterWarmUp) {
  SafetyScene scene;
  scene.path.way_points = {{{0.0, 0.0}, {}}, {{3.0, 0.4}, {}}, {{6.0, 0.0}, {}}};
  Random random(1);
  for (int i = 0; i < 12; ++i) {
    scene.boxes.push_back({{0.5 * i, i % 2 == 0 ? 0.9 : -0.8}, 0.3 * i, 0.2, 0.1});
    if (i % 3 != 0) scene.know(scene.boxes.back(), static_cast<FeatureId>(i + 1));
  }
  ArcShape pillar;
  pillar.closed = true;
  for (const auto& [x_m, y_m] : {std::pair{3.4, 1.0}, {3.0, 1.4}, {2.6, 1.0}, {3.0, 0.6}}) {
    pillar.vertices.push_back({{x_m, y_m}, 0.4142, 0.003, false});
  }
  scene.add(20, pillar, Motion::kFixed);
  const std::size_t persons = scene.map.features.size();
  for (FeatureId id = 21; id < 24; ++id) scene.add(id, EllipseShape()).p_moving = 1.0;
  SafetyAreas areas(scene.path, {}, {});
  PathFollowing following(scene.path, {}, {});
  following.start();
  const SplinePath spline(scene.path);
  std::int64_t before = 0, after = 0;
  std::size_t counted = 0;
  for (int i = 0; i < 300; ++i) {
    const double way_m = spline.length_m() * (0.5 - 0.5 * std::cos(0.05 * i));
    scene.advance(40'000'000);
    scene.T_world_base = spline.at(way_m).pose() * Pose2{{0.0, 0.05}, std::sin(0.05 * i) > 0.0 ? 0.1 : 3.1};
    for (std::size_t k = persons; k < scene.map.features.size(); ++k) {
      const Eigen::Vector2d center_m(random.uniform(0.0, 6.0), random.uniform(-1.0, 1.0));
      scene.map.features[k].shape = EllipseShape{{center_m, 0.0, 0.2, 0.15}, {}};
    }
    const Points points = scene.points();
    VehicleState state;
    state.T_world_base = scene.T_world_base;
    state.speed_m_s = random.uniform(0.0, 0.5);
    before = allocations().count;
    const SafetyDecision& decision = areas.update(points, state, scene.map);
    following.update(scene.stamp_ns, scene.T_world_base, {decision.allowed_speed_m_s, decision.may_turn});
    if (i > 150) after += allocations().count - before;
    counted += decision.counted;
  }
  EXPECT_EQ(after, 0);
  EXPECT_GT(counted, 1000U);
}

TEST(Allocation, NoneForDubinsPaths) {
  Random random(2);
  double sum_m = 0.0;
  const std::int64_t before = allocations().count;
  for (int i = 0; i < 1000; ++i) {
    DubinsEnd from, to;
    for (DubinsEnd* end : {&from, &to}) {
      end->p_m.x() = random.uniform(-5.0, 5.0);
      if (i % 3 != 0 || end == &from) end->yaw_rad = random.uniform(-3.0, 3.0);
    }
    const DubinsPath path = shortest_dubins_path(from, to);
    sum_m += path.length_m + place_at(path, 0.5 * path.length_m).curvature_1_m;
  }
  EXPECT_EQ(allocations().count, before);
  EXPECT_GT(sum_m, 1000.0);
}

TEST(Allocation, NoneForAvoidanceAfterWarmUp) {
  const AvoidanceParams params;
  Random random(3);
  Obstacles scene;
  SegmentPath path;
  std::int64_t before = 0;
  for (int i = 0; i < 300; ++i) {
    if (i == 100) before = allocations().count;
    scene.clear();
    for (std::uint64_t k = 1; k <= 6; ++k) {
      scene.add(Ellipse{{random.uniform(-40.0, 40.0), random.uniform(-40.0, 40.0)}, 0.3, 4.0, 2.0}, 0.1, k);
    }
    const Pose2 from{{-60.0, random.uniform(-20.0, 20.0)}, 0.0};
    plan_around(from, {{60.0, 0.0}, 0.0, params.turn_radius_m}, scene, 0.1, params, path);
  }
  EXPECT_EQ(allocations().count, before);
}

// Two laps around an open boundary, the first to warm up.
TEST(Allocation, NoneForCircumnavigationAfterWarmUp) {
  CircumnavigationParams params;
  params.max_laps = 100.0;
  Map map;
  map.features.resize(1);
  map.features[0].id = 1;
  ArcShape box;
  const std::vector<Eigen::Vector2d> corners{{6.0, -4.0}, {6.0, 4.0}, {-6.0, 4.0}, {-6.0, -4.0}};
  for (std::size_t i = 0; i < corners.size(); ++i) {
    box.vertices.push_back({corners[i], 0.0, 0.05, true});
    if (i < 3) box.vertices.push_back({0.5 * (corners[i] + corners[i + 1]), 0.0, 0.05, false});
  }
  map.features[0].shape = box;
  FreeBeams beams;
  beams.from_rad = -3.0;
  beams.step_rad = 0.01;
  const auto look = [&] {
    beams.free_m.assign(600, 100.0);
    beams.hits_world_m.clear();
    for (std::size_t i = 0; i < beams.free_m.size(); ++i) {
      const double angle_rad = beams.T_world_sensor.yaw_rad + beams.from_rad + beams.step_rad * static_cast<double>(i);
      const Curve ray{
          beams.T_world_sensor.translation_m, {std::cos(angle_rad), std::sin(angle_rad)}, 0.0, beams.free_m[i]};
      for (std::size_t k = 0; k < corners.size(); ++k) {
        const Curve side = straight_curve(corners[k], corners[(k + 1) % corners.size()]);
        beams.free_m[i] = std::min(beams.free_m[i], first_nearer_m(ray, side, 0.01).value_or(100.0));
      }
      if (beams.free_m[i] < 100.0) beams.hits_world_m.push_back(point_at(ray, beams.free_m[i]));
    }
  };
  Circumnavigation mission(params, {});
  constexpr double kSpeed_m_s = 5.0, kPeriod_s = 0.1;
  MissionInput input;
  input.T_world_base = {{-60.0, 2.0}, 0.0};
  input.speed_m_s = kSpeed_m_s;
  input.map = &map;
  input.sight = &beams;
  std::int64_t after = 0;
  double laps = 0.0, warm_laps = 0.0;
  for (int i = 0; i < 1300; ++i) {
    input.stamp_ns += 100'000'000;
    map.stamp_ns = input.stamp_ns;
    beams.T_world_sensor = input.T_world_base;
    look();
    const std::int64_t before = allocations().count;
    const MissionStep& step = mission.step(input);
    if (step.laps < 2.2) {
      warm_laps = step.laps;
    } else {
      after += allocations().count - before;
    }
    laps = step.laps;
    Pose2& pose = input.T_world_base;
    pose.yaw_rad += step.curvature_1_m * kSpeed_m_s * kPeriod_s;
    pose.translation_m += kSpeed_m_s * kPeriod_s * Eigen::Vector2d(std::cos(pose.yaw_rad), std::sin(pose.yaw_rad));
  }
  EXPECT_EQ(after, 0);
  EXPECT_GT(laps, warm_laps + 1.0);
}

}  // namespace
}  // namespace situation_awareness::path_allocation_test
