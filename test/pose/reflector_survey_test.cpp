// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/reflector_survey.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "pose/reflector_world.hpp"
#include "support/consistency.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::reflector_survey_test {
namespace {

const std::vector<Eigen::Vector2d> kPlaces_m = {{4.0, 1.0}, {-2.5, 3.2}, {-1.5, -3.0}, {3.0, -2.8}, {-4.3, -0.6}};

ReflectorMap map_of(std::size_t reflectors) {
  ReflectorMap map;
  for (std::size_t i = 0; i < reflectors; ++i) map.reflectors.push_back({kPlaces_m[i], 0.05});
  return map;
}

ReflectorWorld room_of(const ReflectorMap& map, double speed_m_s = 0.5) {
  ReflectorWorld world;
  world.add_room({-5.5, -4.5}, {5.5, 4.5});
  world.add(map);
  world.path = winding_path(speed_m_s);
  world.T_base_lidar = {{0.2, -0.05}, radians(5.0)};
  world.sweep_s = 0.03;
  return world;
}

/// A drive of which each scan is given to `each` before it is used.
template <class Each>
ReflectorSurveyResult survey_of(ReflectorWorld& world, std::uint64_t seed, int scans, Each each,
                                const Pose2& T_moved = {}) {
  Random random(seed);
  DriftingWheels wheels(world.path, seed + 1);
  ReflectorSurvey survey({}, T_moved * world.path(0.1));
  ReflectorSightings sightings;
  for (int scan = 0; scan < scans; ++scan) {
    const double time_s = 0.1 + 0.04 * scan;
    while (wheels.next_time_s() < time_s + 0.045) {
      const auto [stamp_ns, T_odom_base] = wheels.next();
      survey.add_odometry(stamp_ns, T_odom_base);
    }
    each(scan, world);
    sightings = detect_reflectors(world.points(time_s, random), {}, std::move(sightings));
    survey.add(sightings, world.T_base_lidar);
  }
  return survey.solve();
}

ReflectorSurveyResult survey_of(ReflectorWorld world, std::uint64_t seed, int scans, const Pose2& T_moved = {}) {
  return survey_of(
      world, seed, scans, [](int, ReflectorWorld&) {}, T_moved);
}

/// Index of the reflector of the map nearest to a place, if it is within 0.3 m; else -1.
int nearest(const ReflectorMap& map, const Eigen::Vector2d& p_m) {
  for (std::size_t i = 0; i < map.reflectors.size(); ++i) {
    if ((map.reflectors[i].center_world_m - p_m).norm() < 0.3) return static_cast<int>(i);
  }
  return -1;
}

/// The greatest error of a distance between two reflectors; infinity unless the same are in both.
double worst_distance_error_m(const ReflectorMap& found, const ReflectorMap& truth) {
  if (found.reflectors.size() != truth.reflectors.size()) return std::numeric_limits<double>::infinity();
  std::vector<Eigen::Vector2d> pairs_of_truth;
  for (const Reflector& reflector : found.reflectors) {
    const int i = nearest(truth, reflector.center_world_m);
    if (i < 0) return std::numeric_limits<double>::infinity();
    pairs_of_truth.push_back(truth.reflectors[static_cast<std::size_t>(i)].center_world_m);
  }
  double worst_m = 0.0;
  for (std::size_t a = 0; a < found.reflectors.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      const double distance_m = (found.reflectors[a].center_world_m - found.reflectors[b].center_world_m).norm();
      worst_m = std::max(worst_m, std::abs(distance_m - (pairs_of_truth[a] - pairs_of_truth[b]).norm()));
    }
  }
  return worst_m;
}

TEST(ReflectorSurvey, FindsWhereTheReflectorsAre) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const ReflectorMap truth = map_of(3 + seed % 3);
    const ReflectorSurveyResult result = survey_of(room_of(truth), seed, 500);
    EXPECT_EQ(result.reason, "");
    EXPECT_LT(worst_distance_error_m(result.map, truth), 0.01) << seed;
    EXPECT_LT(result.distance_sigma_m, 0.005) << seed;
    EXPECT_EQ(result.map.reflectors.size(), result.reflectors.size());
  }
}

// Along a corridor and back: of turns there is little but noise.
TEST(ReflectorSurveyStatistics, ACorridorIsNotBent) {
  ReflectorMap truth;
  for (const Eigen::Vector2d& center_m :
       {Eigen::Vector2d(1.0, 1.3), Eigen::Vector2d(3.0, -1.4), Eigen::Vector2d(5.5, 1.4), Eigen::Vector2d(8.0, -1.3),
        Eigen::Vector2d(10.0, 1.4), Eigen::Vector2d(12.5, -1.4), Eigen::Vector2d(14.8, 1.2)}) {
    truth.reflectors.push_back({center_m, 0.05});
  }
  ReflectorWorld world;
  world.add_room({0.0, -1.6}, {15.6, 1.6});
  world.add(truth);
  world.sweep_s = 0.03;
  constexpr double kSpeed_m_s = 0.5, kThere_s = 24.0, kTurn_s = 6.0;
  world.path = [=](double t_s) {
    const double yaw_rad = kPi * std::clamp((t_s - kThere_s) / kTurn_s, 0.0, 1.0);
    const double way_s = std::min(t_s, kThere_s) - std::max(0.0, t_s - kThere_s - kTurn_s);
    return Pose2{{1.5 + kSpeed_m_s * way_s, 0.0}, yaw_rad};
  };
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const ReflectorSurveyResult result = survey_of(world, seed, 1300);
    EXPECT_EQ(result.reason, "");
    EXPECT_LT(worst_distance_error_m(result.map, truth), 0.006) << seed;
    EXPECT_LT(std::abs(result.scale_error.y()), 0.06) << seed;
  }
}

// Against the truth in the world of the first pose, with the covariance of all reflectors one by one.
TEST(ReflectorSurveyStatistics, CovariancesAreHonest) {
  double sum = 0.0;
  int n = 0;
  constexpr int kSeeds = 40;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const ReflectorMap truth = map_of(4);
    const ReflectorSurveyResult result = survey_of(room_of(truth), 100 + seed, 400);
    ASSERT_EQ(result.reason, "");
    for (const SurveyedReflector& found : result.reflectors) {
      const int i = nearest(truth, found.reflector.center_world_m);
      ASSERT_GE(i, 0);
      const Eigen::Vector2d e =
          found.reflector.center_world_m - truth.reflectors[static_cast<std::size_t>(i)].center_world_m;
      sum += e.dot(found.covariance.llt().solve(e));
      ++n;
    }
  }
  EXPECT_EQ(n, 4 * kSeeds);
  std::printf("survey: NEES %.2f of 2\n", sum / n);
  // All errors of a drive have that of the yaw of the first pose in common, so they count as one of 2 to 8 degrees.
  EXPECT_GT(sum / n, chi_square_quantile(0.025, 2 * kSeeds) / kSeeds);
  EXPECT_LT(sum / n, chi_square_quantile(0.975, 2 * kSeeds) / kSeeds);
}

TEST(ReflectorSurvey, TheFirstPoseDefinesTheWorld) {
  const ReflectorMap truth = map_of(4);
  const Pose2 T_moved{{20.0, -7.0}, 2.1};
  const ReflectorSurveyResult here = survey_of(room_of(truth), 3, 300),
                              there = survey_of(room_of(truth), 3, 300, T_moved);
  ASSERT_EQ(here.map.reflectors.size(), 4U);
  ASSERT_EQ(there.map.reflectors.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d moved = T_moved * here.map.reflectors[i].center_world_m;
    EXPECT_LT((moved - there.map.reflectors[i].center_world_m).norm(), 1e-6);
    const Eigen::Matrix2d turned = T_moved.rotation() * here.reflectors[i].covariance * T_moved.rotation().transpose();
    EXPECT_LT((turned - there.reflectors[i].covariance).cwiseAbs().maxCoeff(), 1e-9);
  }
}

// What was surveyed is a map to localise by.
TEST(ReflectorSurvey, ItsMapLocalises) {
  const ReflectorMap truth = map_of(5);
  ReflectorWorld world = room_of(truth);
  const ReflectorMap map = survey_of(world, 5, 400).map;
  EXPECT_EQ(yaml_text(read_reflector_map(yaml_text(map), "file")), yaml_text(map));
  Random random(6);
  DriftingWheels wheels(world.path, 7);
  ReflectorLocalization localization(map, {});
  for (int scan = 0; scan < 100; ++scan) {
    const double time_s = 0.1 + 0.04 * scan;
    while (wheels.next_time_s() < time_s + 0.045) {
      const auto [stamp_ns, T_odom_base] = wheels.next();
      localization.add_odometry(stamp_ns, T_odom_base);
    }
    localization.update(detect_reflectors(world.points(time_s, random), {}), world.T_base_lidar);
  }
  ASSERT_TRUE(localization.is_known());
  const Eigen::Vector3d error =
      Manifold<Pose2>::local_coordinates(localization.pose().T_world_base.x, world.path(0.1 + 0.04 * 99));
  EXPECT_LT(error.head<2>().norm(), 0.015);
  EXPECT_LT(std::abs(error(2)), 0.01);
}

// A loop out of sight of the first reflectors: they are known again at its end.
TEST(ReflectorSurvey, KnowsReflectorsAgain) {
  ReflectorMap truth;
  for (int i = 0; i < 6; ++i) {
    truth.reflectors.push_back({{4.0 * i, 1.4}, 0.05});
    truth.reflectors.push_back({{4.0 * i + 1.7, -1.4}, 0.05});
  }
  ReflectorWorld world;
  world.add_room({-2.0, -1.6}, {24.0, 1.6});
  world.add(truth);
  world.max_range_m = 7.0;
  world.path = [](double t_s) {  // there at 1 m/s, half a turn, and back
    if (t_s < 20.0) return Pose2{{t_s, 0.1 * std::sin(t_s)}, 0.1 * std::cos(t_s)};
    const double turned = std::min(1.0, 0.25 * (t_s - 20.0));
    const double x = t_s < 24.0 ? 20.0 : 44.0 - t_s;
    return Pose2{{x, 0.1 * std::sin(20.0)}, 0.1 * std::cos(20.0) * (1.0 - turned) + kPi * turned};
  };
  const ReflectorSurveyResult result = survey_of(world, 8, 1080);
  EXPECT_EQ(result.reason, "");
  ASSERT_EQ(result.map.reflectors.size(), truth.reflectors.size());
  EXPECT_LT(worst_distance_error_m(result.map, truth), 0.02);
}

TEST(ReflectorSurvey, LeavesOutWhatIsNoReflector) {
  const ReflectorMap truth = map_of(4);
  ReflectorWorld world = room_of(truth);
  world.cylinders.push_back({{0.0, 0.0}, 0.07, 600.0});  // walks
  world.cylinders.push_back({{2.0, 3.2}, 0.05, 800.0});  // goes
  // Narrow glossy boards, bright where they are seen square on.
  world.walls.push_back({{-3.4, 1.55}, {-3.4, 1.65}, 250.0, 500.0});
  world.walls.push_back({{0.6, 3.4}, {0.7, 3.4}, 250.0, 500.0});
  const ReflectorSurveyResult result = survey_of(world, 9, 800, [](int scan, ReflectorWorld& now) {
    const double t = 0.04 * scan;
    now.cylinders[4].center_m = {std::remainder(0.9 * t, 7.0), 2.5 * std::sin(0.3 * t)};
    if (scan == 400) now.cylinders[5].center_m = {100.0, 0.0};
  });
  EXPECT_EQ(result.reason, "");
  EXPECT_LT(worst_distance_error_m(result.map, truth), 0.01);
  const auto is_gone = [](const SurveyRefusal& refusal) {
    return std::string(refusal.reason) == "gone" && (refusal.center_world_m - Eigen::Vector2d(2.0, 3.2)).norm() < 0.05;
  };
  EXPECT_TRUE(std::any_of(result.refused.begin(), result.refused.end(), is_gone));
}

TEST(ReflectorSurvey, SaysWhyItHasNoMap) {
  const ReflectorMap truth = map_of(4);
  EXPECT_TRUE(names(ReflectorSurvey({}, {}).solve().reason, {"no odometry"}));

  ReflectorWorld standing = room_of(truth);
  standing.path = [](double) { return Pose2{}; };
  EXPECT_TRUE(names(survey_of(standing, 1, 100).reason, {"did not move"}));

  EXPECT_TRUE(names(survey_of(room_of({}), 1, 300).reason, {"nothing", "8 scans"}));

  // Each is seen at its own end of a long way, by wheels alone in between.
  ReflectorMap far;
  far.reflectors = {{{2.0, 1.4}, 0.05}, {{30.0, 1.4}, 0.05}};
  ReflectorWorld corridor;
  corridor.add_room({-2.0, -1.6}, {34.0, 1.6});
  corridor.add(far);
  corridor.max_range_m = 5.0;
  corridor.path = [](double t_s) { return Pose2{{t_s, 0.0}, 0.0}; };
  EXPECT_TRUE(names(survey_of(corridor, 1, 750).reason, {"distances", "m;"}));

  ReflectorSurvey again({}, {});
  again.add_odometry(100'000'000'000, {});
  for (std::int64_t i = 0; i < StampOrder::kAgreeing; ++i) again.add_odometry(1'000'000'000 + i * 20'000'000, {});
  EXPECT_TRUE(names(again.solve().reason, {"go back"}));
}

TEST(ReflectorSurvey, RefusalsNameFieldAndBound) {
  ReflectorSurveyParams params;
  params.min_sightings = 1;
  EXPECT_TRUE(names(refusal_of([&] { ReflectorSurvey(params, {}); }), {"survey.min_sightings", "2"}));
}

}  // namespace
}  // namespace situation_awareness::reflector_survey_test
