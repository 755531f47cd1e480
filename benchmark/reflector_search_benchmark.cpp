// SPDX-License-Identifier: BSD-3-Clause
// Processor's time until the first pose of a robot is found by reflectors, without any guess, in halls of all layouts,
// and its growth with the reflectors on the map.
#include <benchmark/benchmark.h>

#include <cstdint>
#include <string>
#include <vector>

#include "measures.hpp"
#include "older_build.hpp"
#include "situation_awareness/pose/reflector_search.hpp"
#include "support/reflector_hall.hpp"
#include "support/thread_cpu.hpp"

namespace situation_awareness {
namespace {

constexpr int kHalls = 21;

void first_pose(benchmark::State& state) {
  for (auto _ : state) {
    std::vector<double> times_us;
    double known = 0.0;
    for (std::uint64_t seed = 1; seed <= kHalls; ++seed) {
      const ReflectorHall hall(seed, static_cast<int>(state.range(0)));
      auto search = search_on<ReflectorSearch>(hall.map, 0);
      const double begin_us = thread_cpu_us();
      const ReflectorPose* pose = &search.find(hall.places);
      while (std::string(pose->reason) == "search not finished") pose = &search.find(hall.places);
      times_us.push_back(thread_cpu_us() - begin_us);
      known += pose->is_known ? 1.0 : 0.0;
    }
    state.counters["p50_us"] = median(times_us);
    state.counters["known"] = known;
  }
}
BENCHMARK(first_pose)->Arg(10)->Arg(100)->Arg(1000)->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace situation_awareness
