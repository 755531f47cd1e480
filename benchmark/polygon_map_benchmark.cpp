// SPDX-License-Identifier: BSD-3-Clause
// Cost of a scan on the way to the map of polygons in a corridor with 40 chains, stage by stage and in all, with what
// the nodelet adds for its message; and its growth with the chains on the map, of which the same part is in view. The
// same on the way to both maps, of polygons and of objects, with somebody who walks along the corridor: p50 and p99 of
// the processor's time.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "older_build.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/pipeline/polygon_pipeline.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "support/thread_cpu.hpp"

namespace situation_awareness {
namespace {

constexpr std::int64_t kPeriod_ns = 40'000'000;
constexpr int kBoxesInView = 38;
constexpr double kHalfLength_m = 10.0;

/// Corridors of 20 m x 3 m side by side, each with a wall on either side and boxes of 0.2 m along both.
Polygons corridors(int chains) {
  Polygons polygons;
  polygons.stamp_ns = 1'000'000'000;
  const auto add = [&](const std::vector<Eigen::Vector2d>& places, bool closed) {
    Chain chain;
    chain.id = polygons.chains.size() + 1;
    chain.closed = closed;
    for (const Eigen::Vector2d& p_m : places) chain.vertices.push_back({p_m, 0.01});
    chain.first_seen_ns = chain.last_seen_ns = polygons.stamp_ns;
    chain.p_exists = 0.9975;
    polygons.chains.push_back(chain);
  };
  for (int k = 0; static_cast<int>(polygons.chains.size()) < chains; ++k) {
    const double y_m = 10.0 * k;
    add({{kHalfLength_m, y_m + 1.5}, {-kHalfLength_m, y_m + 1.5}}, false);
    add({{-kHalfLength_m, y_m - 1.5}, {kHalfLength_m, y_m - 1.5}}, false);
    for (int box = 0; box < kBoxesInView && static_cast<int>(polygons.chains.size()) < chains; ++box) {
      const Eigen::Vector2d c(-9.0 + box / 2, y_m + (box % 2 == 0 ? 1.1 : -1.1));
      const double half_m = 0.1;
      add({{c.x() - half_m, c.y() - half_m},
           {c.x() - half_m, c.y() + half_m},
           {c.x() + half_m, c.y() + half_m},
           {c.x() + half_m, c.y() - half_m}},
          true);
    }
  }
  return polygons;
}

double range_to(const Eigen::Vector2d& from_m, const Eigen::Vector2d& u, const Eigen::Vector2d& a_m,
                const Eigen::Vector2d& b_m) {
  const Eigen::Vector2d way_m = b_m - a_m;
  const double determinant = way_m.x() * u.y() - way_m.y() * u.x();
  if (std::abs(determinant) < 1e-12) return 1e9;
  const Eigen::Vector2d d_m = from_m - a_m;
  const double part = (d_m.x() * u.y() - d_m.y() * u.x()) / determinant;
  const double range_m = (d_m.x() * way_m.y() - d_m.y() * way_m.x()) / determinant;
  return part >= 0.0 && part <= 1.0 && range_m > 0.05 ? range_m : 1e9;
}

/// A scanner of 270 degrees that drives along the first corridor: 541 beams, 12 mm.
class Drive {
 public:
  explicit Drive(int chains, bool with_walker = false) : polygons_(corridors(chains)), with_walker_(with_walker) {}

  Scan next() {
    const Eigen::Vector2d from_m = position_m();
    Scan scan;
    scan.stamp_ns = 100'000'000'000 + scans_ * kPeriod_ns;
    scan.angle_min_rad = radians(-135.0);
    scan.angle_increment_rad = radians(0.5);
    const std::size_t in_view = std::min<std::size_t>(polygons_.chains.size(), 2 + kBoxesInView);
    for (int i = 0; i < 541; ++i) {
      const double angle_rad = scan.angle_min_rad + i * scan.angle_increment_rad;
      const Eigen::Vector2d u(std::cos(angle_rad), std::sin(angle_rad));
      double range_m = 1e9;
      for (std::size_t k = 0; k < in_view; ++k) {
        const std::vector<ChainVertex>& v = polygons_.chains[k].vertices;
        for (std::size_t e = 0; e + 1 < v.size() + (polygons_.chains[k].closed ? 1 : 0); ++e) {
          range_m = std::min(range_m, range_to(from_m, u, v[e].p_world_m, v[(e + 1) % v.size()].p_world_m));
        }
      }
      if (with_walker_) {
        const Ellipse walker{{-6.0 * std::cos(0.007 * static_cast<double>(scans_)), 0.5}, 0.3, 0.25, 0.15};
        if (const auto hit_m = intersect_ray(walker, from_m, u)) range_m = std::min(range_m, *hit_m);
      }
      const auto measured_m = static_cast<float>(range_m > 1e6 ? INFINITY : range_m + 0.012 * random_.normal());
      scan.beams.push_back(beam_from_range(measured_m, 0.05F, 20.0F));
    }
    return scan;
  }

  /// Of the scan that next() gave.
  Eigen::Isometry3d pose() {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation().head<2>() = position_m();
    ++scans_;
    return T;
  }

  const Polygons& polygons() const { return polygons_; }

 private:
  Eigen::Vector2d position_m() const { return {6.0 * std::sin(0.01 * static_cast<double>(scans_)), 0.0}; }

  Polygons polygons_;
  bool with_walker_ = false;
  std::int64_t scans_ = 0;
  Random random_{1};
};

const Eigen::Matrix3d kCovariance = Eigen::Vector3d(9e-6, 9e-6, 1e-6).asDiagonal();

/// From scan to the chains.
void from_scan_to_map(benchmark::State& state) {
  Drive drive(static_cast<int>(state.range(0)));
  PolygonMap map(PolygonMapParams{});
  restore_chains(map, drive.polygons(), 0);
  const PolygonPipelineParams params;
  Scan limited;
  Points points;
  Segments segments;
  Polylines polylines;
  PolygonMapUpdate update;
  Polygons polygons;
  const auto one = [&](const Scan& scan, const Eigen::Isometry3d& T_world_lidar) {
    limited = limit_range(scan, T_world_lidar, params.scan, std::move(limited));
    points = project_horizontally(limited, T_world_lidar, T_world_lidar, std::move(points));
    segments = segment(points, params.segments, std::move(segments));
    polylines = extract_polylines(segments, params.polylines, std::move(polylines));
    update = map.update(polylines, kCovariance, std::move(update));
    make_chains(map, polygons, 0);
  };
  for (int i = 0; i < 100; ++i) {
    const Scan scan = drive.next();
    one(scan, drive.pose());
  }
  for (auto _ : state) {
    state.PauseTiming();
    const Scan scan = drive.next();
    const Eigen::Isometry3d T_world_lidar = drive.pose();
    state.ResumeTiming();
    one(scan, T_world_lidar);
  }
  state.counters["chains"] = static_cast<double>(drive.polygons().chains.size());
  state.counters["elements"] = static_cast<double>(map.elements());
}
BENCHMARK(from_scan_to_map)->Arg(40)->Arg(125)->Arg(250)->Arg(500)->Iterations(500)->Unit(benchmark::kMicrosecond);

/// What a map's user reads after each scan. A map of an older build has one way, that makes all chains anew.
template <class Map>
auto polygons_after_scan(Map& map, Polygons&& memory, int /*preferred*/)
    -> decltype(map.update_due_chains(), map.latest_polygons()) {
  map.update_due_chains();
  return map.latest_polygons(std::move(memory));
}
template <class Map>
Polygons polygons_after_scan(Map& map, Polygons&& memory, long /*older*/) {
  return map.polygons(std::move(memory));
}

/// From scan to chains and objects together.
void from_scan_to_both_maps(benchmark::State& state) {
  Drive drive(static_cast<int>(state.range(0)), true);
  ObjectPipelineParams objects;
  objects.detections.model_folder = SITUATION_AWARENESS_SOURCE_DIR "/models";
  PolygonPipeline pipeline(PolygonPipelineParams{}, objects);
  restore_chains(pipeline.map(), drive.polygons(), 0);
  Polygons polygons;
  const auto one = [&](const Scan& scan, const Eigen::Isometry3d& T_world_lidar) {
    pipeline.process(scan, T_world_lidar, T_world_lidar, kCovariance);
    polygons = polygons_after_scan(pipeline.map(), std::move(polygons), 0);
  };
  for (int i = 0; i < 300; ++i) {
    const Scan scan = drive.next();
    one(scan, drive.pose());
  }
  std::vector<double> times_us;
  int on_movers = 0;
  for (auto _ : state) {
    state.PauseTiming();
    const Scan scan = drive.next();
    const Eigen::Isometry3d T_world_lidar = drive.pose();
    const double begin_us = thread_cpu_us();
    state.ResumeTiming();
    one(scan, T_world_lidar);
    state.PauseTiming();
    times_us.push_back(thread_cpu_us() - begin_us);
    on_movers += pipeline.movers().count() > 0 ? 1 : 0;
    state.ResumeTiming();
  }
  std::sort(times_us.begin(), times_us.end());
  const auto quantile_us = [&](double part) {
    return times_us[static_cast<std::size_t>(part * static_cast<double>(times_us.size() - 1) + 0.5)];
  };
  state.counters["p50_us"] = quantile_us(0.5);
  state.counters["p99_us"] = quantile_us(0.99);
  state.counters["chains"] = static_cast<double>(polygons.chains.size());
  state.counters["elements"] = static_cast<double>(pipeline.map().elements());
  state.counters["objects"] = static_cast<double>(pipeline.objects()->objects.objects.size());
  state.counters["scans_with_movers"] = static_cast<double>(on_movers);
}
BENCHMARK(from_scan_to_both_maps)
    ->Arg(40)
    ->Arg(125)
    ->Arg(250)
    ->Arg(500)
    ->Iterations(1500)
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace situation_awareness
