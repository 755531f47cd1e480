// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/path.hpp"

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/periodic_spline.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::path_test {
namespace {

std::string path_error(const std::string& path, const PathOfBody& path_of_body = {}) {
  return refusal_of([&] { parse_path(path, Eigen::Vector3d::Zero(), 0.0, path_of_body); });
}

TEST(Path, DerivativesAgreeForEveryKind) {
  const std::vector<std::string> paths = {
      "stand",
      "stand spin -0.7",
      "circle center 1 2 radius 0.8 rate 0.5 phase 0.3",
      "circle center 1 2 radius 0.8 rate -0.5 tangent",
      "line from 0 1 to 2 -1 period 7 spin 0.2",
      "straight from 0 1 velocity 0.4 -0.7 spin 0.2",
      "straight from 0 1 velocity 0.4 -0.7 tangent",
      "loop speed 0.9 points 0 0; 2 0.3; 3 2; 1 2.5; -1 1.5",
      "loop speed 0.9 tangent points 0 0; 2 0.3; 3 2; 1 2.5; -1 1.5;",
      "loop speed 1.3 points 0 0 1 0; 2 0.3 1.2 2; 3 2 1.4 4; 1 2.5 1 6; -1 1.5 1 5",
      "stops places 0 0 0 1; 2 0.3 3 6; 2 0.3 3 9; -1 1.5 -3 15",
  };
  constexpr double h = 1e-4;
  for (const std::string& text : paths) {
    const ScriptedPath path = parse_path(text, {0.5, -0.5, 0.9}, 0.4);
    for (double t = -3.0; t < 20.0; t += 0.317) {
      const PathState now = path(t), before = path(t - h), after = path(t + h);
      EXPECT_LT(((after.position_m - before.position_m) / (2 * h) - now.velocity_m_s).norm(), 1e-6) << text;
      EXPECT_LT(((after.velocity_m_s - before.velocity_m_s) / (2 * h) - now.acceleration_m_s2).norm(), 1e-6) << text;
      EXPECT_LT(((after.acceleration_m_s2 - before.acceleration_m_s2) / (2 * h) - now.jerk_m_s3).norm(), 1e-6) << text;
      EXPECT_NEAR(wrap_to_pi(after.yaw_rad - before.yaw_rad) / (2 * h), now.yaw_rate_rad_s, 1e-6) << text;
    }
  }
}

TEST(Path, VelocitiesWithAnotherBodyAreDerivativesOfThePose) {
  const std::vector<std::string> carriers = {"stand spin -0.7", "circle center 1 2 radius 0.8 rate -0.5 tangent",
                                             "loop speed 0.9 tangent points 0 0; 2 0.3; 3 2; 1 2.5; -1 1.5"};
  constexpr double h = 1e-4;
  for (const std::string& carrier : carriers) {
    const PathOfBody path_of_body = [&](const std::string&) { return parse_path(carrier, {0.5, -0.5, 0.9}, 0.4); };
    for (const std::string text : {"with it at 0.3 -0.2", "with it at 0.3 -0.2 swing 0.4 period 1.3 phase 2 spin 0.6",
                                   "with it at 0 0.1 steps 1.1 phase 2"}) {
      const ScriptedPath path = parse_path(text, {0.0, 0.0, 0.9}, 0.4, path_of_body);
      for (double t = -3.0; t < 20.0; t += 0.317) {
        const PathState now = path(t), before = path(t - h), after = path(t + h);
        EXPECT_LT(((after.position_m - before.position_m) / (2 * h) - now.velocity_m_s).norm(), 1e-6) << text;
        EXPECT_NEAR(wrap_to_pi(after.yaw_rad - before.yaw_rad) / (2 * h), now.yaw_rate_rad_s, 1e-6) << text;
      }
    }
  }
}

TEST(Path, HasAFixedPositionInTheAxesOfItsCarrier) {
  const ScriptedPath carrier = parse_path("circle center 1 2 radius 0.5 rate 2 tangent", {5, 6, 7}, 0.2);
  const PathOfBody path_of_body = [&](const std::string& body) { return body == "it" ? carrier : ScriptedPath(); };
  const ScriptedPath path =
      parse_path("with it at 0.3 -0.2 swing 0.1 period 4 phase 0.5", {8, 9, 3}, 0.7, path_of_body);
  for (const double t : {0.0, 0.6, 1.9}) {
    const PathState it = carrier(t), state = path(t);
    const double ahead = 0.3 + 0.1 * std::sin(0.5 * kPi * t + 0.5);
    const Eigen::Vector2d x(std::cos(it.yaw_rad), std::sin(it.yaw_rad)), y(-x.y(), x.x());
    EXPECT_LT((state.position_m.head<2>() - (it.position_m.head<2>() + ahead * x - 0.2 * y)).norm(), 1e-12);
    EXPECT_EQ(state.position_m.z(), 3.0);
    EXPECT_NEAR(state.yaw_rad - it.yaw_rad, 0.7, 1e-12);
  }
}

TEST(Path, OneFootStandsWhileTheOtherPassesIt) {
  constexpr double kPeriod_s = 1.2, kSpeed_m_s = 0.9;
  const ScriptedPath carrier =
      parse_path("straight from 1 2 velocity 0.72 0.54 tangent", {0, 0, 1}, 0.0);  // at 0.9 m/s
  const PathOfBody path_of_body = [&](const std::string&) { return carrier; };
  const auto foot = [&](const std::string& text) { return parse_path(text, {0, 0, 0.3}, 0.0, path_of_body); };
  const ScriptedPath left = foot("with it at 0 0.1 steps 1.2"),
                     right = foot("with it at 0 -0.1 steps 1.2 phase 3.14159265359");
  const Eigen::Vector2d ahead(0.8, 0.6), to_left(-0.6, 0.8);
  double farthest_m = 0.0, fastest_m_s = 0.0;
  for (double t = -2.0; t < 6.0; t += 0.01) {
    const PathState state = left(t), body = carrier(t);
    const double cycles = t / kPeriod_s, off = cycles - std::round(cycles);
    if (std::abs(off) > 0.249 && std::abs(off) < 0.251) continue;
    EXPECT_EQ(state.velocity_m_s.isZero(0.0), std::abs(off) < 0.25) << t;
    EXPECT_EQ(right(t).velocity_m_s.isZero(1e-9), std::abs(off) > 0.25) << t;
    const Eigen::Vector2d q = (state.position_m - body.position_m).head<2>();
    EXPECT_NEAR(q.dot(to_left), 0.1, 1e-9);
    if (std::abs(off) < 0.25) {
      EXPECT_NEAR(q.dot(ahead), -off * kPeriod_s * kSpeed_m_s, 1e-9);
    }
    EXPECT_LT(std::abs(q.dot(ahead)), 0.3 * kPeriod_s * kSpeed_m_s);  // half of a step, and left behind at the start
    farthest_m = std::max(farthest_m, (state.position_m - right(t).position_m).head<2>().dot(ahead));
    fastest_m_s = std::max(fastest_m_s, state.velocity_m_s.norm());
    EXPECT_EQ(state.position_m.z(), 0.3);
  }
  EXPECT_NEAR(farthest_m, 0.5 * kPeriod_s * kSpeed_m_s, 0.01);  // a step
  EXPECT_NEAR(fastest_m_s, 15.0 / 8.0 * 2.0 * kSpeed_m_s, 0.01);
  const PathState first = left(0.0);  // the middle of a stand at phase 0
  EXPECT_LT((first.position_m.head<2>() - (carrier(0.0).position_m.head<2>() + 0.1 * to_left)).norm(), 1e-12);

  const ScriptedPath standing = parse_path("stand", {3, 4, 1}, 0.5);
  const ScriptedPath still =
      parse_path("with it at 0 0.1 steps 1.2", {0, 0, 0.3}, 0.0, [&](const std::string&) { return standing; });
  for (const double t : {0.0, 0.3, 0.5, 7.7}) {
    EXPECT_LT((still(t).position_m - Eigen::Vector3d(3 - 0.1 * std::sin(0.5), 4 + 0.1 * std::cos(0.5), 0.3)).norm(),
              1e-12);
  }
}

TEST(Path, IsThatOfTheManual) {
  const Eigen::Vector3d place(5, 6, 7);
  const PathState stand = parse_path("stand spin 0.5", place, 0.2)(2.0);
  EXPECT_EQ(stand.position_m, place);
  EXPECT_DOUBLE_EQ(stand.yaw_rad, 1.2);

  const PathState circle = parse_path("circle center 1 2 radius 0.5 rate 2 phase 0.1 tangent", place, 0.2)(0.3);
  EXPECT_LT((circle.position_m - Eigen::Vector3d(1 + 0.5 * std::cos(0.7), 2 + 0.5 * std::sin(0.7), 7)).norm(), 1e-12);
  EXPECT_NEAR(circle.velocity_m_s.norm(), 1.0, 1e-12);
  EXPECT_NEAR(wrap_to_pi(circle.yaw_rad - (0.7 + 0.5 * kPi + 0.2)), 0.0, 1e-12);
  EXPECT_NEAR(circle.yaw_rate_rad_s, 2.0, 1e-12);

  const ScriptedPath line = parse_path("line from 0 1 to 4 1 period 8", place, 0.2);
  EXPECT_LT((line(0.0).position_m - Eigen::Vector3d(0, 1, 7)).norm(), 1e-12);
  EXPECT_LT((line(4.0).position_m - Eigen::Vector3d(4, 1, 7)).norm(), 1e-12);
  EXPECT_LT(line(4.0).velocity_m_s.norm(), 1e-12);
  EXPECT_DOUBLE_EQ(line(1.0).yaw_rad, 0.2);

  const PathState straight = parse_path("straight from 1 2 velocity -0.5 0.5 tangent", place, 0.2)(4.0);
  EXPECT_LT((straight.position_m - Eigen::Vector3d(-1, 4, 7)).norm(), 1e-12);
  EXPECT_NEAR(straight.yaw_rad, 0.75 * kPi + 0.2, 1e-12);
}

TEST(Path, StopsAtEachPlaceAtItsTime) {
  const ScriptedPath path = parse_path("stops places 0 1 3 2; 4 1 -3 6; 4 1 -3 9; 4 5 -3 12", {5, 6, 7}, 0.2);
  const std::vector<std::pair<double, Eigen::Vector4d>> places = {{-5.0, {0, 1, 7, 3}},  {2.0, {0, 1, 7, 3}},
                                                                  {6.0, {4, 1, 7, -3}},  {7.5, {4, 1, 7, -3}},
                                                                  {12.0, {4, 5, 7, -3}}, {99.0, {4, 5, 7, -3}}};
  for (const auto& [time_s, place] : places) {
    const PathState state = path(time_s);
    EXPECT_LT((state.position_m - place.head<3>()).norm(), 1e-12) << time_s;
    EXPECT_NEAR(wrap_to_pi(state.yaw_rad - place.w()), 0.0, 1e-12) << time_s;
    EXPECT_LT(state.velocity_m_s.norm() + state.acceleration_m_s2.norm() + std::abs(state.yaw_rate_rad_s), 1e-12);
  }
  // In the middle of a way it is halfway, the shorter way around, at 35/16 of the mean speed.
  EXPECT_LT((path(4.0).position_m - Eigen::Vector3d(2, 1, 7)).norm(), 1e-12);
  EXPECT_NEAR(std::abs(wrap_to_pi(path(4.0).yaw_rad)), kPi, 1e-12);
  EXPECT_NEAR(path(4.0).velocity_m_s.x(), 35.0 / 16.0, 1e-12);
  EXPECT_NEAR(path(10.5).velocity_m_s.y(), 35.0 / 16.0 * 4.0 / 3.0, 1e-12);
}

TEST(Path, GivesThePresenceOfTheBody) {
  const PathFacts always = facts_of_path("stand");
  EXPECT_TRUE(always.presence.always() && always.presence.at(-1e9) && always.presence.at(1e9) && always.stands);
  const PathFacts some = facts_of_path("with it at 0 1 appears 2 goes 5.5");
  EXPECT_EQ(some.carrier, "it");
  EXPECT_FALSE(some.stands || some.presence.always());
  EXPECT_FALSE(some.presence.at(1.999) || some.presence.at(5.5));
  EXPECT_TRUE(some.presence.at(2.0) && some.presence.at(5.499));
  EXPECT_TRUE(facts_of_path("stand goes 3").presence.at(-10.0));
  EXPECT_FALSE(facts_of_path("stand spin 1 appears 3").stands);
}

TEST(Path, NamesTheErrorInItsText) {
  EXPECT_TRUE(names(path_error(" "), {}));
  EXPECT_TRUE(names(path_error("hop over 1"), {"hop", "stand", "circle", "line", "straight", "loop", "with"}));
  EXPECT_TRUE(names(path_error("circle center 1 2 radius 1"), {"rate"}));
  EXPECT_TRUE(names(path_error("circle center 1 radius 1 rate 1"), {"2", "center"}));
  EXPECT_TRUE(names(path_error("circle center 1 2 radius -1 rate 1"), {"radius", "positive"}));
  EXPECT_TRUE(names(path_error("circle center 1 2 radius 1 rate 1 rate 2"), {"rate"}));
  EXPECT_TRUE(names(path_error("circle center 1 2 radius 1 rate 1 spin"), {"1", "spin"}));
  EXPECT_TRUE(names(path_error("circle center 1 2 radius 1 rate 1 speed 3"), {"speed"}));
  EXPECT_TRUE(names(path_error("circle center 1 nan radius 1 rate 1"), {"2", "center"}));
  EXPECT_TRUE(names(path_error("circle 1 2 radius 1 rate 1"), {"1"}));
  EXPECT_TRUE(names(path_error("circle center 1 2 radius 1 rate 0 tangent"), {"tangent"}));
  EXPECT_TRUE(names(path_error("line from 0 0 to 1 0 period 3 tangent"), {"tangent"}));
  EXPECT_TRUE(names(path_error("stand spin 1 tangent"), {"spin", "tangent"}));
  EXPECT_TRUE(names(path_error("loop speed 1 points 0 0; 1 1"), {"3", "points"}));
  EXPECT_TRUE(names(path_error("loop speed 1 points 0 0; 1 1; 2 2 2"), {"points", "2", "4"}));
  EXPECT_TRUE(names(path_error("loop speed 1 points 1 1; 1 1; 1 1"), {"points"}));
  EXPECT_TRUE(names(path_error("loop speed 1 spin 1 points 0 0 0 0; 1 0 0 0; 1 1 0 0"), {"yaw", "spin", "tangent"}));
  EXPECT_TRUE(names(path_error("straight from 0 0 velocity 0 0 tangent"), {"tangent"}));
  EXPECT_TRUE(names(path_error("stops"), {"places"}));
  EXPECT_TRUE(names(path_error("stops places 0 0 0"), {"places", "4"}));
  EXPECT_TRUE(names(path_error("stops places 0 0 0 1; 1 0 0 1"), {"times"}));
  EXPECT_TRUE(names(path_error("stops places 0 0 0 1 spin 1"), {"yaw", "spin", "tangent"}));
  EXPECT_TRUE(names(path_error("with"), {"body"}));
  const PathOfBody path_of_body = [](const std::string& body) {
    return body == "it" ? parse_path("stand", Eigen::Vector3d::Zero(), 0.0) : ScriptedPath();
  };
  EXPECT_TRUE(names(path_error("with it at 0 1"), {"it"}));
  EXPECT_TRUE(names(path_error("with other at 0 1", path_of_body), {"other"}));
  EXPECT_EQ(path_error("with it at 0 1", path_of_body), "");
  EXPECT_TRUE(names(path_error("stand goes 3 appears 4"), {"goes", "appears"}));
  EXPECT_TRUE(names(path_error("stand appears"), {"1", "appears"}));
  EXPECT_TRUE(names(path_error("with it", path_of_body), {"at"}));
  EXPECT_TRUE(names(path_error("with it at 0 1 swing 1", path_of_body), {"period"}));
  EXPECT_TRUE(names(path_error("with it at 0 1 period 1", path_of_body), {"period"}));
  EXPECT_TRUE(names(path_error("with it at 0 1 tangent", path_of_body), {"tangent"}));
  EXPECT_TRUE(names(path_error("with it at 0 1 steps 0", path_of_body), {"steps", "positive"}));
  EXPECT_TRUE(names(path_error("with it at 0 1 steps 1 swing 1", path_of_body), {"swing"}));
  EXPECT_TRUE(names(path_error("straight from 0 1 velocity 1 0 steps 1"), {"steps"}));
}

TEST(PeriodicSpline, PassesItsPointsWithFourContinuousDerivatives) {
  Eigen::MatrixXd points(1, 5);
  points << 0.0, 1.0, 0.5, -2.0, 3.0;
  const PeriodicSpline spline(points);
  constexpr double kEpsilon = 1e-9;
  for (int knot = -5; knot < 10; ++knot) {
    EXPECT_NEAR(spline(knot)[0], points(0, (knot + 5) % 5), 1e-12);
    for (int d = 0; d <= 4; ++d) EXPECT_NEAR(spline(knot - kEpsilon, d)[0], spline(knot + kEpsilon, d)[0], 1e-5);
  }
}

}  // namespace
}  // namespace situation_awareness::path_test
