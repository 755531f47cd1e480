// SPDX-License-Identifier: BSD-3-Clause
// Simulator to map, without ROS: the published figures of the demo, over seeds, and of the other worlds.
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
#include "situation_awareness/sim/ring_scanner.hpp"
#include "situation_awareness/sim/scan_simulation.hpp"
#include "situation_awareness/sim/sensors.hpp"
#include "situation_awareness/sim/truth.hpp"

namespace situation_awareness::demo_world_test {
namespace {

const std::string kSource = SITUATION_AWARENESS_SOURCE_DIR;
constexpr int kScans = 60 * 20;

std::string world_path(const std::string& name) { return kSource + "/models/worlds/" + name + ".xml"; }

/// What is mapped of a world, and how well.
class Flight {
 public:
  explicit Flight(std::vector<Box> fixtures_world) : fixtures_world_(std::move(fixtures_world)) {}

  ObjectPipeline& pipeline() { return pipeline_; }

  /// Compares the map with the truth, whose objects have these names.
  void judge(const Objects& truth, const std::vector<std::string>& names) {
    if (!evaluation_) {
      const std::vector<Body> bodies = bodies_of(names);
      for (const Body& body : bodies) names_[truth.objects.at(body.parts.front()).id] = body.name;
      evaluation_.emplace(MapEvaluationParams{}, bodies, fixtures_world_);
    }
    evaluation_->add(truth, pipeline_.map().at(truth.stamp_ns));
  }

  MapScore score(const std::string& title) const {
    std::cout << title << '\n' << format_table(evaluation_->score(), names_);
    return evaluation_->score();
  }

 private:
  ObjectPipeline pipeline_{load_object_pipeline_params(kSource + "/cfg/objects.yaml", kSource + "/models")};
  std::vector<Box> fixtures_world_;
  std::optional<MapEvaluation> evaluation_;
  std::map<std::uint64_t, std::string> names_;
};

MapScore fly(const std::string& name, std::uint64_t seed) {
  ScanSimulation world(world_path(name), SimulatedScannerParams{}, seed);
  Flight flight(world.world().fixtures());
  for (int i = 0; i < kScans; ++i) {
    const SimulatedScan scan = world.next();
    flight.pipeline().process(scan.scan, scan.T_world_lidar);
    flight.judge(scan.truth, scan.names);
  }
  return flight.score(name + ", seed " + std::to_string(seed));
}

MapScore fly_with_rings(const std::string& name, int rings, std::uint64_t seed) {
  World world(world_path(name));
  SimulatedRingScannerParams params;
  params.rings = rings;
  SimulatedRingScanner scanner(world, world.T_robot_lidar(), params, seed);
  Sightings sightings(world.names().size());
  std::vector<std::string> names;
  for (const std::size_t object : objects_of_true_map(world)) names.push_back(world.names()[object]);
  Flight flight(world.fixtures());
  for (int i = 0; i < kScans; ++i) {
    const double time_s = scanner.next_time_s();
    const RingScannerSample sample = scanner.next();
    sightings.add(sample.cloud.stamp_ns, sample.hits, sample.cloud.columns);
    flight.pipeline().process(sample.cloud, sample.T_world_sensor, sample.T_world_sensor_end);
    flight.judge(true_map(world, sightings, time_s, sample.T_world_sensor.translation().z()), names);
  }
  return flight.score(name + ", " + std::to_string(rings) + " rings, seed " + std::to_string(seed));
}

/// Bounds of a world by docs/benchmarks/README.md and docs/worlds.md, with a margin for other seeds and processors.
struct Bounds {
  const char* world;
  int seed;
  double min_recall;
  double max_center_rmse_m;
  double max_velocity_rmse_m_s;
  double max_delay_s;
  double max_false_s;  ///< of the longest life of a false element; 0: there is none at all
  int max_id_switches;
};

void PrintTo(const Bounds& bounds, std::ostream* stream) { *stream << bounds.world << ", seed " << bounds.seed; }

class FlownWorld : public testing::TestWithParam<Bounds> {};

TEST_P(FlownWorld, IsMappedWithinItsBounds) {
  const Bounds& bounds = GetParam();
  const MapScore score = fly(bounds.world, static_cast<std::uint64_t>(bounds.seed));
  EXPECT_EQ(score.scans, kScans);
  EXPECT_GE(score.recall, bounds.min_recall);
  EXPECT_LE(score.center_rmse_m, bounds.max_center_rmse_m);
  EXPECT_LE(score.velocity_rmse_m_s, bounds.max_velocity_rmse_m_s);
  EXPECT_LE(score.max_delay_s, bounds.max_delay_s);
  EXPECT_LE(score.longest_false_s, bounds.max_false_s);
  if (bounds.max_false_s == 0.0) {
    EXPECT_EQ(score.false_per_scan, 0.0);
  }
  EXPECT_LE(score.id_switches, bounds.max_id_switches);
}

// Worst of 40 seeds: recall 0.991, centre 0.0092 m, velocity 0.0476 m/s, delay 0.45 s, nothing false (but on the
// cabinet) in 39 of them, in one for one scan, 4 changes of id. Without boxes 0.0081 m, 0.0404 m/s and 3: a segment
// that looks like a box is then refused.
constexpr Bounds demo(int seed) { return {"demo", seed, 0.98, 0.01, 0.05, 0.6, 0.0, 7}; }

std::string name_of_seed(const testing::TestParamInfo<Bounds>& info) {
  return "seed_" + std::to_string(info.param.seed);
}
INSTANTIATE_TEST_SUITE_P(Demo, FlownWorld, testing::Values(demo(1), demo(2)), name_of_seed);
INSTANTIATE_TEST_SUITE_P(DemoLong, FlownWorld, testing::Values(demo(3), demo(4), demo(5)), name_of_seed);

// Worst of 20 seeds:
//   lab        0.987   0.121 m   0.286 m/s   1.00 s   false for 3.8 s   101 changes of id
//   orchard    0.994   0.007     0.019       0.70     nothing           10
//   warehouse  0.981   0.017     0.056       1.10     nothing            9 (but on the ends of the racks)
//   crowd      0.986   0.013     0.048       1.00     nothing           20
// The swinging arms of the lab's persons are not always joined with their bodies; a torso and an arm in one segment are
// taken for a box, and how often depends on the noise: its bounds are the worst of 20 seeds. Without boxes it has 0.060
// m, 0.112 m/s, 1.9 s and 26.
INSTANTIATE_TEST_SUITE_P(Others, FlownWorld,
                         testing::Values(Bounds{"lab", 1, 0.98, 0.125, 0.3, 1.0, 6.0, 105},
                                         Bounds{"orchard", 1, 0.985, 0.01, 0.02, 0.9, 0.0, 12},
                                         Bounds{"warehouse", 1, 0.975, 0.018, 0.07, 0.7, 0.0, 11},
                                         Bounds{"crowd", 1, 0.975, 0.018, 0.05, 0.9, 0.0, 23}),
                         [](const auto& info) { return std::string(info.param.world); });

class DemoFromRings : public testing::TestWithParam<int> {};

TEST_P(DemoFromRings, IsMappedWithinItsBounds) {
  const MapScore score = fly_with_rings("demo", 16, static_cast<std::uint64_t>(GetParam()));
  EXPECT_EQ(score.scans, kScans);
  EXPECT_GE(score.recall, 0.98);
  EXPECT_LE(score.center_rmse_m, 0.015);
  EXPECT_LE(score.max_delay_s, 1.0);
  EXPECT_EQ(score.false_per_scan, 0.0);
}

INSTANTIATE_TEST_SUITE_P(Seeds, DemoFromRings, testing::Values(1));
INSTANTIATE_TEST_SUITE_P(SeedsLong, DemoFromRings, testing::Values(2));

}  // namespace
}  // namespace situation_awareness::demo_world_test
