// SPDX-License-Identifier: BSD-3-Clause
// Cost of an update of the map: 1,000 elements with 200 detections and the free space of a 270 degree scanner, and its
// growth with elements and detections, which is linear.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/objects/object_map.hpp"

namespace situation_awareness {
namespace {

constexpr int kWarmUpScans = 20;
constexpr double kSpacing_m = 2.0;
constexpr double kRadius_m = 0.25;

/// The free space of a scanner with 1081 beams in a crowd: almost all undetected elements are hidden, and kept.
FreeSpace free_space_among(Random& random) {
  FreeSpace free_space;
  for (int i = 0; i < 1081; ++i) {
    free_space.azimuth_rad.push_back(static_cast<float>(radians(-135.0 + 0.25 * i)));
    free_space.range_m.push_back(static_cast<float>(random.uniform(0.5, 2.0)));
  }
  return free_space;
}

/// A field of standing ellipses around the scanner, of which every scan detects some, in turn.
class Field {
 public:
  Field(int elements, int detections) : elements_(elements), detections_(detections), map_{ObjectMapParams{}} {
    // Existing, seen by all, at first.
    for (int i = 0; i < kWarmUpScans; ++i) map_.update(scan(elements_, FreeSpace{}));
  }

  Detections next() { return scan(detections_, free_space_among(random_)); }
  ObjectMap& map() { return map_; }

 private:
  Detections scan(int seen, FreeSpace free_space) {
    Detections detections;
    detections.stamp_ns = scans_++ * (kNanosecondsPerSecond / 40);
    detections.free_space = std::move(free_space);
    const int columns = static_cast<int>(std::ceil(std::sqrt(elements_)));
    for (int k = 0; k < seen; ++k) {
      const int i = (first_ + k) % elements_;
      const Eigen::Vector2d place(i % columns - 0.5 * columns + 0.25, i / columns - 0.5 * columns + 0.25);
      Detection detection;
      detection.ellipse_level = {kSpacing_m * place + 0.01 * Eigen::Vector2d(random_.normal(), random_.normal()), 0.3,
                                 kRadius_m, 0.6 * kRadius_m};
      detection.covariance = 4e-4 * Matrix5d::Identity();
      detection.beams = 20;
      detection.time_offset_s = 0.01;
      detections.detections.push_back(detection);
    }
    first_ = (first_ + seen) % elements_;
    return detections;
  }

  int elements_;
  int detections_;
  int first_ = 0;
  std::int64_t scans_ = 0;
  Random random_{1};
  ObjectMap map_;
};

void update(benchmark::State& state, int elements, int detections) {
  Field field(elements, detections);
  for (auto _ : state) {
    state.PauseTiming();
    const Detections scan = field.next();
    state.ResumeTiming();
    benchmark::DoNotOptimize(field.map().update(scan));
  }
  state.counters["elements"] = static_cast<double>(field.map().at(field.map().stamp_ns()).objects.size());
}

constexpr int kDetections = 200;
constexpr int kElements = 1000;

void by_elements(benchmark::State& state) {
  update(state, static_cast<int>(state.range(0)), std::min(kDetections, static_cast<int>(state.range(0))));
}
BENCHMARK(by_elements)
    ->Arg(125)
    ->Arg(250)
    ->Arg(500)
    ->Arg(1000)
    ->Arg(2000)
    ->Arg(4000)
    ->Iterations(200)
    ->Unit(benchmark::kMicrosecond);

void by_detections(benchmark::State& state) { update(state, kElements, static_cast<int>(state.range(0))); }
BENCHMARK(by_detections)
    ->Arg(25)
    ->Arg(50)
    ->Arg(100)
    ->Arg(200)
    ->Arg(400)
    ->Arg(800)
    ->Iterations(200)
    ->Unit(benchmark::kMicrosecond);

void at(benchmark::State& state) {
  Field field(kElements, kDetections);
  const std::int64_t later_ns = field.map().stamp_ns() + kNanosecondsPerSecond / 100;
  for (auto _ : state) benchmark::DoNotOptimize(field.map().at(later_ns));
}
BENCHMARK(at)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace situation_awareness
