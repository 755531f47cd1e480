// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/scouting.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "support/fault_cell.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::scouting_test {
namespace {

constexpr double kStep_s = 0.25;

ScoutingParams quick_params() {
  ScoutingParams params;
  params.routes = 3;
  params.changes = 20;
  return params;
}

GridTarget target_at(std::uint64_t id, const Eigen::Vector2d& p_m) {
  GridTarget target;
  target.id = id;
  target.p_world_m << p_m, 0.0;
  target.covariance_m2 = 0.01 * Eigen::Matrix2d::Identity();
  target.probability = 0.9;
  return target;
}

/// A vehicle that flies as it is told, over level ground, and finds each thing by its third image within 80 m.
class Flown {
 public:
  explicit Flown(const ScoutingParams& params, const Eigen::Vector2d& home_m = {0.0, -95.0})
      : scouting(params, {home_m.x(), home_m.y(), params.height_m}, [](double, double) { return 0.0; }),
        home(home_m.x(), home_m.y(), params.height_m),
        p_m(home) {}

  const ScoutingStep& step() {
    ScoutingInput input;
    input.stamp_ns = nanoseconds(1e5 + time_s + stamp_off_s);
    input.sees = sees;
    input.p_world_m = p_m;
    input.yaw_rad = yaw_rad;
    input.targets = &targets;
    if (gives_obstacles) input.obstacles = &obstacles;
    gives_obstacles = false;
    told = scouting.step(input);
    if (told.state == ScoutingState::kCloseUp && told.target != close_up) ++begun[told.target];
    close_up = told.state == ScoutingState::kCloseUp ? told.target : 0;
    const ScoutingParams& params = scouting.params();
    const Eigen::Vector3d to_m = told.go_to_world_m - p_m;
    const double most_m = params.speed_m_s * kStep_s, turn_rad = wrap_to_pi(told.yaw_rad - yaw_rad);
    p_m += to_m.norm() > most_m ? Eigen::Vector3d(to_m.normalized() * most_m) : to_m;
    yaw_rad =
        wrap_to_pi(yaw_rad + std::clamp(turn_rad, -params.yaw_rate_rad_s * kStep_s, params.yaw_rate_rad_s * kStep_s));
    time_s += kStep_s;
    least_clearance_m = std::min(least_clearance_m, distance_m(obstacles, p_m.head<2>()));
    if (++steps % 2 == 0) look();
    flown_m.push_back(p_m);
    return told;
  }

  /// Until it is done, or so long.
  bool fly(double longest_s) {
    while (time_s < longest_s) {
      if (step().state == ScoutingState::kDone) return true;
    }
    return false;
  }

  Scouting scouting;
  Eigen::Vector3d home, p_m;
  std::vector<Eigen::Vector2d> things_m;
  Obstacles obstacles;
  bool gives_obstacles = false, sees = true;
  double stamp_off_s = 0.0;  ///< error of the stamps
  GridTargets targets;
  ScoutingStep told;
  double yaw_rad = 0.0, time_s = 0.0, least_clearance_m = std::numeric_limits<double>::infinity();
  std::map<std::uint64_t, int> begun;  ///< close-ups by target
  std::map<std::uint64_t, double> nearest_m;
  std::vector<Eigen::Vector3d> flown_m;
  std::vector<ScoutView> views;

 private:
  void look() {
    scouting.add_image(p_m, yaw_rad);
    const ScoutView view{p_m.head<2>(), p_m.z(), yaw_rad};
    views.push_back(view);
    images_.resize(things_m.size(), 0);
    for (std::size_t i = 0; i < things_m.size(); ++i) {
      if (!is_in_view(scouting.params().camera, view, things_m[i])) continue;
      const double distance_m = (things_m[i] - view.p_world_m).norm();
      const std::uint64_t id = i + 1;
      if (distance_m > 80.0) continue;
      const auto nearest = nearest_m.emplace(id, distance_m).first;
      nearest->second = std::min(nearest->second, distance_m);
      if (++images_[i] == 3) targets.targets.push_back(target_at(id, things_m[i]));
    }
  }

  int steps = 0;
  std::uint64_t close_up = 0;
  std::vector<int> images_;
};

std::vector<Eigen::Vector2d> random_things(Random& random, int count) {
  std::vector<Eigen::Vector2d> things_m;
  while (static_cast<int>(things_m.size()) < count) {
    const Eigen::Vector2d p_m(random.uniform(-95.0, 95.0), random.uniform(-95.0, 95.0));
    const bool is_near = std::any_of(things_m.begin(), things_m.end(),
                                     [&](const Eigen::Vector2d& other_m) { return (other_m - p_m).norm() < 10.0; });
    if (!is_near) things_m.push_back(p_m);
  }
  return things_m;
}

TEST(ScoutingFlights, IsHomeBeforeAnyBudgetEnds) {
  Random random(1);
  int short_of_time = 0;
  for (int i = 0; i < 8; ++i) {
    ScoutingParams params = quick_params();
    params.budget_s = random.uniform(40.0, 300.0);
    params.margin_s = random.uniform(5.0, 25.0);
    params.speed_m_s = random.uniform(3.0, 10.0);
    params.seed = i;
    Flown flown(params, {random.uniform(-120.0, 120.0), random.uniform(-120.0, 120.0)});
    flown.things_m = random_things(random, 12);
    ASSERT_TRUE(flown.fly(params.budget_s + 10.0)) << i;
    EXPECT_LE(flown.time_s, params.budget_s) << i;
    EXPECT_LT((flown.p_m - flown.home).head<2>().norm(), 3.0) << i;
    short_of_time += flown.told.reason.find("budget") != std::string::npos ? 1 : 0;
  }
  EXPECT_GT(short_of_time, 2);  // the budget was what ended these
}

TEST(ScoutingFlights, SeesAllOfARegionWithoutTargets) {
  ScoutingParams params = quick_params();
  Flown flown(params);
  ASSERT_TRUE(flown.fly(params.budget_s));
  // The belief says so, and so does a count of images on a finer lattice.
  EXPECT_LT(flown.told.expected_left, 0.1 * params.expected_targets);
  int seen = 0, all = 0;
  for (double x = -98.0; x < 100.0; x += 4.0) {
    for (double y = -98.0; y < 100.0; y += 4.0) {
      const auto shows = [&](const ScoutView& view) {
        return is_in_view(params.camera, view, {x, y}) &&
               (Eigen::Vector2d(x, y) - view.p_world_m).norm() < params.camera.range_m;
      };
      ++all;
      seen += std::count_if(flown.views.begin(), flown.views.end(), shows) >= 3 ? 1 : 0;
    }
  }
  EXPECT_GT(seen, 0.98 * all);
  EXPECT_TRUE(flown.begun.empty());
}

TEST(ScoutingFlights, FindsAllAndGoesNearEachOnce) {
  Random random(2);
  for (int i = 0; i < 3; ++i) {
    ScoutingParams params = quick_params();
    params.seed = i;
    Flown flown(params);
    flown.things_m = random_things(random, 12);
    ASSERT_TRUE(flown.fly(params.budget_s));
    EXPECT_EQ(flown.targets.targets.size(), 12U);
    EXPECT_EQ(flown.told.targets, 12U);
    EXPECT_EQ(flown.told.close_ups, 12U);
    for (const auto& [id, nearest_m] : flown.nearest_m) {
      EXPECT_LT(nearest_m, 1.3 * std::hypot(params.close_up_m, params.close_up_height_m)) << id;
    }
    // An image on the way to another may have been near enough; on the way to one it may turn to another first.
    int begun = 0;
    for (const auto& [id, times] : flown.begun) begun += times;
    EXPECT_LE(begun, 16);
  }
}

TEST(ScoutingFlights, ATargetThatWasNearIsNotGoneToAgain) {
  ScoutingParams params = quick_params();
  Flown flown(params);
  flown.things_m = {{0.0, 0.0}};
  while (flown.told.close_ups == 0 && flown.time_s < 300.0) flown.step();
  ASSERT_EQ(flown.told.close_ups, 1U);
  // The same thing with another id.
  flown.targets.targets = {target_at(77, {0.5, 0.2})};
  const std::map<std::uint64_t, int> before = flown.begun;
  flown.fly(params.budget_s);
  EXPECT_EQ(flown.begun, before);
}

/// Flies until all things it can see were closed up, at most 400 s.
void fly_until(Flown& flown, std::size_t close_ups) {
  while (flown.told.close_ups < close_ups && flown.time_s < 400.0) flown.step();
  ASSERT_EQ(flown.told.close_ups, close_ups);
}

// A map that begins anew has other ids for the same things.
TEST(ScoutingFlights, AMapThatBeginsAnewIsKnownByItsPlaces) {
  ScoutingParams params = quick_params();
  Flown flown(params);
  flown.things_m = {{0.0, 0.0}, {40.0, 20.0}, {-50.0, 30.0}};
  fly_until(flown, 3);
  const std::map<std::uint64_t, int> before = flown.begun;
  // The third one has the id that the first one had; nobody has those of the second and the third.
  flown.targets.targets = {target_at(1, {-50.3, 30.2}), target_at(8, {0.4, -0.3}), target_at(9, {40.0, 20.5})};
  flown.fly(params.budget_s);
  EXPECT_EQ(flown.begun, before);
  EXPECT_EQ(flown.told.targets, 3U);
  EXPECT_EQ(flown.told.close_ups, 3U);
}

// It kept "closed up" under the old id, and flew home.
TEST(ScoutingFlights, AnIdThatIsUsedAgainElsewhereIsAnotherTarget) {
  ScoutingParams params = quick_params();
  Flown flown(params);
  flown.things_m = {{0.0, 0.0}};
  fly_until(flown, 1);
  const double begin_s = flown.time_s;
  flown.things_m.clear();
  flown.targets.targets = {target_at(1, {60.0, 50.0})};
  const Eigen::Vector3d there_m(60.0, 50.0, 0.0);
  double nearest_m = std::numeric_limits<double>::infinity();
  while (flown.told.close_ups < 2 && flown.time_s < begin_s + 200.0 && flown.told.state != ScoutingState::kDone) {
    flown.step();
    nearest_m = std::min(nearest_m, (flown.p_m - there_m).norm());
  }
  EXPECT_EQ(flown.told.close_ups, 2U) << flown.told.reason;
  EXPECT_EQ(flown.told.targets, 2U);
  EXPECT_LT(nearest_m, 1.3 * std::hypot(params.close_up_m, params.close_up_height_m));
}

// Whatever the stamps say: the budget goes on, home is where it was.
TEST(ScoutingFlights, OneStampOrTimeThatIsSetBackMovesNeitherHomeNorBudget) {
  struct Case {
    double by_s;
    int steps;
  };
  ScoutingParams params = quick_params();
  params.budget_s = 120.0;
  for (const Case& one : {Case{2.0, 1}, Case{3600.0, 1}, Case{-5.0, 1}, Case{-3600.0, 1}, Case{-3600.0, 1000000}}) {
    Flown flown(params, {60.0, -40.0});
    for (int i = 0; i < 100; ++i) flown.step();
    const double elapsed_s = flown.told.elapsed_s;
    EXPECT_NEAR(elapsed_s, 24.75, 1e-6);
    flown.stamp_off_s = one.by_s;
    int left = one.steps;
    while (flown.told.state != ScoutingState::kDone && flown.time_s < 2.0 * params.budget_s) {
      flown.step();
      if (--left == 0) flown.stamp_off_s = 0.0;
      EXPECT_LT(flown.told.elapsed_s, flown.time_s + 2.1);
      EXPECT_GT(flown.told.elapsed_s, flown.time_s - 1.0);
    }
    EXPECT_EQ(flown.told.state, ScoutingState::kDone) << one.by_s;
    EXPECT_GT(flown.time_s, 60.0) << one.by_s << ": it went on after the jump";
    EXPECT_LT(flown.time_s, params.budget_s) << one.by_s;
    EXPECT_LT((flown.p_m - flown.home).head<2>().norm(), 3.0) << one.by_s;
  }
}

// Steps that were missing are time that went by.
TEST(ScoutingFlights, CountsTheTimeInWhichItHadNoOdometry) {
  ScoutingParams params = quick_params();
  params.budget_s = 200.0;
  Flown flown(params);
  for (int i = 0; i < 100; ++i) flown.step();
  flown.time_s += 60.0;
  for (int i = 0; i < 3; ++i) flown.step();
  EXPECT_NEAR(flown.told.elapsed_s, flown.time_s - kStep_s, 1e-6);
  EXPECT_TRUE(flown.fly(params.budget_s));
}

TEST(ScoutingFlights, OnePoseThatIsFarOffDoesNotEndTheMission) {
  const FaultCell cell("scout", "odometry", "contradicts another input",
                       "a pose far off: one changes nothing, two send it home");
  ScoutingParams params = quick_params();
  Flown flown(params);
  for (int i = 0; i < 40; ++i) flown.step();
  const Eigen::Vector3d p_m = flown.p_m;
  flown.p_m = {5000.0, 5000.0, 25.0};
  flown.step();
  flown.p_m = p_m;
  flown.step();
  EXPECT_EQ(flown.told.state, ScoutingState::kScout) << flown.told.reason;
}

TEST(ScoutingFlights, HoldsWithoutImagesUntilTheWayHomeIsDue) {
  ScoutingParams params = quick_params();
  params.budget_s = 100.0;
  Flown flown(params);
  for (int i = 0; i < 120; ++i) flown.step();
  flown.sees = false;
  flown.step();
  const Eigen::Vector3d there_m = flown.p_m;
  for (int i = 0; i < 40; ++i) {
    EXPECT_EQ(flown.step().state, ScoutingState::kHold) << flown.told.reason;
    EXPECT_LT((flown.p_m - there_m).norm(), 2.0);
  }
  EXPECT_TRUE(flown.fly(params.budget_s));
  EXPECT_EQ(flown.told.reason, "the budget is only enough for the way home");
  // With images it goes on.
  Flown again(params);
  for (int i = 0; i < 120; ++i) {
    again.sees = i < 40 || i > 60;
    again.step();
  }
  EXPECT_EQ(again.told.state, ScoutingState::kScout) << again.told.reason;
}

TEST(ScoutingFlights, TheSameSeedGivesTheSameFlight) {
  ScoutingParams params = quick_params();
  Random random(3);
  const std::vector<Eigen::Vector2d> things_m = random_things(random, 8);
  std::vector<std::vector<Eigen::Vector3d>> flights;
  for (const int seed : {5, 5, 6}) {
    params.seed = seed;
    Flown flown(params);
    flown.things_m = things_m;
    flown.fly(120.0);
    flights.push_back(flown.flown_m);
  }
  EXPECT_EQ(flights[0], flights[1]);
  EXPECT_NE(flights[0], flights[2]);
}

TEST(ScoutingFlights, KeepsAwayFromObstacles) {
  Random random(4);
  for (int i = 0; i < 2; ++i) {
    ScoutingParams params = quick_params();
    params.seed = i;
    params.clearance_m = 4.0;
    Flown flown(params);
    for (std::uint64_t k = 1; k <= 8; ++k) {
      const Eigen::Vector2d p_m(random.uniform(-80.0, 80.0), random.uniform(-70.0, 80.0));
      flown.obstacles.add(Ellipse{p_m, 0.0, random.uniform(2.0, 8.0), 2.0}, 0.0, k);
    }
    flown.obstacles.add({{-40.0, -75.0}, {40.0, -75.0}, {40.0, -60.0}}, false, 0.0, ObstacleKind::kChain, 99);
    flown.gives_obstacles = true;
    for (const Eigen::Vector2d& p_m : random_things(random, 12)) {
      if (distance_m(flown.obstacles, p_m) > 10.0) flown.things_m.push_back(p_m);
    }
    ASSERT_TRUE(flown.fly(params.budget_s));
    EXPECT_GT(flown.least_clearance_m, params.clearance_m - 1e-6);
    EXPECT_EQ(flown.told.expected_left < 0.25 * params.expected_targets, true) << flown.told.expected_left;
    EXPECT_GE(flown.told.close_ups + flown.told.given_up, flown.things_m.size() - 1);
  }
}

TEST(ScoutingFlights, HoldsWhereItIsShutIn) {
  ScoutingParams params = quick_params();
  Flown flown(params, {0.0, 0.0});
  while ((flown.p_m - flown.home).norm() < 20.0 && flown.time_s < 60.0) flown.step();
  const Eigen::Vector2d p_m = flown.p_m.head<2>();
  flown.obstacles.add(Ellipse{p_m, 0.0, 6.0, 6.0}, 0.0, 1);
  flown.gives_obstacles = true;
  EXPECT_EQ(flown.step().state, ScoutingState::kHold);
  for (int i = 0; i < 40; ++i) flown.step();
  EXPECT_LT((flown.p_m.head<2>() - p_m).norm(), 1e-6);
  // What is gone holds nothing up.
  flown.obstacles.clear();
  flown.gives_obstacles = true;
  EXPECT_NE(flown.step().state, ScoutingState::kHold);
  EXPECT_TRUE(flown.fly(params.budget_s));
}

TEST(Scouting, RefusesNumbersThatAreNone) {
  for (const auto& [name, value] : {std::pair<const char*, double>{"NaN", NAN}, {"inf", INFINITY}, {"-1", -1.0}}) {
    const FaultCell cell("scout", "parameters", name, "does not start, and names field and bound");
    for (double ScoutingParams::*field :
         {&ScoutingParams::budget_s, &ScoutingParams::margin_s, &ScoutingParams::speed_m_s,
          &ScoutingParams::acceleration_m_s2, &ScoutingParams::yaw_rate_rad_s, &ScoutingParams::image_rate_hz,
          &ScoutingParams::height_m, &ScoutingParams::arrival_m, &ScoutingParams::close_up_m,
          &ScoutingParams::close_up_height_m, &ScoutingParams::expected_targets, &ScoutingParams::clearance_m}) {
      ScoutingParams params;
      params.*field = value;
      EXPECT_TRUE(names(refusal_of([&] { Scouting(params, {0.0, 0.0, 25.0}); }), {"scouting."}));
    }
  }
  const FaultCell never("scout", "parameters", "never came", "the defaults: starts");
  const FaultCell empty("scout", "parameters", "empty", "the defaults: starts");
  Flown flown{ScoutingParams()};
  EXPECT_EQ(flown.step().state, ScoutingState::kScout);
}

TEST(Scouting, RefusesBadParams) {
  const FaultCell cell("scout", "parameters", "contradicts another input", "does not start, and names both");
  const auto refused = [](const std::function<void(ScoutingParams&)>& change) {
    ScoutingParams params;
    change(params);
    return refusal_of([&] { Scouting(params, {0.0, 0.0, 25.0}); });
  };
  EXPECT_TRUE(names(refused([](ScoutingParams& p) { p.speed_m_s = 0.0; }), {"scouting.speed_m_s"}));
  EXPECT_TRUE(
      names(refused([](ScoutingParams& p) { p.margin_s = 700.0; }), {"scouting.margin_s", "scouting.budget_s"}));
  EXPECT_TRUE(names(refused([](ScoutingParams& p) { p.region.x_max_world_m = -100.0; }), {"region.x_max_world_m"}));
  EXPECT_TRUE(names(refused([](ScoutingParams& p) {
                      p.camera.pitch_rad = 0.5;
                      p.camera.vertical_field_of_view_rad = 0.9;
                    }),
                    {"camera.pitch_rad"}));
  EXPECT_TRUE(names(refused([](ScoutingParams& p) { p.close_up_m = 2.0; }), {"scouting.close_up_m"}));
  EXPECT_TRUE(names(refused([](ScoutingParams& p) { p.region.x_max_world_m = 1e5; }), {"scouting.region"}));
  EXPECT_TRUE(names(refusal_of([] { Scouting(ScoutingParams(), {0.0, std::nan(""), 0.0}); }), {"home"}));
  Scouting scouting(ScoutingParams(), {0.0, 0.0, 25.0});
  ScoutingInput input;
  input.yaw_rad = std::nan("");
  EXPECT_TRUE(names(refusal_of([&] { scouting.step(input); }), {"pose"}));
}

TEST(ScoutBelief, GainsAreWhatIsLeftLess) {
  Random random(5);
  ScoutBelief belief(ScoutCameraParams(), {-100.0, -100.0}, {100.0, 100.0}, 10.0, 12.0);
  EXPECT_NEAR(belief.left(), 12.0, 1e-9);
  double sum = 0.0;
  for (int i = 0; i < 200; ++i) {
    const ScoutView view{{random.uniform(-120.0, 120.0), random.uniform(-120.0, 120.0)},
                         random.uniform(5.0, 40.0),
                         random.uniform(-kPi, kPi)};
    const double gain = belief.look(view, random.uniform(0.2, 3.0));
    EXPECT_GE(gain, 0.0);
    sum += gain;
  }
  EXPECT_NEAR(belief.left(), 12.0 - sum, 1e-3);
}

TEST(ScoutBelief, TwoImagesAreWorthAsMuchTogether) {
  ScoutBelief once(ScoutCameraParams(), {-100.0, -100.0}, {100.0, 100.0}, 10.0, 12.0), twice = once;
  const ScoutView view{{-50.0, -20.0}, 25.0, 0.3};
  const double together = once.look(view, 3.0);
  const double first = twice.look(view, 1.0), second = twice.look(view, 2.0);
  EXPECT_NEAR(first + second, together, 1e-5);
  // And more of the same are worth ever less; from elsewhere, more.
  EXPECT_LT(once.look(view, 1000.0) + together, 12.0);
  EXPECT_NEAR(once.look(view, 1000.0), 0.0, 1e-3);
  EXPECT_GT(once.look({{60.0, 20.0}, 25.0, kPi + 0.3}, 3.0), 0.05);
}

TEST(ScoutBelief, IsTheSameFromAllSides) {
  // The lattice and the directions are the same after a quarter turn.
  Random random(6);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d p_m(random.uniform(-90.0, 90.0), random.uniform(-90.0, 90.0));
    const double yaw_rad = random.uniform(-kPi, kPi);
    double gains[2];
    for (int k = 0; k < 2; ++k) {
      ScoutBelief belief(ScoutCameraParams(), {-100.0, -100.0}, {100.0, 100.0}, 10.0, 12.0);
      const Eigen::Vector2d turned_m = Eigen::Rotation2Dd(k * 0.5 * kPi) * p_m;
      gains[k] = belief.look({turned_m, 25.0, yaw_rad + k * 0.5 * kPi}, 2.0);
    }
    EXPECT_NEAR(gains[0], gains[1], 1e-6);
  }
}

TEST(ScoutBelief, OnlyWhatIsInViewGains) {
  const ScoutCameraParams camera;
  Random random(7);
  for (int i = 0; i < 20; ++i) {
    ScoutBelief belief(camera, {-100.0, -100.0}, {100.0, 100.0}, 10.0, 12.0);
    const ScoutView view{{random.uniform(-90.0, 90.0), random.uniform(-90.0, 90.0)},
                         random.uniform(5.0, 40.0),
                         random.uniform(-kPi, kPi)};
    belief.look(view, 1.0);
    for (std::size_t place = 0; place < belief.places(); ++place) {
      const Eigen::Vector2d& p_m = belief.place_m(place);
      const bool is_seen = is_in_view(camera, view, p_m) && (p_m - view.p_world_m).norm() <= camera.range_m;
      EXPECT_EQ(belief.found(place) > 0.0, is_seen) << p_m.transpose();
    }
  }
}

TEST(ScoutBelief, WhatTheGridDoesNotShowWasNotSeen) {
  ScoutBelief belief(ScoutCameraParams(), {-100.0, -100.0}, {100.0, 100.0}, 10.0, 12.0);
  const ScoutView view{{-90.0, 0.0}, 25.0, 0.0};
  for (int i = 0; i < 5; ++i) belief.look(view, 1.0);
  SemanticGrid grid;  // observed for x < 0
  grid.cell_m = 1.0;
  grid.first_column = grid.first_row = -100;
  grid.width = grid.height = 200;
  grid.probability.assign(200U * 200U, std::numeric_limits<float>::quiet_NaN());
  for (int row = 0; row < 200; ++row) {
    for (int column = 0; column < 100; ++column) grid.probability[grid.index(column, row)] = 0.0F;
  }
  belief.take_unobserved(grid);
  for (std::size_t place = 0; place < belief.places(); ++place) {
    if (belief.place_m(place).x() > 0.0) {
      EXPECT_EQ(belief.found(place), 0.0);
    }
  }
  const double left = belief.left();
  const double gain = belief.look(view, 100.0);
  EXPECT_NEAR(gain, left - belief.left(), 1e-3);
  for (std::size_t place = 0; place < belief.places(); ++place) {  // no use in looking from there again
    if (belief.place_m(place).x() > 0.0) {
      EXPECT_EQ(belief.found(place), 0.0);
    }
  }
  EXPECT_GT(belief.look({{10.0, 90.0}, 25.0, -0.5 * kPi}, 4.0), 0.1);  // but from elsewhere
}

TEST(ScoutBelief, TentativeClustersAreLookedAt) {
  ScoutBelief belief(ScoutCameraParams(), {-100.0, -100.0}, {100.0, 100.0}, 10.0, 12.0);
  GridCluster cluster;
  cluster.p_world_m = {20.0, 0.0};
  cluster.probability = 0.9;
  belief.set_tentative({cluster});
  EXPECT_NEAR(belief.left(), 12.4, 1e-9);
  belief.look({{-20.0, 0.0}, 25.0, 0.0}, 4.0);
  const double left = belief.left();
  cluster.p_world_m.x() += 1.0;  // it is the same one
  belief.set_tentative({cluster});
  EXPECT_NEAR(belief.left(), left, 1e-9);
  belief.set_tentative({});
  EXPECT_LT(belief.left(), left);
}

TEST(FreeWays, GoesAroundADisc) {
  FreeWays ways({-50.0, -50.0}, {50.0, 50.0}, 2.0);
  Obstacles obstacles;
  obstacles.add(Ellipse{{0.0, 0.0}, 0.0, 8.0, 8.0}, 0.0, 1);
  AvoidanceParams params;
  params.clearance_m = 2.0;
  ways.set(obstacles, params);
  // Tangents from 40 m to a circle of 10 m, and the arc in between.
  const double shortest_m = 2.0 * std::sqrt(40.0 * 40.0 - 100.0) + 10.0 * (kPi - 2.0 * std::acos(10.0 / 40.0));
  const double length_m = ways.length_m({-40.0, 0.0}, {40.0, 0.0});
  EXPECT_GE(length_m, shortest_m - 1e-9);
  EXPECT_LT(length_m, 1.1 * shortest_m);
  EXPECT_EQ(ways.length_m({-40.0, 20.0}, {40.0, 20.0}), 80.0);
  EXPECT_TRUE(std::isinf(ways.length_m({-40.0, 0.0}, {3.0, 0.0})));
  EXPECT_TRUE(ways.way({-40.0, 0.0}, {3.0, 0.0}).empty());
}

TEST(FreeWays, KeepTheirDistanceInRandomScenes) {
  Random random(8);
  int around = 0;
  for (int scene = 0; scene < 10; ++scene) {
    FreeWays ways({-60.0, -60.0}, {60.0, 60.0}, 3.0);
    Obstacles obstacles;
    for (std::uint64_t k = 1; k <= 12; ++k) {
      const Eigen::Vector2d p_m(random.uniform(-50.0, 50.0), random.uniform(-50.0, 50.0));
      const Eigen::Vector2d q_m = p_m + Eigen::Vector2d(random.uniform(-20.0, 20.0), random.uniform(-20.0, 20.0));
      if (k % 2 == 0) obstacles.add({p_m, q_m}, false, 0.1, ObstacleKind::kChain, k);
      if (k % 2 == 1) obstacles.add(Ellipse{p_m, 0.0, random.uniform(1.0, 6.0), 1.0}, 0.1, k);
    }
    AvoidanceParams params;
    params.clearance_m = 2.0;
    ways.set(obstacles, params);
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector2d from_m(random.uniform(-60.0, 60.0), random.uniform(-60.0, 60.0));
      const Eigen::Vector2d to_m(random.uniform(-60.0, 60.0), random.uniform(-60.0, 60.0));
      if (!ways.is_free(from_m) || !ways.is_free(to_m)) continue;
      const std::vector<Eigen::Vector2d> way = ways.way(from_m, to_m);
      if (way.empty()) continue;
      EXPECT_EQ(way.back(), to_m);
      double length_m = 0.0;
      Eigen::Vector2d at_m = from_m;
      for (const Eigen::Vector2d& corner_m : way) {
        for (double part = 0.0; part <= 1.0; part += 0.01) {
          EXPECT_GT(distance_m(obstacles, at_m + part * (corner_m - at_m)), 2.0 + 3.0 * 0.1 - 1e-6);
        }
        length_m += (corner_m - at_m).norm();
        at_m = corner_m;
      }
      EXPECT_LE(length_m, ways.length_m(from_m, to_m) + 1e-9);  // drawn straight it is no longer
      around += way.size() > 1 ? 1 : 0;
    }
  }
  EXPECT_GT(around, 30);
}

}  // namespace
}  // namespace situation_awareness::scouting_test
