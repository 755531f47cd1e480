// SPDX-License-Identifier: BSD-3-Clause
// What one core can do at most: multiplications and additions in its vector registers, and bytes read and written that
// are in its caches. It is what scripts/evaluate speed compares the maps with.
#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

namespace situation_awareness {
namespace {

// The widest registers that the processor has, whatever the package is compiled for.
#if defined(__x86_64__)
#define WIDEST_REGISTERS __attribute__((target_clones("avx512f", "arch=haswell", "default")))
#else
#define WIDEST_REGISTERS
#endif

constexpr int kLanes = 8, kSums = 12;  // as many sums at once as hide the latency of one
constexpr int kTimes = 1000;
using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));

WIDEST_REGISTERS void multiply_and_add(Lanes (&sums)[kSums], double factor, double term) {
  for (int i = 0; i < kTimes; ++i) {
    for (Lanes& sum : sums) sum = sum * factor + term;
  }
}

void floating_point(benchmark::State& state) {
  Lanes sums[kSums] = {};
  double factor = 0.999, term = 0.001;
  for (auto _ : state) {
    benchmark::DoNotOptimize(factor);
    benchmark::DoNotOptimize(term);
    multiply_and_add(sums, factor, term);
    benchmark::DoNotOptimize(sums);
  }
  state.counters["operations_per_us"] = benchmark::Counter(
      1e-6 * 2.0 * kTimes * kSums * kLanes * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK(floating_point);

/// Of 128 KiB, which the second cache holds with its copy.
void copy(benchmark::State& state) {
  constexpr std::size_t kBytes = 128 * 1024;
  const std::vector<std::uint8_t> from(kBytes, 1);
  std::vector<std::uint8_t> to(kBytes);
  for (auto _ : state) {
    std::memcpy(to.data(), from.data(), kBytes);
    benchmark::DoNotOptimize(to.data());
    benchmark::ClobberMemory();
  }
  state.counters["bytes_per_us"] =
      benchmark::Counter(1e-6 * 2.0 * kBytes * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK(copy);

}  // namespace
}  // namespace situation_awareness
