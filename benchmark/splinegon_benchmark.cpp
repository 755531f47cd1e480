// SPDX-License-Identifier: BSD-3-Clause
// Time of one fit of a splinegon to 500 elements, from nothing and from the fit before, of a smooth outline and a box.
#include <benchmark/benchmark.h>

#include <cmath>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/splinegons/splinegon_fit.hpp"

namespace situation_awareness {
namespace {

constexpr int kElements = 500;
constexpr double kSigma_m = 0.015;

SplinegonElement element_at(const Eigen::Vector2d& p_m, const Eigen::Vector2d& normal, Random& random) {
  return {p_m + kSigma_m * random.normal() * normal, normal, kSigma_m * kSigma_m};
}

std::vector<SplinegonElement> lobes(Random& random) {
  std::vector<SplinegonElement> elements;
  for (int i = 0; i < kElements; ++i) {
    const double phi = 2.0 * kPi * i / kElements, r_m = 7.5 + 2.0 * std::cos(3.0 * phi);
    const Eigen::Vector2d outward(std::cos(phi), std::sin(phi)), left(-outward.y(), outward.x());
    const Eigen::Vector2d normal = (r_m * outward + 6.0 * std::sin(3.0 * phi) * left).normalized();
    elements.push_back(element_at(r_m * outward, normal, random));
  }
  return elements;
}

std::vector<SplinegonElement> box(Random& random) {
  std::vector<SplinegonElement> elements;
  for (int i = 0; i < kElements; ++i) {
    const double way_m = 38.0 * (i + 0.5) / kElements;
    if (way_m < 12.0)
      elements.push_back(element_at({-6.0 + way_m, -3.5}, {0.0, -1.0}, random));
    else if (way_m < 19.0)
      elements.push_back(element_at({6.0, -3.5 + (way_m - 12.0)}, {1.0, 0.0}, random));
    else if (way_m < 31.0)
      elements.push_back(element_at({6.0 - (way_m - 19.0), 3.5}, {0.0, 1.0}, random));
    else
      elements.push_back(element_at({-6.0, 3.5 - (way_m - 31.0)}, {-1.0, 0.0}, random));
  }
  return elements;
}

void fit(benchmark::State& state, std::vector<SplinegonElement> (*elements_of)(Random&), bool warm) {
  SplinegonFitParams params;
  params.vertices = static_cast<int>(state.range(0));
  SplinegonFit fit(params);
  Random random(1);
  const std::vector<SplinegonElement> before = elements_of(random), elements = elements_of(random);
  std::vector<SplinegonVertex> known, vertices;
  if (warm) fit.fit(before, true, 0.0, known);
  for (auto _ : state) {
    vertices = known;
    benchmark::DoNotOptimize(fit.fit(elements, true, 0.0, vertices));
  }
}

BENCHMARK_CAPTURE(fit, lobes_warm, lobes, true)->Arg(16)->Arg(20);
BENCHMARK_CAPTURE(fit, lobes, lobes, false)->Arg(16)->Arg(20);
BENCHMARK_CAPTURE(fit, box_warm, box, true)->Arg(16)->Arg(20);
BENCHMARK_CAPTURE(fit, box, box, false)->Arg(16)->Arg(20);

}  // namespace
}  // namespace situation_awareness
