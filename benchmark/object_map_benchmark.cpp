// SPDX-License-Identifier: BSD-3-Clause
// How the map's cost grows with its elements, three of four seen in every scan: linearly.
#include <benchmark/benchmark.h>

#include <cmath>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/map/objects/object_map.hpp"

namespace situation_awareness {
namespace {

constexpr int kWarmUpScans = 20;

/// Detections of a grid of standing ellipses, 2 m apart, with noise; after the warm-up a quarter goes unseen in turn.
Detections detections_of_grid(int elements, int scan, Random& random) {
  Detections detections;
  detections.stamp_ns = scan * (kNanosecondsPerSecond / 20);
  const int columns = static_cast<int>(std::ceil(std::sqrt(elements)));
  for (int i = 0; i < elements; ++i) {
    if (scan >= kWarmUpScans && (i + scan) % 4 == 0) continue;
    Detection detection;
    detection.ellipse_level = {
        {2.0 * (i % columns) + 0.01 * random.normal(), 2.0 * (i / columns) + 0.01 * random.normal()}, 0.3, 0.3, 0.2};
    detection.covariance = 4e-4 * Matrix5d::Identity();
    detection.beams = 20;
    detections.detections.push_back(detection);
  }
  return detections;
}

void update_object_map(benchmark::State& state) {
  const auto elements = static_cast<int>(state.range(0));
  Random random(1);
  ObjectMap map{ObjectMapParams{}};
  int scan = 0;
  for (; scan < kWarmUpScans; ++scan) map.update(detections_of_grid(elements, scan, random));
  for (auto _ : state) {
    state.PauseTiming();
    const Detections detections = detections_of_grid(elements, scan++, random);
    state.ResumeTiming();
    benchmark::DoNotOptimize(map.update(detections));
  }
  state.SetComplexityN(elements);
  state.counters["elements"] = static_cast<double>(map.at(map.stamp_ns()).objects.size());
}
BENCHMARK(update_object_map)
    ->RangeMultiplier(2)
    ->Range(8, 512)
    ->Unit(benchmark::kMicrosecond)
    ->Complexity(benchmark::oN);

}  // namespace
}  // namespace situation_awareness
