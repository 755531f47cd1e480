// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/world.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sim/world_file.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/path.hpp"
#include "situation_awareness/sim/periodic_spline.hpp"

namespace situation_awareness {
namespace {

const std::string kRobot = R"(<body name="robot" mocap="true" pos="0 0 1.5"> <site name="lidar"/>
                                <geom group="2" size="0.2"/> </body>)";

/// A robot in brisk flight, with a scanner mounted aslant and upside down, and two objects.
const std::string kBriskWorld = world_text(
    object_text("post", "pos=\"2.0 0.5 1\" euler=\"0 0 0.4\"", "0.3 0.15 1") +
        object_text("column", "pos=\"-3.0 -1.5 1\" euler=\"0 0 -1.1\"", "0.2 0.5 1") +
        R"(<body name="robot" mocap="true"> <site name="lidar" pos="0.1 -0.05 -0.2" euler="3.1 0.05 0.3"/> </body>)",
    R"(<text name="robot" data="loop speed 2.6 points 0 -2 1.5 0;  3 -2 1.7 1; 4 0.5 2.0 2; 2 2.2 1.6 3; -1 2 1.4 4;
                                 -1.5 0 1.5 5"/>
       <numeric name="robot_drag" data="0.3"/>)");

SimulatedLidarParams without_noise() {
  SimulatedLidarParams lidar;
  lidar.range_sigma_m = 0.0;
  return lidar;
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

/// What a beam at `angle` must see in a world without scenery.
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

double tilt(const Eigen::Isometry3d& T_world_robot) { return std::acos(T_world_robot(2, 2)); }

std::string path_error(const std::string& path, const PathOfBody& path_of_body = {}) {
  try {
    parse_path(path, Eigen::Vector3d::Zero(), 0.0, path_of_body);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "no error";
}

// --- ranges ---------------------------------------------------------------------------------------------------------

TEST(SimulatedScan, RangesEqualAnalyticIntersections) {
  World world(kWorlds + "single.xml", without_noise(), 1);
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
  World world(file.path(), without_noise(), 1);
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
  SimulatedLidarParams lidar = without_noise();
  lidar.sweep_s = 0.04;
  World world(file.path(), lidar, 1);
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

TEST(SimulatedScan, WhereNothingMovesASweepChangesNothing) {
  const WorldFile file(world_text(kRobot + object_text("post", "pos=\"2 0.5 1\"", "0.3 0.15 1")));
  SimulatedLidarParams sweeping;
  sweeping.sweep_s = 0.01875;
  World a(file.path(), {}, 5), b(file.path(), sweeping, 5);
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
  SimulatedLidarParams lidar;
  lidar.range_min_m = 1.0;
  lidar.range_max_m = 2.0;
  lidar.range_sigma_m = 0.05;
  // Walls at 0.99 m ahead, 1.01 m to the left, 1.99 m behind; the rest is open or beyond 2 m.
  const WorldFile file(world_text(kRobot + R"(<geom type="box" pos="1.09 0 1.5" size="0.1 0.1 1"/>
                                              <geom type="box" pos="0 1.11 1.5" size="0.1 0.1 1"/>
                                              <geom type="box" pos="0 -2.09 1.5" size="0.1 0.1 1"/>
                                              <geom type="box" pos="3.0 -3.0 1.5" size="0.3 0.3 1"/>)"));
  World world(file.path(), lidar, 3);
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
  World noisy(kWorlds + "single.xml", {}, 7);
  World exact(kWorlds + "single.xml", without_noise(), 7);
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

TEST(World, SameSeedSameScansBitForBitWhateverElseIsAsked) {
  World a(kWorlds + "demo.xml", {}, 11);
  World b(kWorlds + "demo.xml", {}, 11);
  World c(kWorlds + "demo.xml", {}, 12);
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

// --- motion ---------------------------------------------------------------------------------------------------------

void expect_consistent_robot(const World& world) {
  constexpr double h = 1e-4;
  for (double t = 0.013; t < 40.0; t += 0.37) {
    const RobotState now = world.robot_at(t), before = world.robot_at(t - h), after = world.robot_at(t + h);
    const Eigen::Vector3d velocity =
        (after.T_world_robot.translation() - before.T_world_robot.translation()) / (2.0 * h);
    EXPECT_LT((velocity - now.velocity_world_m_s).norm(), 1e-6) << "t = " << t;
    const Eigen::AngleAxisd turn(before.T_world_robot.linear().transpose() * after.T_world_robot.linear());
    const Eigen::Vector3d angular_velocity = turn.angle() * turn.axis() / (2.0 * h);
    EXPECT_LT((angular_velocity - now.angular_velocity_robot_rad_s).norm(), 1e-6) << "t = " << t;
    EXPECT_TRUE(now.T_world_robot.linear().isUnitary(1e-12));
    EXPECT_NEAR(now.T_world_robot.linear().determinant(), 1.0, 1e-12);
  }
}

TEST(Robot, VelocitiesAreDerivativesOfThePose) {
  expect_consistent_robot(World(kWorlds + "demo.xml", {}, 0));
  const WorldFile file(kBriskWorld);
  expect_consistent_robot(World(file.path(), {}, 0));
}

TEST(Robot, TiltsAsItsAccelerationAndDragDemand) {
  const WorldFile file(kBriskWorld);
  const World world(file.path(), {}, 0);
  constexpr double h = 1e-4;
  double largest_tilt = 0.0;
  for (double t = 0.0; t < 10.0; t += 0.21) {
    const RobotState now = world.robot_at(t);
    const Eigen::Vector3d acceleration =
        (world.robot_at(t + h).velocity_world_m_s - world.robot_at(t - h).velocity_world_m_s) / (2.0 * h);
    const Eigen::Vector3d thrust = acceleration + Eigen::Vector3d(0, 0, 9.81) + 0.3 * now.velocity_world_m_s;
    const Eigen::Vector3d z = now.T_world_robot.linear().col(2);
    EXPECT_LT((z - thrust.normalized()).norm(), 1e-6) << "t = " << t;
    largest_tilt = std::max(largest_tilt, tilt(now.T_world_robot));
  }
  EXPECT_GT(largest_tilt, radians(10.0));
  EXPECT_LT(largest_tilt, radians(25.0));
}

TEST(Robot, PassesItsWaypointsAtItsYaw) {
  const WorldFile file(world_text(
      R"(<body name="robot" mocap="true"> <site name="lidar"/> </body>)",
      R"(<text name="robot" data="loop speed 1 points 0 0 1 0; 2 0 1 1.5708; 2 2 1 3.1416; 0 2 1 -1.5708"/>)"));
  const World world(file.path(), {}, 0);
  // By symmetry the four legs take equal times; in a round the robot turns once.
  double period_s = 1.0;
  while ((world.robot_at(period_s).T_world_robot.translation() - Eigen::Vector3d(0, 0, 1)).norm() > 1e-3) {
    ASSERT_LT(period_s += 1e-3, 20.0);
  }
  const std::vector<Eigen::Vector3d> waypoints = {{0, 0, 1}, {2, 0, 1}, {2, 2, 1}, {0, 2, 1}};
  for (int i = 0; i < 8; ++i) {
    const Eigen::Isometry3d T = world.robot_at(0.25 * i * period_s).T_world_robot;
    EXPECT_LT((T.translation() - waypoints[static_cast<std::size_t>(i % 4)]).norm(), 0.01);
    EXPECT_NEAR(wrap_to_pi(std::atan2(T(1, 0), T(0, 0)) - 0.5 * kPi * i), 0.0, 0.01);
  }
  double length_m = 0.0;
  for (int i = 0; i < 1000; ++i) length_m += world.robot_at(1e-3 * i * period_s).velocity_world_m_s.norm() * 1e-3;
  EXPECT_NEAR(length_m, 1.0, 1e-3);  // mean speed
}

TEST(Truth, VelocitiesAreDerivativesOfThePose) {
  for (const std::string& path : {kWorlds + "demo.xml", kWorlds + "single.xml"}) {
    const World world(path, {}, 0);
    constexpr double h = 1e-4;
    for (double t = 0.017; t < 60.0; t += 0.61) {
      const Objects now = world.truth_at(t), before = world.truth_at(t - h), after = world.truth_at(t + h);
      for (std::size_t i = 0; i < now.objects.size(); ++i) {
        const Object& object = now.objects[i];
        const Ellipse& a = before.objects[i].ellipse_world;
        const Ellipse& b = after.objects[i].ellipse_world;
        EXPECT_LT(((b.center_m - a.center_m) / (2.0 * h) - object.velocity_world_m_s).norm(), 1e-6);
        EXPECT_NEAR(wrap_to_half_pi(b.psi_rad - a.psi_rad) / (2.0 * h), object.angular_velocity_rad_s, 1e-6);
      }
    }
  }
}

TEST(Truth, ListsObjectsInFileOrderWithCanonicalRadiiAndNoCovariance) {
  const WorldFile file(world_text(object_text("b", "pos=\"2 0 1\"", "0.2 0.5 1") + kRobot +
                                  object_text("a", "pos=\"-2 1 1\" euler=\"0 0 0.3\"", "0.4 0.1 1")));
  World world(file.path(), {}, 0);
  const SimulatedScan simulated = world.next();
  ASSERT_EQ(simulated.names, (std::vector<std::string>{"b", "a"}));
  ASSERT_EQ(simulated.truth.objects.size(), 2U);
  const Object& b = simulated.truth.objects[0];
  EXPECT_EQ(b.id, 1U);
  EXPECT_EQ(simulated.truth.objects[1].id, 2U);
  EXPECT_DOUBLE_EQ(b.ellipse_world.rx_m, 0.5);
  EXPECT_DOUBLE_EQ(b.ellipse_world.ry_m, 0.2);
  EXPECT_NEAR(std::abs(b.ellipse_world.psi_rad), 0.5 * kPi, 1e-12);
  EXPECT_NEAR(simulated.truth.objects[1].ellipse_world.psi_rad, 0.3, 1e-12);
  EXPECT_TRUE(b.covariance.isZero(0.0));
  EXPECT_DOUBLE_EQ(simulated.truth.height_world_m, 1.5);
}

TEST(Truth, AHiddenObjectHasNoBeamsAndKeepsWhenItWasSeen) {
  // A screen passes between the robot and the pole.
  const WorldFile file(world_text(kRobot + object_text("pole", "pos=\"4 0 1\"", "0.1 0.1 1") +
                                      object_text("screen", "mocap=\"true\" pos=\"2 0 1\"", "0.1 0.4 1"),
                                  R"(<text name="screen" data="line from 2 -3 to 2 3 period 12"/>)"));
  World world(file.path(), {}, 0);
  int hidden_scans = 0, seen_scans = 0;
  std::int64_t first_seen_ns = -1, last_seen_ns = -1;
  for (int scan = 0; scan < 120; ++scan) {
    const SimulatedScan simulated = world.next();
    const Object& pole = simulated.truth.objects[0];
    const bool all_hidden = std::abs(simulated.truth.objects[1].ellipse_world.center_m.y()) < 0.3;
    if (all_hidden) {
      EXPECT_EQ(pole.beams, 0);
      ++hidden_scans;
    }
    if (pole.beams > 0) {
      ++seen_scans;
      last_seen_ns = simulated.scan.stamp_ns;
      if (first_seen_ns < 0) first_seen_ns = last_seen_ns;
    }
    EXPECT_EQ(pole.observations, seen_scans);
    EXPECT_EQ(pole.first_seen_ns, first_seen_ns);
    EXPECT_EQ(pole.last_seen_ns, last_seen_ns);
  }
  EXPECT_GT(hidden_scans, 5);
  EXPECT_GT(seen_scans, 50);
  EXPECT_EQ(world.truth_at(3.0).objects[0].observations, seen_scans);
}

// --- paths ----------------------------------------------------------------------------------------------------------

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
  };
  constexpr double h = 1e-4;
  for (const std::string& text : paths) {
    const Path path = parse_path(text, {0.5, -0.5, 0.9}, 0.4);
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
    for (const std::string text :
         {"with it at 0.3 -0.2", "with it at 0.3 -0.2 swing 0.4 period 1.3 phase 2 spin 0.6"}) {
      const Path path = parse_path(text, {0.0, 0.0, 0.9}, 0.4, path_of_body);
      for (double t = -3.0; t < 20.0; t += 0.317) {
        const PathState now = path(t), before = path(t - h), after = path(t + h);
        EXPECT_LT(((after.position_m - before.position_m) / (2 * h) - now.velocity_m_s).norm(), 1e-6) << text;
        EXPECT_NEAR(wrap_to_pi(after.yaw_rad - before.yaw_rad) / (2 * h), now.yaw_rate_rad_s, 1e-6) << text;
      }
    }
  }
}

TEST(Path, KeepsItsPlaceInTheAxesOfTheBodyItMovesWith) {
  const Path carrier = parse_path("circle center 1 2 radius 0.5 rate 2 tangent", {5, 6, 7}, 0.2);
  const PathOfBody path_of_body = [&](const std::string& body) { return body == "it" ? carrier : Path(); };
  const Path path = parse_path("with it at 0.3 -0.2 swing 0.1 period 4 phase 0.5", {8, 9, 3}, 0.7, path_of_body);
  for (const double t : {0.0, 0.6, 1.9}) {
    const PathState it = carrier(t), state = path(t);
    const double ahead = 0.3 + 0.1 * std::sin(0.5 * kPi * t + 0.5);
    const Eigen::Vector2d x(std::cos(it.yaw_rad), std::sin(it.yaw_rad)), y(-x.y(), x.x());
    EXPECT_LT((state.position_m.head<2>() - (it.position_m.head<2>() + ahead * x - 0.2 * y)).norm(), 1e-12);
    EXPECT_EQ(state.position_m.z(), 3.0);
    EXPECT_NEAR(state.yaw_rad - it.yaw_rad, 0.7, 1e-12);
  }
}

TEST(Path, MeansWhatTheManualSays) {
  const Eigen::Vector3d place(5, 6, 7);
  const PathState stand = parse_path("stand spin 0.5", place, 0.2)(2.0);
  EXPECT_EQ(stand.position_m, place);
  EXPECT_DOUBLE_EQ(stand.yaw_rad, 1.2);

  const PathState circle = parse_path("circle center 1 2 radius 0.5 rate 2 phase 0.1 tangent", place, 0.2)(0.3);
  EXPECT_LT((circle.position_m - Eigen::Vector3d(1 + 0.5 * std::cos(0.7), 2 + 0.5 * std::sin(0.7), 7)).norm(), 1e-12);
  EXPECT_NEAR(circle.velocity_m_s.norm(), 1.0, 1e-12);
  EXPECT_NEAR(wrap_to_pi(circle.yaw_rad - (0.7 + 0.5 * kPi + 0.2)), 0.0, 1e-12);
  EXPECT_NEAR(circle.yaw_rate_rad_s, 2.0, 1e-12);

  const Path line = parse_path("line from 0 1 to 4 1 period 8", place, 0.2);
  EXPECT_LT((line(0.0).position_m - Eigen::Vector3d(0, 1, 7)).norm(), 1e-12);
  EXPECT_LT((line(4.0).position_m - Eigen::Vector3d(4, 1, 7)).norm(), 1e-12);
  EXPECT_LT(line(4.0).velocity_m_s.norm(), 1e-12);
  EXPECT_DOUBLE_EQ(line(1.0).yaw_rad, 0.2);

  const PathState straight = parse_path("straight from 1 2 velocity -0.5 0.5 tangent", place, 0.2)(4.0);
  EXPECT_LT((straight.position_m - Eigen::Vector3d(-1, 4, 7)).norm(), 1e-12);
  EXPECT_NEAR(straight.yaw_rad, 0.75 * kPi + 0.2, 1e-12);
}

TEST(Path, SaysWhatIsWrongWithItsText) {
  EXPECT_EQ(path_error(" "), "is empty");
  EXPECT_EQ(path_error("hop over 1"), "starts with 'hop' instead of stand, circle, line, straight, loop or with");
  EXPECT_EQ(path_error("circle center 1 2 radius 1"), "lacks 'rate'");
  EXPECT_EQ(path_error("circle center 1 radius 1 rate 1"), "needs 2 number(s) after 'center'");
  EXPECT_EQ(path_error("circle center 1 2 radius -1 rate 1"), "needs a positive number after 'radius'");
  EXPECT_EQ(path_error("circle center 1 2 radius 1 rate 1 rate 2"), "has 'rate' twice");
  EXPECT_EQ(path_error("circle center 1 2 radius 1 rate 1 spin"), "needs 1 number(s) after 'spin'");
  EXPECT_EQ(path_error("circle center 1 2 radius 1 rate 1 speed 3"), "has 'speed', which it does not know");
  EXPECT_EQ(path_error("circle center 1 nan radius 1 rate 1"), "needs 2 number(s) after 'center'");
  EXPECT_EQ(path_error("circle 1 2 radius 1 rate 1"), "has '1' where a word should be");
  EXPECT_EQ(path_error("circle center 1 2 radius 1 rate 0 tangent"), "has 'tangent' but does not move on all the time");
  EXPECT_EQ(path_error("line from 0 0 to 1 0 period 3 tangent"), "has 'tangent' but does not move on all the time");
  EXPECT_EQ(path_error("stand spin 1 tangent"), "turns in two ways: 'spin' and 'tangent'");
  EXPECT_EQ(path_error("loop speed 1 points 0 0; 1 1"), "needs at least 3 points");
  EXPECT_EQ(path_error("loop speed 1 points 0 0; 1 1; 2 2 2"),
            "needs points of 2 numbers each (x y) or of 4 (x y z yaw)");
  EXPECT_EQ(path_error("loop speed 1 points 1 1; 1 1; 1 1"), "has all its points at one place");
  EXPECT_EQ(path_error("loop speed 1 spin 1 points 0 0 0 0; 1 0 0 0; 1 1 0 0"),
            "turns in two ways: by the yaw of its points, and by 'spin' or 'tangent'");
  EXPECT_EQ(path_error("straight from 0 0 velocity 0 0 tangent"), "has 'tangent' but does not move on all the time");
  EXPECT_EQ(path_error("with"), "lacks the body to move with");
  const PathOfBody path_of_body = [](const std::string& body) {
    return body == "it" ? parse_path("stand", Eigen::Vector3d::Zero(), 0.0) : Path();
  };
  const std::string of_none = "', which only an object may, and only with a body that has a path of its own";
  EXPECT_EQ(path_error("with it at 0 1"), "moves with 'it" + of_none);
  EXPECT_EQ(path_error("with other at 0 1", path_of_body), "moves with 'other" + of_none);
  EXPECT_EQ(path_error("with it at 0 1", path_of_body), "no error");
  EXPECT_EQ(path_error("with it", path_of_body), "lacks 'at'");
  EXPECT_EQ(path_error("with it at 0 1 swing 1", path_of_body), "lacks 'period'");
  EXPECT_EQ(path_error("with it at 0 1 period 1", path_of_body), "has 'period', which it does not know");
  EXPECT_EQ(path_error("with it at 0 1 tangent", path_of_body), "has 'tangent' but does not move on all the time");
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

// --- files ----------------------------------------------------------------------------------------------------------

TEST(World, RefusesBadFilesNamingFileAndElement) {
  const std::string post = object_text("post", "pos=\"2 0 1\"", "0.2 0.1 1");
  EXPECT_EQ(error_of(world_text(kRobot + post)), "no error");

  try {
    const World world("/nowhere/missing.xml", {}, 0);
    FAIL() << "a missing file was accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("/nowhere/missing.xml: MuJoCo refuses it: "), std::string::npos);
  }
  expect_error("<mujoco><worldbody>", "MuJoCo refuses it: XML");
  expect_error(world_text(kRobot + "<body name=\"b\"><geom type=\"ellipse\"/></body>"), "MuJoCo refuses it: XML");
  expect_error(world_text(kRobot + "<body name=\"b\"><geom type=\"ellipsoid\" size=\"0.1 0 1\"/></body>"),
               "MuJoCo refuses it: ");
  expect_error(world_text(post), "there is no body 'robot'");
  expect_error(world_text("<body name=\"robot\"><site name=\"lidar\"/></body>"), "body 'robot' needs mocap");
  expect_error(world_text("<body name=\"robot\" mocap=\"true\"/>"), "there is no site 'lidar' on 'robot'");
  expect_error(world_text("<body name=\"robot\" mocap=\"true\"/><site name=\"lidar\"/>"),
               "site 'lidar' is not on 'robot'");
  expect_error(
      world_text("<body name=\"robot\" mocap=\"true\"><geom name=\"arm\" size=\"1\"/><site name=\"lidar\"/></body>"),
      "geom 'arm' of 'robot' needs group=\"2\"");
  expect_error(world_text(kRobot + "<body name=\"box\"><geom type=\"box\" group=\"1\" size=\"1 1 1\"/></body>"),
               "object 'box' is not of type ellipsoid");
  expect_error(world_text(kRobot + "<body><geom type=\"ellipsoid\" group=\"1\" size=\"1 1 1\"/></body>"),
               "object number 2 (without a name) needs a name");
  expect_error(world_text(kRobot + "<geom name=\"loose\" type=\"ellipsoid\" group=\"1\" size=\"1 1 1\"/>"),
               "geom 'loose' is an object without a body");
  expect_error(world_text(kRobot + object_text("lying", "euler=\"1 0 0\"", "1 1 1")), "object 'lying' is not upright");
  expect_error(
      world_text(kRobot +
                 "<body name=\"off\"><geom type=\"ellipsoid\" group=\"1\" size=\"1 1 1\" pos=\"1 0 0\"/></body>"),
      "object 'off' has a geom with a pose of its own");
  expect_error(world_text(kRobot + "<body name=\"two\"><geom type=\"ellipsoid\" group=\"1\" size=\"1 1 1\"/>"
                                   "<geom type=\"ellipsoid\" group=\"1\" size=\"2 1 1\"/></body>"),
               "object 'two' has more than one geom in group 1");
  expect_error(world_text(kRobot + "<body name=\"b\"><joint name=\"hinge\"/><geom size=\"1\"/></body>"),
               "joint 'hinge' cannot move");
  expect_error(world_text(kRobot + post, "<text name=\"pots\" data=\"stand\"/>"), "text 'pots' is the path of no body");
  expect_error(world_text(kRobot + post, "<text name=\"post\" data=\"stand\"/>"),
               "body 'post' has a path and so needs mocap");
  const std::string turns = "<text name=\"hat\" data=\"stand spin 1\"/>";
  EXPECT_EQ(
      error_of(world_text(kRobot + "<body name=\"hat\" mocap=\"true\"><geom group=\"2\" size=\"0.1\"/></body>", turns)),
      "no error");
  expect_error(world_text(kRobot + "<body name=\"hat\" mocap=\"true\"><geom size=\"0.1\"/></body>", turns),
               "body 'hat' moves and has a geom in group 0");
  expect_error(world_text(kRobot, "<text name=\"robot\" data=\"circle center 1\"/>"),
               "the path of 'robot' needs 2 number(s) after 'center'");
  const std::string pair = object_text("a", "mocap=\"true\"", "1 1 1") + object_text("b", "mocap=\"true\"", "1 1 1");
  EXPECT_EQ(error_of(world_text(kRobot + pair,
                                "<text name=\"a\" data=\"with b at 0 1\"/>"
                                "<text name=\"b\" data=\"stand\"/>")),
            "no error");
  expect_error(world_text(kRobot + pair, "<text name=\"a\" data=\"with b at 0 1\"/>"),
               "the path of 'a' moves with 'b', which only an object may");
  expect_error(world_text(kRobot + pair,
                          "<text name=\"a\" data=\"with b at 0 1\"/>"
                          "<text name=\"b\" data=\"with a at 0 1\"/>"),
               "the path of 'b' moves with 'a', which only an object may");
  expect_error(world_text(kRobot + pair,
                          "<text name=\"robot\" data=\"with b at 0 1\"/>"
                          "<text name=\"b\" data=\"stand\"/>"),
               "the path of 'robot' moves with 'b', which only an object may");
  expect_error(world_text(kRobot, "<numeric name=\"robot_drag\" data=\"-1\"/>"),
               "numeric 'robot_drag' is outside [0, 10]");
}

TEST(World, RefusesBadScannersNamingFieldAndBound) {
  const auto message = [](const SimulatedLidarParams& lidar) -> std::string {
    try {
      const World world(kWorlds + "single.xml", lidar, 0);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "no error";
  };
  SimulatedLidarParams lidar;
  EXPECT_EQ(message(lidar), "no error");
  lidar.rate_hz = 0.0;
  EXPECT_EQ(message(lidar), "lidar.rate_hz = 0 is outside [0.1, 1000] Hz");
  lidar = {};
  lidar.range_max_m = 0.05;
  EXPECT_EQ(message(lidar), "lidar.range_max_m must be above lidar.range_min_m");
  lidar = {};
  lidar.sweep_s = 0.05;
  EXPECT_EQ(message(lidar), "lidar.sweep_s must be below 1 / lidar.rate_hz");
  lidar = {};
  lidar.beams = 2000;
  EXPECT_NE(message(lidar).find("lidar.angle_increment_rad"), std::string::npos);
}

// --- the demo world -------------------------------------------------------------------------------------------------

TEST(DemoWorld, ShowsStandingAndMovingObjectsAndHidesThePoleForAWhile) {
  World world(kWorlds + "demo.xml", {}, 0);
  const std::vector<Object> at_start = world.truth_at(0.0).objects, later = world.truth_at(5.0).objects;
  int standing = 0;
  for (std::size_t i = 0; i < later.size(); ++i) {
    standing += later[i].ellipse_world.center_m == at_start[i].ellipse_world.center_m ? 1 : 0;
  }
  EXPECT_GE(standing, 5);
  EXPECT_GE(static_cast<int>(later.size()) - standing, 4);

  std::vector<int> scans_seen(later.size(), 0);
  double hidden_s = 0.0, longest_hidden_s = 0.0, tilt_rad = 0.0;
  int visible = 0;
  constexpr int kScans = 1200;
  for (int scan = 0; scan < kScans; ++scan) {
    const SimulatedScan simulated = world.next();
    tilt_rad = std::max(tilt_rad, tilt(simulated.robot.T_world_robot));
    for (std::size_t i = 0; i < scans_seen.size(); ++i) {
      const Object& object = simulated.truth.objects[i];
      const double distance_m =
          (object.ellipse_world.center_m - simulated.T_world_lidar.translation().head<2>()).norm();
      if (object.beams >= 5 && distance_m < 10.0) ++scans_seen[i], ++visible;
      if (simulated.names[i] != "pole") continue;
      const Eigen::Vector3d p_lidar =
          simulated.T_world_lidar.inverse() *
          Eigen::Vector3d(object.ellipse_world.center_m.x(), object.ellipse_world.center_m.y(), 1.8);
      const bool in_view = std::abs(std::atan2(p_lidar.y(), p_lidar.x())) < radians(130.0);
      hidden_s = in_view && object.beams == 0 ? hidden_s + 0.05 : 0.0;
      longest_hidden_s = std::max(longest_hidden_s, hidden_s);
    }
  }
  for (std::size_t i = 0; i < scans_seen.size(); ++i) EXPECT_GT(scans_seen[i], kScans / 3) << "object " << i + 1;
  EXPECT_GT(visible, 6 * kScans);
  EXPECT_GT(longest_hidden_s, 2.0);
  EXPECT_LT(longest_hidden_s, 6.0);
  EXPECT_GT(tilt_rad, radians(3.0));
}

}  // namespace
}  // namespace situation_awareness
