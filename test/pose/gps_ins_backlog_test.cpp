// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/gps_ins_backlog.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "pose/gps_ins_flight.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness::gps_ins_backlog_test {
namespace {

const GeodeticPosition kOrigin = {47.0, 8.0, 400.0};

struct Truth {
  std::int64_t stamp_ns;
  Eigen::Isometry3d T_world_base;
  Eigen::Vector3d velocity_m_s;
};

/// A flight until the pose is ready, and what is known then of the time before.
struct Start {
  std::vector<Truth> truth;
  GpsInsPose ready;
  std::vector<GpsInsPose> poses;

  explicit Start(std::uint64_t seed, double duration_s = 60.0, double yaw_rad = 0.7) {
    SimulatedFlight flight;
    flight.initial_yaw_rad = yaw_rad;
    FlightRun run(flight, {}, seed);
    GpsIns ins({}, {}, kOrigin);
    GpsInsBacklog backlog({}, {}, duration_s);
    for (; !ins.is_ready() && run.time_s() < 60.0; run.next()) {
      const InertialSample sample = run.sample();
      truth.push_back({sample.stamp_ns, run.T_world_base(), flight.velocity(run.time_s())});
      ins.add_imu(sample);
      if (!ins.is_ready()) backlog.add_imu(sample);
      if (!run.has_fix()) continue;
      GeodeticFix fix;
      fix.stamp_ns = run.stamp_ns();
      fix.position = geodetic_position(kOrigin, run.fix());
      fix.covariance_m2 = run.fix_covariance();
      ins.add_fix(fix);
      if (!ins.is_ready()) backlog.add_fix(fix);
    }
    ready = ins.pose();
    poses = backlog.take_poses(ready, kOrigin);
  }

  const Truth& truth_of(const GpsInsPose& pose) const {
    return *std::lower_bound(truth.begin(), truth.end(), pose.stamp_ns,
                             [](const Truth& then, std::int64_t stamp) { return then.stamp_ns < stamp; });
  }
};

double yaw_of_pose(const Eigen::Isometry3d& T) { return std::atan2(T(1, 0), T(0, 0)); }

// Straight flight in wind does not tell the yaw, the turn after it does, also of the time before.
TEST(GpsInsBacklogFlights, KnowsTheYawOfStraightFlight) {
  double worst = 0.0, mean_square = 0.0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Start start(seed);
    ASSERT_TRUE(start.ready.is_ready);
    ASSERT_FALSE(start.poses.empty());
    EXPECT_LT(start.poses.front().stamp_ns, nanoseconds(4.0));
    EXPECT_GT(start.ready.stamp_ns, nanoseconds(12.0));
    std::int64_t before_ns = std::numeric_limits<std::int64_t>::min();
    for (const GpsInsPose& pose : start.poses) {
      ASSERT_TRUE(pose.is_ready);
      ASSERT_GT(pose.stamp_ns, before_ns);
      ASSERT_LT(pose.stamp_ns, start.ready.stamp_ns);
      before_ns = pose.stamp_ns;
      const double error = wrap_to_pi(yaw_of_pose(pose.T_world_base) - yaw_of_pose(start.truth_of(pose).T_world_base));
      worst = std::max(worst, std::abs(error));
      mean_square += error * error;
      ++count;
    }
  }
  EXPECT_LT(worst, 0.35);
  EXPECT_LT(std::sqrt(mean_square / count), 0.15);
}

TEST(GpsInsBacklog, KeepsNoMoreThanItsTime) {
  const Start all(2), few(2, 10.0);
  ASSERT_FALSE(few.poses.empty());
  EXPECT_LT(all.poses.front().stamp_ns, few.poses.front().stamp_ns);
  EXPECT_GE(few.poses.front().stamp_ns, few.ready.stamp_ns - nanoseconds(10.1));
}

TEST(GpsInsBacklog, HasNothingWithoutAPose) {
  GpsInsBacklog backlog({}, {}, 10.0);
  EXPECT_TRUE(backlog.take_poses({}, kOrigin).empty());
  InertialSample sample;
  sample.specific_force_m_s2.x() = std::nan("");
  backlog.add_imu(sample);
  GpsInsPose ready;
  ready.is_ready = true;
  EXPECT_TRUE(backlog.take_poses(ready, kOrigin).empty());
}

}  // namespace
}  // namespace situation_awareness::gps_ins_backlog_test
