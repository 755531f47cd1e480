// SPDX-License-Identifier: BSD-3-Clause
// Time per Dubins path, of random poses in a box of a half width of 4 and 30 radii: both headings given, with equal and
// unequal radii, and the last one free.
#include <benchmark/benchmark.h>

#include <cstddef>
#include <utility>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/path/dubins.hpp"

namespace situation_awareness {
namespace {

void shortest(benchmark::State& state, double radius_to_m, bool free_end) {
  const auto size_m = static_cast<double>(state.range(0));
  Random random(1);
  std::vector<std::pair<DubinsEnd, DubinsEnd>> cases(4096);
  for (auto& [from, to] : cases) {
    for (DubinsEnd* end : {&from, &to}) {
      end->p_m.x() = random.uniform(-size_m, size_m);
      end->p_m.y() = random.uniform(-size_m, size_m);
      end->yaw_rad = random.uniform(-kPi, kPi);
    }
    to.radius_m = radius_to_m;
    if (free_end) to.yaw_rad.reset();
  }
  std::size_t i = 0;
  for (auto _ : state) {
    const auto& [from, to] = cases[i++ % cases.size()];
    benchmark::DoNotOptimize(shortest_dubins_path(from, to));
  }
}

BENCHMARK_CAPTURE(shortest, equal_radii, 1.0, false)->Arg(4)->Arg(30);
BENCHMARK_CAPTURE(shortest, unequal_radii, 2.0, false)->Arg(4)->Arg(30);
BENCHMARK_CAPTURE(shortest, free_end, 1.0, true)->Arg(4)->Arg(30);
BENCHMARK_CAPTURE(shortest, free_end_unequal_radii, 2.0, true)->Arg(4)->Arg(30);

}  // namespace
}  // namespace situation_awareness
