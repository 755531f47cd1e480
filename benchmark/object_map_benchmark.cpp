// SPDX-License-Identifier: BSD-3-Clause
// Cost of an update of the map: 1,000 elements with 200 detections and the free space of a 270 degree scanner, and its
// growth with elements and detections, which is linear; of 13 elements in view and others at rest, which is constant;
// and of clutter, detections that match nothing and stay on the map for a second.
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

/// Standing elements in rooms where the scanner was before, and 13 in view.
class Rooms {
 public:
  explicit Rooms(int elements) : map_(kept()) {
    constexpr int kScans = 60, kOfRoom = 200;
    for (int left = elements; left > 0; left -= kOfRoom) {
      for (int i = 0; i < kScans; ++i) map_.update(scan(std::min(left, kOfRoom)));
      origin_world_m_.x() += 30.0;
      stamp_ns_ += kNanosecondsPerSecond;
    }
    for (int i = 0; i < kScans; ++i) map_.update(next());
  }

  Detections next() { return scan(13); }
  ObjectMap& map() { return map_; }

 private:
  static ObjectMapParams kept() {
    ObjectMapParams params;
    params.max_unseen_s = 1e6;
    return params;
  }

  Detections scan(int objects) {
    Detections detections;
    detections.stamp_ns = stamp_ns_ += kNanosecondsPerSecond / 20;
    detections.T_world_level.translation_m = origin_world_m_;
    for (int i = 0; i < 1081; ++i) {
      detections.free_space.azimuth_rad.push_back(static_cast<float>(radians(-135.0 + 0.25 * i)));
      detections.free_space.range_m.push_back(12.0F);
    }
    for (int k = 0; k < objects; ++k) {
      const double azimuth_rad = radians(-130.0 + 260.0 * k / objects);
      const double range_m = k % 2 == 0 ? 8.0 : 11.0;
      Detection detection;
      detection.ellipse_level = {range_m * Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad)) +
                                     0.01 * Eigen::Vector2d(random_.normal(), random_.normal()),
                                 0.3, 0.15 + 0.001 * (k % 100), 0.1};
      detection.covariance = 4e-4 * Matrix5d::Identity();
      detection.beams = 20;
      detections.detections.push_back(detection);
    }
    return detections;
  }

  Random random_{1};
  Eigen::Vector2d origin_world_m_ = Eigen::Vector2d::Zero();
  std::int64_t stamp_ns_ = 0;
  ObjectMap map_;
};

void by_elements_at_rest(benchmark::State& state) {
  Rooms rooms(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    state.PauseTiming();
    const Detections scan = rooms.next();
    state.ResumeTiming();
    benchmark::DoNotOptimize(rooms.map().update(scan));
  }
  state.counters["elements"] = static_cast<double>(rooms.map().size());
}
BENCHMARK(by_elements_at_rest)->Arg(0)->Arg(1000)->Arg(3000)->Iterations(200)->Unit(benchmark::kMicrosecond);

/// Detections at other places in each scan.
void clutter(benchmark::State& state) {
  Random random(1);
  ObjectMap map{ObjectMapParams{}};
  std::int64_t stamp_ns = 0;
  const auto scan = [&] {
    constexpr double kHalf_m = 20.0;
    Detections detections;
    detections.stamp_ns = stamp_ns += kNanosecondsPerSecond / 25;
    detections.free_space = free_space_among(random);
    for (int k = 0; k < state.range(0); ++k) {
      Detection detection;
      detection.ellipse_level = {{random.uniform(-kHalf_m, kHalf_m), random.uniform(-kHalf_m, kHalf_m)},
                                 random.uniform(-1.5, 1.5),
                                 random.uniform(0.2, 0.4),
                                 random.uniform(0.05, 0.2)};
      detection.covariance = 4e-4 * Matrix5d::Identity();
      detection.beams = 20;
      detections.detections.push_back(detection);
    }
    return detections;
  };
  for (int i = 0; i < 2 * kWarmUpScans; ++i) map.update(scan());
  for (auto _ : state) {
    state.PauseTiming();
    const Detections detections = scan();
    state.ResumeTiming();
    benchmark::DoNotOptimize(map.update(detections));
  }
  state.counters["elements"] = static_cast<double>(map.size());
}
BENCHMARK(clutter)->Arg(15)->Arg(30)->Arg(60)->Iterations(100)->Unit(benchmark::kMicrosecond);

void at(benchmark::State& state) {
  Field field(kElements, kDetections);
  const std::int64_t later_ns = field.map().stamp_ns() + kNanosecondsPerSecond / 100;
  for (auto _ : state) benchmark::DoNotOptimize(field.map().at(later_ns));
}
BENCHMARK(at)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace situation_awareness
