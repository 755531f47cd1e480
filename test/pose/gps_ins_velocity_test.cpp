// SPDX-License-Identifier: BSD-3-Clause
// The velocity of a receiver as a measurement of GpsIns.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "gps_ins_drive.hpp"
#include "gps_ins_flight.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "support/covariance.hpp"
#include "support/manifold_jacobian.hpp"

namespace situation_awareness::gps_ins_velocity_test {
namespace {

constexpr double kSigma_m_s = 0.05;
const Eigen::Matrix3d kCovariance = kSigma_m_s * kSigma_m_s * Eigen::Matrix3d::Identity();

/// Goes on until a time, with a velocity beside each fix that is `age_s` older than its stamp.
template <class Run, class Each>
void go(Run& run, GpsIns& ins, double until_s, double age_s, const Each& each) {
  for (; run.time_s() < until_s; run.next()) {
    ins.add_imu(run.sample());
    if (!run.has_fix()) continue;
    ins.add_position(run.stamp_ns(), run.fix(), run.fix_covariance());
    ins.add_velocity({run.stamp_ns(), run.antenna_velocity(age_s) + run.noise(kSigma_m_s), kCovariance});
    each();
  }
}
constexpr auto kNothing = [] {};

FlightSensors receiver(double fix_sigma_m) {
  FlightSensors sensors;
  sensors.imu_rate_hz = 100.0;
  sensors.fix_sigma_m = fix_sigma_m;
  return sensors;
}

GpsInsMounting mounting() {
  return {Eigen::Isometry3d(Eigen::Translation3d(0.5, 0.1, 0.2)), Eigen::Vector3d(-1.5, 0.3, 1.0)};
}

TEST(GpsInsVelocity, ItsJacobianEqualsTheNumericalOne) {
  Random random(5);
  for (int i = 0; i < 20; ++i) {
    const GpsInsState x = Manifold<GpsInsState>::retract({}, normal_vector<18>(random));
    const Eigen::Vector3d rate = normal_vector<3>(random), antenna = normal_vector<3>(random);
    Eigen::Matrix<double, 3, 18> H, unused;
    velocity_innovation(x.motion, Eigen::Vector3d::Zero(), rate, antenna, H);
    const auto expected = [&](const GpsInsState& at) {
      return Eigen::Vector3d(-velocity_innovation(at.motion, Eigen::Vector3d::Zero(), rate, antenna, unused));
    };
    EXPECT_LT((manifold_jacobian<Eigen::Vector3d>(expected, x) - H).cwiseAbs().maxCoeff(), 1e-7);
  }
}

// With fixes of 1.5 m that are alike for 20 s the velocity is what shows the motion. That it is old must not turn the
// yaw, nor make the pose more certain than it is.
TEST(GpsInsVelocity, AnOldOneIsNotBelievedTooMuch) {
  for (const double age_s : {0.0, 0.3}) {
    double velocity_nees = 0.0, yaw_nees = 0.0, count = 0.0;
    for (std::uint64_t seed = 0; seed < 4; ++seed) {
      SimulatedFlight flight;
      flight.initial_yaw_rad = 0.77 * static_cast<double>(seed);
      FlightRun run(flight, receiver(1.5), 300 + seed, mounting());
      GpsIns ins({}, mounting());
      go(run, ins, 110.0, age_s, [&] {
        if (run.time_s() < 60.0) return;
        const GpsInsPose pose = ins.pose();
        ASSERT_TRUE(pose.is_ready);
        const double yaw = wrap_to_pi(base_yaw(run.T_world_base()) - base_yaw(pose.T_world_base));
        yaw_nees += yaw * yaw / yaw_variance(pose);
        const Eigen::Vector3d v_base =
            flight.velocity(run.time_s()) -
            flight.attitude(run.time_s()) *
                flight.angular_velocity_body(run.time_s()).cross(mounting().T_base_imu.translation());
        const Eigen::Vector3d e = v_base - pose.velocity_world_m_s;
        velocity_nees += mahalanobis2(e, pose.velocity_covariance);
        count += 1.0;
      });
    }
    EXPECT_LT(velocity_nees / count, 4.5) << age_s;
    EXPECT_GT(velocity_nees / count, 0.3) << age_s;
    EXPECT_LT(yaw_nees / count, 2.0) << age_s;
  }
}

// A start from rest, by a usual receiver.
TEST(GpsInsVelocity, ThePoseIsReadyWithinFiveSecondsOfMoving) {
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    SimulatedDrive drive;
    drive.initial_yaw_rad = 0.8 * static_cast<double>(seed);
    drive.change_s = 5.0;
    drive.legs = {{40.0, 0.0, 0.0}, {30.0, 10.0, 0.0}};
    DriveRun run(drive, receiver(1.5), seed, mounting());
    GpsIns ins({}, mounting());
    go(run, ins, 40.0, 0.1, kNothing);
    EXPECT_FALSE(ins.is_ready()) << seed;
    go(run, ins, 45.0, 0.1, kNothing);
    ASSERT_TRUE(ins.is_ready()) << seed << ": " << ins.reason();
    const GpsInsPose pose = ins.pose();
    const double yaw = wrap_to_pi(drive.initial_yaw_rad - base_yaw(pose.T_world_base));
    EXPECT_LT(yaw * yaw, 9.0 * yaw_variance(pose)) << seed;
  }
}

TEST(GpsInsVelocity, OneThatIsFarOffIsNotUsed) {
  FlightRun run({}, receiver(1.5), 12);
  GpsIns ins({}, {});
  go(run, ins, 60.0, 0.0, kNothing);
  ASSERT_TRUE(ins.is_ready());
  const GpsInsPose before = ins.pose();
  ins.add_velocity({ins.stamp_ns(), before.velocity_world_m_s + Eigen::Vector3d(6.0, 0.0, 3.0), kCovariance});
  EXPECT_TRUE(ins.pose().T_world_base.isApprox(before.T_world_base, 0.0));
  EXPECT_EQ(ins.counters().of("velocity outside its gate"), 1u);
  EXPECT_EQ(ins.counters().of("climb outside its gate"), 1u);
}

TEST(GpsInsVelocity, BadOnesAreDroppedAndCounted) {
  FlightRun run({}, receiver(1.5), 13);
  GpsIns ins({}, {});
  go(run, ins, 40.0, 0.0, kNothing);
  const GpsInsPose before = ins.pose();
  const std::int64_t now = ins.stamp_ns();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  ins.add_velocity({now, {nan, 0.0, 0.0}, kCovariance});
  ins.add_velocity({now, {2e4, 0.0, 0.0}, kCovariance});
  ins.add_velocity({now, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero()});
  ins.add_velocity({now, Eigen::Vector3d::Zero(), nan * kCovariance});
  ins.add_velocity({now - 5'000'000'000, Eigen::Vector3d::Zero(), kCovariance});
  ins.add_velocity({now + 5'000'000'000, Eigen::Vector3d::Zero(), kCovariance});
  EXPECT_EQ(ins.counters().of("velocity not finite"), 1u);
  EXPECT_EQ(ins.counters().of("velocity out of range"), 1u);
  EXPECT_EQ(ins.counters().of("velocity without covariance"), 2u);
  EXPECT_EQ(ins.counters().of("velocity too late"), 1u);
  EXPECT_EQ(ins.counters().of("velocity ahead of the imu"), 1u);
  EXPECT_TRUE(ins.pose().T_world_base.isApprox(before.T_world_base, 0.0));
}

}  // namespace
}  // namespace situation_awareness::gps_ins_velocity_test
