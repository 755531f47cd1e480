// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "allocations.hpp"
#include "pose/reflector_world.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/pipeline/hit_labels.hpp"
#include "situation_awareness/pipeline/localization_pipeline.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/pipeline/polygon_pipeline.hpp"
#include "situation_awareness/scan/cloud_slice.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::pipeline_allocation_test {
namespace {

const std::string kSource = SITUATION_AWARENESS_SOURCE_DIR;
constexpr int kScans = 314;  // two rounds of the moving object

/// A room with standing objects, one half hidden and one at the wall, and a moving one that comes and goes.
std::vector<Scan> scans() {
  Random random(1);
  std::vector<Scan> result;
  for (int i = 0; i < kScans; ++i) {
    LevelScene scene;
    scene.walls = {{{6.0, -8.0}, {6.0, 8.0}}, {{6.0, 8.0}, {-3.0, 8.0}}};
    scene.ellipses = {{{3.0, -1.0}, 0.3, 0.3, 0.2},
                      {{2.0, 1.5}, 0.0, 0.2, 0.2},
                      {{3.4, 2.1}, 1.0, 0.4, 0.25},
                      {{5.7, 0.5}, 0.0, 0.25, 0.25},
                      {{4.0, 3.0 * std::sin(4.0 * kPi * i / kScans)}, 0.5, 0.25, 0.15}};
    result.push_back(scene.scan(&random));
  }
  return result;
}

/// Allocations of a second round of the same scans.
struct SecondRound {
  std::int64_t asked = 0;
  std::size_t objects = 0;
  std::size_t persons = 0;
};

/// Persons by their legs: two who walk back and forth and cross, one hidden by the other, and one who stands.
std::vector<Scan> scans_of_legs() {
  Random random(2);
  std::vector<Scan> result;
  for (int i = 0; i < kScans; ++i) {
    LevelScene scene;
    scene.walls = {{{6.0, -8.0}, {6.0, 8.0}}, {{6.0, 8.0}, {-3.0, 8.0}}};
    const auto add_legs = [&](double x_m, double y_m, double step_m) {
      scene.ellipses.push_back({{x_m - 0.1, y_m + step_m}, 0.0, 0.06, 0.06});
      scene.ellipses.push_back({{x_m + 0.1, y_m - step_m}, 0.0, 0.06, 0.06});
    };
    const double along_m = 1.5 * std::sin(4.0 * kPi * i / kScans);
    const double step_m = 0.15 * std::sin(40.0 * kPi * i / kScans);
    add_legs(1.5, along_m, step_m);
    add_legs(2.3, -along_m, step_m);
    add_legs(2.0, -2.5, 0.0);
    result.push_back(scene.scan(&random));
  }
  return result;
}

SecondRound second_round(const std::string& detector, std::vector<Scan> all) {
  ObjectPipelineParams params = load_object_pipeline_params(kSource + "/cfg/objects.yaml", kSource + "/models");
  params.detections.detector = detector;
  ObjectPipeline pipeline(params);
  SecondRound result;
  Objects map;
  std::vector<HitLabel> labels;
  std::int64_t stamp_ns = 1'000'000'000;
  for (int round = 0; round < 2; ++round) {
    const std::int64_t before = allocations().count;
    for (Scan& scan : all) {
      scan.stamp_ns = stamp_ns += 50'000'000;
      const ObjectPipelineResult& made = pipeline.process(scan, Eigen::Isometry3d::Identity());
      labels = label_hits(made.segments, made.detections, map, std::move(labels));
      map = pipeline.map().at(scan.stamp_ns, std::move(map));
    }
    result.asked = allocations().count - before;
  }
  result.objects = map.objects.size();
  result.persons =
      static_cast<std::size_t>(std::count_if(map.objects.begin(), map.objects.end(), [](const Object& object) {
        return object.object_class == ObjectClass::kPerson;
      }));
  return result;
}

TEST(Allocation, TheCounterCounts) {
  const Allocations before = allocations();
  const std::vector<double> some(100);
  const Allocations during = allocations() - before;
  EXPECT_EQ(during.count, 1);
  EXPECT_EQ(during.bytes, static_cast<std::int64_t>(some.size() * sizeof(double)));
}

TEST(Allocation, NoneFromScanToMapAfterWarmUp) {
  for (const char* detector : {"least_squares", "network"}) {
    const SecondRound round = second_round(detector, scans());
    EXPECT_GE(round.objects, 4U) << detector;
    EXPECT_EQ(round.asked, 0) << detector;
  }
}

// Both maps, of the same scans, among which somebody walks.
TEST(Allocation, NoneFromScanToBothMapsAfterWarmUp) {
  const std::string file = kSource + "/cfg/polygons.yaml";
  PolygonPipeline pipeline(params_from_yaml<PolygonPipelineParams>(read_text_file(file), file),
                           load_object_pipeline_params(file, kSource + "/models", [](const UnknownKey&) {}));
  std::vector<Scan> all = scans();
  Polygons polygons;
  std::int64_t stamp_ns = 1'000'000'000, asked = 0;
  int on_movers = 0;
  for (int round = 0; round < 6; ++round) {
    on_movers = 0;
    const std::int64_t before = allocations().count;
    for (Scan& scan : all) {
      scan.stamp_ns = stamp_ns += 50'000'000;
      const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
      on_movers += pipeline.process(scan, T, T, 1e-8 * Eigen::Matrix3d::Identity()).update.on_movers;
      pipeline.map().update_due_chains();
      polygons = pipeline.map().latest_polygons(std::move(polygons));
    }
    asked = allocations().count - before;
  }
  EXPECT_GT(on_movers, 100);
  EXPECT_GE(polygons.chains.size(), 4U);
  EXPECT_EQ(asked, 0);
}

TEST(Allocation, NoneForPersonsAfterWarmUp) {
  const SecondRound round = second_round("network", scans_of_legs());
  EXPECT_GE(round.persons, 2U);
  EXPECT_EQ(round.asked, 0);
}

TEST(Allocation, NoneForTheSliceOfACloudAfterWarmUp) {
  Cloud cloud;
  cloud.rows = 3;
  const std::vector<Scan> all = scans();
  cloud.columns = all[0].beams.size();
  for (const float height_m : {-0.1F, 0.0F, 0.1F}) {
    for (std::size_t i = 0; i < cloud.columns; ++i) {
      CloudPoint point;
      const double angle_rad = all[0].angle_min_rad + static_cast<double>(i) * all[0].angle_increment_rad;
      const Beam& beam = all[0].beams[i];
      if (beam.state == BeamState::kHit) {
        point.x_m = beam.range_m * static_cast<float>(std::cos(angle_rad));
        point.y_m = beam.range_m * static_cast<float>(std::sin(angle_rad));
        point.z_m = height_m;
      }
      cloud.points.push_back(point);
    }
  }
  CloudSlice slice;
  std::int64_t asked = 0;
  for (int round = 0; round < 3; ++round) {
    const std::int64_t before = allocations().count;
    slice = slice_cloud(cloud, Eigen::Isometry3d::Identity(), Eigen::Isometry3d::Identity(), {}, std::move(slice));
    asked = allocations().count - before;
  }
  EXPECT_EQ(asked, 0);
  EXPECT_GT(std::count_if(slice.scan.beams.begin(), slice.scan.beams.end(),
                          [](const Beam& beam) { return beam.state == BeamState::kHit; }),
            100);
}

// From the scan on, with the first pose found in the warm-up.
TEST(Allocation, NoneFromScanToPoseByReflectorsAfterWarmUp) {
  ReflectorMap map;
  for (const Eigen::Vector2d& center : {Eigen::Vector2d(4.0, 1.0), Eigen::Vector2d(-2.5, 3.2),
                                        Eigen::Vector2d(-1.5, -3.0), Eigen::Vector2d(3.0, -2.8)}) {
    map.reflectors.push_back({center, 0.05});
  }
  ReflectorWorld world;
  world.add_room({-5.5, -4.5}, {5.5, 4.5});
  world.add(map);
  world.path = winding_path(0.5);
  world.sweep_s = 0.03;
  world.lost_share = 0.01;
  Random random(3);
  std::vector<Scan> all;
  for (int i = 0; i < 200; ++i) all.push_back(world.scan(0.1 + 0.04 * i, random));
  DriftingWheels wheels(world.path, 1);
  LocalizationPipeline pipeline(map, {}, {});
  std::int64_t before = 0;
  bool is_known = false;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i == 50) before = allocations().count;
    while (wheels.next_time_s() < 0.1 + 0.04 * static_cast<double>(i) + 0.045) {
      const auto [stamp_ns, T_odom_base] = wheels.next();
      pipeline.add_odometry(stamp_ns, T_odom_base);
    }
    is_known = pipeline.process(all[i], Eigen::Isometry3d::Identity()).is_known;
  }
  EXPECT_EQ(allocations().count - before, 0);
  EXPECT_TRUE(is_known);
}

}  // namespace
}  // namespace situation_awareness::pipeline_allocation_test
