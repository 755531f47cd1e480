// SPDX-License-Identifier: BSD-3-Clause
// Cost of the pose by GPS and INS, once it is ready: of a sample of the IMU at 200 Hz, of a fix at 5 Hz that comes at
// once or 0.2 s late, and of the pose.
#include <benchmark/benchmark.h>

#include <cstddef>
#include <utility>
#include <vector>

#include "pose/gps_ins_flight.hpp"

namespace situation_awareness {
namespace {

/// A flight that has gone on for a minute, and then goes on between the measurements.
struct Flight {
  Flight() : run({}, {}, 1), ins({}, {}) {
    while (run.time_s() < 60.0) {
      add_sample();
      for (const auto& [stamp_ns, fix] : fixes) ins.add_position(stamp_ns, fix, run.fix_covariance());
      fixes.clear();
    }
  }

  void add_sample() {
    ins.add_imu(run.sample());
    take_fix();
  }
  void take_fix() {
    if (run.has_fix()) fixes.emplace_back(run.stamp_ns(), run.fix());
    run.next();
  }

  FlightRun run;
  GpsIns ins;
  std::vector<std::pair<std::int64_t, Eigen::Vector3d>> fixes;  ///< not added yet
};

void imu(benchmark::State& state) {
  Flight flight;
  for (auto _ : state) {
    state.PauseTiming();
    const InertialSample sample = flight.run.sample();
    state.ResumeTiming();
    flight.ins.add_imu(sample);
    state.PauseTiming();
    flight.take_fix();
    for (const auto& [stamp_ns, fix] : flight.fixes)
      flight.ins.add_position(stamp_ns, fix, flight.run.fix_covariance());
    flight.fixes.clear();
    state.ResumeTiming();
  }
}

/// state.range(0): samples of the IMU that come before the fix.
void fix(benchmark::State& state) {
  Flight flight;
  for (auto _ : state) {
    state.PauseTiming();
    while (flight.fixes.empty()) flight.add_sample();
    for (int i = 0; i < state.range(0); ++i) flight.add_sample();
    const auto [stamp_ns, fix] = flight.fixes.front();
    flight.fixes.erase(flight.fixes.begin());
    state.ResumeTiming();
    flight.ins.add_position(stamp_ns, fix, flight.run.fix_covariance());
  }
}

void pose(benchmark::State& state) {
  const Flight flight;
  for (auto _ : state) benchmark::DoNotOptimize(flight.ins.pose().T_world_base);
}

BENCHMARK(imu)->Unit(benchmark::kMicrosecond);
BENCHMARK(fix)->Arg(0)->Arg(39)->Unit(benchmark::kMicrosecond);
BENCHMARK(pose)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace situation_awareness
