// SPDX-License-Identifier: BSD-3-Clause
// Processor's time of a scan, from its polylines to the live map of polygons, and memory: in a hall, all of which is in
// view, and in a street of 6 km with houses and lamp posts on both sides, the last kilometre against the first.
#include <benchmark/benchmark.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "map/polygons/room_polylines.hpp"
#include "measures.hpp"
#include "older_build.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"
#include "situation_awareness/polylines/polyline_extraction.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "support/street.hpp"
#include "support/thread_cpu.hpp"

namespace situation_awareness {
namespace {

const Eigen::Matrix3d kCovariance = Eigen::Vector3d(9e-6, 9e-6, 1e-6).asDiagonal();

/// A live map and what its updates cost.
class TimedMap {
 public:
  void update(const Polylines& polylines) {
    const double begin_us = thread_cpu_us();
    report_ = map_.update(polylines, kCovariance, std::move(report_));
    make_chains(map_, polygons_, 0);
    times_us_.push_back(thread_cpu_us() - begin_us);
  }
  /// Of the updates since the latest call.
  double median_us() {
    const double result_us = median(times_us_);
    times_us_.clear();
    return result_us;
  }
  const PolygonMap& map() const { return map_; }

 private:
  PolygonMap map_{PolygonMapParams{}};
  Polygons polygons_;
  PolygonMapUpdate report_;
  std::vector<double> times_us_;
};

/// With twelve boxes, and so much longer than wide as 24 m x 16 m.
void hall(benchmark::State& state) {
  const double scale = static_cast<double>(state.range(0)) / 24.0;
  for (auto _ : state) {
    RoomPolylines room(1, 1'000'000'000'000, {{0.0, 0.0}, 0.0, scale * 12.0, scale * 8.0});
    for (int i = 0; i < 12; ++i) {
      room.add_box({{scale * (-8.0 + 1.5 * i), scale * (i % 2 == 0 ? 3.0 : -3.5)}, 0.1 * i, 0.3, 0.2});
    }
    TimedMap map;
    for (int i = 0; i < 200; ++i) map.update(room.next());
    map.median_us();
    for (int i = 0; i < 600; ++i) map.update(room.next());
    state.counters["p50_us"] = map.median_us();
    state.counters["elements"] = static_cast<double>(map.map().elements());
  }
}
BENCHMARK(hall)->Arg(12)->Arg(24)->Arg(48)->Iterations(1)->Unit(benchmark::kMillisecond);

void street(benchmark::State& state) {
  for (auto _ : state) {
    StreetDrive drive(1);
    TimedMap map;
    const std::int64_t before_bytes = memory().heap_bytes;
    std::vector<double> km_us;
    for (int km = 1; km <= 6; ++km) {
      while (drive.travelled_m() < 1000.0 * km) {
        map.update(extract_polylines(segment(drive.next(), {}), {}));
      }
      km_us.push_back(map.median_us());
      state.counters["km_" + std::to_string(km) + "_us"] = km_us.back();
    }
    const double kilobytes = static_cast<double>(memory().heap_bytes - before_bytes) / 1024.0;
    state.counters["growth"] = km_us.back() / km_us.front();
    state.counters["kib_per_km"] = kilobytes / static_cast<double>(km_us.size());
    state.counters["elements"] = static_cast<double>(map.map().elements());
  }
}
BENCHMARK(street)->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace situation_awareness
