// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/safety_areas.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>
#include <variant>
#include <vector>

#include <boost/geometry.hpp>
#include <boost/geometry/geometries/point_xy.hpp>
#include <boost/geometry/geometries/polygon.hpp>

#include "path/safety_scene.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::safety_areas_test {
namespace {

using Verdict = SafetyDecision::Verdict;
using Kind = SafetyDecision::Kind;
constexpr SafetyPolicy kPolicies[] = {SafetyPolicy::kConservative, SafetyPolicy::kUpdated, SafetyPolicy::kIgnoreKnown};

SafetyDecision decide(const SafetyScene& scene, double speed_m_s = 0.5, SafetyParams params = {}) {
  SafetyAreas areas(scene.path, {}, params);
  VehicleState state;
  state.T_world_base = scene.T_world_base;
  state.speed_m_s = speed_m_s;
  return areas.update(scene.points(), state, scene.map);
}

SafetyDecision decide(const SafetyScene& scene, SafetyPolicy policy, double speed_m_s = 0.5) {
  SafetyParams params;
  params.policy = policy;
  return decide(scene, speed_m_s, params);
}

/// Drives up to where the scene has the vehicle, 1.5 m, so that what is behind it was seen. `state.T_world_base` is
/// set.
const SafetyDecision& drive_up(SafetyAreas& areas, const SafetyScene& scene, VehicleState state = {},
                               double way_m = 1.5) {
  const SafetyDecision* decision = nullptr;
  const int steps = static_cast<int>(way_m / 0.02);
  for (int k = steps; k >= 0; --k) {
    SafetyScene before = scene;
    before.T_world_base = scene.T_world_base * Pose2{{-0.02 * k, 0.0}, 0.0};
    before.advance(-40'000'000 * std::int64_t{k});
    state.T_world_base = before.T_world_base;
    decision = &areas.update(before.points(), state, before.map);
  }
  return *decision;
}

bool lacks(const SafetyDecision& decision, SafetyInput input) {
  return std::count(decision.missing.begin(), decision.missing.end(), input) == 1;
}

/// Whether a point is within what the footprint sweeps on a straight way ahead, with a margin.
bool in_straight_area(const Pose2& T_world_base, double way_m, double margin_m, const Eigen::Vector2d& p_world_m) {
  const Footprint footprint = VehicleParams().footprint;
  const Eigen::Vector2d p = inverse(T_world_base) * p_world_m;
  for (double d_m = 0.0; d_m <= way_m; d_m += 0.002) {
    if (clearance_m(footprint, p - Eigen::Vector2d(d_m, 0.0)) <= margin_m) return true;
  }
  return false;
}

double floor_way_m(double speed_m_s) {
  const VehicleParams vehicle;
  return speed_m_s * vehicle.reaction_s + 0.5 * speed_m_s * speed_m_s / vehicle.braking_m_s2;
}

TEST(SafetyAreas, AnEmptySceneIsFullSpeed) {
  for (const SafetyPolicy policy : kPolicies) {
    const SafetyDecision decision = decide(SafetyScene::straight(), policy);
    EXPECT_EQ(decision.verdict, Verdict::kFullSpeed);
    EXPECT_EQ(decision.kind, Kind::kNone);
    EXPECT_EQ(decision.allowed_speed_m_s, VehicleParams().max_speed_m_s);
    EXPECT_FALSE(decision.may_turn) << "what is behind was never seen";
    EXPECT_EQ(decision.policy, policy);
    EXPECT_TRUE(decision.missing.empty());
    SafetyAreas areas(SafetyScene::straight().path, {}, {});
    EXPECT_TRUE(drive_up(areas, SafetyScene::straight()).may_turn);
  }
}

TEST(SafetyAreas, AScanWithoutBeamsHidesTheWay) {
  SafetyScene scene = SafetyScene::straight();
  SafetyAreas areas(scene.path, {}, {});
  Points none;
  none.stamp_ns = scene.stamp_ns;
  const SafetyDecision& decision = areas.update(none, {}, {});
  EXPECT_EQ(decision.verdict, Verdict::kStop);
  EXPECT_EQ(decision.kind, Kind::kHidden);
  EXPECT_EQ(decision.allowed_speed_m_s, 0.0);
  EXPECT_FALSE(decision.may_turn);
}

TEST(SafetyAreas, AScannerThatSaysNothingLetsTheVehicleStand) {
  for (const BeamState state : {BeamState::kInvalid, BeamState::kTooClose}) {
    SafetyScene scene = SafetyScene::straight();
    SafetyAreas areas(scene.path, {}, {});
    Points points = scene.points();
    for (Point& point : points.points) point.state = state;
    const SafetyDecision& decision = areas.update(points, {}, {});
    EXPECT_EQ(decision.verdict, Verdict::kStop);
    EXPECT_EQ(decision.allowed_speed_m_s, 0.0);
    EXPECT_FALSE(decision.may_turn);
  }
}

TEST(SafetyAreas, LostBeamsDoNotKeepTheVehicleFromTurning) {
  SafetyScene scene = SafetyScene::straight();
  SafetyAreas areas(scene.path, {}, {});
  drive_up(areas, scene);
  scene.advance(40'000'000);
  Points points = scene.points();
  for (std::size_t i = 0; i < points.points.size(); i += 3) points.points[i].state = BeamState::kInvalid;
  EXPECT_TRUE(areas.update(points, {}, {}).may_turn);
}

TEST(SafetyAreas, StopsBeforeAnUnknownThing) {
  SafetyScene scene = SafetyScene::straight();
  scene.boxes = {{{1.0, 0.0}, 0.0, 0.1, 0.2}};
  double before_m_s = 1.0;
  for (const double gap_m : {1.5, 0.8, 0.6, 0.4, 0.3, 0.1}) {
    scene.T_world_base.translation_m.x() = 0.9 - 0.215 - gap_m;
    const SafetyDecision decision = decide(scene, 0.1);
    EXPECT_LE(decision.allowed_speed_m_s, before_m_s);
    if (decision.allowed_speed_m_s < 0.5) {
      EXPECT_EQ(decision.kind, Kind::kUnknownHit);
      EXPECT_NEAR(decision.place_world_m.x(), 0.9, 0.01);
    }
    before_m_s = decision.allowed_speed_m_s;
  }
  EXPECT_EQ(before_m_s, 0.0);
  scene.T_world_base.translation_m.x() = 0.9 - 0.215 - 0.5;
  EXPECT_EQ(decide(scene, 0.5).verdict, Verdict::kStop);
}

TEST(SafetyAreas, NamesTheChainOrObject) {
  SafetyScene scene = SafetyScene::straight();
  scene.boxes = {{{0.9, 0.0}, 0.0, 0.1, 0.2}};
  scene.know(scene.boxes.front(), 17);
  SafetyDecision decision = decide(scene, SafetyPolicy::kConservative);
  EXPECT_EQ(decision.kind, Kind::kChain);
  EXPECT_EQ(decision.id, 17U);
  EXPECT_NEAR(decision.distance_m, 0.8 - 0.215 - 0.12, 0.01);
  scene.map.features.clear();
  scene.add(5, EllipseShape{{{0.9, 0.0}, 0.0, 0.2, 0.2}, {}}).p_moving = 0.9;
  decision = decide(scene, SafetyPolicy::kIgnoreKnown);
  EXPECT_EQ(decision.kind, Kind::kObject);
  EXPECT_EQ(decision.id, 5U);
}

TEST(SafetyAreas, AMoverCountsWithoutAHit) {
  SafetyScene scene = SafetyScene::straight();
  scene.add(5, EllipseShape{{{0.8, 0.7}, 0.0, 0.2, 0.15}, {}}).object_class = ObjectClass::kPerson;
  for (const SafetyPolicy policy : kPolicies) {
    EXPECT_LT(decide(scene, policy).allowed_speed_m_s, 0.3);
    EXPECT_EQ(decide(scene, policy).kind, Kind::kObject);
  }
  // A map too old to say where it is now does not count, and says that it is missing.
  scene.map.objects_stamp_ns -= 3'000'000'000;
  EXPECT_EQ(decide(scene).verdict, Verdict::kFullSpeed);
  EXPECT_TRUE(lacks(decide(scene), SafetyInput::kMap));
}

TEST(SafetyAreas, PoliciesDifferBesideAndOnTheWay) {
  SafetyScene scene = SafetyScene::straight();
  scene.boxes = {{{0.6, 0.6}, 0.0, 0.2, 0.1}};  // 0.31 m beside the vehicle
  EXPECT_LT(decide(scene).allowed_speed_m_s, 0.15) << "an unknown thing may come nearer";
  scene.know(scene.boxes.front(), 3, Motion::kStanding);
  EXPECT_EQ(decide(scene).allowed_speed_m_s, SafetyParams().slow_speed_m_s) << "a standing one is passed";
  scene.map.features.clear();
  scene.know(scene.boxes.front(), 3);
  EXPECT_EQ(decide(scene, SafetyPolicy::kConservative).allowed_speed_m_s, SafetyParams().slow_speed_m_s);
  EXPECT_EQ(decide(scene, SafetyPolicy::kUpdated).allowed_speed_m_s, 0.5);
  EXPECT_EQ(decide(scene, SafetyPolicy::kIgnoreKnown).allowed_speed_m_s, 0.5);
  EXPECT_GT(decide(scene, SafetyPolicy::kUpdated).ignored, 5U);

  // On the way, the areas cannot shrink beside it.
  scene = SafetyScene::straight();
  scene.boxes = {{{0.75, 0.0}, 0.0, 0.1, 0.2}};
  scene.know(scene.boxes.front(), 3);
  const double updated_m_s = decide(scene, SafetyPolicy::kUpdated, 0.2).allowed_speed_m_s;
  const double ignore_m_s = decide(scene, SafetyPolicy::kIgnoreKnown, 0.2).allowed_speed_m_s;
  EXPECT_LT(updated_m_s, 0.45);
  EXPECT_GT(ignore_m_s, updated_m_s);
}

TEST(SafetyAreas, AKnownChainDoesNotExplainWhoStandsBesideIt) {
  SafetyScene scene = SafetyScene::straight();
  scene.boxes = {{{0.6, 0.6}, 0.0, 0.2, 0.1}, {{0.6, 0.3}, 0.0, 0.05, 0.05}};
  scene.know(scene.boxes.front(), 3);
  for (const SafetyPolicy policy : kPolicies) {
    const SafetyDecision decision = decide(scene, policy);
    EXPECT_EQ(decision.verdict, Verdict::kStop);
    EXPECT_EQ(decision.kind, Kind::kUnknownHit);
  }
}

TEST(SafetyAreas, DoubtedAndUncertainChainsAreNotKnown) {
  SafetyScene scene = SafetyScene::straight();
  scene.boxes = {{{0.6, 0.6}, 0.0, 0.2, 0.1}};
  scene.know(scene.boxes.front(), 3);
  SafetyParams params;
  EXPECT_EQ(decide(scene, 0.5, params).allowed_speed_m_s, 0.5);
  scene.map.features.front().p_exists = 0.79;
  EXPECT_EQ(decide(scene, 0.5, params).allowed_speed_m_s, params.slow_speed_m_s);
  // What beams have passed a part of is not known, whatever the parameter is.
  params.min_p_exists = 0.0;
  EXPECT_EQ(decide(scene, 0.5, params).allowed_speed_m_s, 0.5);
  scene.map.features.front().p_exists = 0.74;
  EXPECT_EQ(decide(scene, 0.5, params).allowed_speed_m_s, params.slow_speed_m_s);
}

// Things that drive off, and lines over gaps that nobody saw, are passed slowly.
TEST(SafetyAreas, WhatACameraSeesAndBoundariesAreNotKnown) {
  SafetyScene scene = SafetyScene::straight();
  scene.boxes = {{{0.6, 0.6}, 0.0, 0.2, 0.1}};
  scene.know(scene.boxes.front(), 3).seen_by.camera = true;
  EXPECT_EQ(decide(scene, SafetyPolicy::kIgnoreKnown).allowed_speed_m_s, SafetyParams().slow_speed_m_s);
  EXPECT_EQ(decide(scene, SafetyPolicy::kIgnoreKnown).kind, Kind::kChain);

  scene.map.features.clear();
  ArcShape outline;
  outline.closed = true;
  const auto corner = corners(scene.boxes.front());
  for (std::size_t i = 0; i < 4; ++i) {
    outline.vertices.push_back({corner[i], 0.0, 0.003, true});
    outline.vertices.push_back({0.5 * (corner[i] + corner[(i + 1) % 4]), 0.0, 0.003, false});
  }
  scene.add(4, outline, Motion::kFixed);
  const SafetyDecision decision = decide(scene, SafetyPolicy::kIgnoreKnown);
  EXPECT_EQ(decision.allowed_speed_m_s, SafetyParams().slow_speed_m_s);
  EXPECT_EQ(decision.kind, Kind::kChain);
  EXPECT_EQ(decision.id, 4U);
}

// Hits on a round thing are between its vertices, far from their chords.
TEST(SafetyAreas, HitsOnArcsAreOnTheirBoundary) {
  SafetyScene scene = SafetyScene::straight();
  const Eigen::Vector2d center_m(1.0, 1.2);
  constexpr double kRadius_m = 0.8;
  ArcShape pillar;
  pillar.closed = true;
  const double bulge = std::tan(0.125 * kPi);  // quarters
  for (int i = 0; i < 4; ++i) {
    const double angle_rad = 0.5 * kPi * i;
    pillar.vertices.push_back(
        {center_m + kRadius_m * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad)), bulge, 0.003, false});
  }
  scene.add(4, pillar, Motion::kFixed);
  for (int i = 0; i < 200; ++i) {
    const double angle_rad = -kPi + kPi * i / 200.0;
    scene.lone_hits.push_back(center_m + kRadius_m * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad)));
  }
  const SafetyDecision decision = decide(scene);
  EXPECT_EQ(decision.kind, Kind::kChain);
  EXPECT_EQ(decision.allowed_speed_m_s, SafetyParams().slow_speed_m_s);
}

// A person who has stood still for a while is on the map as a line, and may walk on.
TEST(SafetyAreas, APersonThatIsALineMayMoveAlsoAtAWall) {
  SafetyScene scene = SafetyScene::straight();
  scene.boxes = {{{3.0, 0.65}, 0.0, 5.0, 0.1}, {{0.7, 0.53}, 0.0, 0.2, 0.05}};
  scene.know(scene.boxes.front(), 3);
  const double without_m_s = decide(scene, SafetyPolicy::kIgnoreKnown).allowed_speed_m_s;
  scene.know(scene.boxes.back(), 5).object_class = ObjectClass::kPerson;
  for (const SafetyPolicy policy : kPolicies) {
    const SafetyDecision decision = decide(scene, policy);
    EXPECT_LT(decision.allowed_speed_m_s, 0.1);
    EXPECT_EQ(decision.kind, Kind::kObject);
    EXPECT_EQ(decision.id, 5U);
  }
  EXPECT_GT(without_m_s, 0.4);
  scene.boxes.pop_back();
  EXPECT_EQ(decide(scene, SafetyPolicy::kIgnoreKnown).kind, Kind::kObject) << "seen or not";
}

TEST(SafetyAreas, ATargetOfImagesStandsInTheWay) {
  SafetyScene scene = SafetyScene::straight();
  FootprintShape car;
  car.p_world_m = {2.5, 0.0, 0.0};
  car.area_m2 = 4.0;
  scene.add(7, car);
  for (const SafetyPolicy policy : kPolicies) {
    const SafetyDecision decision = decide(scene, policy);
    EXPECT_EQ(decision.kind, Kind::kObject);
    EXPECT_EQ(decision.id, 7U);
    EXPECT_LT(decision.allowed_speed_m_s, 0.5);
  }
  scene.T_world_base.translation_m.x() = 1.0;
  EXPECT_EQ(decide(scene, 0.2).verdict, Verdict::kStop);
  scene.T_world_base.translation_m.x() = 2.3;
  EXPECT_EQ(decide(scene).verdict, Verdict::kFullSpeed) << "it is the vehicle";
  // It explains no hit.
  scene.T_world_base.translation_m.x() = 0.0;
  scene.map.features.front().shape = FootprintShape{{0.6, 0.6, 0.0}, Eigen::Matrix2d::Zero(), 0.1};
  scene.boxes = {{{0.6, 0.6}, 0.0, 0.1, 0.1}};
  EXPECT_EQ(decide(scene).kind, Kind::kUnknownHit);
}

TEST(SafetyAreas, ALoneHitCountsInTheHardFloorAlone) {
  SafetyScene scene = SafetyScene::straight();
  scene.lone_hits = {{0.7, 0.0}};
  EXPECT_EQ(decide(scene, 0.1).kind, Kind::kNone);
  scene.lone_hits = {{0.3, 0.1}};
  EXPECT_LT(decide(scene, 0.5).allowed_speed_m_s, 0.3);
  EXPECT_EQ(decide(scene, 0.5).verdict, Verdict::kStop);
}

TEST(SafetyAreas, DrivesWithinSight) {
  // A corner of a known wall hides the way round it.
  SafetyScene scene;
  for (const auto& [x, y] : {std::pair{0.0, 0.0}, {1.0, 0.0}, {1.5, 0.2}, {1.7, 0.7}, {1.7, 1.7}}) {
    scene.path.way_points.push_back({{x, y}, {}});
  }
  scene.boxes = {{{0.0, 1.35}, 0.0, 1.15, 1.0}};
  scene.know(scene.boxes.front(), 3);
  scene.T_world_base = {{0.4, 0.0}, 0.0};
  SafetyParams params;
  params.policy = SafetyPolicy::kIgnoreKnown;
  VehicleParams fast;
  fast.max_speed_m_s = 3.0;
  SafetyAreas areas(scene.path, fast, params);
  VehicleState state;
  state.T_world_base = scene.T_world_base;
  const SafetyDecision hidden = areas.update(scene.points(), state, scene.map);
  EXPECT_EQ(hidden.kind, Kind::kHidden);
  EXPECT_GT(hidden.allowed_speed_m_s, 0.5);
  EXPECT_LT(hidden.allowed_speed_m_s, 2.0);
}

TEST(SafetyAreas, WhatCountedAndGotOutOfViewStillCounts) {
  SafetyScene scene = SafetyScene::straight();
  scene.boxes = {{{0.5, 0.5}, 0.0, 0.1, 0.1}};
  SafetyAreas areas(scene.path, {}, {});
  VehicleState state;
  EXPECT_LT(areas.update(scene.points(), state, scene.map).allowed_speed_m_s, 0.1);
  // Gone, and seen to be gone.
  SafetyAreas other = areas;
  SafetyScene gone = scene;
  gone.boxes.clear();
  gone.advance(40'000'000);
  EXPECT_EQ(other.update(gone.points(), state, {}).verdict, Verdict::kFullSpeed);
  // Behind something in between, until it is forgotten.
  SafetyScene behind = scene;
  behind.boxes = {{{0.36, 0.36}, 0.25 * kPi, 0.01, 0.13}};
  behind.know(behind.boxes.front(), 3);
  behind.advance(40'000'000);
  const SafetyDecision& decision = areas.update(behind.points(), state, behind.map);
  EXPECT_LT(decision.allowed_speed_m_s, 0.1);
  EXPECT_EQ(decision.kind, Kind::kUnknownHit);
  behind.advance(4'000'000'000);
  EXPECT_GT(areas.update(behind.points(), state, behind.map).allowed_speed_m_s, 0.2);
}

TEST(SafetyAreas, WithoutAPoseTheyStop) {
  const SafetyScene scene = SafetyScene::straight();
  SafetyAreas areas(scene.path, {}, {});
  VehicleState state;
  state.covariance_world.diagonal() << 0.3, 0.01, 0.001;
  EXPECT_EQ(areas.update(scene.points(), state, {}).kind, Kind::kPose);
  state = {};
  state.T_world_base.translation_m.y() = 1.5;
  EXPECT_EQ(areas.update(scene.points(), state, {}).kind, Kind::kPose);
  state = {};
  SafetyScene aside = scene;
  aside.T_world_base.yaw_rad = 1.4;
  SafetyAreas after(scene.path, {}, {});
  const SafetyDecision& decision = drive_up(after, aside, {}, 0.8);
  EXPECT_EQ(decision.kind, Kind::kPose);
  EXPECT_TRUE(decision.may_turn);
  state.T_world_base.yaw_rad = std::nan("");
  EXPECT_EQ(areas.update(scene.points(), state, {}).verdict, Verdict::kStop);
  state = {};
  EXPECT_EQ(areas.update(scene.points(), state, {}).verdict, Verdict::kFullSpeed);
}

// --- what is missing, broken or contradictory

/// A person with their back to a known wall beside the way, within what the wall explains.
SafetyScene back_to_the_wall() {
  SafetyScene scene = SafetyScene::straight();
  scene.boxes = {{{3.0, 0.65}, 0.0, 5.0, 0.1}, {{0.7, 0.53}, 0.0, 0.2, 0.05}};
  scene.know(scene.boxes.front(), 3);
  return scene;
}

TEST(SafetyAreas, AreConservativeWithoutFreshObjectsOnTheMap) {
  const SafetyScene scene = back_to_the_wall();
  EXPECT_GT(decide(scene, SafetyPolicy::kIgnoreKnown).allowed_speed_m_s, 0.4) << "the map has nobody there";
  std::vector<SafetyScene> lacking;
  for (const double age_s : {1.1, 2.5, 3600.0, -2.0, -3600.0}) {
    lacking.push_back(scene);
    lacking.back().map.objects_stamp_ns -= nanoseconds(age_s);
  }
  lacking.push_back(scene);
  lacking.back().map.objects_stamp_ns = 0;  // a map without objects
  for (const SafetyScene& lack : lacking) {
    for (const SafetyPolicy policy : kPolicies) {
      const SafetyDecision decision = decide(lack, policy);
      EXPECT_LE(decision.allowed_speed_m_s, SafetyParams().slow_speed_m_s);
      EXPECT_EQ(decision.policy, SafetyPolicy::kConservative);
      EXPECT_TRUE(lacks(decision, SafetyInput::kMap));
      EXPECT_EQ(decision.missing.size(), 1U);
      EXPECT_EQ(decision.ignored, 0U);
    }
  }
}

TEST(SafetyAreas, AMapThatIsNotFreshExplainsNothing) {
  SafetyScene scene = SafetyScene::straight();
  scene.boxes = {{{0.6, 0.6}, 0.0, 0.2, 0.1}};
  scene.know(scene.boxes.front(), 3);
  EXPECT_EQ(decide(scene).allowed_speed_m_s, 0.5);
  for (const double age_s : {1.1, 3600.0, -2.0, -3600.0, 100.0}) {  // the last: a stamp of 0, never came
    SafetyScene lack = scene;
    lack.map.stamp_ns -= nanoseconds(age_s);
    for (const SafetyPolicy policy : kPolicies) {
      const SafetyDecision decision = decide(lack, policy);
      EXPECT_EQ(decision.kind, Kind::kUnknownHit) << age_s;
      EXPECT_LT(decision.allowed_speed_m_s, 0.15);
      EXPECT_EQ(decision.policy, SafetyPolicy::kConservative);
      EXPECT_TRUE(lacks(decision, SafetyInput::kMap));
    }
  }
}

// As those are that the map has from a file, or that a frozen one repeats.
TEST(SafetyAreas, AChainThatTheMapDoesNotSeeExplainsNothing) {
  SafetyScene scene = SafetyScene::straight();
  scene.boxes = {{{0.6, 0.6}, 0.0, 0.2, 0.1}};
  scene.know(scene.boxes.front(), 3);
  for (const double age_s : {5.0, 100.0, -50.0}) {
    scene.map.features.front().last_seen_ns = scene.stamp_ns - nanoseconds(age_s);
    EXPECT_EQ(decide(scene).kind, Kind::kUnknownHit) << age_s;
    EXPECT_LT(decide(scene).allowed_speed_m_s, 0.15);
  }
}

TEST(SafetyAreas, AChainThatTheScanSeesThroughExplainsNothing) {
  SafetyScene scene = SafetyScene::straight();
  const Box gone{{0.7, 0.75}, 0.0, 0.5, 0.2};
  scene.know(gone, 3);
  for (const bool with_wall_behind : {false, true}) {
    scene.boxes = {{{0.7, 0.6}, 0.0, 0.15, 0.04}};  // who stands where its face was
    if (with_wall_behind) scene.boxes.push_back({{0.7, 3.0}, 0.0, 6.0, 0.1});
    for (const SafetyPolicy policy : kPolicies) {
      const SafetyDecision decision = decide(scene, policy);
      EXPECT_EQ(decision.kind, Kind::kUnknownHit);
      EXPECT_LT(decision.allowed_speed_m_s, 0.2);
    }
  }
  scene.boxes = {gone};
  EXPECT_EQ(decide(scene, SafetyPolicy::kIgnoreKnown).verdict, Verdict::kFullSpeed) << "it is there";
}

TEST(SafetyAreas, ACovarianceThatIsNoneIsAStop) {
  const SafetyScene scene = SafetyScene::straight();
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  std::vector<Eigen::Matrix3d> wrong;
  for (const double value : {nan, inf, -inf, -1.0}) {
    for (int i = 0; i < 3; ++i) {
      wrong.push_back(Eigen::Vector3d(1e-4, 1e-4, 1e-4).asDiagonal());
      wrong.back()(i, i) = value;
    }
    wrong.push_back(Eigen::Matrix3d::Constant(value));
  }
  wrong.push_back(Eigen::Vector3d(1e-4, 1e-4, 1e-4).asDiagonal());
  wrong.back()(0, 1) = wrong.back()(1, 0) = 2e-4;  // not positive semidefinite
  wrong.push_back(Eigen::Vector3d(1e-4, 1e-4, 1e-4).asDiagonal());
  wrong.back()(0, 1) = 1e-4;  // not symmetric
  for (const Eigen::Matrix3d& P : wrong) {
    SafetyAreas areas(scene.path, {}, {});
    VehicleState state;
    state.covariance_world = P;
    const SafetyDecision& decision = areas.update(scene.points(), state, scene.map);
    EXPECT_EQ(decision.verdict, Verdict::kStop) << P;
    EXPECT_EQ(decision.kind, Kind::kPose);
    EXPECT_FALSE(decision.may_turn);
    EXPECT_TRUE(lacks(decision, SafetyInput::kCovariance));
  }
}

// The worse the pose says that it is, the slower.
TEST(SafetyAreas, TheAllowedSpeedFallsWithTheCovariance) {
  SafetyScene scene = SafetyScene::straight();
  scene.boxes = {{{0.9, 0.75}, 0.0, 0.3, 0.1}};
  double before_m_s = 1.0;
  for (const double sigma_m : {0.0, 0.01, 0.03, 0.1, 0.19, 0.21, 1.0, 1e10, 1e160}) {
    SafetyAreas areas(scene.path, {}, {});
    VehicleState state;
    state.covariance_world.diagonal() << sigma_m * sigma_m, 0.0, 1e-4;
    const double allowed_m_s = areas.update(scene.points(), state, scene.map).allowed_speed_m_s;
    EXPECT_LE(allowed_m_s, before_m_s) << sigma_m;
    before_m_s = allowed_m_s;
  }
  EXPECT_EQ(before_m_s, 0.0);
  SafetyAreas areas(scene.path, {}, {});
  VehicleState state;
  state.covariance_world.diagonal() << 1e-6, 1e-6, 1.0;
  EXPECT_EQ(areas.update(scene.points(), state, scene.map).kind, Kind::kPose);
}

TEST(SafetyAreas, ASpeedThatIsNotKnownIsTheGreatest) {
  SafetyScene scene = SafetyScene::straight();
  scene.boxes = {{{0.85, 0.0}, 0.0, 0.1, 0.2}};
  scene.know(scene.boxes.front(), 3, Motion::kStanding);
  const SafetyDecision fastest = decide(scene, 0.5);
  ASSERT_EQ(fastest.verdict, Verdict::kStop);
  ASSERT_NE(decide(scene, 0.05).verdict, Verdict::kStop);
  VehicleState late, ahead, nan, inf;
  late.speed_stamp_ns = scene.stamp_ns - 600'000'000;
  ahead.speed_stamp_ns = scene.stamp_ns + 2'000'000'000;
  nan.speed_m_s = std::nan("");
  inf.speed_m_s = std::numeric_limits<double>::infinity();
  for (const VehicleState& state : {late, ahead, nan, inf}) {
    SafetyAreas areas(scene.path, {}, {});
    const SafetyDecision& decision = areas.update(scene.points(), state, scene.map);
    EXPECT_EQ(decision.verdict, Verdict::kStop);
    EXPECT_EQ(decision.allowed_speed_m_s, fastest.allowed_speed_m_s);
    EXPECT_TRUE(lacks(decision, SafetyInput::kSpeed));
  }
}

SafetyScene corridor() {
  SafetyScene scene = SafetyScene::straight();
  scene.boxes = {{{5.0, 1.8}, 0.0, 9.0, 0.1}, {{5.0, -1.8}, 0.0, 9.0, 0.1}, {{14.1, 0.0}, 0.0, 0.1, 1.7}};
  for (std::size_t i = 0; i < 3; ++i) scene.know(scene.boxes[i], i + 1);
  return scene;
}

/// No beam has a return.
SafetyScene without_return(SafetyScene scene) {
  scene.boxes.clear();
  scene.far_off.clear();
  return scene;
}

TEST(SafetyAreas, AScannerThatSeesNothingBetweenKnownWallsIsAStop) {
  for (const SafetyPolicy policy : kPolicies) {
    SafetyScene scene = corridor();
    SafetyParams params;
    params.policy = policy;
    SafetyAreas areas(scene.path, {}, params);
    EXPECT_EQ(drive_up(areas, scene).verdict, Verdict::kFullSpeed);
    SafetyScene blind = without_return(scene);
    // The map forgets walls that the scanner does not see: it is as blind as before.
    for (int i = 0; i < 100; ++i) {
      blind.stamp_ns += 40'000'000;
      blind.map.stamp_ns = blind.map.objects_stamp_ns = blind.stamp_ns;
      if (i == 20) blind.map.features.clear();
      VehicleState state;
      const SafetyDecision& decision = areas.update(blind.points(), state, blind.map);
      ASSERT_EQ(decision.verdict, Verdict::kStop) << i;
      ASSERT_EQ(decision.kind, Kind::kContradiction);
      ASSERT_FALSE(decision.may_turn);
    }
    scene.advance(blind.stamp_ns + 40'000'000 - scene.stamp_ns);
    EXPECT_EQ(areas.update(scene.points(), {}, scene.map).verdict, Verdict::kFullSpeed);
  }
}

TEST(SafetyAreas, AScannerThatIsBlindAheadOrFromTheBeginningIsAStop) {
  SafetyScene scene = corridor();
  scene.boxes.push_back({{6.0, 0.0}, 0.0, 0.1, 1.6});  // the end, so that there is something to see ahead
  scene.know(scene.boxes.back(), 3);
  scene.path.way_points = {{{-2.0, 0.0}, {}}, {{5.0, 0.0}, {}}};
  ASSERT_EQ(decide(scene).verdict, Verdict::kFullSpeed);
  Points points = scene.points();
  for (Point& point : points.points) {
    if (std::abs(point.azimuth_rad) > radians(60.0)) continue;
    point.state = BeamState::kFree;
    point.range_m = 20.0;
  }
  SafetyAreas areas(scene.path, {}, {});
  EXPECT_EQ(areas.update(points, {}, scene.map).kind, Kind::kContradiction);
  // Hits beyond the walls, as of another place.
  points = scene.points();
  for (Point& point : points.points) {
    point.range_m = 15.0;
    point.p_level_m *= 15.0 / std::max(point.p_level_m.norm(), 1e-9);
  }
  SafetyAreas elsewhere(scene.path, {}, {});
  EXPECT_EQ(elsewhere.update(points, {}, scene.map).kind, Kind::kContradiction);
}

// Its scans are those of an empty place, of whatever the maps have: a file that nobody has seen yet, or nothing.
TEST(SafetyAreas, AScannerThatWasNotShownToSeeIsAStop) {
  for (const SafetyPolicy policy : kPolicies) {
    for (const bool has_file : {true, false}) {
      for (const std::int64_t map_age_ns : {std::int64_t{0}, std::int64_t{-1}}) {
        const SafetyScene scene = corridor();
        SafetyParams params;
        params.policy = policy;
        SafetyAreas areas(scene.path, {}, params);
        SafetyScene blind = without_return(scene);
        if (!has_file) blind.map.features.clear();
        for (int i = 0; i < 100; ++i) {
          blind.advance(40'000'000);
          for (Feature& feature : blind.map.features) feature.last_seen_ns = 0;
          if (map_age_ns < 0) blind.map.stamp_ns = blind.map.objects_stamp_ns = 0;
          Points points = blind.points();
          // Some returns, as of dust, show nothing.
          for (std::size_t k = 0; k < 10; ++k) {
            Point& point = points.points[(53 * k + 7 * static_cast<std::size_t>(i)) % points.points.size()];
            point.state = BeamState::kHit;
            point.range_m = 15.0;
            point.p_level_m = 15.0 * Eigen::Vector2d(std::cos(point.azimuth_rad), std::sin(point.azimuth_rad));
          }
          const SafetyDecision& decision = areas.update(points, {}, blind.map);
          ASSERT_EQ(decision.verdict, Verdict::kStop) << name_of(policy) << ", scan " << i;
          ASSERT_EQ(decision.kind, Kind::kContradiction);
          ASSERT_EQ(decision.allowed_speed_m_s, 0.0);
          ASSERT_FALSE(decision.may_turn);
        }
        SafetyScene sees = scene;
        sees.advance(blind.stamp_ns + 40'000'000 - scene.stamp_ns);
        EXPECT_EQ(areas.update(sees.points(), {}, sees.map).verdict, Verdict::kFullSpeed);
        EXPECT_TRUE(areas.scanner_has_seen());
      }
    }
  }
}

// What a scanner sees behind does not show that it sees ahead, where a file has walls.
TEST(SafetyAreas, AQuarterThatSeesNothingOfAFileIsAStop) {
  SafetyScene scene = corridor();
  scene.boxes.push_back({{6.0, 0.0}, 0.0, 0.1, 1.6});
  scene.know(scene.boxes.back(), 4);
  for (Feature& feature : scene.map.features) feature.last_seen_ns = 0;
  for (const bool is_fresh : {true, false}) {
    if (!is_fresh) scene.map.stamp_ns = 0;
    ASSERT_EQ(decide(scene).verdict, Verdict::kFullSpeed);
    Points points = scene.points();
    for (Point& point : points.points) {
      if (std::abs(point.azimuth_rad) > radians(60.0)) continue;
      point.state = BeamState::kFree;
      point.range_m = 20.0;
    }
    SafetyAreas areas(scene.path, {}, {});
    for (int i = 0; i < 3; ++i) {
      points.stamp_ns += 40'000'000;
      EXPECT_EQ(areas.update(points, {}, scene.map).kind, Kind::kContradiction);
      scene.map.features.clear();  // the map forgets what it does not see
    }
    scene = corridor();
    scene.boxes.push_back({{6.0, 0.0}, 0.0, 0.1, 1.6});
    scene.know(scene.boxes.back(), 4);
    for (Feature& feature : scene.map.features) feature.last_seen_ns = 0;
  }
}

// Ahead, where nothing is on a map, a covered scanner is like one in an open place.
TEST(SafetyAreas, AQuarterAheadThatWasNotShownToSeeIsAStopWhereItMustBe) {
  SafetyScene scene = corridor();
  scene.map.features.clear();
  const auto covered = [&scene] {
    Points points = scene.points();
    for (Point& point : points.points) {
      if (std::abs(point.azimuth_rad) > radians(60.0)) continue;
      point.state = BeamState::kFree;
      point.range_m = 20.0;
    }
    return points;
  };
  for (const bool must_see_ahead : {true, false}) {
    SafetyParams params;
    params.must_see_ahead = must_see_ahead;
    SafetyAreas areas(scene.path, {}, params);
    const auto decide_next = [&](const Points& points) {
      const SafetyDecision& decision = areas.update(points, {}, scene.map);
      scene.advance(40'000'000);
      return std::pair(decision.verdict == Verdict::kStop && decision.kind == Kind::kContradiction, decision.may_turn);
    };
    for (int i = 0; i < 100; ++i) {
      const auto [stops, may_turn] = decide_next(covered());
      ASSERT_EQ(stops, must_see_ahead) << i;
      ASSERT_FALSE(may_turn && must_see_ahead);
      ASSERT_TRUE(areas.scanner_has_seen());
      ASSERT_FALSE(areas.scanner_has_seen_ahead());
    }
    EXPECT_FALSE(decide_next(scene.points()).first);
    EXPECT_TRUE(areas.scanner_has_seen_ahead());
    EXPECT_TRUE(decide_next(covered()).first) << "what gets blind is found in any case";
    // After a gap it has to be shown again.
    decide_next(scene.points());
    scene.advance(3'000'000'000);
    EXPECT_EQ(decide_next(covered()).first, must_see_ahead);
  }
}

TEST(SafetyAreas, AScannerThatGetsBlindWithoutAnyMapIsAStop) {
  SafetyScene scene = corridor();
  scene.map.features.clear();
  SafetyAreas areas(scene.path, {}, {});
  VehicleState state;
  const auto next = [&](const SafetyScene& seen, std::int64_t after_ns) {
    scene.advance(after_ns);
    scene.T_world_base.translation_m.x() += 0.02;
    state.T_world_base = scene.T_world_base;
    SafetyScene now = seen;
    now.T_world_base = scene.T_world_base;
    now.stamp_ns = scene.stamp_ns;
    return areas.update(now.points(), state, scene.map);
  };
  const SafetyScene sees = scene, blind = without_return(scene);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(next(sees, 40'000'000).verdict, Verdict::kFullSpeed);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(next(blind, 40'000'000).kind, Kind::kContradiction) << i;
  EXPECT_EQ(next(sees, 40'000'000).verdict, Verdict::kFullSpeed);
  // A driver that comes back is another one.
  EXPECT_EQ(next(blind, 10'000'000'000).kind, Kind::kContradiction);
  EXPECT_EQ(next(sees, 40'000'000).verdict, Verdict::kFullSpeed);
}

// A vehicle that leaves a hall, and someone who walks past in an empty place, get out of sight little by little.
TEST(SafetyAreas, AScannerThatSeesLessAndLessIsNotBlind) {
  SafetyScene scene = without_return(SafetyScene::straight());
  scene.boxes = {{{-1.0, 1.8}, 0.0, 3.0, 0.1}, {{-1.0, -1.8}, 0.0, 3.0, 0.1}};
  SafetyAreas hall(scene.path, {}, {});
  VehicleState state;
  for (int i = 0; i < 500; ++i) {
    scene.advance(40'000'000);
    scene.T_world_base.translation_m.x() += 0.02;
    state.T_world_base = scene.T_world_base;
    ASSERT_EQ(hall.update(scene.points(), state, scene.map).verdict, Verdict::kFullSpeed) << i;
  }
  scene = SafetyScene::straight();
  SafetyAreas place(scene.path, {}, {});
  for (int i = 0; i < 200; ++i) {
    scene.advance(100'000'000);
    scene.boxes = {{{-1.0, 4.0 - 0.2 * i}, 0.0, 0.25, 0.25}};
    EXPECT_NE(place.update(scene.points(), {}, scene.map).kind, Kind::kContradiction) << i;
    scene.far_off.clear();
  }
}

// A door that opens, and beams that are lost, are not.
TEST(SafetyAreas, ScanAndMapAgreeWhereSomeOfItIsGone) {
  SafetyScene scene = corridor();
  scene.boxes.erase(scene.boxes.begin());
  scene.boxes.push_back({{-2.0, 1.8}, 0.0, 1.5, 0.1});
  scene.boxes.push_back({{6.5, 1.8}, 0.0, 5.0, 0.1});
  Points points = scene.points();
  for (std::size_t i = 0; i < points.points.size(); i += 9) {
    points.points[i].state = BeamState::kFree;
    points.points[i].range_m = 20.0;
  }
  SafetyAreas areas(scene.path, {}, {});
  EXPECT_NE(areas.update(points, {}, scene.map).kind, Kind::kContradiction);
}

std::vector<float> ranges_of(const Points& points, Random* noise) {
  std::vector<float> ranges_m;
  for (const Point& point : points.points) {
    const bool is_hit = point.state == BeamState::kHit;
    ranges_m.push_back(is_hit ? static_cast<float>(point.range_m + (noise ? 0.01 * noise->normal() : 0.0))
                              : std::numeric_limits<float>::infinity());
  }
  return ranges_m;
}

TEST(SafetyAreas, ADriverThatRepeatsItselfIsAStop) {
  for (const bool is_noisy : {false, true}) {
    SafetyScene scene = corridor();
    SafetyAreas areas(scene.path, {}, {});
    Random random(1);
    VehicleState state;
    Points points;
    const auto next = [&](double moved_m, bool repeats, std::vector<float>& ranges_m) {
      scene.advance(40'000'000);
      state.T_world_base.translation_m.x() += moved_m;
      scene.T_world_base = state.T_world_base;
      if (!repeats) {
        points = scene.points();
        ranges_m = ranges_of(points, is_noisy ? &random : nullptr);
      }
      points.stamp_ns = scene.stamp_ns;
      points.T_world_level = scene.T_world_base;
      return areas.update(points, state, scene.map, ranges_m).kind;
    };
    std::vector<float> ranges_m;
    // Standing, then driving, they differ; without noise those of a vehicle that stands are alike, and no fault.
    for (int i = 0; i < 20; ++i) EXPECT_NE(next(0.0, false, ranges_m), Kind::kFrozenScan);
    for (int i = 0; i < 20; ++i) EXPECT_NE(next(0.02, false, ranges_m), Kind::kFrozenScan);
    EXPECT_NE(next(0.02, true, ranges_m), Kind::kFrozenScan);
    for (int i = 0; i < 20; ++i) EXPECT_EQ(next(0.02, true, ranges_m), Kind::kFrozenScan) << i;
    EXPECT_NE(next(0.02, false, ranges_m), Kind::kFrozenScan);
    if (!is_noisy) continue;
    next(0.0, true, ranges_m);
    EXPECT_EQ(next(0.0, true, ranges_m), Kind::kFrozenScan) << "also of a vehicle that stands";
  }
}

// A driver that repeats itself from the first scan on has shown no noise: the vehicle has to move until it is found.
// Noise of the pose does not set it off again, nor does time.
TEST(SafetyAreas, ADriverThatRepeatsItsFirstScanIsFoundOnce) {
  SafetyScene scene = corridor();
  const Points first = scene.points();
  const std::vector<float> ranges_m = ranges_of(first, nullptr);
  SafetyAreas areas(scene.path, {}, {});
  Random random(1);
  double way_m = 0.0;
  int found = 0, lost = 0;
  bool is_found = false;
  for (int i = 0; i < 1500; ++i) {  // a minute
    scene.advance(40'000'000);
    VehicleState state;
    state.T_world_base = {{way_m + 0.003 * random.normal(), 0.003 * random.normal()}, 0.001 * random.normal()};
    Points points = first;
    points.stamp_ns = scene.stamp_ns;
    points.T_world_level = state.T_world_base;
    const SafetyDecision& decision = areas.update(points, state, scene.map, ranges_m);
    const bool was_found = is_found;
    is_found = decision.kind == Kind::kFrozenScan;
    found += is_found && !was_found ? 1 : 0;
    lost += was_found && !is_found ? 1 : 0;
    if (!is_found) way_m += 0.04 * std::min(decision.allowed_speed_m_s, 0.1);
  }
  EXPECT_GT(found, 0);
  EXPECT_LE(lost, 6);
  EXPECT_LE(way_m, 0.1);
}

TEST(SafetyAreas, EmptyPlacesMayLookAlike) {
  SafetyScene scene = SafetyScene::straight();
  SafetyAreas areas(scene.path, {}, {});
  VehicleState state;
  for (int i = 0; i < 20; ++i) {
    scene.advance(40'000'000);
    scene.T_world_base.translation_m.x() += 0.02;
    state.T_world_base = scene.T_world_base;
    const Points points = scene.points();
    EXPECT_EQ(areas.update(points, state, scene.map, ranges_of(points, nullptr)).verdict, Verdict::kFullSpeed);
    scene.far_off.clear();  // the scanner was shown to see
  }
}

// --- turning on the spot

VehicleParams with_a_tail() {
  VehicleParams vehicle;
  vehicle.footprint.corners_m = {{0.2, 0.2}, {-0.6, 0.2}, {-0.6, -0.2}, {0.2, -0.2}};
  return vehicle;
}

TEST(SafetyAreas, TurnOnlyWhereAllOfTheCircleWasSeenFree) {
  SafetyScene scene = SafetyScene::straight();
  const VehicleParams vehicle = with_a_tail();
  SafetyAreas areas(scene.path, vehicle, {});
  VehicleState state;
  EXPECT_FALSE(areas.update(scene.points(), state, scene.map).may_turn) << "never seen";
  EXPECT_TRUE(drive_up(areas, scene).may_turn);
  scene.advance(static_cast<std::int64_t>((SafetyParams().turn_memory_s + 1.0) * 1e9));
  EXPECT_FALSE(areas.update(scene.points(), state, scene.map).may_turn) << "too long ago";
}

TEST(SafetyAreas, TurnOnlyWhereTheMapsHaveNothing) {
  const VehicleParams vehicle = with_a_tail();
  for (const double from_rad : {0.0, 0.5, 1.5, 2.3, 2.7, 3.1, -2.5, -1.6}) {
    for (const bool is_fresh : {true, false}) {
      SafetyScene scene = SafetyScene::straight();
      SafetyAreas areas(scene.path, vehicle, {});
      ASSERT_TRUE(drive_up(areas, scene).may_turn);
      scene.advance(40'000'000);
      // Not in the scan: behind, or so low that it is not seen.
      const Box box{Eigen::Vector2d(0.7 * std::cos(from_rad), 0.7 * std::sin(from_rad)), from_rad, 0.1, 0.1};
      scene.know(box, 3);
      if (!is_fresh) scene.map.stamp_ns = 0;  // of a file
      EXPECT_FALSE(areas.update(scene.points(), {}, scene.map).may_turn) << from_rad;
    }
    SafetyScene scene = SafetyScene::straight();
    SafetyAreas areas(scene.path, vehicle, {});
    drive_up(areas, scene);
    scene.advance(40'000'000);
    scene.add(1, EllipseShape{{0.75 * Eigen::Vector2d(std::cos(from_rad), std::sin(from_rad)), 0.0, 0.15, 0.15}, {}});
    EXPECT_FALSE(areas.update(scene.points(), {}, scene.map).may_turn) << from_rad;
  }
}

// On a way that turns left, the tail swings to the right, where the scanner does not look.
TEST(SafetyAreas, AChainBehindStopsTheTailThatSwingsToIt) {
  SafetyScene scene;
  for (int i = 0; i <= 8; ++i) {
    const double angle_rad = radians(22.5 * i - 90.0);
    scene.path.way_points.push_back({1.2 * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad)), {}});
  }
  scene.T_world_base = SplinePath(scene.path).at(1.5).pose();
  VehicleState state;
  state.T_world_base = scene.T_world_base;
  for (const double side : {-1.0, 1.0}) {
    SafetyScene beside = scene;
    beside.know(scene.T_world_base * Box{{-0.5, side * 0.32}, 0.0, 0.1, 0.05}, 3);
    SafetyAreas areas(scene.path, with_a_tail(), {});
    const SafetyDecision& decision = areas.update(beside.points(), state, beside.map);
    EXPECT_EQ(decision.kind, side < 0.0 ? Kind::kChain : Kind::kNone);
    EXPECT_EQ(decision.allowed_speed_m_s < 0.4, side < 0.0);
  }
}

TEST(SafetyAreas, AreThoseOfTheWayBack) {
  SafetyScene scene = SafetyScene::straight();
  scene.T_world_base = {{3.0, 0.0}, kPi};
  scene.boxes = {{{2.2, 0.0}, 0.0, 0.1, 0.2}};
  const SafetyDecision decision = decide(scene, 0.1);
  EXPECT_EQ(decision.kind, Kind::kUnknownHit);
  scene.boxes = {{{3.9, 0.0}, 0.0, 0.1, 0.2}};  // behind
  scene.know(scene.boxes.front(), 1);
  EXPECT_EQ(decide(scene, 0.1).verdict, Verdict::kFullSpeed);
}

/// Things of random size, place and state on and beside the way.
SafetyScene random_scene(Random& random) {
  SafetyScene scene = SafetyScene::straight();
  scene.T_world_base = {{random.uniform(0.0, 2.0), random.uniform(-0.05, 0.05)}, random.uniform(-0.05, 0.05)};
  const int things = 1 + static_cast<int>(random.uniform(0.0, 4.0));
  for (int i = 0; i < things; ++i) {
    scene.boxes.push_back({{random.uniform(0.5, 4.0), random.uniform(-1.2, 1.2)},
                           random.uniform(-kPi, kPi),
                           random.uniform(0.05, 0.4),
                           random.uniform(0.03, 0.3)});
    const double what = random.uniform();
    const auto id = static_cast<std::uint64_t>(i + 1);
    if (what < 0.5) scene.know(scene.boxes.back(), id);
    if (what > 0.7) scene.know(scene.boxes.back(), id, Motion::kStanding);
  }
  return scene;
}

TEST(SafetyAreas, VerdictIsMonotoneInSpeed) {
  Random random(1);
  for (int n = 0; n < 60; ++n) {
    const SafetyScene scene = random_scene(random);
    for (const SafetyPolicy policy : kPolicies) {
      double before_m_s = 1.0;
      Verdict worst = Verdict::kFullSpeed;
      for (const double speed_m_s : {0.0, 0.1, 0.2, 0.3, 0.4, 0.5}) {
        const SafetyDecision decision = decide(scene, policy, speed_m_s);
        EXPECT_LE(decision.allowed_speed_m_s, before_m_s);
        EXPECT_GE(decision.verdict, worst);
        before_m_s = decision.allowed_speed_m_s;
        worst = decision.verdict;
      }
    }
  }
}

TEST(SafetyAreas, PoliciesAreOrdered) {
  Random random(2);
  int differ = 0;
  for (int n = 0; n < 200; ++n) {
    const SafetyScene scene = random_scene(random);
    for (const double speed_m_s : {0.0, 0.25, 0.5}) {
      const SafetyDecision a = decide(scene, SafetyPolicy::kConservative, speed_m_s);
      const SafetyDecision b = decide(scene, SafetyPolicy::kUpdated, speed_m_s);
      const SafetyDecision c = decide(scene, SafetyPolicy::kIgnoreKnown, speed_m_s);
      EXPECT_LE(a.allowed_speed_m_s, b.allowed_speed_m_s);
      EXPECT_LE(b.allowed_speed_m_s, c.allowed_speed_m_s);
      EXPECT_GE(a.verdict, b.verdict);
      EXPECT_GE(b.verdict, c.verdict);
      differ += a.allowed_speed_m_s < c.allowed_speed_m_s ? 1 : 0;
    }
  }
  EXPECT_GT(differ, 50);
}

TEST(SafetyAreas, TheHardFloorIsNeverViolated) {
  Random random(3);
  int limited = 0;
  for (int n = 0; n < 200; ++n) {
    SafetyScene scene = random_scene(random);
    scene.T_world_base = {{random.uniform(0.0, 2.0), 0.0}, 0.0};
    const Points points = scene.points();
    for (const SafetyPolicy policy : kPolicies) {
      const SafetyDecision decision = decide(scene, policy, 0.5);
      limited += decision.allowed_speed_m_s > 0.0 && decision.allowed_speed_m_s < 0.5 ? 1 : 0;
      if (decision.allowed_speed_m_s == 0.0) continue;
      for (const Point& point : points.points) {
        if (point.state != BeamState::kHit) continue;
        EXPECT_FALSE(in_straight_area(scene.T_world_base, floor_way_m(decision.allowed_speed_m_s) - 0.003,
                                      SafetyParams().floor_margin_m - 0.003, points.T_world_level * point.p_level_m));
      }
    }
  }
  EXPECT_GT(limited, 30);
}

TEST(SafetyAreas, MoveWithTheWorld) {
  Random random(4);
  for (int n = 0; n < 50; ++n) {
    const SafetyScene scene = random_scene(random);
    const SafetyScene moved = scene.moved({{20.0, -7.0}, 2.2});
    for (const SafetyPolicy policy : kPolicies) {
      const SafetyDecision a = decide(scene, policy), b = decide(moved, policy);
      EXPECT_EQ(a.verdict, b.verdict);
      EXPECT_NEAR(a.allowed_speed_m_s, b.allowed_speed_m_s, 1e-6);
      ASSERT_EQ(a.warning_world_m.size(), b.warning_world_m.size());
    }
  }
}

using BoostPoint = boost::geometry::model::d2::point_xy<double>;
using BoostPolygon = boost::geometry::model::polygon<BoostPoint, false, false>;

BoostPolygon boost_polygon(const std::vector<Eigen::Vector2d>& points_m) {
  BoostPolygon polygon;
  for (const Eigen::Vector2d& p : points_m) polygon.outer().emplace_back(p.x(), p.y());
  return polygon;
}

// The polygons cover what the footprint sweeps with its margin, and not much more.
TEST(SafetyAreas, PolygonsAreTheSweptFootprint) {
  const VehicleParams vehicle;
  SafetyScene bend;
  for (const auto& [x, y] : {std::pair{0.0, 0.0}, {1.5, 0.1}, {2.6, 0.9}, {2.9, 2.2}}) {
    bend.path.way_points.push_back({{x, y}, {}});
  }
  bend.T_world_base = SplinePath(bend.path).at(1.2).pose();
  for (const SafetyScene& scene : {SafetyScene::straight(), bend}) {
    const SafetyDecision decision = decide(scene, SafetyPolicy::kConservative, 0.5);
    const SplinePath spline(scene.path);
    const double way_m = spline.nearest_m(scene.T_world_base.translation_m);
    const BoostPolygon protective = boost_polygon(decision.protective_world_m);
    EXPECT_TRUE(boost::geometry::is_valid(protective));
    EXPECT_TRUE(boost::geometry::is_valid(boost_polygon(decision.warning_world_m)));
    EXPECT_GT(boost::geometry::area(protective), 0.0) << "counter-clockwise";
    const double ahead_m = SafetyParams().standoff_m + 0.5 * vehicle.reaction_s + 0.25 / (2.0 * vehicle.slowing_m_s2);
    int inside = 0;
    for (double x = -1.0; x < 2.0; x += 0.03) {
      for (double y = -1.0; y < 1.0; y += 0.03) {
        const Eigen::Vector2d p = scene.T_world_base * Eigen::Vector2d(x, y);
        double gap_m = 1e9;
        for (double d_m = 0.0; d_m <= ahead_m; d_m += 0.01) {
          gap_m = std::min(gap_m, clearance_m(vehicle.footprint, inverse(spline.at(way_m + d_m).pose()) * p));
        }
        const bool is_in = boost::geometry::within(BoostPoint(p.x(), p.y()), protective);
        inside += is_in ? 1 : 0;
        if (gap_m < SafetyParams().margin_m - 0.04 && !is_in) ADD_FAILURE() << "outside: " << x << ' ' << y;
        if (gap_m > SafetyParams().margin_m + 0.08 && is_in) ADD_FAILURE() << "inside: " << x << ' ' << y;
      }
    }
    EXPECT_GT(inside, 300);
  }
}

TEST(SafetyAreas, PolygonsGrowWithSpeedAndShrinkToKnownChains) {
  SafetyScene scene = SafetyScene::straight();
  const auto area = [](const std::vector<Eigen::Vector2d>& points_m) {
    return boost::geometry::area(boost_polygon(points_m));
  };
  double before_m2 = 0.0;
  for (const double speed_m_s : {0.0, 0.2, 0.35, 0.5}) {
    const double now_m2 = area(decide(scene, speed_m_s).protective_world_m);
    EXPECT_GT(now_m2, before_m2);
    before_m2 = now_m2;
  }
  scene.boxes = {{{0.6, 0.6}, 0.0, 0.2, 0.1}};
  scene.know(scene.boxes.front(), 3);
  const SafetyDecision updated = decide(scene, SafetyPolicy::kUpdated);
  const SafetyDecision conservative = decide(scene, SafetyPolicy::kConservative);
  EXPECT_LT(area(updated.warning_world_m), area(conservative.warning_world_m));
  for (const ChainVertex& vertex : std::get<PolylineShape>(scene.map.features.front().shape).vertices) {
    const BoostPoint p(vertex.p_world_m.x(), vertex.p_world_m.y());
    EXPECT_FALSE(boost::geometry::within(p, boost_polygon(updated.warning_world_m)));
    EXPECT_TRUE(boost::geometry::within(p, boost_polygon(conservative.warning_world_m)));
  }
  // Never below the hard floor, in whose way a chain may stand.
  scene.boxes = {{{0.6, 0.2}, 0.0, 0.2, 0.1}};
  scene.map.features.clear();
  scene.know(scene.boxes.front(), 3);
  const BoostPolygon shrunk = boost_polygon(decide(scene, SafetyPolicy::kUpdated).protective_world_m);
  for (double x_m = -0.2; x_m < 0.4; x_m += 0.05) {
    for (const double y_m : {-0.2, 0.0, 0.2}) {
      EXPECT_TRUE(boost::geometry::within(BoostPoint(x_m, y_m), shrunk)) << x_m << ' ' << y_m;
    }
  }
}

TEST(SafetyAreas, PoliciesAreNamed) {
  SafetyParams params;
  for (const SafetyPolicy policy : kPolicies) {
    params.policy = policy;
    EXPECT_EQ(params_from_yaml<SafetyParams>(yaml_from_params(params), "text").policy, policy);
  }
  EXPECT_TRUE(names(refusal_of([] { params_from_yaml<SafetyParams>("policy: reckless", "my.yaml"); }),
                    {"my.yaml", "policy", "conservative", "updated", "ignore_known"}));
  EXPECT_TRUE(names(refusal_of([] { params_from_yaml<SafetyParams>("floor_margin_m: 1", "my.yaml"); }),
                    {"safety.floor_margin_m", "safety.margin_m"}));
}

}  // namespace
}  // namespace situation_awareness::safety_areas_test
