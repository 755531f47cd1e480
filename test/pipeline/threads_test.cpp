// SPDX-License-Identifier: BSD-3-Clause
// The core has no threads, but a nodelet manager and tools run several pipelines concurrently. Built with
// -fsanitize=thread by scripts/test.
#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness {
namespace {

constexpr int kScans = 25;

ObjectPipelineParams params_of(const std::string& detector) {
  ObjectPipelineParams params;
  params.detections.detector = detector;
  params.detections.model_folder = std::string(SITUATION_AWARENESS_SOURCE_DIR) + "/models";
  return params;
}

/// The map after every scan of objects that stand, walk and hide each other; each seed has its own noise and position.
std::vector<Objects> maps_of(const std::string& detector, std::uint64_t seed) {
  ObjectPipeline pipeline(params_of(detector));
  Random random(seed);
  std::vector<Objects> maps;
  for (int i = 0; i < kScans; ++i) {
    const double time_s = 0.05 * i;
    LevelScene scene;
    scene.angle_increment_rad = radians(0.5);
    scene.beams = 541;
    scene.ellipses = {{{3.0, 1.5}, 0.6, 0.4, 0.2},
                      {{2.5, -1.0 + 0.8 * time_s}, 0.2, 0.25, 0.15},
                      {{5.0, -0.5 * static_cast<double>(seed)}, 0.0, 0.2, 0.2}};
    scene.walls = {{{8.0, -9.0}, {8.0, 9.0}}};
    Scan scan = scene.scan(&random);
    scan.stamp_ns = nanoseconds(time_s);
    pipeline.process(scan, Eigen::Isometry3d::Identity());
    maps.push_back(pipeline.map().at(scan.stamp_ns));
  }
  return maps;
}

void expect_same_bits(const std::vector<Objects>& a, const std::vector<Objects>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].objects.size(), b[i].objects.size());
    for (std::size_t k = 0; k < a[i].objects.size(); ++k) {
      const Object& x = a[i].objects[k];
      const Object& y = b[i].objects[k];
      EXPECT_EQ(x.id, y.id);
      EXPECT_EQ(x.ellipse_world.center_m, y.ellipse_world.center_m);
      EXPECT_EQ(x.ellipse_world.psi_rad, y.ellipse_world.psi_rad);
      EXPECT_EQ(x.ellipse_world.rx_m, y.ellipse_world.rx_m);
      EXPECT_EQ(x.ellipse_world.ry_m, y.ellipse_world.ry_m);
      EXPECT_EQ(x.velocity_world_m_s, y.velocity_world_m_s);
      EXPECT_EQ(x.covariance, y.covariance);
      EXPECT_EQ(x.p_moving, y.p_moving);
      EXPECT_EQ(x.p_exists, y.p_exists);
    }
  }
}

TEST(Threads, ConcurrentPipelinesGiveBitForBitTheResultsOfEachAlone) {
  const std::vector<std::string> detectors = {"network", "least_squares", "network", "vgg", "least_squares", "alex"};
  std::vector<std::vector<Objects>> alone;
  for (std::size_t i = 0; i < detectors.size(); ++i) alone.push_back(maps_of(detectors[i], i));
  for (const std::vector<Objects>& maps : alone) EXPECT_GE(maps.back().objects.size(), 2U);

  std::vector<std::vector<Objects>> together(detectors.size());
  std::vector<std::thread> threads;  // each loads its own model, too
  for (std::size_t i = 0; i < detectors.size(); ++i) {
    threads.emplace_back([&, i] { together[i] = maps_of(detectors[i], i); });
  }
  for (std::thread& thread : threads) thread.join();
  for (std::size_t i = 0; i < detectors.size(); ++i) {
    SCOPED_TRACE(detectors[i]);
    expect_same_bits(together[i], alone[i]);
  }
}

// Several threads may query the map at once (ObjectMap::at): queries are const.
TEST(Threads, AMapIsReadConcurrentlyWithoutAChange) {
  ObjectMap map(ObjectMapParams{});
  Detections detections;
  for (int i = 0; i < 20; ++i) {
    detections.stamp_ns = nanoseconds(0.05 * i);
    Detection detection;
    detection.ellipse_level = {{3.0, 0.02 * i}, 0.3, 0.3, 0.2};
    detection.covariance = 1e-4 * Matrix5d::Identity();
    detection.beams = 20;
    detections.detections = {detection};
    map.update(detections);
  }
  const std::vector<Objects> alone = {map.at(nanoseconds(1.0)), map.at(nanoseconds(1.5))};
  ASSERT_EQ(alone.front().objects.size(), 1U);
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      for (int k = 0; k < 50; ++k) expect_same_bits({map.at(nanoseconds(1.0)), map.at(nanoseconds(1.5))}, alone);
    });
  }
  for (std::thread& thread : threads) thread.join();
}

}  // namespace
}  // namespace situation_awareness
