// SPDX-License-Identifier: BSD-3-Clause
// Scanners of simulated worlds whose stamps are wrong: how far, found from scans and poses, and the map that is made
// with what was found.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/evaluation/bodies.hpp"
#include "situation_awareness/evaluation/map_evaluation.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/pipeline/scanner_check.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/pose/pose_offset.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "situation_awareness/sim/scan_simulation.hpp"
#include "situation_awareness/sim/scanner_presets.hpp"

namespace situation_awareness::pose_offset_test {
namespace {

const std::string kSource = SITUATION_AWARENESS_SOURCE_DIR;
constexpr double kFlight_s = 50.0;
constexpr double kLag_s = 0.13;
constexpr double kTolerance_s = 0.02;

std::string world_path(const std::string& name) { return kSource + "/models/worlds/" + name + ".xml"; }

/// The preset, with stamps that are late by so much more than its own.
SimulatedScannerParams late_scanner(const std::string& preset, double lag_s) {
  SimulatedScannerParams scanner = load_scanner_preset(scanner_preset_file(preset, kSource + "/models/scanners"));
  scanner.stamp_error_s += lag_s;
  return scanner;
}

/// Of the pose of a scan on average over its beams: they are measured from the first one on, and are taken to be
/// measured at the times that the scan says.
double true_offset_s(const SimulatedScannerParams& scanner) {
  return 0.5 * scanner.sweep_s * (1.0 - scanner.time_increment_scale) - scanner.stamp_error_s;
}

struct Case {
  const char* world;
  const char* preset;
  int seed;
  double lag_s;
};

void PrintTo(const Case& flown, std::ostream* stream) {
  *stream << flown.world << ", " << flown.preset << ", seed " << flown.seed << ", late by " << flown.lag_s << " s";
}

class LateScans : public testing::TestWithParam<Case> {};

TEST_P(LateScans, AreFoundToBeLate) {
  const Case& flown = GetParam();
  const SimulatedScannerParams scanner = late_scanner(flown.preset, flown.lag_s);
  ScanSimulation world(world_path(flown.world), scanner, static_cast<std::uint64_t>(flown.seed));
  PoseOffsetEstimator estimator(0.0);
  for (int i = 0; i < kFlight_s * scanner.rate_hz; ++i) {
    const SimulatedScan scan = world.next();
    estimator.add(project_horizontally(scan.scan, scan.T_world_lidar, scan.T_world_lidar_end));
  }
  const PoseOffset& found = estimator.estimate();
  ASSERT_TRUE(found.is_known);
  const double error_s = found.offset_s - true_offset_s(scanner);
  EXPECT_LT(std::abs(error_s), kTolerance_s);
  EXPECT_LT(std::abs(error_s), 3.0 * found.sigma_s);
  if (flown.lag_s != 0.0) {
    EXPECT_TRUE(is_out_of_step(found, 0.0));
    EXPECT_FALSE(is_out_of_step(found, true_offset_s(scanner)));
  }
}

INSTANTIATE_TEST_SUITE_P(Flights, LateScans,
                         testing::Values(Case{"demo", "lms100", 1, kLag_s}, Case{"demo", "lms100", 3, 0.0},
                                         Case{"lab", "rplidar_a2", 1, kLag_s}));
INSTANTIATE_TEST_SUITE_P(FlightsLong, LateScans,
                         testing::Values(Case{"demo", "lms100", 2, kLag_s}, Case{"lab", "s300", 1, -kLag_s},
                                         Case{"lab", "rplidar_a2", 2, 0.0}, Case{"warehouse", "lms100", 1, kLag_s}));

TEST(OrderOfBeams, IsFound) {
  constexpr double kOrderFlight_s = 30.0;
  struct Order {
    const char* world;
    const char* preset;
    bool is_shown;  ///< by the flight; within 30 ms the drone hardly turns
  };
  for (const Order& flown :
       {Order{"lab", "rplidar_a3", true}, {"demo", "rplidar_a3", true}, {"lab", "lms100", false}}) {
    for (const bool is_backward : {false, true}) {
      SimulatedScannerParams scanner = late_scanner(flown.preset, 0.0);
      scanner.sweep_against_order = is_backward ? 1 : 0;
      ScanSimulation world(world_path(flown.world), scanner, 1);
      ScannerCheck check({}, 0.0);
      for (int i = 0; i < kOrderFlight_s * scanner.rate_hz; ++i) {
        const SimulatedScan scan = world.next();
        const Scan limited = limit_range(scan.scan, scan.T_world_lidar, RangeLimiterParams{});
        check.add(limited, project_horizontally(limited, scan.T_world_lidar, scan.T_world_lidar_end),
                  scan.T_world_lidar, scan.T_world_lidar_end);
      }
      const std::vector<std::string> advice = check.advice();
      EXPECT_TRUE(is_backward || advice.empty()) << flown.world << ", " << flown.preset;
      if (!is_backward || !flown.is_shown) continue;
      ASSERT_FALSE(advice.empty()) << flown.world << ", " << flown.preset;
      EXPECT_NE(advice[0].find("set scan/beam_order to backward"), std::string::npos) << flown.preset;
    }
  }
}

// The scans of clouds have no motion in them any more: what scan/stamp_at and scan/beam_order say does not change them.
TEST(ScansOfClouds, AreOutOfStepByTheOffsetAlone) {
  constexpr double kSweep_s = 0.06, kSlicesFlight_s = 20.0;
  SimulatedScannerParams scanner = late_scanner("lms100", kSweep_s);
  scanner.sweep_s = 0.0;
  ScanSimulation world(world_path("demo"), scanner, 1);
  ScannerCheck check({}, 0.0);
  for (int i = 0; i < kSlicesFlight_s * scanner.rate_hz; ++i) {
    const SimulatedScan scan = world.next();
    Scan level = limit_range(scan.scan, scan.T_world_lidar, RangeLimiterParams{});
    level.time_increment_s = kSweep_s / static_cast<double>(level.beams.size() - 1);
    check.add(level, project_horizontally(level, scan.T_world_lidar, scan.T_world_lidar), scan.T_world_lidar,
              scan.T_world_lidar);
  }
  EXPECT_TRUE(check.advice().empty());
  EXPECT_TRUE(check.is_out_of_step());
  EXPECT_NEAR(check.pose_offset().estimate().offset_s, -kSweep_s, kTolerance_s);
}

/// The map of a flight with the poses of this offset after the stamps.
struct Mapped {
  MapScore score;
  PoseOffset found;
};

Mapped fly(double lag_s, double offset_s) {
  const SimulatedScannerParams scanner = late_scanner("lms100", lag_s);
  ScanSimulation world(world_path("demo"), scanner, 1);
  ObjectPipeline pipeline(load_object_pipeline_params(kSource + "/cfg/objects.yaml", kSource + "/models"));
  PoseOffsetEstimator estimator(offset_s);
  std::optional<MapEvaluation> evaluation;
  for (int i = 0; i < kFlight_s * scanner.rate_hz; ++i) {
    const SimulatedScan scan = world.next();
    const double stamp_s = 1e-9 * static_cast<double>(scan.scan.stamp_ns);
    const auto pose_at = [&](double time_s) { return world.robot_at(time_s).T_world_robot * world.T_robot_lidar(); };
    const auto& result = pipeline.process(scan.scan, pose_at(stamp_s + offset_s),
                                          pose_at(stamp_s + offset_s + scanner.time_increment_scale * scanner.sweep_s));
    estimator.add(result.points);
    if (!evaluation) evaluation.emplace(MapEvaluationParams{}, bodies_of(scan.names));
    // What the scan saw is the truth of when it was taken.
    Objects truth = world.truth_at(stamp_s - lag_s);
    truth.stamp_ns = scan.scan.stamp_ns;
    evaluation->add(truth, pipeline.map().at(scan.scan.stamp_ns));
  }
  return {evaluation->score(), estimator.estimate()};
}

TEST(FoundOffset, MakesTheMapAsGoodAsThatOfScansInTime) {
  const Mapped in_time = fly(0.0, 0.0);
  const Mapped late = fly(kLag_s, 0.0);
  const Mapped corrected = fly(kLag_s, late.found.offset_s);
  EXPECT_NEAR(corrected.found.offset_s, late.found.offset_s, 0.01);
  EXPECT_GT(late.score.center_rmse_m, 2.0 * in_time.score.center_rmse_m) << "a lag matters in this flight";
  EXPECT_LT(corrected.score.center_rmse_m, 1.1 * in_time.score.center_rmse_m);
  EXPECT_LT(corrected.score.velocity_rmse_m_s, 1.1 * in_time.score.velocity_rmse_m_s);
  EXPECT_GE(corrected.score.recall, in_time.score.recall - 0.01);
  EXPECT_LE(corrected.score.id_switches, in_time.score.id_switches + 1);
  std::printf("centre %.4f m in time, %.4f m late, %.4f m corrected\n", in_time.score.center_rmse_m,
              late.score.center_rmse_m, corrected.score.center_rmse_m);
}

}  // namespace
}  // namespace situation_awareness::pose_offset_test
