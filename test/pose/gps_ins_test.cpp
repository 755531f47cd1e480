// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/gps_ins.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "gps_ins_flight.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "support/covariance.hpp"
#include "support/manifold_jacobian.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::gps_ins_test {
namespace {

using namespace navigation_error;

GpsInsState random_state(Random& random) {
  ErrorVector<GpsInsState> e = normal_vector<18>(random);
  e.segment<6>(kAccelerometerBias) *= 0.1;
  return Manifold<GpsInsState>::retract({}, e);
}

/// A measurement with the time at which it arrives.
struct Arrival {
  std::int64_t at_ns;
  std::int64_t stamp_ns;
  Eigen::Vector3d position;
};

/// Flies, and calls `each(run, ins)` after each fix has been added. `change` may change a fix, or leave it out.
template <class Change, class Each>
void fly(FlightRun& run, GpsIns& ins, double until_s, const Change& change, const Each& each) {
  for (; run.time_s() < until_s; run.next()) {
    ins.add_imu(run.sample());
    if (!run.has_fix()) continue;
    Eigen::Vector3d fix = run.fix();
    if (change(run.time_s(), fix)) ins.add_position(run.stamp_ns(), fix, run.fix_covariance());
    each(run, ins);
  }
}
constexpr auto kAll = [](double, Eigen::Vector3d&) { return true; };
constexpr auto kNothing = [](const FlightRun&, const GpsIns&) {};

/// Error of the position and of the attitude, as the covariance has it.
Eigen::Matrix<double, 6, 1> error_of(const Eigen::Isometry3d& truth, const GpsInsPose& pose) {
  Eigen::Matrix<double, 6, 1> e;
  e << truth.translation() - pose.T_world_base.translation(),
      log_so3(Eigen::Quaterniond(pose.T_world_base.linear().transpose() * truth.linear()));
  return e;
}

NavigationState moved_by_imu(const NavigationState& x, const Eigen::Vector3d& force, const Eigen::Vector3d& rate,
                             double dt_s) {
  return MotionJacobian().append(x, force, rate, dt_s);
}

TEST(InertialMotion, JacobianEqualsTheNumericalOneOverSeveralSteps) {
  Random random(1);
  for (int i = 0; i < 20; ++i) {
    const GpsInsState start = random_state(random);
    std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> samples;
    for (int k = 0; k < 8; ++k) samples.emplace_back(5.0 * normal_vector<3>(random), normal_vector<3>(random));
    const double dt_s = random.uniform(0.002, 0.05);
    const auto moved = [&](NavigationState x) {
      for (const auto& [force, rate] : samples) x = moved_by_imu(x, force, rate, dt_s);
      return x;
    };
    MotionJacobian F;
    NavigationState x = start.motion;
    for (const auto& [force, rate] : samples) x = F.append(x, force, rate, dt_s);
    const auto numerical = manifold_jacobian<NavigationState>(moved, start.motion);
    EXPECT_LT((F.matrix() - numerical).cwiseAbs().maxCoeff(), 1e-7);
  }
}

TEST(InertialMotion, AShortStepIsAsExactAsALongOne) {
  Random random(4);
  for (int i = 0; i < 100; ++i) {
    NavigationState x = random_state(random).motion;
    const Eigen::Vector3d force = 5.0 * normal_vector<3>(random), rate = normal_vector<3>(random);
    const double dt_s = random.uniform(0.0, 0.1);
    const NavigationState y = moved_by_imu(x, force, rate, dt_s);
    const Eigen::Vector3d turn = dt_s * (rate - x.gyroscope_bias_rad_s);
    EXPECT_LT(log_so3((x.q_world_imu * exp_so3(turn)).conjugate() * y.q_world_imu).norm(), 1e-14);
    const Eigen::Vector3d gain_m_s =
        dt_s * (x.q_world_imu * (exp_so3(0.5 * turn) * (force - x.accelerometer_bias_m_s2)));
    EXPECT_LT((y.velocity_world_m_s - x.velocity_world_m_s - gain_m_s + dt_s * Eigen::Vector3d(0, 0, 9.80665)).norm(),
              1e-13);
  }
}

TEST(InertialMotion, CovarianceIsFPFTPlusNoise) {
  Random random(2);
  const auto P = random_covariance<ErrorMatrix<GpsInsState>>(random, 1.0);
  MotionJacobian F;
  const GpsInsState x = random_state(random);
  F.append(x.motion, {1.0, -2.0, 9.0}, {0.3, 0.2, -0.5}, 0.1);
  InertialNoiseParams none;
  none.accelerometer_noise = none.gyroscope_noise = none.accelerometer_bias_walk = none.gyroscope_bias_walk = 0.0;
  ErrorMatrix<GpsInsState> whole = ErrorMatrix<GpsInsState>::Identity();
  whole.topLeftCorner<15, 15>() = F.matrix();
  const double kept = std::exp(-0.1 / 3.0);
  whole.bottomRightCorner<3, 3>() *= kept;
  ErrorMatrix<GpsInsState> expected = whole * P * whole.transpose();
  expected.diagonal().tail<3>().array() += 1.0 - kept * kept;
  EXPECT_LT((moved_covariance(P, F, none, 3.0) - expected).cwiseAbs().maxCoeff(), 1e-12 * P.norm());
  const InertialNoiseParams noise;
  const auto square = [](double x) { return x * x; };
  const Eigen::Matrix<double, 9, 3> by_force = F.matrix().block<9, 3>(0, navigation_error::kAccelerometerBias);
  const Eigen::Matrix<double, 9, 3> by_rate = F.matrix().block<9, 3>(0, navigation_error::kGyroscopeBias);
  expected.topLeftCorner<9, 9>() += square(noise.accelerometer_noise) / 0.1 * by_force * by_force.transpose() +
                                    square(noise.gyroscope_noise) / 0.1 * by_rate * by_rate.transpose();
  expected.diagonal().segment<3>(navigation_error::kAccelerometerBias).array() +=
      0.1 * square(noise.accelerometer_bias_walk);
  expected.diagonal().segment<3>(navigation_error::kGyroscopeBias).array() += 0.1 * square(noise.gyroscope_bias_walk);
  EXPECT_LT((moved_covariance(P, F, noise, 3.0) - expected).cwiseAbs().maxCoeff(), 1e-13 * P.norm());
}

TEST(GpsInsModels, JacobiansEqualNumericalOnes) {
  Random random(3);
  GpsInsModel model;
  model.antenna_imu_m = {0.3, -0.2, 0.5};
  const GpsInsMounting mounting{Eigen::Isometry3d(Eigen::Translation3d(0.1, -0.4, 0.2)), {0.0, 0.0, 0.3}};
  const GpsIns ins({}, mounting);
  for (int i = 0; i < 20; ++i) {
    const GpsInsState x = random_state(random);
    GpsInsMeasurement fix;
    fix.value = normal_vector<3>(random);
    fix.covariance = Eigen::Vector3d(2.0, 3.0, 5.0).asDiagonal();
    Eigen::Vector3d nu;
    Eigen::Matrix<double, 3, 18> H;
    Eigen::Matrix3d R;
    const auto predicted = [&](const GpsInsState& at) {
      Eigen::Matrix<double, 3, 18> unused_H;
      Eigen::Matrix3d unused_R;
      Eigen::Vector3d residual;
      fix_innovation(at, fix, model, {0.7, 10.0}, residual, unused_H, unused_R);
      return Eigen::Vector3d(-residual);
    };
    fix_innovation(x, fix, model, {0.7, 10.0}, nu, H, R);
    EXPECT_LT((manifold_jacobian<Eigen::Vector3d>(predicted, x) - H).cwiseAbs().maxCoeff(), 1e-7);

    using Scalar = Eigen::Matrix<double, 1, 1>;
    const Eigen::Vector3d rate = normal_vector<3>(random), lever = normal_vector<3>(random);
    const auto slip = [&](const GpsInsState& at) { return Scalar(sideslip(at.motion, rate, lever)); };
    EXPECT_LT((manifold_jacobian<Scalar>(slip, x) - sideslip_jacobian(x.motion, lever)).cwiseAbs().maxCoeff(), 1e-7);

    const double yaw = yaw_of(x.motion.q_world_imu);
    const auto turned = [&](const GpsInsState& at) { return Scalar(wrap_to_pi(yaw_of(at.motion.q_world_imu) - yaw)); };
    const auto by_yaw = manifold_jacobian<Scalar>(turned, x);
    EXPECT_LT((by_yaw.middleCols<3>(kAttitude) - yaw_jacobian(x.motion.q_world_imu)).cwiseAbs().maxCoeff(),
              1e-5 * (1.0 + by_yaw.norm() * by_yaw.norm()));

    // The pose of the base: its error is the position's in the world and the attitude's in the body.
    const Eigen::Isometry3d T = ins.pose_of(x);
    Eigen::Matrix<double, 6, 18> numerical;
    for (int k = 0; k < 18; ++k) {
      const auto at = [&](double step) {
        GpsInsPose pose;
        pose.T_world_base = T;
        return error_of(ins.pose_of(Manifold<GpsInsState>::retract(x, step * ErrorVector<GpsInsState>::Unit(k))), pose);
      };
      numerical.col(k) = (at(1e-5) - at(-1e-5)) / 2e-5;
    }
    EXPECT_LT((numerical - ins.pose_jacobian(x)).cwiseAbs().maxCoeff(), 1e-7);
  }
}

TEST(LocalWorld, ThereAndBackAgain) {
  const GeodeticPosition origin{48.1, 11.6, 520.0};
  EXPECT_LT(local_position(origin, origin).norm(), 1e-6);
  Random random(4);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d p = 1000.0 * normal_vector<3>(random);
    EXPECT_LT((local_position(origin, geodetic_position(origin, p)) - p).norm(), 1e-6);
  }
  EXPECT_GT(local_position(origin, {48.101, 11.6, 520.0}).y(), 100.0) << "north";
  EXPECT_GT(local_position(origin, {48.1, 11.602, 520.0}).x(), 100.0) << "east";
  EXPECT_FALSE(is_valid({std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0}));
  EXPECT_FALSE(is_valid({91.0, 0.0, 0.0}));
}

TEST(LocalWorld, OriginsAreReadFromThreeNumbersAndNothingElse) {
  const GeodeticPosition origin = parse_geodetic_position("-48.1,+11.6,-5e1", "--origin");
  EXPECT_EQ(origin.latitude_deg, -48.1);
  EXPECT_EQ(origin.longitude_deg, 11.6);
  EXPECT_EQ(origin.altitude_m, -50.0);
  for (const std::string text : {"", "48.1,11.6", "48.1;11.6;520", "48.1,11.6,520,1", "48.1,11.6,520 m", "91,0,0",
                                 "0,361,0", "nan,0,0", "0,0,inf"}) {
    EXPECT_TRUE(
        names(refusal_of([&] { parse_geodetic_position(text, "--origin"); }), {"--origin: " + text, "LAT,LON,ALT"}));
  }
}

TEST(GpsInsParams, AreChecked) {
  GpsInsParams params;
  params.max_delay_s = 0.0;
  EXPECT_TRUE(names(refusal_of([&] { GpsIns(params, {}); }), {"gps_ins.max_delay_s", "0"}));
  params = {};
  params.imu.gyroscope_noise = -1.0;
  EXPECT_TRUE(names(refusal_of([&] { GpsIns(params, {}); }), {"imu.gyroscope_noise", "-1"}));
}

// With lever arms and an IMU that is mounted askew, since poses are those of the base.
TEST(GpsIns, FollowsAFlightWithLeverArms) {
  GpsInsMounting mounting;
  mounting.T_base_imu.translate(Eigen::Vector3d(0.1, -0.3, 0.2)).rotate(exp_so3({0.3, 2.0, -1.0}));
  mounting.antenna_base_m = {-0.5, 0.1, 0.3};
  FlightSensors good;
  good.fix_sigma_m = 0.03;
  FlightRun run({}, good, 5, mounting);
  GpsIns ins({}, mounting);
  EXPECT_FALSE(ins.pose().is_ready);
  EXPECT_STRNE(ins.pose().reason, "");
  int checked = 0;
  fly(run, ins, 90.0, kAll, [&](const FlightRun& now, const GpsIns& filter) {
    const GpsInsPose pose = filter.pose();
    if (!pose.is_ready || now.time_s() < 40.0) return;
    const auto e = error_of(now.T_world_base(), pose);
    EXPECT_LT(e.head<3>().norm(), 0.3);
    EXPECT_LT(e.tail<3>().norm(), 0.05);
    EXPECT_NEAR(pose.T_world_base.translation().z(), now.T_world_base().translation().z(), 0.3);
    ++checked;
  });
  EXPECT_GT(checked, 200);
}

// The covariance of the velocity in the axes of the base is not only that of the velocity in the world, turned: the
// attitude is uncertain, too, and correlated with it.
TEST(GpsIns, TwistOfTheBaseHasItsCovariance) {
  GpsInsMounting mounting;
  mounting.T_base_imu.translate(Eigen::Vector3d(0.5, -0.3, 0.2)).rotate(exp_so3({0.3, 2.0, -1.0}));
  FlightRun run({}, {}, 6, mounting);
  GpsIns ins({}, mounting);
  int checked = 0;
  fly(run, ins, 60.0, kAll, [&](const FlightRun& now, const GpsIns& filter) {
    const GpsInsPose pose = filter.pose();
    Estimate<GpsInsState> estimate;
    if (!pose.is_ready || !filter.state_at(pose.stamp_ns, estimate)) return;
    EXPECT_LT((pose.T_world_base.linear() * pose.velocity_base_m_s - pose.velocity_world_m_s).norm(), 1e-12);
    using Vector6 = Eigen::Matrix<double, 6, 1>;
    const Eigen::Vector3d measured = pose.angular_velocity_base_rad_s + estimate.x.motion.gyroscope_bias_rad_s;
    const auto twist = [&](const GpsInsState& x) {
      const Eigen::Vector3d rate = measured - x.motion.gyroscope_bias_rad_s;
      Vector6 t;
      t << x.motion.q_world_imu.conjugate() * x.motion.velocity_world_m_s -
               rate.cross(mounting.T_base_imu.translation()),
          rate;
      return t;
    };
    EXPECT_LT((twist(estimate.x).head<3>() - pose.velocity_base_m_s).norm(), 1e-9);
    const auto J = manifold_jacobian<Vector6>(twist, estimate.x);
    Eigen::Matrix<double, 6, 6> rest = pose.twist_covariance - J * estimate.P * J.transpose();
    const Eigen::Vector3d white = rest.diagonal().tail<3>();  // of one sample of the gyroscope
    EXPECT_GT(white.minCoeff(), 0.0);
    EXPECT_NEAR(white.x() * 0.005, filter.imu_noise()(1) * filter.imu_noise()(1), 1e-3 * white.x() * 0.005 + 1e-12);
    rest.diagonal().tail<3>().setZero();
    EXPECT_LT(rest.cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_LT((now.T_world_base().linear().transpose() * pose.velocity_world_m_s - pose.velocity_base_m_s).norm(), 1.0);
    ++checked;
  });
  EXPECT_GT(checked, 100);
}

// Heading is not course: a straight flight in the wind says nothing of the yaw.
TEST(GpsIns, IsNotReadyBeforeTheYawShowsItself) {
  SimulatedFlight straight;
  straight.legs = {{1000.0, 0.0}};
  FlightRun run(straight, {}, 6);
  GpsIns ins({}, {});
  fly(run, ins, 30.0, kAll, kNothing);
  EXPECT_FALSE(ins.is_ready());
  EXPECT_NE(std::string(ins.reason()).find("yaw"), std::string::npos);

  // One heading may be an outlier.
  fly(run, ins, 31.0, kAll, [&](const FlightRun& now, const GpsIns&) {
    ins.add_heading(now.stamp_ns() - 100'000'000, straight.initial_yaw_rad, 0.03);
  });
  EXPECT_TRUE(ins.is_ready());
  EXPECT_NEAR(wrap_to_pi(base_yaw(ins.pose().T_world_base) - straight.initial_yaw_rad), 0.0, 0.1);
}

// At the limit itself it may rest on some seconds of fixes that drift, and comes and goes.
TEST(GpsIns, IsReadyOnceTheYawIsKnownWithAMargin) {
  const GpsInsParams params;
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    FlightRun run({}, {}, seed);
    GpsIns ins(params, {});
    double sigma_rad = 0.0;
    fly(run, ins, 60.0, kAll, [&](const FlightRun&, const GpsIns& now) {
      if (sigma_rad > 0.0 || !now.is_ready()) return;
      sigma_rad = std::sqrt(yaw_variance(now.pose()));
    });
    EXPECT_GT(sigma_rad, 0.0) << seed;
    EXPECT_LT(sigma_rad, 0.75 * params.max_yaw_sigma_rad) << seed;
  }
}

TEST(GpsIns, NamesAnImuThatIsMountedOtherwiseThanSaid) {
  GpsInsMounting true_mounting;
  true_mounting.T_base_imu.rotate(Eigen::AngleAxisd(kPi / 2.0, Eigen::Vector3d::UnitX()));
  FlightRun run({}, {}, 7, true_mounting);
  GpsIns ins({}, {});
  fly(run, ins, 10.0, kAll, kNothing);
  EXPECT_FALSE(ins.is_ready());
  EXPECT_NE(std::string(ins.reason()).find("T_base_imu"), std::string::npos);
}

TEST(GpsIns, TurningTheWorldTurnsThePose) {
  FlightRun run({}, {}, 8);
  // By a step of the yaws that are tried, or several.
  const Eigen::Isometry3d turn(Eigen::AngleAxisd(3.0 * kPi / 4.0, Eigen::Vector3d::UnitZ()));
  GpsIns here({}, {}), there({}, {});
  for (; run.time_s() < 60.0; run.next()) {
    const InertialSample sample = run.sample();
    here.add_imu(sample);
    there.add_imu(sample);
    if (!run.has_fix()) continue;
    const Eigen::Vector3d fix = run.fix();
    const Eigen::Matrix3d R = run.fix_covariance();
    here.add_position(run.stamp_ns(), fix, R);
    there.add_position(run.stamp_ns(), turn * fix, turn.linear() * R * turn.linear().transpose());
  }
  const GpsInsPose a = here.pose(), b = there.pose();
  ASSERT_TRUE(a.is_ready && b.is_ready);
  EXPECT_TRUE(b.T_world_base.isApprox(turn * a.T_world_base, 1e-2));
  Eigen::Matrix<double, 6, 6> J = Eigen::Matrix<double, 6, 6>::Identity();
  J.topLeftCorner<3, 3>() = turn.linear();
  EXPECT_LT((b.covariance - J * a.covariance * J.transpose()).norm(), 0.02 * a.covariance.norm());
}

// Late fixes and those that come in another order are applied at their stamps: the pose is the same once all are there.
TEST(GpsIns, LateFixesAreAsGoodAsThoseInTime) {
  FlightRun run({}, {}, 9);
  GpsIns in_time({}, {}), late({}, {});
  std::vector<Arrival> arrivals;
  Random random(10);
  for (; run.time_s() < 60.0; run.next()) {
    const InertialSample sample = run.sample();
    in_time.add_imu(sample);
    late.add_imu(sample);
    if (run.has_fix()) {
      const Eigen::Vector3d fix = run.fix();
      in_time.add_position(run.stamp_ns(), fix, run.fix_covariance());
      // Until the pose is ready in time, as the history begins then; later up to 0.5 s late, so that some overtake.
      const double delay_s = run.time_s() < 30.0 || run.time_s() > 59.0 ? 0.0 : random.uniform(0.0, 0.5);
      arrivals.push_back({run.stamp_ns() + nanoseconds(delay_s), run.stamp_ns(), fix});
    }
    for (auto arrival = arrivals.begin(); arrival != arrivals.end();) {
      if (arrival->at_ns > run.stamp_ns()) {
        ++arrival;
        continue;
      }
      late.add_position(arrival->stamp_ns, arrival->position, run.fix_covariance());
      arrival = arrivals.erase(arrival);
    }
  }
  const GpsInsPose a = in_time.pose(), b = late.pose();
  ASSERT_TRUE(a.is_ready && b.is_ready);
  EXPECT_EQ(late.counters().of("fix too late"), 0u);
  EXPECT_LT(error_of(a.T_world_base, b).head<3>().norm(), 1e-3);
  EXPECT_LT(error_of(a.T_world_base, b).tail<3>().norm(), 1e-4);
  EXPECT_LT((a.covariance - b.covariance).norm(), 1e-2 * a.covariance.norm());
}

TEST(GpsIns, UsesNothingFromTheFuture) {
  FlightRun run({}, {}, 11);
  GpsIns ins({}, {});
  fly(run, ins, 40.0, kAll, kNothing);
  const GpsInsPose before = ins.pose();
  ins.add_position(ins.stamp_ns() + 50'000'000, before.T_world_base.translation() + Eigen::Vector3d(1.0, 0.0, 0.0),
                   run.fix_covariance());
  EXPECT_TRUE(ins.pose().T_world_base.isApprox(before.T_world_base, 0.0));
  ins.add_position(ins.stamp_ns() + 5'000'000'000, Eigen::Vector3d::Zero(), run.fix_covariance());
  EXPECT_EQ(ins.counters().of("fix ahead of the imu"), 1u);
  ins.add_position(ins.stamp_ns() - 5'000'000'000, Eigen::Vector3d::Zero(), run.fix_covariance());
  EXPECT_EQ(ins.counters().of("fix too late"), 1u);
}

TEST(GpsIns, AFarFixDoesNotMoveThePose) {
  FlightRun run({}, {}, 12);
  GpsIns ins({}, {});
  fly(run, ins, 60.0, kAll, kNothing);
  ASSERT_TRUE(ins.is_ready());
  Eigen::Isometry3d last = ins.pose().T_world_base;
  double usual = 0.0, with_outlier = 0.0;
  for (int i = 0; run.time_s() < 90.0; run.next()) {
    ins.add_imu(run.sample());
    if (!run.has_fix()) continue;
    const bool is_outlier = ++i % 20 == 0;
    Eigen::Vector3d fix = run.fix();
    if (is_outlier) fix += 30.0 * Eigen::Vector3d(std::cos(i), std::sin(i), 0.0);
    ins.add_position(run.stamp_ns(), fix, run.fix_covariance());
    const Eigen::Isometry3d now = ins.pose().T_world_base;
    double& most = is_outlier ? with_outlier : usual;
    most = std::max(most, (now.translation() - last.translation()).norm());
    last = now;
  }
  EXPECT_LE(with_outlier, 1.2 * usual);
  EXPECT_GE(ins.counters().of("fix outside its gate"), 7u);
  EXPECT_LE(ins.counters().of("fix outside its gate"), 9u);
}

TEST(GpsIns, DoesNotStartFromAFarFix) {
  for (int far = 0; far < 9; ++far) {
    FlightRun run({}, {}, 14);
    GpsIns ins({}, {});
    int number = 0;
    const auto moved = [&](double /*time_s*/, Eigen::Vector3d& fix) {
      if (number++ == far) fix += Eigen::Vector3d(-20.0, 25.0, 10.0);
      return true;
    };
    while (run.time_s() < 25.0 && !ins.is_ready()) fly(run, ins, run.time_s() + 0.5, moved, kNothing);
    EXPECT_TRUE(ins.is_ready()) << far;
    EXPECT_LE(ins.counters().of("fix outside its gate"), 1u) << far;
    const GpsInsPose pose = ins.pose();
    EXPECT_LT((pose.T_world_base.translation() - run.T_world_base().translation()).norm(), 6.0) << far;
  }
}

TEST(GpsIns, RecoversIfItIsWrongItself) {
  FlightRun run({}, {}, 13);
  GpsIns ins({}, {});
  // From 60 s on the receiver is 40 m away: no pose could know that it is not right.
  const auto moved = [](double time_s, Eigen::Vector3d& fix) {
    if (time_s > 60.0) fix.x() += 40.0;
    return true;
  };
  fly(run, ins, 60.0, moved, kNothing);
  ASSERT_TRUE(ins.is_ready());
  fly(run, ins, 69.0, moved, kNothing);
  EXPECT_LT(std::abs(ins.pose().T_world_base.translation().x() - run.T_world_base().translation().x()), 10.0);
  fly(run, ins, 100.0, moved, kNothing);
  EXPECT_NEAR(ins.pose().T_world_base.translation().x(), run.T_world_base().translation().x() + 40.0, 6.0);
}

TEST(GpsIns, BadDataAreDroppedAndCounted) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  FlightRun run({}, {}, 14);
  GpsIns ins({}, {}, GeodeticPosition{48.0, 11.0, 500.0});
  fly(run, ins, 40.0, kAll, kNothing);
  const Eigen::Matrix3d R = run.fix_covariance();
  const GpsInsPose before = ins.pose();
  const std::int64_t now = ins.stamp_ns();
  ins.add_fix({now, false, {48.0, 11.0, 500.0}, R});
  ins.add_fix({now, true, {nan, 11.0, 500.0}, R});
  ins.add_fix({now, true, {48.0, 11.0, nan}, R});
  ins.add_fix({now, true, {48.0, 11.0, 500.0}, nan * R});
  ins.add_fix({now, true, {48.0, 11.0, 500.0}, Eigen::Matrix3d::Zero()});
  ins.add_altitude(now, nan, 1.0);
  ins.add_heading(now, 0.0, 0.0);
  ins.add_imu({now + 1, {nan, 0.0, 9.8}, {0.0, 0.0, 0.0}});
  ins.add_imu({now, {0.0, 0.0, 9.8}, {0.0, 0.0, 0.0}});
  ins.add_imu({now - 10'000'000, {0.0, 0.0, 9.8}, {0.0, 0.0, 0.0}});
  EXPECT_EQ(ins.counters().of("no fix"), 1u);
  EXPECT_EQ(ins.counters().of("fix not finite"), 2u);
  EXPECT_EQ(ins.counters().of("fix without covariance"), 2u);
  EXPECT_EQ(ins.counters().of("altitude not finite"), 1u);
  EXPECT_EQ(ins.counters().of("heading not finite"), 1u);
  EXPECT_EQ(ins.counters().of("imu not finite"), 1u);
  EXPECT_EQ(ins.counters().of("imu stamped twice"), 1u);
  EXPECT_EQ(ins.counters().of("imu out of order"), 1u);
  EXPECT_TRUE(ins.pose().T_world_base.isApprox(before.T_world_base, 0.0));

  // Time goes back, as three samples in a row say: everything starts anew.
  for (const std::int64_t since : {0, 10'000'000, 20'000'000}) {
    EXPECT_TRUE(ins.is_ready());
    ins.add_imu({now - 30'000'000'000 + since, {0.0, 0.0, 9.8}, {0.0, 0.0, 0.0}});
  }
  EXPECT_EQ(ins.counters().of("imu restarted"), 1u);
  EXPECT_FALSE(ins.is_ready());
}

TEST(GpsIns, AShortGapOfTheImuIsBridgedAndALongOneRestarts) {
  FlightRun run({}, {}, 15);
  GpsIns ins({}, {});
  fly(run, ins, 60.0, kAll, kNothing);
  // Without receipts a gap counts when three samples in a row agree with it.
  const auto go_on_at = [&](double time_s) {
    while (run.time_s() < time_s) run.next();
    for (int i = 0; i < StampOrder::kAgreeing; ++i) {
      if (i > 0) run.next();
      ins.add_imu(run.sample());
    }
  };
  go_on_at(60.6);
  EXPECT_EQ(ins.counters().of("imu gap"), 1u);
  ASSERT_TRUE(ins.is_ready());
  const GpsInsPose pose = ins.pose();
  const auto e = error_of(run.T_world_base(), pose);
  EXPECT_LT(mahalanobis2(e, pose.covariance), chi_square_quantile(0.999, 6));
  run.next();
  fly(run, ins, 90.0, kAll, kNothing);
  go_on_at(95.0);
  EXPECT_FALSE(ins.is_ready());
  EXPECT_EQ(ins.counters().of("restarted after an imu gap"), 1u);
}

// Corrections of another kind: a place that is known to 0.1 m, said late and linear about the state at that time.
TEST(GpsIns, TakesCorrectionsOfOthersAtTheirStamps) {
  FlightRun run({}, {}, 16);
  GpsIns ins({}, {});
  fly(run, ins, 50.0, kAll, kNothing);
  ASSERT_TRUE(ins.is_ready());
  const Eigen::Vector3d then = run.T_world_base().translation();
  const std::int64_t stamp_ns = run.stamp_ns();
  fly(run, ins, 50.3, kAll, kNothing);
  Estimate<GpsInsState> estimate;
  ASSERT_TRUE(ins.state_at(stamp_ns, estimate));
  GpsInsCorrection place;
  place.stamp_ns = stamp_ns;
  place.rows = 3;
  place.reference = estimate.x;
  place.residual.head<3>() = then - estimate.x.motion.position_world_m;
  place.H.block<3, 3>(0, kPosition).setIdentity();
  place.R.topLeftCorner<3, 3>() = 0.01 * Eigen::Matrix3d::Identity();
  ins.correct(place);
  const GpsInsPose pose = ins.pose();
  run.next();
  const Eigen::Matrix2d covariance = pose.covariance.topLeftCorner<2, 2>();
  EXPECT_LT(covariance.trace(), 0.2);
  EXPECT_EQ(ins.nis(GpsInsSensor::kOther).summarise().matches, 3u);
  EXPECT_FALSE(ins.state_at(stamp_ns - 10'000'000'000, estimate));
  place.residual(0) = std::numeric_limits<double>::quiet_NaN();
  ins.correct(place);
  EXPECT_EQ(ins.counters().of("correction not finite"), 1u);
}

// --- over seeds ---

struct Totals {
  double square = 0.0, yaw_square = 0.0, nees = 0.0, fix_square = 0.0, outage_square = 0.0, after_square = 0.0;
  long count = 0, fixes = 0, inside = 0;
  int runs = 0, ready = 0;
};

Totals totals(int seeds, const FlightSensors& sensors, bool with_outage) {
  Totals total;
  for (int seed = 0; seed < seeds; ++seed) {
    SimulatedFlight flight;
    flight.initial_yaw_rad = 0.77 * seed;
    FlightRun run(flight, sensors, static_cast<std::uint64_t>(1000 + seed));
    GpsIns ins({}, {});
    const auto change = [&](double time_s, Eigen::Vector3d& fix) {
      total.fix_square += (fix - run.antenna()).head<2>().squaredNorm();
      ++total.fixes;
      return !with_outage || time_s < 110.0 || time_s > 140.0;
    };
    fly(run, ins, 160.0, change, [&](const FlightRun& now, const GpsIns& filter) {
      const GpsInsPose pose = filter.pose();
      if (!pose.is_ready || now.time_s() < 50.0) return;
      const auto e = error_of(now.T_world_base(), pose);
      const double nees =
          mahalanobis2(Eigen::Vector2d(e.head<2>()), Eigen::Matrix2d(pose.covariance.topLeftCorner<2, 2>()));
      total.nees += nees;
      total.inside += nees < 11.83 ? 1 : 0;  // 3 sigma of two
      total.square += e.head<2>().squaredNorm();
      total.yaw_square += std::pow(wrap_to_pi(base_yaw(now.T_world_base()) - base_yaw(pose.T_world_base)), 2);
      ++total.count;
      if (std::abs(now.time_s() - 140.0) < 0.05) total.outage_square += e.head<2>().squaredNorm();
      if (std::abs(now.time_s() - 145.0) < 0.05) total.after_square += e.head<2>().squaredNorm();
    });
    ++total.runs;
    total.ready += ins.is_ready() ? 1 : 0;
  }
  return total;
}

double rms(double square, double count) { return std::sqrt(square / count); }

// Also where the share and the time constant of the slow errors are not among those that the bank has.
TEST(GpsInsStatistics, IsHonestHoweverTheFixesAreCorrelated) {
  for (const auto& [share, correlation_s] :
       std::vector<std::pair<double, double>>{{0.0, 1.0}, {0.3, 7.0}, {0.7, 20.0}, {0.96, 60.0}}) {
    FlightSensors sensors;
    sensors.imu_rate_hz = 100.0;
    sensors.correlated_share = share;
    sensors.correlation_s = correlation_s;
    const Totals total = totals(25, sensors, false);
    const auto count = static_cast<double>(total.count);
    RecordProperty("nees_" + std::to_string(share), std::to_string(total.nees / count));
    EXPECT_EQ(total.ready, total.runs);
    EXPECT_GT(total.nees / count, 1.2) << share;
    // 75 independent errors: the mean of an honest filter has a standard deviation of 0.23, and half a minute is short
    // to learn the noise.
    EXPECT_LT(total.nees / count, 3.0) << share;
    EXPECT_GT(static_cast<double>(total.inside) / count, 0.97) << share;
    // Errors slower than the flight is long stay: nothing tells them from the place.
    EXPECT_LT(rms(total.square, count), 1.05 * rms(total.fix_square, static_cast<double>(total.fixes))) << share;
    EXPECT_LT(rms(total.yaw_square, count), 3.0 * kPi / 180.0) << share;
    if (share == 0.0) {
      EXPECT_LT(rms(total.square, count), 0.8);
    }
  }
}

// In a banked turn the force is along the body's z, as if it flew level: the bank is found by the fixes.
TEST(GpsInsStatistics, StartsInATurn) {
  FlightSensors sensors;
  sensors.imu_rate_hz = 100.0;
  double nees = 0.0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    SimulatedFlight orbit;
    orbit.initial_yaw_rad = 0.3 * static_cast<double>(seed);
    orbit.change_s = 0.01;
    orbit.legs = {{1000.0, 5.0 / 8.0}};
    FlightRun run(orbit, sensors, seed);
    GpsIns ins({}, {});
    fly(run, ins, 60.0, kAll, kNothing);
    ASSERT_TRUE(ins.is_ready()) << seed;
    const GpsInsPose pose = ins.pose_at(ins.stamp_ns() - 5'000'000);
    const double time_s = 1e-9 * static_cast<double>(pose.stamp_ns);
    const Eigen::Quaterniond q(pose.T_world_base.linear());
    const Eigen::Vector3d e = log_so3(q.conjugate() * orbit.attitude(time_s));
    EXPECT_LT(e.norm(), 0.25) << seed;
    nees += mahalanobis2(e, Eigen::Matrix3d(pose.covariance.bottomRightCorner<3, 3>()));
  }
  EXPECT_LT(nees, chi_square_quantile(0.999, 60));
}

/// Square of the yaw's error by its variance.
double yaw_nees(const SimulatedFlight& flight, const GpsInsPose& pose) {
  const double error_rad =
      wrap_to_pi(flight.yaw(1e-9 * static_cast<double>(pose.stamp_ns)) - base_yaw(pose.T_world_base));
  return error_rad * error_rad / yaw_variance(pose);
}

/// Adds samples and fixes until the pose is ready; false if it is not by then.
bool becomes_ready(FlightRun& run, GpsIns& ins, double until_s) {
  while (!ins.is_ready() && run.time_s() < until_s) fly(run, ins, run.time_s() + 0.1, kAll, kNothing);
  return ins.is_ready();
}

FlightSensors good_receiver() {
  FlightSensors sensors;
  sensors.imu_rate_hz = 100.0;
  sensors.fix_sigma_m = 0.1;
  sensors.correlated_share = 0.0;
  return sensors;
}

// With the biases that an IMU may have, a steady turn of 14 m at 5 m/s shows the yaw to 0.16 rad: a gyroscope bias
// keeps a tilt in place that has the force of the turn, had it another yaw. So the pose is not ready there, and is once
// the turn ends.
TEST(GpsInsStatistics, ASteadyTurnShowsNoMoreOfTheYawThanTheBiasesLeaveOpen) {
  FlightSensors sensors = good_receiver();
  sensors.gyroscope_bias_sigma_rad_s = InertialNoiseParams{}.gyroscope_bias_sigma_rad_s;
  sensors.accelerometer_bias_sigma_m_s2 = InertialNoiseParams{}.accelerometer_bias_sigma_m_s2;
  double nees = 0.0;
  constexpr int kRuns = 24;
  for (int i = 0; i < kRuns; ++i) {
    SimulatedFlight flight;
    flight.wind_m_s.setZero();
    flight.initial_yaw_rad = 2.0 * kPi * i / kRuns;
    flight.legs = {{60.0, 5.0 / 14.0}, {10.0, 0.0}};
    FlightRun run(flight, sensors, static_cast<std::uint64_t>(i));
    GpsIns ins({}, {});
    EXPECT_FALSE(becomes_ready(run, ins, 60.0)) << i;
    ASSERT_TRUE(becomes_ready(run, ins, 70.0)) << i << ": " << ins.reason();
    nees += yaw_nees(flight, ins.pose());
  }
  EXPECT_LT(nees, chi_square_quantile(0.999, kRuns));
}

// Biases stay what they are in a gap, so the yaw shows itself in any turn.
TEST(GpsInsStatistics, AfterAGapInATurnThePoseIsFoundAtOnce) {
  double nees = 0.0;
  constexpr int kRuns = 24;
  for (int i = 0; i < kRuns; ++i) {
    SimulatedFlight flight;
    flight.legs = {{12.0, 0.0}, {14.0, 5.0 / 6.0}, {6.0, 0.0}, {14.0, -5.0 / 6.0}, {1000.0, 5.0 / 14.0}};
    FlightRun run(flight, good_receiver(), static_cast<std::uint64_t>(i));
    GpsIns ins({}, {});
    const double gap_s = 60.0 + i * 2.0 * kPi * 14.0 / 5.0 / kRuns;
    fly(run, ins, gap_s, kAll, kNothing);
    ASSERT_TRUE(ins.is_ready());
    while (run.time_s() < gap_s + 1.5) run.next();
    for (int k = 0; k < StampOrder::kAgreeing; ++k, run.next()) ins.add_imu(run.sample());
    ASSERT_EQ(ins.counters().of("restarted after an imu gap"), 1u);
    ASSERT_FALSE(ins.is_ready());
    ASSERT_TRUE(becomes_ready(run, ins, gap_s + 30.0)) << i << ": " << ins.reason();
    nees += yaw_nees(flight, ins.pose());
  }
  EXPECT_LT(nees, chi_square_quantile(0.999, kRuns));
}

TEST(GpsInsStatistics, ComesThroughAnOutage) {
  FlightSensors sensors;
  sensors.imu_rate_hz = 100.0;
  sensors.correlated_share = 0.0;
  const Totals total = totals(25, sensors, true);
  const auto count = static_cast<double>(total.count);
  EXPECT_GT(total.nees / count, 1.2);
  EXPECT_LT(total.nees / count, 2.6);
  EXPECT_GT(static_cast<double>(total.inside) / count, 0.97);
  EXPECT_LT(rms(total.outage_square, total.runs), 35.0);
  EXPECT_LT(rms(total.after_square, total.runs), 1.2);
}

}  // namespace
}  // namespace situation_awareness::gps_ins_test
