// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/scanner.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sim/world_file.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/scan_simulation.hpp"
#include "support/aggregate_size.hpp"

namespace situation_awareness::scanner_test {
namespace {

SimulatedScannerParams without_noise() {
  SimulatedScannerParams scanner;
  scanner.range_sigma_m = 0.0;
  return scanner;
}

double beam_angle(const Scan& scan, std::size_t beam) {
  return scan.angle_min_rad + static_cast<double>(beam) * scan.angle_increment_rad;
}

/// Everything moves: the robot, an object on a circle, and one that the first carries.
std::string moving_world(const std::string& robot) {
  return world_text(object_text("cart", "mocap=\"true\" pos=\"2 0 1\" euler=\"0 0 0.4\"", "0.3 0.15 1") +
                        object_text("load", "mocap=\"true\" pos=\"0 0 1\" euler=\"0 0 0.9\"", "0.2 0.1 1"),
                    R"(<text name="cart" data="circle center 0.5 0.5 radius 3 rate 0.9 tangent"/>
       <text name="load" data="with cart at -0.2 0.7 swing 0.3 period 1.1 phase 0.4 spin 0.8"/>
       <text name="robot" data="loop speed 2.0 points 0 -1 1.5 0; 1 -1 1.7 1; 2 0.5 2.0 2; 1 1.5 1.6 3; -1 1 1.4 4"/>)",
                    robot);
}

const std::string kExactRobot =
    R"(<worldbody> <body name="robot" mocap="true"> <site name="lidar" pos="0.1 -0.05 -0.2"/>
                                     </body> </worldbody>)";

/// Range at which a ray enters an infinite upright elliptic cylinder: the smaller root of
/// |B (o + s d - c)|^2 = 1, where B = diag(1/rx, 1/ry) R(psi)^T acts in the plane.
std::optional<double> cylinder_range(const Ellipse& ellipse, const Eigen::Vector3d& origin,
                                     const Eigen::Vector3d& ray) {
  const Eigen::Matrix2d B = Eigen::Vector2d(1.0 / ellipse.rx_m, 1.0 / ellipse.ry_m).asDiagonal() *
                            Eigen::Rotation2Dd(-ellipse.psi_rad).toRotationMatrix();
  const Eigen::Vector2d o = B * (origin.head<2>() - ellipse.center_m);
  const Eigen::Vector2d d = B * ray.head<2>();
  const double half_b = o.dot(d);
  const double discriminant = half_b * half_b - d.squaredNorm() * (o.squaredNorm() - 1.0);
  if (discriminant < 0.0 || half_b > 0.0) return std::nullopt;
  return (-half_b - std::sqrt(discriminant)) / d.squaredNorm();
}

struct Expected {
  double range_m = std::numeric_limits<double>::infinity();
  int object = -1;  // index in the truth
};

/// The expected range of a beam at `angle` in a world without scenery.
Expected expected(const Objects& truth, const Eigen::Isometry3d& T_world_lidar, double angle) {
  const Eigen::Vector3d ray = T_world_lidar.linear() * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0);
  Expected nearest;
  for (std::size_t i = 0; i < truth.objects.size(); ++i) {
    const auto range = cylinder_range(truth.objects[i].ellipse_world, T_world_lidar.translation(), ray);
    if (range && *range < nearest.range_m) nearest = {*range, static_cast<int>(i)};
  }
  return nearest;
}

Expected expected(const SimulatedScan& simulated, std::size_t beam) {
  return expected(simulated.truth, simulated.T_world_lidar, beam_angle(simulated.scan, beam));
}

// --- ranges ---------------------------------------------------------------------------------------------------------

TEST(SimulatedScannerParams, DeclareAllTheirMembers) {
  // `intensity` and `errors` are one member each, and are declared with members of their own.
  EXPECT_EQ(declared_size<SimulatedScannerParams>(), aggregate_size<SimulatedScannerParams>() - 2 +
                                                         declared_size<SimulatedIntensityParams>() +
                                                         declared_size<ScannerErrors>());
}

TEST(SimulatedScan, RangesEqualAnalyticIntersections) {
  ScanSimulation world(kWorlds + "single.xml", without_noise(), 1);
  int hits = 0;
  for (int scan = 0; scan < 100; ++scan) {
    const SimulatedScan simulated = world.next();
    for (std::size_t i = 0; i < simulated.scan.beams.size(); ++i) {
      const Beam& beam = simulated.scan.beams[i];
      const Expected truth = expected(simulated, i);
      ASSERT_EQ(beam.state == BeamState::kHit, truth.object >= 0) << "scan " << scan << " beam " << i;
      if (beam.state != BeamState::kHit) continue;
      ASSERT_NEAR(beam.range_m, truth.range_m, 1e-4) << "scan " << scan << " beam " << i;
      ++hits;
    }
  }
  EXPECT_GT(hits, 100 * 40);
}

TEST(SimulatedScan, RangesAndBeamCountsAreExactForATiltedRobotAndAnyMount) {
  const WorldFile file(kBriskWorld);
  ScanSimulation world(file.path(), without_noise(), 1);
  const Eigen::Matrix3d mount =
      (Eigen::AngleAxisd(3.1, Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()))
          .toRotationMatrix();
  EXPECT_LT((world.T_robot_lidar().linear() - mount).norm(), 1e-9);
  EXPECT_LT((world.T_robot_lidar().translation() - Eigen::Vector3d(0.1, -0.05, -0.2)).norm(), 1e-9);
  double largest_tilt = 0.0;
  int grazing = 0;
  std::vector<int> total(2, 0);
  for (int scan = 0; scan < 200; ++scan) {
    const SimulatedScan simulated = world.next();
    const Eigen::Isometry3d T_world_robot = world.robot_at(0.05 * scan).T_world_robot;
    ASSERT_TRUE(simulated.T_world_lidar.isApprox(T_world_robot * world.T_robot_lidar(), 1e-9));
    largest_tilt = std::max(largest_tilt, tilt(simulated.robot.T_world_robot));
    std::vector<int> beams(2, 0);
    for (std::size_t i = 0; i < simulated.scan.beams.size(); ++i) {
      const Beam& beam = simulated.scan.beams[i];
      const Expected truth = expected(simulated, i);
      if ((beam.state == BeamState::kHit) != (truth.object >= 0)) {
        ++grazing;  // a tangent to within rounding; none is expected
        continue;
      }
      if (beam.state != BeamState::kHit) continue;
      ASSERT_NEAR(beam.range_m, truth.range_m, 1e-4) << "scan " << scan << " beam " << i;
      ++beams[static_cast<std::size_t>(truth.object)];
    }
    for (std::size_t i = 0; i < 2; ++i) {
      ASSERT_EQ(simulated.truth.objects[i].beams, beams[i]) << "scan " << scan << " object " << i;
      total[i] += beams[i];
    }
  }
  EXPECT_EQ(grazing, 0);
  EXPECT_GT(largest_tilt, radians(10.0));
  EXPECT_GT(total[0], 1000);
  EXPECT_GT(total[1], 1000);
}

class SweepOf : public testing::TestWithParam<std::string> {};

TEST_P(SweepOf, EachBeamSeesTheWorldAtItsOwnTime) {
  const WorldFile file(moving_world(GetParam()));
  SimulatedScannerParams scanner = without_noise();
  scanner.sweep_s = 0.04;
  ScanSimulation world(file.path(), scanner, 1);
  std::vector<int> total(2, 0);
  for (int scan = 0; scan < 100; ++scan) {
    const SimulatedScan simulated = world.next();
    const double start_s = 0.05 * scan;
    ASSERT_NEAR(simulated.scan.time_increment_s * 1080, 0.04, 1e-12);
    ASSERT_TRUE(simulated.T_world_lidar.isApprox(world.robot_at(start_s).T_world_robot * world.T_robot_lidar(), 1e-9));
    ASSERT_TRUE(simulated.T_world_lidar_end.isApprox(
        world.robot_at(start_s + 0.04).T_world_robot * world.T_robot_lidar(), 1e-9));
    std::vector<int> beams(2, 0);
    for (std::size_t i = 0; i < simulated.scan.beams.size(); ++i) {
      const double time_s = start_s + static_cast<double>(i) * simulated.scan.time_increment_s;
      const Expected truth =
          expected(world.truth_at(time_s), world.robot_at(time_s).T_world_robot * world.T_robot_lidar(),
                   beam_angle(simulated.scan, i));
      const Beam& beam = simulated.scan.beams[i];
      ASSERT_EQ(beam.state == BeamState::kHit, truth.object >= 0) << "scan " << scan << " beam " << i;
      ASSERT_EQ(simulated.object_of_beam[i], truth.object) << "scan " << scan << " beam " << i;
      if (truth.object < 0) continue;
      ASSERT_NEAR(beam.range_m, truth.range_m, 1e-4) << "scan " << scan << " beam " << i;
      ++beams[static_cast<std::size_t>(truth.object)];
    }
    for (std::size_t i = 0; i < 2; ++i) {
      ASSERT_EQ(simulated.truth.objects[i].beams, beams[i]);
      total[i] += beams[i];
    }
  }
  EXPECT_GT(total[0], 1000);
  EXPECT_GT(total[1], 1000);
}

INSTANTIATE_TEST_SUITE_P(Robots, SweepOf, testing::Values(kExactRobot, kQuadrotor),
                         [](const auto& info) { return info.index == 0 ? "Exact" : "Flown"; });

TEST(SimulatedScan, WithoutMotionASweepChangesNothing) {
  const WorldFile file(world_text(kRobot + object_text("post", "pos=\"2 0.5 1\"", "0.3 0.15 1")));
  SimulatedScannerParams sweeping;
  sweeping.sweep_s = 0.01875;
  ScanSimulation a(file.path(), {}, 5), b(file.path(), sweeping, 5);
  for (int scan = 0; scan < 5; ++scan) {
    const SimulatedScan from_a = a.next(), from_b = b.next();
    EXPECT_EQ(from_a.scan.time_increment_s, 0.0);
    EXPECT_TRUE(from_b.T_world_lidar_end.isApprox(from_a.T_world_lidar, 1e-12));
    for (std::size_t i = 0; i < from_a.scan.beams.size(); ++i) {
      ASSERT_EQ(from_a.scan.beams[i].range_m, from_b.scan.beams[i].range_m);
    }
  }
}

TEST(SimulatedScan, TrueRangesDecideBetweenHitTooCloseAndFree) {
  SimulatedScannerParams scanner;
  scanner.range_min_m = 1.0;
  scanner.range_max_m = 2.0;
  scanner.range_sigma_m = 0.05;
  // Walls at 0.99 m ahead, 1.01 m to the left, 1.99 m behind; the rest is open or beyond 2 m.
  const WorldFile file(world_text(kRobot + R"(<geom type="box" pos="1.09 0 1.5" size="0.1 0.1 1"/>
                                              <geom type="box" pos="0 1.11 1.5" size="0.1 0.1 1"/>
                                              <geom type="box" pos="0 -2.09 1.5" size="0.1 0.1 1"/>
                                              <geom type="box" pos="3.0 -3.0 1.5" size="0.3 0.3 1"/>)"));
  ScanSimulation world(file.path(), scanner, 3);
  const auto beam_at = [&](const Scan& scan, double angle_deg) {
    return scan.beams[static_cast<std::size_t>(
        std::lround((radians(angle_deg) - scan.angle_min_rad) / scan.angle_increment_rad))];
  };
  for (int i = 0; i < 200; ++i) {
    const Scan scan = world.next().scan;
    ASSERT_EQ(beam_at(scan, 0.0).state, BeamState::kTooClose);
    ASSERT_EQ(beam_at(scan, 90.0).state, BeamState::kHit);
    ASSERT_EQ(beam_at(scan, -90.0).state, BeamState::kHit);
    ASSERT_EQ(beam_at(scan, -45.0).state, BeamState::kFree);
    ASSERT_EQ(beam_at(scan, 45.0).state, BeamState::kFree);
    for (const Beam& beam : scan.beams) {
      if (beam.state == BeamState::kHit) {
        ASSERT_GE(beam.range_m, 1.0F);
        ASSERT_LE(beam.range_m, 2.0F);
      } else {
        ASSERT_EQ(beam.range_m, beam.state == BeamState::kFree ? 2.0F : 0.0F);
      }
    }
  }
}

// --- noise ----------------------------------------------------------------------------------------------------------

TEST(SimulatedScan, NoiseIsWhiteGaussianOfTheGivenSigma) {
  ScanSimulation noisy(kWorlds + "single.xml", {}, 7);
  ScanSimulation exact(kWorlds + "single.xml", without_noise(), 7);
  double sum = 0.0, sum_of_squares = 0.0, sum_of_products = 0.0;
  double before = 0.0;
  int n = 0, within_one_sigma = 0;
  for (int scan = 0; scan < 200; ++scan) {
    const Scan a = noisy.next().scan;
    const Scan b = exact.next().scan;
    for (std::size_t i = 0; i < a.beams.size(); ++i) {
      ASSERT_EQ(a.beams[i].state, b.beams[i].state);
      if (a.beams[i].state != BeamState::kHit) continue;
      const double z = (a.beams[i].range_m - b.beams[i].range_m) / 0.01;
      sum += z;
      sum_of_squares += z * z;
      sum_of_products += z * before;
      before = z;
      within_one_sigma += std::abs(z) < 1.0 ? 1 : 0;
      ++n;
    }
  }
  ASSERT_GT(n, 5000);
  // Four standard deviations of each statistic: normal, chi-square, normal, binomial.
  EXPECT_LT(std::abs(sum), 4.0 * std::sqrt(n));
  EXPECT_LT(std::abs(sum_of_squares - n), 4.0 * std::sqrt(2.0 * n));
  EXPECT_LT(std::abs(sum_of_products), 4.0 * std::sqrt(n));
  EXPECT_LT(std::abs(within_one_sigma - 0.682689 * n), 4.0 * std::sqrt(0.682689 * 0.317311 * n));
}

TEST(SimulatedScan, SameSeedSameScansBitForBitForAnyQueries) {
  ScanSimulation a(kWorlds + "demo.xml", {}, 11);
  ScanSimulation b(kWorlds + "demo.xml", {}, 11);
  ScanSimulation c(kWorlds + "demo.xml", {}, 12);
  int differ = 0, hits = 0;
  for (int scan = 0; scan < 20; ++scan) {
    b.truth_at(17.0 + scan);
    b.robot_at(-3.0);
    const SimulatedScan from_a = a.next(), from_b = b.next(), from_c = c.next();
    ASSERT_EQ(from_a.scan.stamp_ns, 50'000'000 * scan);
    ASSERT_EQ(from_a.scan.stamp_ns, from_b.scan.stamp_ns);
    ASSERT_EQ(from_a.truth.stamp_ns, from_a.scan.stamp_ns);
    ASSERT_TRUE(from_a.T_world_lidar.matrix() == from_b.T_world_lidar.matrix());
    for (std::size_t i = 0; i < from_a.scan.beams.size(); ++i) {
      ASSERT_EQ(from_a.scan.beams[i].state, from_b.scan.beams[i].state);
      ASSERT_EQ(from_a.scan.beams[i].range_m, from_b.scan.beams[i].range_m);
      ASSERT_EQ(from_a.scan.beams[i].state, from_c.scan.beams[i].state);
      differ += from_a.scan.beams[i].range_m != from_c.scan.beams[i].range_m ? 1 : 0;
      hits += from_a.scan.beams[i].state == BeamState::kHit ? 1 : 0;
    }
  }
  EXPECT_GT(differ, hits * 99 / 100);
}

TEST(SimulatedScanner, RefusesBadParamsNamingFieldAndBound) {
  const auto message = [](const SimulatedScannerParams& scanner) {
    return refusal_of([&] { ScanSimulation(kWorlds + "single.xml", scanner, 0); });
  };
  SimulatedScannerParams scanner;
  EXPECT_EQ(message(scanner), "");
  scanner.rate_hz = 0.0;
  EXPECT_TRUE(names(message(scanner), {"scanner.rate_hz", "0", "0.1", "1000"}));
  scanner = {};
  scanner.range_max_m = 0.05;
  EXPECT_TRUE(names(message(scanner), {"scanner.range_max_m", "scanner.range_min_m"}));
  scanner = {};
  scanner.sweep_s = 0.05;
  EXPECT_TRUE(names(message(scanner), {"scanner.sweep_s", "scanner.rate_hz"}));
  scanner = {};
  scanner.beams = 2000;
  EXPECT_TRUE(names(message(scanner), {"scanner.angle_increment_rad"}));
}

}  // namespace
}  // namespace situation_awareness::scanner_test
