// SPDX-License-Identifier: BSD-3-Clause
// How drivers stamp scans, and in which order beams are measured, found on 20 s of turning to both sides.
#include "situation_awareness/pipeline/scanner_check.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <ostream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness::scanner_check_test {
namespace {

constexpr double kDrive_s = 20.0;

struct Scanner {
  int beams;
  double field_deg, rate_hz, sigma_m, sweep_s;
};

void PrintTo(const Scanner& scanner, std::ostream* stream) {
  *stream << scanner.beams << " beams, " << scanner.rate_hz << " Hz";
}

/// Sweeps of 19, 15, 30 and 67 ms.
const Scanner kScanners[] = {{1081, 270.0, 40.0, 0.01, 0.01875},
                             {541, 270.0, 50.0, 0.012, 0.015},
                             {1081, 270.0, 25.0, 0.008, 0.03},
                             {1440, 360.0, 15.0, 0.012, 0.0667}};

/// What a driver sends.
struct Sent {
  bool is_backward = false;
  double stamp_part = 0.0;  ///< of the sweep, after which it is stamped
};

/// Turning at up to `most_rad_s`.
Pose2 at(double t_s, double most_rad_s) {
  return {{0.8 * std::sin(0.25 * t_s), 0.5 * std::sin(0.4 * t_s)}, most_rad_s / 0.6 * std::sin(0.6 * t_s)};
}

/// In a room of 12 m x 9 m with five posts.
double range_m(const Eigen::Vector2d& p_m, double angle_rad) {
  const Eigen::Vector2d ray(std::cos(angle_rad), std::sin(angle_rad)), half_m(6.0, 4.5);
  double range_m = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 2; ++i) range_m = std::min(range_m, (std::copysign(half_m(i), ray(i)) - p_m(i)) / ray(i));
  const double posts_m[][3] = {
      {2.0, 1.6, 0.2}, {-2.2, 2.4, 0.15}, {3.0, -2.0, 0.3}, {-3.4, -1.6, 0.25}, {0.4, -3.0, 0.18}};
  for (const auto& [x_m, y_m, radius_m] : posts_m) {
    const Eigen::Vector2d to_m = Eigen::Vector2d(x_m, y_m) - p_m;
    const double along_m = ray.dot(to_m);
    const double inside_m2 = radius_m * radius_m - (to_m.squaredNorm() - along_m * along_m);
    if (along_m > 0.0 && inside_m2 > 0.0) range_m = std::min(range_m, along_m - std::sqrt(inside_m2));
  }
  return range_m;
}

Eigen::Isometry3d isometry(const Pose2& pose) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(pose.yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  T.translation().head<2>() = pose.translation_m;
  return T;
}

/// The check after the drive, whose poses are late by `late_s`.
ScannerCheck after(const Scanner& scanner, const Sent& sent, std::uint64_t seed, double late_s = 0.0,
                   double most_rad_s = 0.72) {
  ScannerCheck check({}, 0.0);
  Random random(seed);
  const double field_rad = radians(scanner.field_deg), step_rad = field_rad / scanner.beams;
  const double between_s = scanner.sweep_s / (scanner.beams - 1);
  const auto pose_at = [&](double t_s) { return isometry(at(t_s - late_s, most_rad_s)); };
  for (int k = 0; k < kDrive_s * scanner.rate_hz; ++k) {
    const double t_s = 100.0 + k / scanner.rate_hz;
    Scan scan;
    scan.angle_min_rad = -0.5 * field_rad;
    scan.angle_increment_rad = step_rad;
    scan.time_increment_s = between_s;
    for (int i = 0; i < scanner.beams; ++i) {
      const Pose2 pose = at(t_s + between_s * (sent.is_backward ? scanner.beams - 1 - i : i), most_rad_s);
      const double measured_m = range_m(pose.translation_m, pose.yaw_rad + scan.angle_min_rad + i * step_rad);
      const double noisy_m = measured_m + scanner.sigma_m * random.normal();
      scan.beams.push_back(beam_from_range(static_cast<float>(noisy_m), 0.05F, 20.0F));
    }
    const double stamp_s = t_s + sent.stamp_part * scanner.sweep_s;
    scan.stamp_ns = nanoseconds(stamp_s);
    const Eigen::Isometry3d T = pose_at(stamp_s), T_end = pose_at(stamp_s + scanner.sweep_s);
    check.add(scan, project_horizontally(scan, T, T_end), T, T_end);
  }
  return check;
}

std::string said(const ScannerCheck& check) {
  std::string text;
  for (const std::string& sentence : check.advice()) text += sentence + "\n";
  return text;
}

bool says(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

class Scanners : public testing::TestWithParam<Scanner> {};

TEST_P(Scanners, AreNotCorrectedWhereTheyAreRight) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    const ScannerCheck check = after(GetParam(), {}, seed);
    EXPECT_EQ(said(check), "");
    EXPECT_FALSE(check.is_out_of_step());
  }
}

TEST_P(Scanners, AreFoundToBeStampedAtTheLastBeam) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    const std::string text = said(after(GetParam(), {false, 1.0}, seed));
    EXPECT_TRUE(says(text, "set scan/stamp_at to last")) << text;
    EXPECT_FALSE(says(text, "beam_order")) << text;
  }
}

TEST_P(Scanners, AreFoundToBeStampedInTheMiddle) {
  constexpr double kShortSweep_s = 0.016;  // half of it is hardly more than the least uncertainty of an offset
  const std::string text = said(after(GetParam(), {false, 0.5}, 1));
  EXPECT_TRUE(says(text, "set scan/stamp_at to middle") || GetParam().sweep_s < kShortSweep_s) << text;
  EXPECT_FALSE(says(text, "beam_order") || says(text, "to last")) << text;
}

TEST_P(Scanners, AreFoundToMeasureBackwards) {
  const std::string text = said(after(GetParam(), {true, 0.0}, 1));
  EXPECT_TRUE(says(text, "set scan/beam_order to backward")) << text;
  EXPECT_FALSE(says(text, "stamp_at")) << text;
}

TEST_P(Scanners, AreFoundToMeasureBackwardsAndToBeStampedAtTheLastBeam) {
  const std::string text = said(after(GetParam(), {true, 1.0}, 1));
  EXPECT_TRUE(says(text, "set scan/beam_order to backward")) << text;
  EXPECT_TRUE(says(text, "set scan/stamp_at to last")) << text;
}

INSTANTIATE_TEST_SUITE_P(Turning, Scanners, testing::ValuesIn(kScanners));

TEST(ScannerCheck, IsNotMisledByPosesThatAreLate) {
  const ScannerCheck check = after(kScanners[0], {}, 1, 0.1);
  EXPECT_EQ(said(check), "");
  EXPECT_TRUE(check.is_out_of_step());
}

TEST(ScannerCheck, SaysNothingWhereTheScannerHardlyTurns) {
  for (const Sent& sent : {Sent{}, {true, 0.0}, {false, 1.0}}) {
    EXPECT_EQ(said(after(kScanners[1], sent, 1, 0.0, 0.05)), "") << sent.is_backward << " " << sent.stamp_part;
  }
}

}  // namespace
}  // namespace situation_awareness::scanner_check_test
