// SPDX-License-Identifier: BSD-3-Clause
// The pose by way of the map, where that is better than GPS and INS: flights around a building with the noise of fixes
// of all receivers there are.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "circling_flight.hpp"
#include "pose/gps_ins_flight.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/pipeline/splinegon_pipeline.hpp"
#include "support/covariance.hpp"

namespace situation_awareness::place_by_map_test {
namespace {

SplinegonPipelineParams with_the_pipeline_alone() {
  const std::string path = std::string(SITUATION_AWARENESS_SOURCE_DIR) + "/cfg/splinegons.yaml";
  return params_from_yaml<SplinegonPipelineParams>(read_text_file(path), path, [](const UnknownKey&) {});
}

struct Receiver {
  double sigma_m, correlated_share, correlation_s;
  double outage_s = 0.0;  ///< at the end of the flight
};

/// The errors are those of x and y of the poses at the scans.
struct Errors {
  double square_m2 = 0.0, nees = 0.0;
  int scans = 0, beyond_3_sigma = 0;

  void add(const Eigen::Vector2d& error_m, const Eigen::Matrix2d& P) {
    const double own = mahalanobis2(error_m, P);
    square_m2 += error_m.squaredNorm();
    nees += own;
    ++scans;
    if (own > 9.0) ++beyond_3_sigma;
  }
  double rms_m() const { return std::sqrt(square_m2 / scans); }
  double mean_nees() const { return nees / scans; }
};

struct Flown {
  Errors by_gps_ins, chosen;
  int by_map = 0;
};

/// So long it has a compass, and no scanner.
constexpr double kBefore_s = 20.0;

/// Three laps, with odom of gyroscopes and accelerations that are a little wrong.
void fly(const Receiver& receiver, const Outline& outline, std::uint64_t seed, Flown& flown) {
  const std::int64_t first_ns = 1'000'000'000'000;
  const double rate_rad_s = Flight::kSpeed_m_s / Flight::kRadius_m;
  SimulatedFlight motion;
  motion.airspeed_m_s = Flight::kSpeed_m_s;
  motion.wind_m_s.setZero();
  motion.initial_yaw_rad = 0.5 * kPi;
  motion.change_s = 1e-6;
  motion.legs = {{1e9, rate_rad_s}};
  FlightSensors sensors;
  sensors.imu_rate_hz = 50.0;
  sensors.fix_sigma_m = receiver.sigma_m;
  sensors.correlated_share = receiver.correlated_share;
  sensors.correlation_s = receiver.correlation_s;
  FlightRun run(motion, sensors, seed);
  const Eigen::Vector3d begin_m(Flight::kRadius_m, 0.0, 0.0);  // the run begins at the origin
  Flight flight(outline, seed);
  GpsIns ins({}, {});
  SplinegonPipeline pipeline(with_the_pipeline_alone());

  Random random(1000 + seed);
  const double yaw_rate_error_rad_s = 0.002 * random.normal();
  const Eigen::Vector2d acceleration_error_m_s2(0.1 * random.normal(), 0.1 * random.normal());
  Eigen::Vector2d p_odom_m = Eigen::Vector2d::Zero(), v_odom_m_s = Eigen::Vector2d::Zero();
  double yaw_odom_rad = 0.0;
  bool has_odom = false;
  std::vector<PlacedFix> fixes;
  const double end_s = kBefore_s + 3.0 * Flight::lap_s() + receiver.outage_s;
  for (long step = 0; run.time_s() < end_s; run.next(), ++step) {
    ins.add_imu(run.sample());
    if (run.has_fix()) {
      const Eigen::Vector3d fix = run.fix() + begin_m;
      if (run.time_s() < end_s - receiver.outage_s) {
        ins.add_position(run.stamp_ns(), fix, run.fix_covariance());
        if (has_odom) {
          fixes.push_back(
              {first_ns + run.stamp_ns(), p_odom_m, fix.head<2>(), run.fix_covariance().diagonal().head<2>()});
        }
      }
    }
    if (run.time_s() < kBefore_s) {
      if (run.has_fix()) ins.add_heading(run.stamp_ns(), motion.yaw(run.time_s()) + 0.02 * random.normal(), 0.02);
      continue;
    }
    const GpsInsPose pose = ins.pose();
    if (pose.is_ready && !has_odom) {
      has_odom = true;
      yaw_odom_rad = yaw_of(Eigen::Quaterniond(pose.T_world_base.linear()));
      p_odom_m = pose.T_world_base.translation().head<2>();
      v_odom_m_s = pose.velocity_world_m_s.head<2>();
    }
    if (!has_odom) continue;
    if (step % 5 == 0 && pose.is_ready) {
      const Pose2 T_odom_base{p_odom_m, yaw_odom_rad};
      const Pose2 T_world_base{pose.T_world_base.translation().head<2>(),
                               yaw_of(Eigen::Quaterniond(pose.T_world_base.linear()))};
      Eigen::Matrix<double, 3, 6> J = Eigen::Matrix<double, 3, 6>::Zero();
      J(0, 0) = J(1, 1) = 1.0;
      J.row(2).tail<3>() = pose.T_world_base.linear().row(2);
      InertialPlacement placement;
      placement.T_world_odom = T_world_base * inverse(T_odom_base);
      placement.pose_covariance = J * pose.covariance * J.transpose();
      placement.v_odom_m_s = v_odom_m_s;
      placement.v_world_m_s = pose.velocity_world_m_s.head<2>();
      placement.velocity_sigma_m_s =
          std::sqrt(pose.velocity_covariance.topLeftCorner<2, 2>().diagonal().maxCoeff() +
                    pose.velocity_world_m_s.head<2>().squaredNorm() * placement.pose_covariance(2, 2));
      placement.fixes = std::exchange(fixes, {});
      const double turned_rad = (rate_rad_s + yaw_rate_error_rad_s) * Flight::kSweep_s;
      pipeline.process(flight.scan_at(run.time_s()), Flight::banked(T_odom_base),
                       Flight::banked({p_odom_m + Flight::kSweep_s * v_odom_m_s, yaw_odom_rad + turned_rad}),
                       placement);
      const Eigen::Vector2d truth_m = (run.T_world_base().translation() + begin_m).head<2>();
      flown.by_gps_ins.add(truth_m - T_world_base.translation_m, placement.pose_covariance.topLeftCorner<2, 2>());
      if (const auto place = pipeline.alignment().better_place(placement.pose_covariance)) {
        ++flown.by_map;
        flown.chosen.add(truth_m - place->T_world_odom * p_odom_m, place->covariance.topLeftCorner<2, 2>());
      } else {
        flown.chosen.add(truth_m - T_world_base.translation_m, placement.pose_covariance.topLeftCorner<2, 2>());
      }
    }
    const double dt_s = 1.0 / sensors.imu_rate_hz;
    const Eigen::Vector2d a_level_m_s2 =
        Eigen::Vector2d(0.0, Flight::kSpeed_m_s * rate_rad_s) + acceleration_error_m_s2;
    const double middle_rad = yaw_odom_rad + 0.5 * dt_s * (rate_rad_s + yaw_rate_error_rad_s);
    const Eigen::Vector2d a_m_s2 = Pose2{Eigen::Vector2d::Zero(), middle_rad}.rotation() * a_level_m_s2;
    p_odom_m += dt_s * v_odom_m_s + 0.5 * dt_s * dt_s * a_m_s2;
    v_odom_m_s += dt_s * a_m_s2;
    yaw_odom_rad += dt_s * (rate_rad_s + yaw_rate_error_rad_s);
  }
}

struct Obstacle {
  std::string name;
  Outline outline;
};

/// A scanner that flies around a round tower sees neither how far it went around it nor how it turns; around ellipses
/// it sees it the less the rounder they are.
std::vector<Obstacle> obstacles() {
  const auto tower = [](double length_m, double width_m) {
    const Outline fine = ellipse({length_m, width_m});
    Outline outline;
    for (std::size_t i = 0; i < fine.size(); i += 10) outline.push_back(fine[i]);
    return outline;
  };
  return {{"box", box(12.0, 7.0)},
          {"tower", tower(6.1, 6.0)},
          {"ellipse", tower(10.0, 6.0)},
          {"round ellipse", tower(8.0, 6.0)}};
}

void expect_no_worse(const Receiver& receiver, const Obstacle& obstacle, int seeds) {
  Flown flown;
  for (int seed = 1; seed <= seeds; ++seed) fly(receiver, obstacle.outline, static_cast<std::uint64_t>(seed), flown);
  const Errors &alone = flown.by_gps_ins, &chosen = flown.chosen;
  const std::string what = std::to_string(receiver.sigma_m) + " m, " + std::to_string(receiver.correlated_share) +
                           " of it slow, outage of " + std::to_string(receiver.outage_s) + " s, " + obstacle.name;
  SCOPED_TRACE(what);
  std::printf("%s: %.3f m, NEES %.2f; GPS and INS alone %.3f m, %.2f; beyond 3 sigma %.1f %%; %.0f %% by the map\n",
              what.c_str(), chosen.rms_m(), chosen.mean_nees(), alone.rms_m(), alone.mean_nees(),
              100.0 * chosen.beyond_3_sigma / chosen.scans, 100.0 * flown.by_map / chosen.scans);
  EXPECT_LE(chosen.rms_m(), alone.rms_m());
  // Two errors in each lap are taken to be independent.
  const double freedom = 6.0 * seeds;
  const double most_nees = 2.0 * chi_square_quantile(0.975, freedom) / freedom;
  EXPECT_LE(chosen.mean_nees(), std::max(most_nees, alone.mean_nees()));
}

TEST(PlaceByMap, IsNoWorseThanGpsAndIns) {
  for (const Obstacle& obstacle : obstacles()) {
    for (const double share : {0.0, 0.7}) expect_no_worse({1.5, share, 20.0}, obstacle, 2);
  }
}

TEST(PlaceByMapLong, IsNoWorseThanGpsAndIns) {
  for (const Obstacle& obstacle : obstacles()) {
    for (const double share : {0.0, 0.7}) {
      for (const double sigma_m : {0.02, 0.3, 1.5, 5.0}) expect_no_worse({sigma_m, share, 20.0}, obstacle, 6);
    }
    expect_no_worse({1.5, 0.7, 20.0, 20.0}, obstacle, 6);
  }
}

}  // namespace
}  // namespace situation_awareness::place_by_map_test
