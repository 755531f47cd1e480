// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/scan/scan.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::scan_test {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

TEST(BeamFromRange, DistinguishesTheThreeCasesOfRep117) {
  EXPECT_EQ(beam_from_range(kInfinity, 0.1F, 30.0F).state, BeamState::kFree);
  EXPECT_EQ(beam_from_range(-kInfinity, 0.1F, 30.0F).state, BeamState::kTooClose);
  EXPECT_EQ(beam_from_range(std::nanf(""), 0.1F, 30.0F).state, BeamState::kInvalid);
}

TEST(BeamFromRange, ClassifiesFiniteRangesByTheSensorsLimits) {
  EXPECT_EQ(beam_from_range(31.0F, 0.1F, 30.0F).state, BeamState::kFree);
  EXPECT_EQ(beam_from_range(0.05F, 0.1F, 30.0F).state, BeamState::kInvalid);
  EXPECT_EQ(beam_from_range(0.0F, 0.0F, 30.0F).state, BeamState::kInvalid);
  EXPECT_EQ(beam_from_range(-3.0F, 0.1F, 30.0F).state, BeamState::kInvalid);
  const Beam hit = beam_from_range(2.5F, 0.1F, 30.0F);
  EXPECT_EQ(hit.state, BeamState::kHit);
  EXPECT_EQ(hit.range_m, 2.5F);
}

TEST(BeamFromRange, IsFreeAtRangeMaxToRounding) {
  for (const float range_max_m : {3.5F, 5.6F, 8.0F, 30.0F, 120.0F}) {
    for (const float below_m : {0.0F, 1e-6F, 1e-4F, -1e-6F}) {
      const Beam beam = beam_from_range(range_max_m - below_m, 0.1F, range_max_m);
      EXPECT_EQ(beam.state, BeamState::kFree) << range_max_m << " - " << below_m;
      EXPECT_EQ(beam.range_m, range_max_m);
    }
    EXPECT_EQ(beam_from_range(range_max_m - 1e-3F, 0.1F, range_max_m).state, BeamState::kHit) << range_max_m;
  }
  EXPECT_EQ(beam_from_range(static_cast<float>(5600 * 0.001), 0.02F, 5.6F).state, BeamState::kFree);
  EXPECT_EQ(beam_from_range(0.0F, 0.0F, 0.0F).state, BeamState::kInvalid);
}

TEST(BeamFromRange, IsFreeAsFarAsTheSensorReaches) {
  EXPECT_EQ(beam_from_range(kInfinity, 0.1F, 30.0F).range_m, 30.0F);
  EXPECT_EQ(beam_from_range(31.0F, 0.1F, 30.0F).range_m, 30.0F);
  EXPECT_EQ(beam_from_range(kInfinity, 0.1F, kInfinity).range_m, kInfinity);
  EXPECT_EQ(beam_from_range(kInfinity, 0.1F, kInfinity).state, BeamState::kFree);
  for (const float nothing_m : {0.0F, -1.0F, -kInfinity, std::nanf("")}) {
    const Beam beam = beam_from_range(kInfinity, 0.1F, nothing_m);
    EXPECT_EQ(beam.state, BeamState::kFree);
    EXPECT_EQ(beam.range_m, 0.0F);
  }
}

TEST(ScanDefect, NamesTheDefectOfAScan) {
  Scan scan;
  scan.angle_increment_rad = 0.01;
  EXPECT_STREQ(scan_defect(scan), "empty scan");
  scan.beams.resize(1);
  EXPECT_STREQ(scan_defect(scan), "scan of a single beam");
  scan.beams.resize(2);
  EXPECT_STREQ(scan_defect(scan), "");
  scan.angle_increment_rad = 0.0;
  EXPECT_STREQ(scan_defect(scan), "angle increment of zero");
  scan.angle_increment_rad = std::nan("");
  EXPECT_STREQ(scan_defect(scan), "scan angles not finite");
  scan.angle_increment_rad = radians(-1.0);
  scan.beams.resize(361);
  EXPECT_STREQ(scan_defect(scan), "");
  scan.beams.resize(400);
  EXPECT_STREQ(scan_defect(scan), "scan of more than one revolution");

  // Beams more than half a turn apart: which of them is to the right of the other?
  EXPECT_STREQ(scan_defect(2, 0.0, 3.2), "angle increment of more than half a turn");
  EXPECT_STREQ(scan_defect(2, 0.0, -3.2), "angle increment of more than half a turn");
  EXPECT_STREQ(scan_defect(3, 0.0, 3.1), "");
}

// Azimuths that rounding makes equal are no order of beams.
TEST(ScanDefect, NamesAnglesWithoutAnOrderOfBeams) {
  Scan scan;
  scan.beams.resize(2);
  scan.angle_increment_rad = 1e-20;
  EXPECT_STREQ(scan_defect(scan), "angle increment too small");
  scan.angle_increment_rad = radians(-135.0);
  EXPECT_STREQ(scan_defect(scan), "");
  scan.angle_min_rad = 1e9;
  EXPECT_STREQ(scan_defect(scan), "first angle too large");
  scan.angle_min_rad = 4.0 * kPi;
  EXPECT_STREQ(scan_defect(scan), "");
}

Scan circle_of_hits(float range_m) {
  Scan scan;
  scan.angle_min_rad = -kPi;
  scan.angle_increment_rad = radians(1.0);
  scan.beams.assign(360, {range_m, BeamState::kHit});
  return scan;
}

TEST(RangeLimiter, DistinguishesOutsideHitsFromFreeBeams) {
  RangeLimiterParams params;
  params.min_range_m = 0.5;
  params.max_range_m = 4.0;
  Scan scan = circle_of_hits(3.0F);
  scan.beams[0] = {0.4F, BeamState::kHit};
  scan.beams[1] = {4.5F, BeamState::kHit};
  scan.beams[2] = {30.0F, BeamState::kFree};
  const Scan limited = limit_range(scan, Eigen::Isometry3d::Identity(), params);
  EXPECT_EQ(limited.beams[0].state, BeamState::kTooClose);
  EXPECT_EQ(limited.beams[1].state, BeamState::kOutside);
  EXPECT_EQ(limited.beams[1].range_m, 4.5F);
  EXPECT_EQ(limited.beams[2].state, BeamState::kFree);
  EXPECT_EQ(limited.beams[2].range_m, 30.0F);
  EXPECT_EQ(limited.beams[3].state, BeamState::kHit);
}

TEST(RangeLimiter, KeepsIntensities) {
  RangeLimiterParams params;
  params.min_range_m = 2.0;
  Scan scan = circle_of_hits(1.0F);
  for (std::size_t i = 100; i < scan.beams.size(); ++i) scan.beams[i].range_m = i < 200 ? 3.0F : 50.0F;
  for (std::size_t i = 0; i < scan.beams.size(); ++i) scan.beams[i].intensity = static_cast<float>(i);
  const Scan limited = limit_range(scan, Eigen::Isometry3d::Identity(), params);
  for (std::size_t i = 0; i < limited.beams.size(); ++i) {
    EXPECT_EQ(limited.beams[i].intensity, static_cast<float>(i));
  }
}

// Eq. 4 of the circle paper: the volume is fixed in the world, for any pose and tilt of the robot.
TEST(RangeLimiter, VolumeIsFixedInTheWorld) {
  RangeLimiterParams params;
  params.volume = {{Eigen::Vector3d::UnitX(), 2.0}, {-Eigen::Vector3d::UnitZ(), -1.0}};  // x <= 2, z >= 1
  Eigen::Isometry3d T_world_lidar = Eigen::Isometry3d::Identity();
  T_world_lidar.translation() << 0.5, -1.0, 1.5;
  T_world_lidar.rotate(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()));
  T_world_lidar.rotate(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()));
  const Scan scan = circle_of_hits(3.0F);
  const Scan limited = limit_range(scan, T_world_lidar, params);
  int inside = 0;
  for (std::size_t i = 0; i < scan.beams.size(); ++i) {
    const double angle_rad = scan.angle_min_rad + static_cast<double>(i) * scan.angle_increment_rad;
    const Eigen::Vector3d p_world =
        T_world_lidar * Eigen::Vector3d(3.0 * std::cos(angle_rad), 3.0 * std::sin(angle_rad), 0.0);
    const bool in_volume = p_world.x() <= 2.0 && p_world.z() >= 1.0;
    EXPECT_EQ(limited.beams[i].state, in_volume ? BeamState::kHit : BeamState::kOutside);
    inside += in_volume ? 1 : 0;
  }
  EXPECT_GT(inside, 50);
  EXPECT_LT(inside, 310);
}

TEST(ScannerParams, RefusesWrongValuesByName) {
  const auto refused = [](auto change) {
    ScannerParams params;
    change(params);
    return refusal_of([&] { params.validate(); });
  };
  EXPECT_EQ(refused([](auto&) {}), "");
  EXPECT_EQ(refused([](auto& p) { p.no_return = "0"; }),
            "scan.no_return = 0 is unknown, known are: inf, nan, range_max, zero");
  EXPECT_EQ(refused([](auto& p) { p.beam_order = "reversed"; }),
            "scan.beam_order = reversed is unknown, known are: backward, forward");
  EXPECT_EQ(refused([](auto& p) { p.stamp_at = "end"; }),
            "scan.stamp_at = end is unknown, known are: first, last, middle");
}

TEST(RangeLimiterParams, RefusesWrongValuesByName) {
  RangeLimiterParams params;
  params.max_range_m = -1.0;
  EXPECT_TRUE(names(refusal_of([&] { params.validate(); }), {"scan.max_range_m", "-1", "0", "1000"}));
  params.max_range_m = std::nan("");
  EXPECT_THROW(params.validate(), std::invalid_argument);
  params.max_range_m = 0.05;
  EXPECT_THROW(params.validate(), std::invalid_argument);
  params = {};
  params.volume = {{Eigen::Vector3d::Zero(), 1.0}};
  EXPECT_THROW(params.validate(), std::invalid_argument);
}

TEST(Volume, ReadsBackWhatItWrites) {
  Random random(1);
  std::vector<HalfSpace> volume;
  EXPECT_EQ(yaml_text(volume), "[]");
  for (int i = 0; i < 200; ++i) {
    const double scale = std::pow(10.0, random.uniform(-12.0, 12.0));
    volume.push_back({{scale * random.normal(), random.normal(), 0.1 * i}, scale * random.normal()});
  }
  std::vector<HalfSpace> read;
  read_yaml_text(yaml_text(volume), read);
  ASSERT_EQ(read.size(), volume.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].normal_world, volume[i].normal_world);
    EXPECT_EQ(read[i].offset_m, volume[i].offset_m);
  }
  EXPECT_EQ(yaml_text(std::vector<HalfSpace>{{{0.1, -1.0, 0.0}, 2.5}}), "[[0.1, -1, 0, 2.5]]");
}

TEST(Volume, IsNothingButAListOfFours) {
  std::vector<HalfSpace> volume(1);
  read_yaml_text("[]", volume);
  EXPECT_TRUE(volume.empty());
  for (const char* text : {"", "{}", "7", "a room", "[1, 0, 0, 2]", "[[1, 0, 0]]", "[[1, 0, 0, 2, 3]]",
                           "[[1, 0, 0, x]]", "[[1, 0, 0, 2]", "[[1, 0, 0, 2]]]", "\t", "&a [*a]"}) {
    EXPECT_THROW(read_yaml_text(text, volume), std::invalid_argument) << text;
  }
}

}  // namespace
}  // namespace situation_awareness::scan_test
