// SPDX-License-Identifier: BSD-3-Clause
// Rates against the course by fixes.
#include "situation_awareness/pose/turn_consistency.hpp"

#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness::turn_consistency_test {
namespace {

struct Motion {
  std::function<double(double t)> course_rad = [](double) { return 0.0; };
  double speed_m_s = 5.0;
  std::function<double(double t)> rate_rad_s = [](double) { return 0.0; };
  double fix_sigma_m = 0.3;
  double seconds = 60.0;
  bool exchanged = false;  ///< east for north
};

TurnConsistency after(const Motion& motion, unsigned seed = 1) {
  TurnConsistency turns;
  std::mt19937 random(seed);
  std::normal_distribution<double> noise;
  Eigen::Vector2d p = Eigen::Vector2d::Zero();
  constexpr double kStep_s = 0.01;
  for (int i = 0; i * kStep_s < motion.seconds; ++i) {
    const double t = i * kStep_s;
    turns.add_rate(nanoseconds(t), motion.rate_rad_s(t) + 0.003 * noise(random));
    p += kStep_s * motion.speed_m_s * Eigen::Vector2d(std::cos(motion.course_rad(t)), std::sin(motion.course_rad(t)));
    if (i % 20 != 10) continue;
    Eigen::Vector2d fix = p + motion.fix_sigma_m * Eigen::Vector2d(noise(random), noise(random));
    if (motion.exchanged) std::swap(fix.x(), fix.y());
    turns.add_fix(nanoseconds(t), fix, motion.fix_sigma_m);
  }
  return turns;
}

/// A car on a circle, whose rates are so many times the true ones.
Motion circle(double times, double rate_rad_s = 0.25) {
  Motion motion;
  motion.course_rad = [rate_rad_s](double t) { return rate_rad_s * t; };
  motion.rate_rad_s = [times, rate_rad_s](double) { return times * rate_rad_s; };
  return motion;
}

/// To and fro, as a ship or a mower goes.
Motion serpentine(double times) {
  Motion motion;
  motion.course_rad = [](double t) { return 1.5 * std::sin(0.3 * t); };
  motion.rate_rad_s = [times](double t) { return times * 0.45 * std::cos(0.3 * t); };
  return motion;
}

TEST(TurnConsistency, MeasuresTheRatioOfTurns) {
  for (const double times : {1.0, degrees(1.0), -1.0}) {
    for (const auto& make : {std::function<Motion(double)>([](double k) { return circle(k); }),
                             std::function<Motion(double)>(serpentine)}) {
      for (unsigned seed = 1; seed <= 5; ++seed) {
        const TurnConsistency turns = after(make(times), seed);
        ASSERT_TRUE(turns.ratio()) << times;
        EXPECT_NEAR(*turns.ratio() / times, 1.0, 0.1);
        EXPECT_EQ(turns.contradiction().empty(), times == 1.0) << turns.contradiction();
      }
    }
  }
}

TEST(TurnConsistency, NamesTheCauseWithinTenSecondsOfATurn) {
  const std::pair<double, const char*> kinds[] = {{degrees(1.0), "rates in deg/s do: rad/s"},
                                                  {-1.0, "points down"},
                                                  {-degrees(1.0), "deg/s about an axis that points down"},
                                                  {1000.0, "rad/s, positive to the left?"}};
  for (const auto& [times, cause] : kinds) {
    for (unsigned seed = 1; seed <= 5; ++seed) {
      Motion motion = circle(times);  // straight at first, for 15 s
      motion.course_rad = [](double t) { return 0.25 * std::max(t - 15.0, 0.0); };
      motion.rate_rad_s = [k = times](double t) { return t > 15.0 ? k * 0.25 : 0.0; };
      motion.seconds = 25.0;
      EXPECT_NE(after(motion, seed).contradiction().find(cause), std::string::npos) << times;
    }
  }
}

TEST(TurnConsistency, ExchangedCoordinatesTurnTheOtherWay) {
  Motion motion = circle(1.0);
  motion.exchanged = true;
  ASSERT_TRUE(after(motion).ratio());
  EXPECT_NEAR(*after(motion).ratio(), -1.0, 0.1);
  EXPECT_NE(after(motion).contradiction(), "");
}

TEST(TurnConsistency, SaysNothingOfVehiclesThatHeadElsewhere) {
  Motion sideways = circle(0.0);  // it keeps its heading, and the gyroscope drifts
  sideways.rate_rad_s = [](double) { return 0.01; };
  Motion looking_around = circle(1.0);
  looking_around.rate_rad_s = [](double t) { return 2.0 * std::sin(0.7 * t); };
  Motion straight;
  Motion spinning;  // straight ahead, as thrown
  spinning.rate_rad_s = [](double) { return 10.0; };
  Motion standing = circle(degrees(1.0));
  standing.speed_m_s = 0.0;
  Motion banked = circle(std::cos(1.0));  // by 57 degrees
  for (unsigned seed = 1; seed <= 20; ++seed) {
    for (const Motion& motion : {sideways, looking_around, straight, spinning, standing, banked}) {
      EXPECT_EQ(after(motion, seed).contradiction(), "");
    }
  }
}

TEST(TurnConsistency, NeedsTimeAndForgetsIt) {
  Motion brief = circle(degrees(1.0));
  brief.seconds = 7.5;
  EXPECT_EQ(after(brief).contradiction(), "");
  Motion mended = circle(1.0);  // after the first half
  mended.seconds = 150.0;
  mended.rate_rad_s = [](double t) { return t < 75.0 ? degrees(0.25) : 0.25; };
  EXPECT_EQ(after(mended).contradiction(), "");
}

TEST(TurnConsistency, BeginsAnewWhereTimeDoes) {
  TurnConsistency turns = after(circle(degrees(1.0)));
  ASSERT_NE(turns.contradiction(), "");
  turns.add_rate(0, 0.0);
  EXPECT_EQ(turns.contradiction(), "");
  turns.add_fix(nanoseconds(100.0), {1.0, 2.0}, 0.3);  // ahead of all rates
  turns.add_fix(nanoseconds(-100.0), {1.0, 2.0}, 0.3);
  turns.add_rate(1, std::nan(""));
  turns.add_fix(1, {std::nan(""), 2.0}, 0.3);
  EXPECT_EQ(turns.ratio(), std::nullopt);
}

}  // namespace
}  // namespace situation_awareness::turn_consistency_test
