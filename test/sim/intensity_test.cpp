// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/intensity.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sim/world_file.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/ring_scanner.hpp"
#include "situation_awareness/sim/scanner.hpp"

namespace situation_awareness::intensity_test {
namespace {

SimulatedScannerParams with_intensity(double sigma = 0.0) {
  SimulatedScannerParams params;
  params.range_sigma_m = 0.0;
  params.beams = 721;
  params.angle_min_rad = -kPi;
  params.angle_increment_rad = radians(0.5);
  params.intensity.gain = 400.0;
  params.intensity.sigma = sigma;
  params.range_max_m = 60.0;
  return params;
}

/// The intensity of a surface by Lambert's law, lobe and tape, at a range, with saturation.
double expected_intensity(double diffuse, double glossy, double retro, double range_m, double cos_incidence) {
  const double part = (diffuse + retro) * cos_incidence + glossy * std::pow(cos_incidence, 50.0);
  return std::min(1000.0, 400.0 * part / (1.0 + range_m * range_m / 64.0));
}

Scan scan_of(const std::string& bodies, const SimulatedScannerParams& params, const std::string& more = "") {
  const WorldFile file(world_text(kRobot + bodies, "", "<size nuser_geom=\"3\"/>" + more));
  World world(file.path());
  return SimulatedScanner(world, world.T_robot_lidar(), params, 1).next().scan;
}

double angle_of(const Scan& scan, std::size_t beam) {
  return scan.angle_min_rad + static_cast<double>(beam) * scan.angle_increment_rad;
}

TEST(Intensity, OfAWallFallsWithRangeAndIncidence) {
  const Scan scan = scan_of(R"(<geom type="box" pos="3.5 0 1.5" size="0.5 40 2" user="0.8"/>)", with_intensity());
  int hits = 0;
  float before = 0.0F;
  for (std::size_t i = 0; i < scan.beams.size(); ++i) {
    const Beam& beam = scan.beams[i];
    ASSERT_EQ(std::isnan(beam.intensity), beam.state != BeamState::kHit);
    if (beam.state != BeamState::kHit) continue;
    ++hits;
    const double cosine = std::cos(angle_of(scan, i));
    EXPECT_NEAR(beam.intensity, expected_intensity(0.8, 0.0, 0.0, 3.0 / cosine, cosine), 1e-2);
    if (angle_of(scan, i) < -1e-9) {
      EXPECT_GT(beam.intensity, before);
    }
    if (angle_of(scan, i) > 1e-9) {
      EXPECT_LT(beam.intensity, before);
    }
    before = beam.intensity;
  }
  EXPECT_GT(hits, 200);
}

TEST(Intensity, UsesTheNormalsOfAllShapes) {
  // Each fills the view in one direction; the incidence follows from its shape.
  const std::string mesh = R"(<asset><mesh name="wedge" vertex="0 -9 0  1 0 0  0 9 0  0 -9 3  1 0 3  0 9 3"/></asset>)";
  const Scan scan =
      scan_of(object_text("post", "pos=\"5 0 1\" euler=\"0 0 0.7\"", "0.8 0.5 1") +
                  R"(<geom type="cylinder" pos="0 5 1.5" size="0.7 1"/> <geom type="sphere" pos="-5 0 1.5" size="0.9"/>
                     <geom type="mesh" mesh="wedge" pos="0 -5 0" euler="0 0 1.570796327"/>)",
              with_intensity(), mesh);
  std::vector<int> hits(4, 0);
  for (std::size_t i = 0; i < scan.beams.size(); ++i) {
    const Beam& beam = scan.beams[i];
    if (beam.state != BeamState::kHit) continue;
    const Eigen::Vector2d ray(std::cos(angle_of(scan, i)), std::sin(angle_of(scan, i)));
    const Eigen::Vector2d p = beam.range_m * ray;
    Eigen::Vector2d normal;
    if (p.y() < -3.5) {
      // The wedge, rotated by 90 degrees: its edge points to the robot, its sides fall back by 1 m over 9 m.
      normal = Eigen::Vector2d(p.x() > 0.0 ? 1.0 : -1.0, 9.0);
      if (std::abs(p.x()) < 0.05) continue;  // on the edge
      ++hits[3];
    } else if (p.x() > std::abs(p.y())) {
      const Eigen::Rotation2Dd R(0.7);
      const Eigen::Vector2d q = R.inverse() * (p - Eigen::Vector2d(5.0, 0.0));
      normal = R * Eigen::Vector2d(q.x() / 0.64, q.y() / 0.25);
      ++hits[0];
    } else if (p.y() > 2.0) {
      normal = p - Eigen::Vector2d(0.0, 5.0);
      ++hits[1];
    } else {
      normal = p + Eigen::Vector2d(5.0, 0.0);
      ++hits[2];
    }
    const double cosine = std::abs(normal.normalized().dot(ray));
    EXPECT_NEAR(beam.intensity, expected_intensity(0.5, 0.0, 0.0, beam.range_m, cosine), 0.2) << p.transpose();
  }
  for (const int count : hits) EXPECT_GT(count, 15);
}

TEST(Intensity, IsHighForAReflectorAndForAGlossySurfaceOnlyAtNormalIncidence) {
  const auto brightest_and_hits = [](const std::string& bodies) {
    float brightest = 0.0F;
    int bright = 0;
    for (const Beam& beam : scan_of(bodies, with_intensity()).beams) {
      if (beam.state != BeamState::kHit) continue;
      brightest = std::max(brightest, beam.intensity);
      bright += beam.intensity > 400.0F ? 1 : 0;
    }
    return std::make_pair(brightest, bright);
  };
  // White walls stay below 400 at any range, reflectors are above up to 15 m.
  EXPECT_LE(brightest_and_hits(R"(<geom type="box" pos="1.5 0 1.5" size="0.5 9 2" user="1"/>)").first, 400.0F);
  for (const char* range : {"2", "6", "10", "14"}) {
    const auto reflector = brightest_and_hits(
        std::string("<geom type=\"cylinder\" size=\"0.2 1\" user=\"0.5 0 6\" pos=\"") + range + " 0 1.5\"/>");
    EXPECT_GT(reflector.first, 450.0F) << range;
    EXPECT_LE(reflector.first, 1000.0F) << range;
    EXPECT_GE(reflector.second, 2) << range;
  }
  // A glossy wall: bright where it is seen square on, within some 10 deg, and not beside.
  const Scan glossy = scan_of(R"(<geom type="box" pos="3.5 0 1.5" size="0.5 9 2" user="0.4 2"/>)", with_intensity());
  for (std::size_t i = 0; i < glossy.beams.size(); ++i) {
    if (glossy.beams[i].state != BeamState::kHit) continue;
    const double angle = std::abs(angle_of(glossy, i));
    if (angle < radians(5.0)) {
      EXPECT_GT(glossy.beams[i].intensity, 400.0F);
    }
    if (angle > radians(25.0)) {
      EXPECT_LT(glossy.beams[i].intensity, 200.0F);
    }
  }
}

TEST(Intensity, ItsNoiseIsRelativeAndChangesNoRange) {
  const std::string wall = R"(<geom type="box" pos="3.5 0 1.5" size="0.5 40 2" user="0.8"/>)";
  SimulatedScannerParams params = with_intensity(0.1), plain = params;
  params.range_sigma_m = plain.range_sigma_m = 0.02;
  plain.intensity.gain = 0.0;
  const Scan noisy = scan_of(wall, params), without = scan_of(wall, plain), exact = scan_of(wall, with_intensity());
  double sum = 0.0, sum_of_squares = 0.0;
  int n = 0;
  for (std::size_t i = 0; i < noisy.beams.size(); ++i) {
    ASSERT_EQ(noisy.beams[i].range_m, without.beams[i].range_m);
    ASSERT_TRUE(std::isnan(without.beams[i].intensity));
    if (noisy.beams[i].state != BeamState::kHit) continue;
    const double z = (noisy.beams[i].intensity / exact.beams[i].intensity - 1.0) / 0.1;
    sum += z;
    sum_of_squares += z * z;
    ++n;
  }
  ASSERT_GT(n, 200);
  EXPECT_LT(std::abs(sum), 4.0 * std::sqrt(n));
  EXPECT_LT(std::abs(sum_of_squares - n), 4.0 * std::sqrt(2.0 * n));
}

TEST(Intensity, OfARingScannerIsTheSame) {
  const WorldFile file(
      world_text(kRobot + R"(<geom type="plane" size="20 20 1" user="0.3"/>)", "", "<size nuser_geom=\"1\"/>"));
  World world(file.path());
  SimulatedRingScannerParams params;
  params.range_sigma_m = params.intensity.sigma = 0.0;
  params.intensity.gain = 400.0;
  const Cloud cloud = SimulatedRingScanner(world, world.T_robot_lidar(), params, 1).next().cloud;
  int hits = 0;
  for (const CloudPoint& point : cloud.points) {
    ASSERT_EQ(std::isnan(point.intensity), std::isnan(point.x_m));
    if (std::isnan(point.x_m)) continue;
    const double range_m = Eigen::Vector3f(point.x_m, point.y_m, point.z_m).cast<double>().norm();
    EXPECT_NEAR(point.intensity, expected_intensity(0.3, 0.0, 0.0, range_m, 1.5 / range_m), 1e-2);
    ++hits;
  }
  EXPECT_GT(hits, 900 * 4);
}

}  // namespace
}  // namespace situation_awareness::intensity_test
