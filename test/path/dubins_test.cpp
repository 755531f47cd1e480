// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/dubins.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "path/dubins_paths.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::dubins_test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::string words_of(const DubinsEnd& from, const DubinsEnd& to) {
  std::string words;
  for (const DubinsWord word : kDubinsWords) {
    const auto path = dubins_path(word, from, to);
    words += path ? std::string(" ") + name_of(word) + "=" + std::to_string(path->length_m) : "";
  }
  return words;
}

double length_of(const DubinsEnd& from, const DubinsEnd& to) { return shortest_dubins_path(from, to).length_m; }

/// Cases of all sizes against the radii, of equal and unequal radii, some on a grid, moved or not.
std::pair<DubinsEnd, DubinsEnd> random_case(Random& random) {
  const double rho_s = std::exp(random.uniform(-2.0, 2.0));
  const double rho_f = random.uniform() < 0.5 ? rho_s : std::exp(random.uniform(-2.0, 2.0));
  std::pair<DubinsEnd, DubinsEnd> ends;
  if (random.uniform() < 0.3) {
    const double radius_m = std::floor(random.uniform(1.0, 4.0));
    ends = {grid_end(random, radius_m), grid_end(random, random.uniform() < 0.5 ? radius_m : 2.0)};
    if (random.uniform() < 0.5) return ends;
    const Pose2 T{{random.uniform(-100.0, 100.0), random.uniform(-100.0, 100.0)}, random.uniform(-kPi, kPi)};
    return {moved(T, ends.first), moved(T, ends.second)};
  }
  const double size_m = std::exp(random.uniform(-3.0, 5.0));
  return {random_end(random, size_m, rho_s), random_end(random, size_m, rho_f)};
}

TEST(Dubins, IsContinuousFromPoseToPoseAndNoLongerThanAnyWord) {
  Random random(1);
  double greatest = 0.0;
  for (int i = 0; i < 100'000 && !::testing::Test::HasFailure(); ++i) {
    const auto [from, to] = random_case(random);
    double least_m = kInfinity;
    for (const DubinsWord word : kDubinsWords) {
      const auto path = dubins_path(word, from, to);
      if (!path) continue;
      EXPECT_LT(greatest_gap(*path, from, to), 1e-9) << i << name_of(word);
      EXPECT_NEAR(path->length_m, sum_of_segments_m(*path), 1e-12 * (100.0 + path->length_m)) << i;
      least_m = std::min(least_m, path->length_m);
    }
    const DubinsPath path = shortest_dubins_path(from, to);
    greatest = std::max(greatest, greatest_gap(path, from, to));
    EXPECT_LE(path.length_m, least_m + 1e-9);
    EXPECT_GE(path.length_m, (from.p_m - to.p_m).norm() - 1e-9);
  }
  EXPECT_LT(greatest, 1e-9);
}

/// The shortest path with a straight between two turns, by a search for headings at which the tangents of both circles
/// are one line.
double searched_length_m(const DubinsEnd& from, const DubinsEnd& to) {
  constexpr int kHeadings = 4000;
  const auto center = [](const DubinsEnd& end, double e) {
    return Eigen::Vector2d(end.p_m +
                           e * end.radius_m * Eigen::Vector2d(-std::sin(*end.yaw_rad), std::cos(*end.yaw_rad)));
  };
  const auto turned = [](double turn_rad) { return turn_rad - 2.0 * kPi * std::floor(turn_rad / (2.0 * kPi)); };
  double best_m = kInfinity;
  for (const double e_s : {1.0, -1.0}) {
    for (const double e_f : {1.0, -1.0}) {
      const Eigen::Vector2d O_s = center(from, e_s), O_f = center(to, e_f);
      const auto way = [&](double heading_rad) {  // from where the first turn ends to where the last begins
        const Eigen::Vector2d n(-std::sin(heading_rad), std::cos(heading_rad));
        return Eigen::Vector2d(O_f - e_f * to.radius_m * n - (O_s - e_s * from.radius_m * n));
      };
      const auto across = [&](double heading_rad) {
        const Eigen::Vector2d v = way(heading_rad);
        return std::cos(heading_rad) * v.y() - std::sin(heading_rad) * v.x();
      };
      for (int i = 0; i < kHeadings; ++i) {
        double low = 2.0 * kPi * i / kHeadings, high = 2.0 * kPi * (i + 1) / kHeadings;
        if ((across(low) > 0.0) == (across(high) > 0.0)) continue;
        const bool low_is_left = across(low) > 0.0;
        for (int k = 0; k < 60; ++k) {
          const double middle = 0.5 * (low + high);
          (across(middle) > 0.0) == low_is_left ? low = middle : high = middle;
        }
        const Eigen::Vector2d v = way(low);
        if (std::cos(low) * v.x() + std::sin(low) * v.y() < 0.0) continue;
        best_m = std::min(best_m, from.radius_m * turned(e_s * (low - *from.yaw_rad)) + v.norm() +
                                      to.radius_m * turned(e_f * (*to.yaw_rad - low)));
      }
    }
  }
  return best_m;
}

TEST(Dubins, UnequalRadiiAgreeWithASearch) {
  Random random(2);
  for (int i = 0; i < 400; ++i) {
    const DubinsEnd from = random_end(random, 8.0, random.uniform(0.5, 6.0));
    const DubinsEnd to = random_end(random, 8.0, random.uniform(0.5, 6.0));
    const double searched_m = searched_length_m(from, to);
    const double length_m = length_of(from, to);
    EXPECT_LE(length_m, searched_m + 1e-9) << i;
    // Two roots within one step of the search are not found.
    if (length_m < searched_m - 1e-9) {
      double nearest_m = kInfinity;
      for (const DubinsWord word : kDubinsWords) {
        const auto path = dubins_path(word, from, to);
        if (path) nearest_m = std::min(nearest_m, situation_awareness::length_m(path->segments[1]));
      }
      EXPECT_LT(nearest_m, 0.1) << i << words_of(from, to);
    }
  }
}

TEST(Dubins, MirrorReversalAndMotionKeepTheLength) {
  Random random(3);
  for (int i = 0; i < 10'000; ++i) {
    const DubinsEnd from = random_end(random, 6.0, random.uniform(0.5, 3.0));
    const DubinsEnd to = random_end(random, 6.0, random.uniform() < 0.5 ? from.radius_m : random.uniform(0.5, 3.0));
    const auto mirrored = [](DubinsEnd end) {
      end.p_m.y() *= -1.0;
      *end.yaw_rad *= -1.0;
      return end;
    };
    const auto backward = [](DubinsEnd end) {
      *end.yaw_rad += kPi;
      return end;
    };
    const Pose2 T{{random.uniform(-50.0, 50.0), random.uniform(-50.0, 50.0)}, random.uniform(-10.0, 10.0)};
    const double length_m = length_of(from, to);
    EXPECT_NEAR(length_of(mirrored(from), mirrored(to)), length_m, 1e-9) << i;
    EXPECT_NEAR(length_of(backward(to), backward(from)), length_m, 1e-9) << i;
    EXPECT_NEAR(length_of(moved(T, from), moved(T, to)), length_m, 1e-9) << i;
  }
}

// Poses at the end of a path that was driven: with and without each of its parts, in any frame.
TEST(Dubins, RoundingAddsNoTurn) {
  Random random(4);
  for (int i = 0; i < 100'000; ++i) {
    const DubinsWord word = kDubinsWords[static_cast<std::size_t>(random.uniform(0.0, 6.0))];
    const std::string letters = name_of(word);
    const bool is_straight = letters[1] == 'S';
    DubinsEnd from = random_end(random, std::pow(10.0, random.uniform(0.0, 4.0)), std::exp(random.uniform(-1.0, 3.0)));
    DubinsEnd to;
    to.radius_m = is_straight && random.uniform() < 0.5 ? std::exp(random.uniform(-1.0, 3.0)) : from.radius_m;
    Pose2 at = pose_of(from);
    double driven_m = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double part = random.uniform() < 0.4 ? 0.0 : random.uniform();
      if (letters[k] == 'S') {
        at = at * Pose2{{10.0 * part, 0.0}, 0.0};
        driven_m += 10.0 * part;
        continue;
      }
      const double sign = letters[k] == 'L' ? 1.0 : -1.0;
      const double turn_rad = k == 1 ? kPi * (1.01 + 0.98 * part) : 6.28 * part;
      const double radius_m = k == 2 ? to.radius_m : from.radius_m;
      at = at * Pose2{{radius_m * std::sin(turn_rad), sign * radius_m * (1.0 - std::cos(turn_rad))}, sign * turn_rad};
      driven_m += radius_m * turn_rad;
    }
    to.p_m = at.translation_m;
    to.yaw_rad = at.yaw_rad;
    const double tolerance_m = 1e-9 * (1.0 + 1e-3 * from.p_m.norm());
    EXPECT_LE(length_of(from, to), driven_m + tolerance_m) << i << " " << letters << words_of(from, to);
    if (!is_straight) continue;
    const auto path = dubins_path(word, from, to);
    ASSERT_TRUE(path) << i << " " << letters;
    EXPECT_LE(path->length_m, driven_m + tolerance_m) << i << " " << letters << words_of(from, to);
  }
}

TEST(Dubins, AnswersDegenerateCases) {
  const auto end = [](double x_m, double y_m, double yaw_rad, double radius_m) {
    return DubinsEnd{{x_m, y_m}, yaw_rad, radius_m};
  };
  // From, to, length; the radius of both is 2 where nothing else is said.
  const struct {
    const char* name;
    DubinsEnd from, to;
    double length_m;
  } cases[] = {
      {"same pose", end(1, 2, 0.3, 2), end(1, 2, 0.3, 2), 0.0},
      {"same pose, a turn later", end(1, 2, 0.3, 2), end(1, 2, 0.3 + 2.0 * kPi, 2), 0.0},
      {"ahead", end(0, 0, 0, 2), end(7, 0, 0, 2), 7.0},
      {"just ahead", end(0, 0, 0, 2), end(1e-7, 0, 0, 2), 1e-7},
      {"same left circle, a quarter on", end(0, 0, 0, 2), end(2, 2, 0.5 * kPi, 2), kPi},
      {"same left circle, a quarter back", end(2, 2, 0.5 * kPi, 2), end(0, 0, 0, 2), 3.0 * kPi},
      {"same right circle", end(0, 0, 0, 2), end(0, -4, kPi, 2), 2.0 * kPi},
      {"circles that touch", end(0, 0, 0.5 * kPi, 2), end(-8, 0, 0.5 * kPi, 2), 4.0 * kPi},
      {"circles that touch, of two radii", end(0, 0, 0.5 * kPi, 2), end(-10, 0, 0.5 * kPi, 3), 5.0 * kPi},
      {"a circle that touches within", end(0, 0, 0.5 * kPi, 2), end(2, 0, 0.5 * kPi, 3), 5.0 * kPi},
      {"back to the same place, three turns", end(0, 0, 0, 2), end(0, 0, kPi, 2), 14.0 / 3.0 * kPi},
      {"beside, the other way", end(0, 0, 0, 2), end(0, 4, kPi, 2), 2.0 * kPi},
      {"a turn after a straight", end(0, 0, 0, 2), end(7, 2, 0.5 * kPi, 2), 5.0 + kPi},
      {"a straight after a turn", end(0, 0, 0, 2), end(2, 7, 0.5 * kPi, 2), 5.0 + kPi},
  };
  Random random(5);
  for (const auto& one : cases) {
    for (int i = 0; i < 1000; ++i) {
      Pose2 T{{random.uniform(-1e3, 1e3), random.uniform(-1e3, 1e3)}, random.uniform(-kPi, kPi)};
      if (i == 0) T = {};
      const DubinsEnd from = moved(T, one.from), to = moved(T, one.to);
      const DubinsPath path = shortest_dubins_path(from, to);
      EXPECT_NEAR(path.length_m, one.length_m, 1e-9) << one.name << words_of(from, to);
      EXPECT_LT(greatest_gap(path, from, to), 1e-9) << one.name;
    }
  }
}

// The circles lie within one another on one side at most.
TEST(Dubins, OneOfLslAndRsrExists) {
  Random random(9);
  int within = 0;
  for (int i = 0; i < 100'000; ++i) {
    const DubinsEnd from = random_end(random, 1.0, random.uniform(0.1, 3.0));
    DubinsEnd to = random_end(random, 1.0, random.uniform(0.1, 3.0));
    if (i % 3 == 0) to.p_m = from.p_m;
    if (i % 2 == 0) to.yaw_rad = from.yaw_rad;
    const bool has_lsl = dubins_path(DubinsWord::kLsl, from, to).has_value();
    const bool has_rsr = dubins_path(DubinsWord::kRsr, from, to).has_value();
    EXPECT_TRUE(has_lsl || has_rsr) << i;
    within += has_lsl && has_rsr ? 0 : 1;
  }
  EXPECT_GT(within, 1000);
}

TEST(Dubins, ARadiusMayBeTheLeast) {
  EXPECT_TRUE(may_turn(6.0, 1.0 / 6.0));
  EXPECT_TRUE(may_turn(3.0, 1.0 / 3.0));
  EXPECT_TRUE(may_turn(6.1, 1.0 / 6.0));
  EXPECT_FALSE(may_turn(6.0 - 1e-9, 1.0 / 6.0));
  EXPECT_TRUE(may_turn(1e-6, kInfinity));
  EXPECT_FALSE(may_turn(1e6, 0.0));
}

/// The shortest path over the headings that are free, by a search.
double searched_free_m(DubinsEnd from, DubinsEnd to, bool free_start) {
  double& yaw_rad = free_start ? from.yaw_rad.emplace() : to.yaw_rad.emplace();
  const auto length_at = [&](double heading_rad) {
    yaw_rad = heading_rad;
    return length_of(from, to);
  };
  double best_rad = 0.0, best_m = kInfinity;
  double step_rad = kPi / 360.0;
  for (int i = 0; i < 720; ++i) {
    const double length_m = length_at(step_rad * i);
    if (length_m < best_m) best_m = length_m, best_rad = step_rad * i;
  }
  for (int k = 0; k < 40; ++k) {
    step_rad *= 0.5;
    for (const double sign : {1.0, -1.0}) {
      const double length_m = length_at(best_rad + sign * step_rad);
      if (length_m < best_m) best_m = length_m, best_rad += sign * step_rad;
    }
  }
  return best_m;
}

TEST(Dubins, AFreeHeadingIsTheBest) {
  Random random(6);
  int less = 0;
  constexpr int kCases = 1000;
  for (int i = 0; i < kCases; ++i) {
    const double size_m = std::exp(random.uniform(-1.0, 2.5));
    DubinsEnd from = random_end(random, size_m, random.uniform(0.5, 3.0));
    DubinsEnd to = random_end(random, size_m, i % 2 == 0 ? from.radius_m : random.uniform(0.5, 3.0));
    const bool free_start = random.uniform() < 0.5;
    (free_start ? from : to).yaw_rad.reset();
    const DubinsPath path = shortest_dubins_path(from, to);
    EXPECT_LT(greatest_gap(path, from, to), 1e-9) << i;
    const double searched_m = searched_free_m(from, to, free_start);
    EXPECT_LE(path.length_m, searched_m + 1e-9) << i << name_of(path.word) << (free_start ? " start" : " end");
    less += path.length_m < searched_m - 1e-6 ? 1 : 0;
    // Its own heading given, the path is no other.
    DubinsEnd given_from = from, given_to = to;
    given_from.yaw_rad = place_at(path, 0.0).pose.yaw_rad;
    given_to.yaw_rad = place_at(path, path.length_m).pose.yaw_rad;
    EXPECT_NEAR(length_of(given_from, given_to), path.length_m, 1e-9) << i;
  }
  EXPECT_LT(less, kCases / 20);  // the search misses minima at the edge of where a word has a path
}

TEST(Dubins, AFreeHeadingReachesTheEndAlsoWithUnlikeRadii) {
  Random random(10);
  for (int i = 0; i < 100'000; ++i) {
    const auto size = [&random] { return std::exp(random.uniform(-7.0, 7.0)); };
    const double size_m = size();
    DubinsEnd from = random_end(random, size_m, size());
    DubinsEnd to = random_end(random, size_m, size());
    (i % 2 == 0 ? from : to).yaw_rad.reset();
    EXPECT_LT(greatest_gap(shortest_dubins_path(from, to), from, to), 1e-9) << i;
  }
}

TEST(Dubins, BothHeadingsFreeAreALine) {
  Random random(7);
  for (int i = 0; i < 100; ++i) {
    DubinsEnd from = random_end(random, 5.0, 2.0), to = random_end(random, 5.0, 3.0);
    from.yaw_rad.reset();
    to.yaw_rad.reset();
    const DubinsPath path = shortest_dubins_path(from, to);
    EXPECT_NEAR(path.length_m, (from.p_m - to.p_m).norm(), 1e-12);
    EXPECT_LT(greatest_gap(path, from, to), 1e-9);
  }
}

TEST(Dubins, FreeHeadingsAnswerDegenerateCases) {
  const DubinsEnd from{{1.0, 2.0}, 0.3, 2.0};
  EXPECT_EQ(length_of(from, {from.p_m, {}, 2.0}), 0.0);
  EXPECT_EQ(length_of({from.p_m, {}, 2.0}, from), 0.0);
  EXPECT_EQ(length_of({from.p_m, {}, 2.0}, {from.p_m, {}, 2.0}), 0.0);
  // On the circle, and at its centre, which a circle of half its radius reaches at once.
  EXPECT_NEAR(length_of({{0.0, 0.0}, 0.0, 2.0}, {{2.0, 2.0}, {}, 2.0}), kPi, 1e-12);
  EXPECT_NEAR(length_of({{0.0, 0.0}, 0.0, 2.0}, {{0.0, 2.0}, {}, 1.0}), kPi, 1e-9);
}

TEST(Dubins, PlacesAreAlongThePath) {
  Random random(8);
  std::vector<Pose2> poses;
  for (int i = 0; i < 1000; ++i) {
    const auto [from, to] = random_case(random);
    const DubinsPath path = shortest_dubins_path(from, to);
    EXPECT_LT(distance(place_at(path, 0.0).pose, pose_of(from)), 1e-9);
    EXPECT_LT(distance(place_at(path, path.length_m).pose, pose_of(to)), 1e-9);
    EXPECT_LT(distance(place_at(path, path.length_m + 1.0).pose, pose_of(to)), 1e-9);
    const double way_m = random.uniform() * path.length_m;
    const double step_m = 1e-5 * std::min(from.radius_m, to.radius_m);
    const DubinsPlace here = place_at(path, way_m);
    const DubinsPlace next = place_at(path, way_m + step_m);
    if (way_m + step_m > path.length_m || here.curvature_1_m != next.curvature_1_m) continue;
    const Pose2 driven = inverse(here.pose) * next.pose;
    EXPECT_NEAR(driven.translation_m.x(), step_m, 1e-4 * step_m + 1e-12);
    EXPECT_NEAR(driven.translation_m.y(), 0.5 * here.curvature_1_m * step_m * step_m, 1e-4 * step_m);
    EXPECT_NEAR(wrap_to_pi(driven.yaw_rad), here.curvature_1_m * step_m, 1e-9);

    const double spacing_m = std::max(1e-3, 0.1 * path.length_m * random.uniform());
    sample(path, spacing_m, poses);
    EXPECT_LT(distance(poses.front(), pose_of(from)), 1e-9);
    EXPECT_LT(distance(poses.back(), pose_of(to)), 1e-9);
    for (std::size_t k = 1; k < poses.size(); ++k) {
      EXPECT_LE((poses[k].translation_m - poses[k - 1].translation_m).norm(), spacing_m * (1.0 + 1e-9) + 1e-12);
    }
  }
}

TEST(Dubins, RefusesWhatIsNoEnd) {
  const DubinsEnd good{{0.0, 0.0}, 0.0, 1.0};
  const double nan = std::nan("");
  const auto refusal = [](const DubinsEnd& from, const DubinsEnd& to) {
    return refusal_of([&] { shortest_dubins_path(from, to); });
  };
  EXPECT_TRUE(names(refusal({{nan, 0.0}, 0.0, 1.0}, good), {"from", "coordinates", "1e9"}));
  EXPECT_TRUE(names(refusal({{0.0, nan}, 0.0, 1.0}, good), {"from", "coordinates", "1e9"}));
  EXPECT_TRUE(names(refusal(good, {{0.0, -kInfinity}, 0.0, 1.0}), {"to", "coordinates", "1e9"}));
  EXPECT_TRUE(names(refusal(good, {{0.0, 0.0}, nan, 1.0}), {"to", "yaw", "1e6"}));
  EXPECT_TRUE(names(refusal(good, {{0.0, 0.0}, 0.0, 0.0}), {"to", "radius", "1e-6"}));
  EXPECT_TRUE(names(refusal({{0.0, 0.0}, 0.0, 2e9}, good), {"from", "radius", "1e9"}));
  EXPECT_TRUE(names(refusal_of([&] { dubins_path(DubinsWord::kLsl, good, {{0.0, 0.0}, {}, 1.0}); }), {"yaw"}));
}

}  // namespace
}  // namespace situation_awareness::dubins_test
