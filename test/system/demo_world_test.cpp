// SPDX-License-Identifier: BSD-3-Clause
// Simulator to map, without ROS: the demo's promises over seeds, and those of the other worlds.
#include <gtest/gtest.h>

#include <iostream>
#include <map>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "situation_awareness/evaluation/bodies.hpp"
#include "situation_awareness/evaluation/map_evaluation.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/sim/scan_simulation.hpp"

namespace situation_awareness {
namespace {

const std::string kSource = SITUATION_AWARENESS_SOURCE_DIR;
constexpr int kScans = 60 * 20;

MapScore fly(const std::string& name, std::uint64_t seed) {
  ScanSimulation world(kSource + "/models/worlds/" + name + ".xml", SimulatedScannerParams{}, seed);
  ObjectPipeline pipeline(load_object_pipeline_params(kSource + "/cfg/objects.yaml", kSource + "/models"));
  std::optional<MapEvaluation> evaluation;
  std::map<std::uint64_t, std::string> names;
  for (int i = 0; i < kScans; ++i) {
    const SimulatedScan scan = world.next();
    if (!evaluation) {
      const std::vector<Body> bodies = bodies_of(scan.names);
      for (const Body& body : bodies) names[scan.truth.objects.at(body.parts.front()).id] = body.name;
      evaluation.emplace(MapEvaluationParams{}, bodies);
    }
    pipeline.process(scan.scan, scan.T_world_lidar);
    evaluation->add(scan.truth, pipeline.map().at(scan.scan.stamp_ns));
  }
  std::cout << name << ", seed " << seed << '\n' << format_table(evaluation->score(), names);
  return evaluation->score();
}

class DemoWorld : public testing::TestWithParam<int> {};

TEST_P(DemoWorld, IsMappedTrulyAndInTime) {
  const MapScore score = fly("demo", static_cast<std::uint64_t>(GetParam()));
  EXPECT_LT(score.center_rmse_m, 0.05);
  EXPECT_LE(score.max_delay_s, 1.0);
  EXPECT_LE(score.longest_false_s, 1.0);
  EXPECT_GT(score.recall, 0.9);
}

INSTANTIATE_TEST_SUITE_P(Seeds, DemoWorld, testing::Range(1, 6));

struct Promise {
  const char* world;
  double center_rmse_m;
  double longest_false_s;
};

void PrintTo(const Promise& promise, std::ostream* stream) { *stream << promise.world; }

class FlownWorld : public testing::TestWithParam<Promise> {};

TEST_P(FlownWorld, IsMappedTrulyAndInTime) {
  const MapScore score = fly(GetParam().world, 1);
  EXPECT_LT(score.center_rmse_m, GetParam().center_rmse_m);
  EXPECT_LE(score.max_delay_s, 1.0);
  EXPECT_LE(score.longest_false_s, GetParam().longest_false_s);
  EXPECT_GT(score.recall, 0.9);
}

// The persons of the lab swing their arms, which are not always taken for theirs.
INSTANTIATE_TEST_SUITE_P(Worlds, FlownWorld,
                         testing::Values(Promise{"lab", 0.1, 2.0}, Promise{"orchard", 0.05, 1.0},
                                         Promise{"warehouse", 0.05, 1.0}, Promise{"crowd", 0.05, 1.0}),
                         [](const auto& info) { return std::string(info.param.world); });

}  // namespace
}  // namespace situation_awareness
