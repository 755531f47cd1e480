// SPDX-License-Identifier: BSD-3-Clause
// Cost of localisation by reflectors for a scan of 541 beams: of the filter alone, and from the scan on. The robot
// drives a figure of eight in a room with a number of reflectors around it, with odometry at 50 Hz.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "pose/reflector_world.hpp"
#include "situation_awareness/pipeline/localization_pipeline.hpp"

namespace situation_awareness {
namespace {

constexpr int kScans = 500;
constexpr double kPeriod_s = 0.04;

/// Scans and odometry of a drive, which is driven again and again at later stamps.
class Drive {
 public:
  explicit Drive(int reflectors) {
    for (int i = 0; i < reflectors; ++i) {
      const double angle_rad = 2.0 * kPi * i / reflectors + 0.3 * std::sin(5.0 * i);
      const double range_m = 3.6 + 0.5 * std::cos(3.0 * i);
      map.reflectors.push_back({{range_m * std::cos(angle_rad), range_m * std::sin(angle_rad)}, 0.05});
    }
    ReflectorWorld world;
    world.add_room({-5.5, -4.5}, {5.5, 4.5});
    world.add(map);
    world.path = winding_path(0.5);
    world.sweep_s = 0.03;
    Random random(1);
    for (int i = 0; i < kScans; ++i) scans_.push_back(world.scan(stamp_s(i), random));
    DriftingWheels wheels(world.path, 1);
    while (wheels.next_time_s() < stamp_s(kScans)) odometry_.push_back(wheels.next());
  }

  /// The next scan; its odometry is added before.
  template <class Localization>
  const Scan& next(Localization& localization) {
    if (scan_ == scans_.size()) {
      scan_ = next_odometry_ = 0;
      localization.localization().relocate();
      begin_ns_ += nanoseconds(stamp_s(kScans) + 1.0);
    }
    now_ = scans_[scan_];
    now_.stamp_ns = begin_ns_ + nanoseconds(stamp_s(static_cast<int>(scan_)));
    ++scan_;
    while (next_odometry_ < odometry_.size() &&
           begin_ns_ + odometry_[next_odometry_].first < now_.stamp_ns + nanoseconds(0.045)) {
      const auto& [stamp_ns, T_odom_base] = odometry_[next_odometry_++];
      localization.add_odometry(begin_ns_ + stamp_ns, T_odom_base);
    }
    return now_;
  }

  ReflectorMap map;

 private:
  static double stamp_s(int scan) { return 0.1 + kPeriod_s * scan; }

  std::vector<Scan> scans_;
  std::vector<std::pair<std::int64_t, Pose2>> odometry_;
  std::size_t scan_ = 0, next_odometry_ = 0;
  std::int64_t begin_ns_ = 0;
  Scan now_;
};

void from_scan(benchmark::State& state) {
  Drive drive(static_cast<int>(state.range(0)));
  LocalizationPipeline pipeline(drive.map, {}, {});
  for (auto _ : state) {
    state.PauseTiming();
    const Scan& scan = drive.next(pipeline);
    state.ResumeTiming();
    benchmark::DoNotOptimize(pipeline.process(scan, Eigen::Isometry3d::Identity()).is_known);
  }
}

/// The filter alone, with what was sighted before.
void filter(benchmark::State& state) {
  struct Filter {
    explicit Filter(const ReflectorMap& map) : localization_(map, {}) {}
    void add_odometry(std::int64_t stamp_ns, const Pose2& T_odom_base) {
      localization_.add_odometry(stamp_ns, T_odom_base);
    }
    ReflectorLocalization& localization() { return localization_; }
    ReflectorLocalization localization_;
  };
  Drive drive(static_cast<int>(state.range(0)));
  Filter of(drive.map);
  ReflectorSightings sightings;
  double matches = 0.0;
  for (auto _ : state) {
    state.PauseTiming();
    const Points points = project_horizontally(drive.next(of), Eigen::Isometry3d::Identity());
    sightings = detect_reflectors(points, {}, std::move(sightings));
    state.ResumeTiming();
    matches += static_cast<double>(of.localization().update(sightings, {}).matches.size());
  }
  state.counters["matches"] = matches / static_cast<double>(state.iterations());
}

BENCHMARK(filter)->Arg(3)->Arg(5)->Arg(8)->Arg(16)->Unit(benchmark::kMicrosecond);
BENCHMARK(from_scan)->Arg(3)->Arg(5)->Arg(8)->Arg(16)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace situation_awareness
