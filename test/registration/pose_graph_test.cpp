// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/registration/pose_graph.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <limits>
#include <vector>

#include <Eigen/Cholesky>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness::pose_graph_test {
namespace {

/// Of a scan's hits, and of a loop's (1 / m^2).
constexpr double kWeight = 1e3, kLoopWeight = 1e6;

std::int64_t at(double t_s) { return nanoseconds(1000.0 + t_s); }

/// Places around one, on walls of two directions.
struct Place {
  Eigen::Vector2d p_m, normal;
};
std::vector<Place> places_around(const Eigen::Vector2d& p_m) {
  return {{p_m + Eigen::Vector2d(10.0, 0.0), {-1.0, 0.0}},
          {p_m + Eigen::Vector2d(10.0, 5.0), {-1.0, 0.0}},
          {p_m + Eigen::Vector2d(0.0, 10.0), {0.0, -1.0}},
          {p_m + Eigen::Vector2d(-5.0, 10.0), {0.0, -1.0}}};
}

/// That what the latest pose sees, which was drawn at a time, is off by a motion.
void tie(PoseGraph& graph, double drawn_s, const Eigen::Vector2d& p_m, const Pose2& off, double weight = kWeight) {
  for (const Place& place : places_around(p_m)) {
    graph.tie(at(drawn_s), place.p_m, place.normal, place.normal.dot(off * place.p_m - place.p_m), weight);
  }
}

double apart_m(const Pose2& a, const Pose2& b, const Eigen::Vector2d& p_m) { return (a * p_m - b * p_m).norm(); }

Eigen::Vector2d along_line(int k) { return {5.0 * k, 0.0}; }

// The motion of a random walk whose end is known grows with time.
TEST(PoseGraph, SharesALoopWithTheTimeSinceThen) {
  PoseGraph graph;
  for (int k = 0; k <= 40; ++k) graph.add(at(k), along_line(0));
  tie(graph, 0.0, along_line(0), {{0.0, -0.4}, 0.0}, kLoopWeight);
  graph.solve();
  for (const double t_s : {0.0, 7.0, 10.5, 20.0, 40.0}) {
    const Pose2 motion = graph.motion_of(at(t_s));
    EXPECT_NEAR(motion.translation_m.y(), -0.4 * t_s / 40.0, 1e-3) << t_s;
    EXPECT_NEAR(motion.translation_m.x(), 0.0, 1e-3) << t_s;
  }
  EXPECT_LT(apart_m(graph.motion_of(at(-5.0)), {}, along_line(0)), 1e-6);
  EXPECT_LT(apart_m(graph.motion_of(at(45.0)), graph.motion_of(at(40.0)), along_line(0)), 1e-12);
}

// A loop around one obstacle is closed while another one is in sight, which was drawn on the way: it moves as the pose
// that sees it, and what drifted did so before.
TEST(PoseGraph, MovesWhatIsInSightAsThePoseThatSeesIt) {
  PoseGraph graph;
  for (int k = 0; k <= 40; ++k) {
    graph.add(at(k), along_line(k));
    if (k > 20) tie(graph, 18.0, along_line(k), {});
  }
  tie(graph, 0.0, along_line(40), {{0.3, -0.4}, 0.01}, kLoopWeight);
  graph.solve();
  const Pose2 now = graph.motion_of(at(40.0));
  EXPECT_LT(apart_m(now, {{0.3, -0.4}, 0.01}, along_line(40)), 0.01);
  EXPECT_LT(apart_m(graph.motion_of(at(18.0)), now, along_line(40)), 0.01);
  EXPECT_LT(apart_m(graph.motion_of(at(30.0)), now, along_line(40)), 0.01);
  EXPECT_GT(apart_m(graph.motion_of(at(9.0)), now, along_line(40)), 0.15);
}

// What was seen twice at one place moves as one.
TEST(PoseGraph, MovesWhatBelongsTogetherAsOne) {
  PoseGraph graph;
  for (int k = 0; k <= 60; ++k) {
    graph.add(at(k), along_line(0));
    if (k == 40) tie(graph, 20.0, along_line(0), {}, kLoopWeight);
  }
  tie(graph, 0.0, along_line(0), {{0.0, -0.5}, 0.0}, kLoopWeight);
  graph.solve();
  EXPECT_LT(apart_m(graph.motion_of(at(20.0)), graph.motion_of(at(40.0)), along_line(0)), 1e-3);
  EXPECT_NEAR(graph.motion_of(at(40.0)).translation_m.y(), -0.25, 1e-3);
}

// Ties that tell all find the drift, whatever it was.
TEST(PoseGraph, FindsADriftThatTiesTell) {
  Random random(7);
  for (int round = 0; round < 20; ++round) {
    PoseGraph graph;
    std::vector<Pose2> drift;  // of what is drawn then
    std::vector<Eigen::Vector2d> p_m;
    Pose2 sum;
    for (int k = 0; k < 50; ++k) {
      p_m.emplace_back(random.uniform(-50.0, 50.0), random.uniform(-50.0, 50.0));
      if (k > 0) {
        sum.translation_m += Eigen::Vector2d(random.normal(), random.normal()) * 0.03;
        sum.yaw_rad += 1e-4 * random.normal();
      }
      drift.push_back(sum);
      graph.add(at(k), p_m.back());
      for (int n = 0; n < 4 && k > 0; ++n) {
        const int other = n == 0 ? 0 : static_cast<int>(random.uniform(0.0, k));
        const Pose2 off = inverse(drift[static_cast<std::size_t>(k)]) * drift[static_cast<std::size_t>(other)];
        tie(graph, other, p_m.back(), off, kLoopWeight);
      }
    }
    graph.solve();
    for (std::size_t k = 0; k < drift.size(); ++k) {
      EXPECT_LT(apart_m(graph.motion_of(at(static_cast<double>(k))), inverse(drift[k]), p_m[k]), 2e-3) << k;
    }
  }
}

// A wall says nothing of the way along it.
TEST(PoseGraph, MovesNothingAlongAWall) {
  PoseGraph graph;
  for (int k = 0; k <= 10; ++k) graph.add(at(k), along_line(0));
  for (const double x_m : {-3.0, 3.0}) graph.tie(at(0.0), {x_m, 10.0}, {0.0, -1.0}, 0.2, kLoopWeight);
  graph.solve();
  const Pose2 motion = graph.motion_of(at(10.0));
  EXPECT_NEAR(motion.translation_m.y(), -0.2, 1e-3);
  EXPECT_NEAR(motion.translation_m.x(), 0.0, 1e-6);
  EXPECT_NEAR(motion.yaw_rad, 0.0, 1e-6);
}

// A tie by the normal equations of a motion about a place is that by its hits.
TEST(PoseGraph, TakesNormalEquationsAboutAPlace) {
  const Eigen::Vector2d center_m(30.0, -20.0);
  const Pose2 off = {{0.1, -0.2}, 0.005};
  PoseGraph by_hits, by_equations;
  for (int k = 0; k <= 10; ++k) {
    by_hits.add(at(k), along_line(k));
    by_equations.add(at(k), along_line(k));
  }
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const Place& place : places_around(along_line(10))) {
    const double residual_m = place.normal.dot(off * place.p_m - place.p_m);
    Eigen::Vector3d J;
    J << place.normal, place.normal.dot(left_of(place.p_m - center_m));
    A += kWeight * J * J.transpose();
    b += kWeight * residual_m * J;
    by_hits.tie(at(2.0), place.p_m, place.normal, residual_m, kWeight);
  }
  by_equations.tie(at(2.0), center_m, A, b);
  by_hits.solve();
  by_equations.solve();
  for (int k = 0; k <= 10; ++k) {
    EXPECT_LT(apart_m(by_hits.motion_of(at(k)), by_equations.motion_of(at(k)), center_m), 1e-9) << k;
  }
}

TEST(PoseGraph, MovesTheSameWhereverTheMapIs) {
  const Pose2 T = {{12.0, -35.0}, 2.1};
  PoseGraph graph, moved_graph;
  const Pose2 off = {{0.2, 0.1}, 0.004};
  for (int k = 0; k <= 30; ++k) {
    const Eigen::Vector2d p_m(20.0 * std::cos(0.2 * k), 20.0 * std::sin(0.2 * k));
    graph.add(at(k), p_m);
    moved_graph.add(at(k), T * p_m);
    for (const int back : {3, 8, 30}) {
      if (back > k) continue;
      for (const Place& place : places_around(p_m)) {
        const double residual_m = back == 30 ? place.normal.dot(off * place.p_m - place.p_m) : 0.0;
        graph.tie(at(k - back), place.p_m, place.normal, residual_m, kWeight);
        moved_graph.tie(at(k - back), T * place.p_m, T.rotation() * place.normal, residual_m, kWeight);
      }
    }
  }
  graph.solve();
  moved_graph.solve();
  for (int k = 0; k <= 30; ++k) {
    const Eigen::Vector2d p_m(20.0 * std::cos(0.2 * k), 20.0 * std::sin(0.2 * k));
    const Pose2 back = inverse(T) * moved_graph.motion_of(at(k)) * T;
    EXPECT_LT(apart_m(back, graph.motion_of(at(k)), p_m), 1e-6) << k;
  }
}

// Once all was moved there is nothing left to be moved, and later loops begin there.
TEST(PoseGraph, IsAtRestOnceMoved) {
  PoseGraph graph;
  for (int k = 0; k <= 20; ++k) {
    graph.add(at(k), along_line(k));
    if (k >= 4) tie(graph, k - 4, along_line(k), {});
  }
  tie(graph, 0.0, along_line(20), {{0.2, -0.3}, 0.01});
  graph.solve();
  EXPECT_GT(apart_m(graph.motion_of(at(20.0)), {}, along_line(20)), 0.1);
  graph.move();
  EXPECT_LT(apart_m(graph.motion_of(at(20.0)), {}, along_line(20)), 1e-12);
  graph.solve();
  for (int k = 0; k <= 20; ++k) EXPECT_LT(apart_m(graph.motion_of(at(k)), {}, along_line(k)), 1e-6) << k;
}

TEST(PoseGraph, IsDueOnceASecond) {
  PoseGraph graph;
  EXPECT_TRUE(graph.is_due(at(0.0)));
  graph.add(at(0.0), along_line(0));
  EXPECT_FALSE(graph.is_due(at(0.96)));
  EXPECT_TRUE(graph.is_due(at(1.0)));
}

// Hours of it: what is older than the poses that are kept stays where it is.
TEST(PoseGraph, KeepsTheLatestPoses) {
  PoseGraph graph;
  constexpr int kPoses = 7300;
  for (int k = 0; k < kPoses; ++k) {
    graph.add(at(k), along_line(0));
    for (int back = 2; back <= 30 && back <= k; ++back) {
      graph.tie(at(k - back), {0.0, 10.0}, {0.0, -1.0}, 0.0, kWeight);
    }
  }
  tie(graph, 0.0, along_line(0), {{0.1, 0.0}, 0.0}, kLoopWeight);
  graph.solve();
  EXPECT_NEAR(graph.motion_of(at(kPoses - 1.0)).translation_m.x(), 0.1, 1e-3);
  for (const double t_s : {0.0, 0.5 * kPoses, kPoses - 1800.0}) {
    EXPECT_LT(apart_m(graph.motion_of(at(t_s)), {}, along_line(0)), 1e-6) << t_s;
  }
  EXPECT_GT(graph.motion_of(at(kPoses - 300.0)).translation_m.x(), 0.05);
}

/// Least CPU time of a loop that is found after so long, while what is seen was drawn at any time of the latest half
/// hour.
double loop_cost_s(double t_s) {
  Random random(3);
  PoseGraph graph;
  for (int k = 0; k <= t_s; ++k) {
    graph.add(at(k), along_line(0));
    for (int n = 0; n < 8 && k > 0; ++n) {
      const double back_s = random.uniform(1.0, std::min(k + 1.0, 1800.0));
      graph.tie(at(k - back_s), {random.normal(), 10.0}, {0.0, -1.0}, 0.0, kWeight);
    }
  }
  tie(graph, t_s - 60.0, along_line(0), {{0.1, 0.0}, 0.0}, kLoopWeight);
  double least_s = std::numeric_limits<double>::infinity();  // other processes add to the others
  for (int repeat = 0; repeat < 10; ++repeat) {
    PoseGraph once = graph;
    const std::clock_t begin = std::clock();
    once.solve();
    least_s = std::min(least_s, static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
  }
  return least_s;
}

// The loop is solved in the callback of a scan.
TEST(PoseGraph, ALoopCostsAfterHoursWhatItDoesAfterMinutes) {
  EXPECT_LT(loop_cost_s(7200.0), 4.0 * loop_cost_s(300.0) + 1e-3);
}

// Poses that are not kept say of those that are what they said before: the motions are those with all of them.
TEST(PoseGraph, IsExactForThePosesThatAreKept) {
  constexpr int kPoses = 400;
  Random random(5);
  PoseGraph graph;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(kPoses, kPoses);  // of all poses, across a wall only
  Eigen::VectorXd b = Eigen::VectorXd::Zero(kPoses);
  const auto relate = [&](int node, int other, double weight, double residual_m) {
    H(node, node) += weight;
    H(other, other) += weight;
    H(node, other) -= weight;
    H(other, node) -= weight;
    b(node) += weight * residual_m;
    b(other) -= weight * residual_m;
  };
  H(0, 0) = 1e9;
  for (int k = 0; k < kPoses; ++k) {
    graph.add(at(k), along_line(0));
    if (k > 0) relate(k, k - 1, 100.0, 0.0);  // (0.1 m)^2 per second
    for (int n = 0; n < 3 && k > 0; ++n) {
      // What is that young was drawn at a pose that is still there.
      const int other = std::max(0, k - 1 - static_cast<int>(random.uniform(0.0, 40.0)));
      const double residual_m = 0.05 * random.normal();
      graph.tie(at(other), {0.0, 0.0}, {0.0, 1.0}, residual_m, kWeight);
      relate(k, other, kWeight, residual_m);
    }
  }
  graph.tie(at(0.0), {0.0, 0.0}, {0.0, 1.0}, 0.4, kLoopWeight);
  relate(kPoses - 1, 0, kLoopWeight, 0.4);
  graph.solve();
  EXPECT_LT(graph.size(), kPoses / 2);
  const Eigen::VectorXd expected = H.ldlt().solve(b);
  for (int k = kPoses - 48; k < kPoses; ++k) {
    EXPECT_NEAR(graph.motion_of(at(k)).translation_m.y(), expected(k), 1e-6) << k;
  }
  // Between them it is a line.
  for (int k = 0; k < kPoses; ++k) EXPECT_NEAR(graph.motion_of(at(k)).translation_m.y(), expected(k), 0.1) << k;
}

}  // namespace
}  // namespace situation_awareness::pose_graph_test
