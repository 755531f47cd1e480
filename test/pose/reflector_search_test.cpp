// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/reflector_search.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/estimation/manifold.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "support/consistency.hpp"
#include "support/manifold_jacobian.hpp"
#include "support/random_gaussian.hpp"
#include "support/reflector_hall.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::reflector_search_test {
namespace {

Pose2 random_pose(Random& random) {
  return {{random.uniform(-6.0, 6.0), random.uniform(-6.0, 6.0)}, random.uniform(-kPi, kPi)};
}

ReflectorMap random_map(Random& random, int reflectors) {
  ReflectorMap map;
  while (static_cast<int>(map.reflectors.size()) < reflectors) {
    const Reflector next{{random.uniform(-8.0, 8.0), random.uniform(-8.0, 8.0)}, 0.05};
    bool is_near = false;
    for (const Reflector& other : map.reflectors) {
      is_near = is_near || (next.center_world_m - other.center_world_m).norm() < 0.6;
    }
    if (!is_near) map.reflectors.push_back(next);
  }
  return map;
}

/// Places as seen from `T`, with the errors of the covariance if `random` is given.
std::vector<ReflectorPlace> places_of(const ReflectorMap& map, const Pose2& T, double sigma_m,
                                      Random* random = nullptr) {
  std::vector<ReflectorPlace> places;
  for (const Reflector& reflector : map.reflectors) {
    ReflectorPlace place{place_of(T, reflector.center_world_m), sigma_m * sigma_m * Eigen::Matrix2d::Identity()};
    if (random != nullptr) place.center_m += draw(place.covariance, *random);
    places.push_back(place);
  }
  return places;
}

TEST(ReflectorPlace, JacobianEqualsTheNumericalOne) {
  Random random(1);
  for (int i = 0; i < 50; ++i) {
    const Pose2 T = random_pose(random);
    const Eigen::Vector2d l(random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0));
    const auto J = manifold_jacobian<Eigen::Vector2d>([&](const Pose2& at) { return place_of(at, l); }, T);
    EXPECT_LT((J - place_jacobian(place_of(T, l))).cwiseAbs().maxCoeff(), 1e-8);
  }
}

// Whatever the configuration, the pose is exact, or said to be ambiguous, and that is rare.
TEST(ReflectorSearch, RecoversThePoseWithoutAGuess) {
  Random random(2);
  int found = 0;
  constexpr int kRuns = 3000;
  for (int i = 0; i < kRuns; ++i) {
    const ReflectorMap map = random_map(random, 3 + i % 6);
    const Pose2 truth = random_pose(random);
    ReflectorSearch search(map);
    const ReflectorPose& pose = search.find(places_of(map, truth, 0.002));
    if (!pose.is_known) {
      EXPECT_STREQ(pose.reason, "ambiguous");
      continue;
    }
    ++found;
    EXPECT_LT(Manifold<Pose2>::local_coordinates(pose.T_world_frame, truth).norm(), 1e-6) << i;
    for (std::size_t k = 0; k < pose.reflectors.size(); ++k) EXPECT_EQ(pose.reflectors[k], static_cast<int>(k));
  }
  EXPECT_GT(found, 0.99 * kRuns);
}

// Of eight reflectors four or five are seen, in any order, and two things that are none.
TEST(ReflectorSearchStatistics, LeavesOutWhatIsNoReflectorAndIsAsGoodAsItsCovarianceSays) {
  Random random(3);
  ChiSquareSum errors;
  int found = 0, wrong = 0;
  for (int i = 0; i < 400; ++i) {
    const ReflectorMap map = random_map(random, 8);
    const Pose2 truth = random_pose(random);
    ReflectorMap visible;
    for (int k = 0; k < 4 + i % 2; ++k)
      visible.reflectors.push_back(map.reflectors[static_cast<std::size_t>((3 * k + i) % 8)]);
    std::vector<ReflectorPlace> places = places_of(visible, truth, 0.01, &random);
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector2d anywhere(random.uniform(-8.0, 8.0), random.uniform(-8.0, 8.0));
      places.insert(places.begin(), {anywhere, 1e-4 * Eigen::Matrix2d::Identity()});
    }
    ReflectorSearch search(map);
    const ReflectorPose& pose = search.find(places);
    if (!pose.is_known) continue;
    ++found;
    const Estimate<Pose2> estimate{pose.T_world_frame, pose.P};
    const double squared = nees(estimate, truth);
    if (squared > 100.0) {
      ++wrong;
    } else if (pose.reflectors[0] < 0 && pose.reflectors[1] < 0) {
      errors.add(squared, 3);
    }
  }
  EXPECT_GT(found, 380);
  EXPECT_EQ(wrong, 0);
  EXPECT_TRUE(errors.is_consistent());
}

TEST(ReflectorSearch, RefusesWhatLooksTheSameAfterATurn) {
  const auto reason = [](const std::vector<Eigen::Vector2d>& centers, std::size_t seen) -> std::string {
    ReflectorMap map, visible;
    for (const Eigen::Vector2d& center : centers) map.reflectors.push_back({center, 0.05});
    visible.reflectors.assign(map.reflectors.begin(), map.reflectors.begin() + static_cast<std::ptrdiff_t>(seen));
    ReflectorSearch search(map);
    return search.find(places_of(visible, {{1.0, 0.5}, 0.4}, 0.005)).reason;
  };
  const double h = std::sqrt(3.0);
  EXPECT_EQ(reason({{0, 0}, {2, 0}, {1, h}}, 3), "ambiguous");                             // a regular triangle
  EXPECT_EQ(reason({{0, 0}, {3, 0}, {3, 2}, {0, 2}}, 4), "ambiguous");                     // a rectangle
  EXPECT_EQ(reason({{-2, 0}, {0, 0}, {2, 0}}, 3), "ambiguous");                            // a row, from either side
  EXPECT_EQ(reason({{0, 0}, {2, 0}, {0, 1}, {10, 0}, {12, 0}, {10, 1}}, 3), "ambiguous");  // a pattern that is repeated
  EXPECT_EQ(reason({{0, 0}, {2, 0}, {0, 1}, {10, 0}, {12, 0}, {10, 1}}, 4), "");           // with more it is clear
  EXPECT_EQ(reason({{0, 0}, {2, 0}, {0, 1}}, 3), "");
  EXPECT_EQ(reason({{0, 0}, {2, 0}, {1, 3}}, 3), "");  // equal legs: only the mirror image is the same
  EXPECT_EQ(reason({{0, 0}, {2, 0}, {0, 1}}, 2), "too few places");
}

TEST(ReflectorSearch, FindsNoMirrorImage) {
  ReflectorMap map;
  for (const Eigen::Vector2d& center : {Eigen::Vector2d(0, 0), Eigen::Vector2d(3, 0), Eigen::Vector2d(1, 2)}) {
    map.reflectors.push_back({center, 0.05});
  }
  std::vector<ReflectorPlace> places = places_of(map, {}, 0.005);
  for (ReflectorPlace& place : places) place.center_m.y() *= -1.0;
  ReflectorSearch search(map);
  EXPECT_STREQ(search.find(places).reason, "no match");
}

// Left-invariance: the world may be moved.
TEST(ReflectorSearch, MovesWithTheWorld) {
  Random random(5);
  for (int i = 0; i < 50; ++i) {
    const ReflectorMap map = random_map(random, 5);
    const Pose2 motion = random_pose(random);
    ReflectorMap moved = map;
    for (Reflector& reflector : moved.reflectors) reflector.center_world_m = motion * reflector.center_world_m;
    const std::vector<ReflectorPlace> places = places_of(map, random_pose(random), 0.01, &random);
    ReflectorSearch here(map), there(moved);
    const ReflectorPose& a = here.find(places);
    const ReflectorPose& b = there.find(places);
    ASSERT_EQ(a.is_known, b.is_known);
    EXPECT_LT(Manifold<Pose2>::local_coordinates(motion * a.T_world_frame, b.T_world_frame).norm(), 1e-9);
    EXPECT_LT((a.P - b.P).cwiseAbs().maxCoeff(), 1e-12);
  }
}

/// Searches until it has finished.
const ReflectorPose& finish(ReflectorSearch& search, const std::vector<ReflectorPlace>& places, int& calls) {
  const ReflectorPose* pose = &search.find(places);
  for (calls = 1; std::string(pose->reason) == "search not finished" && calls < 1000; ++calls) {
    pose = &search.find(places);
  }
  return *pose;
}

void find_in_halls(std::uint64_t first, std::uint64_t halls) {
  int known = 0, clear = 0, clear_known = 0;
  for (std::uint64_t seed = first; seed < first + halls; ++seed) {
    const ReflectorHall hall(seed);
    ReflectorSearch search(hall.map);
    int calls = 0;
    const ReflectorPose& pose = finish(search, hall.places, calls);
    EXPECT_LE(calls, 25) << "a second of scans, hall " << seed;
    if (pose.is_known) {
      EXPECT_TRUE(hall.is_right(pose.T_world_frame)) << "hall " << seed << ", " << hall.name;
    }
    known += pose.is_known ? 1 : 0;
    // Of a layout that hardly ever looks like itself.
    const bool is_clear = hall.name == "anywhere" && hall.true_places >= 6;
    clear += is_clear ? 1 : 0;
    clear_known += is_clear && pose.is_known ? 1 : 0;
  }
  std::printf("halls: %d of %d poses known; %d of %d with six places or more of reflectors that are anywhere\n", known,
              static_cast<int>(halls), clear_known, clear);
  EXPECT_GT(clear_known, 0.95 * clear);
}

TEST(ReflectorSearch, IsNeverWrongInAnyHall) { find_in_halls(1, 500); }

TEST(ReflectorSearchLong, IsNeverWrongInTenThousandHalls) { find_in_halls(20'000, 10'000); }

// Counted, not timed: what is not finished goes on with the next scan, and the last says the same as if it had not been
// interrupted.
TEST(ReflectorSearch, FindsThePoseAmongAThousandReflectors) {
  int clear = 0, known = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const ReflectorHall hall(seed, 1000);
    ReflectorSearch search(hall.map);
    int calls = 0;
    const ReflectorPose& pose = finish(search, hall.places, calls);
    EXPECT_LE(calls, 25) << seed;
    if (pose.is_known) {
      EXPECT_TRUE(hall.is_right(pose.T_world_frame)) << seed;
    }
    const bool is_clear = hall.name == "anywhere" && hall.true_places >= 6;
    clear += is_clear ? 1 : 0;
    known += is_clear && pose.is_known ? 1 : 0;
  }
  EXPECT_GE(clear, 2);
  EXPECT_EQ(known, clear);
}

TEST(ReflectorSearch, RefusesAMapWithoutReflectors) {
  ReflectorMap map;
  EXPECT_TRUE(names(refusal_of([&] { ReflectorSearch search(map); }), {"reflectors"}));
}

}  // namespace
}  // namespace situation_awareness::reflector_search_test
