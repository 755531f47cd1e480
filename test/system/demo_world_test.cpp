// SPDX-License-Identifier: BSD-3-Clause
// Simulator to map, without ROS: the demo's promises over seeds.
#include <gtest/gtest.h>

#include <iostream>
#include <map>
#include <string>

#include "situation_awareness/evaluation/map_evaluation.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {
namespace {

const std::string kSource = SITUATION_AWARENESS_SOURCE_DIR;
constexpr int kScans = 60 * 20;

MapScore fly_demo_world(std::uint64_t seed) {
  World world(kSource + "/models/worlds/demo.xml", SimulatedLidarParams{}, seed);
  ObjectPipeline pipeline(load_object_pipeline_params(kSource + "/cfg/objects.yaml", kSource + "/models"));
  MapEvaluation evaluation;
  std::map<std::uint64_t, std::string> names;
  for (int i = 0; i < kScans; ++i) {
    const SimulatedScan scan = world.next();
    pipeline.process(scan.scan, scan.T_world_lidar);
    evaluation.add(scan.truth, pipeline.map().at(scan.scan.stamp_ns));
    for (std::size_t k = 0; k < scan.names.size(); ++k) names[scan.truth.objects[k].id] = scan.names[k];
  }
  std::cout << "seed " << seed << '\n' << format_table(evaluation.score(), names);
  return evaluation.score();
}

class DemoWorld : public testing::TestWithParam<int> {};

TEST_P(DemoWorld, IsMappedTrulyAndInTime) {
  const MapScore score = fly_demo_world(static_cast<std::uint64_t>(GetParam()));
  EXPECT_LT(score.center_rmse_m, 0.05);
  EXPECT_LE(score.max_delay_s, 1.0);
  EXPECT_LE(score.longest_false_s, 1.0);
  EXPECT_GT(score.recall, 0.9);
}

INSTANTIATE_TEST_SUITE_P(Seeds, DemoWorld, testing::Range(1, 6));

}  // namespace
}  // namespace situation_awareness
