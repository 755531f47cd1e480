// SPDX-License-Identifier: BSD-3-Clause
// Time of one fit of a splinegon to 500 elements, from nothing and from the fit before, of a smooth outline and a box;
// and processor's time of a scan by inertial navigation, minute by minute, on a circle around an obstacle.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstddef>
#include <numeric>
#include <string>
#include <vector>

#include "measures.hpp"
#include "older_build.hpp"
#include "pipeline/circling_flight.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/splinegons/splinegon_fit.hpp"
#include "situation_awareness/pipeline/splinegon_pipeline.hpp"
#include "support/thread_cpu.hpp"

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

std::vector<SplinegonElement> sides(Random& random) {
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

/// 12 m x 7 m, with pilasters of 1 m every 3 m that stand out by 0.5 m.
Outline box_with_pilasters() {
  Outline outline;
  const Outline wall = box(12.0, 7.0);
  for (std::size_t i = 0; i < wall.size(); ++i) {
    const Eigen::Vector2d edge_m = wall[(i + 1) % wall.size()] - wall[i], u = edge_m.normalized(), out(u.y(), -u.x());
    outline.push_back(wall[i]);
    for (double at_m = 1.5; at_m < edge_m.norm() - 1.0; at_m += 3.0) {
      const Eigen::Vector2d from_m = wall[i] + (at_m - 0.5) * u, to_m = from_m + u;
      outline.insert(outline.end(), {from_m, from_m + 0.5 * out, to_m + 0.5 * out, to_m});
    }
  }
  return outline;
}

struct Obstacle {
  Outline outline;
  int movers;
};

/// Odom is of a gyroscope and accelerations that are a little wrong.
void by_inertial_navigation(benchmark::State& state, const Obstacle& obstacle) {
  constexpr double kFor_s = 360.0, kYawRateError_rad_s = 0.002;
  constexpr int kSteps = 20;  // of odom from a scan to the next
  const std::string path = std::string(SITUATION_AWARENESS_SOURCE_DIR) + "/cfg/splinegons.yaml";
  const auto params =
      params_from_yaml<SplinegonPipelineParams>(read_text_file(path), path, [](const UnknownKey& /*key*/) {});
  const Eigen::Vector2d velocity_error_m_s(0.4, -0.5);
  const Eigen::Vector2d a_level_m_s2(0.05, Flight::kSpeed_m_s * Flight::kSpeed_m_s / Flight::kRadius_m - 0.05);
  const auto yaw_rad = [&](double t_s) { return Flight::pose2_at(t_s).yaw_rad + kYawRateError_rad_s * t_s; };
  const auto velocity_m_s = [](double t_s) -> Eigen::Vector2d {
    return Flight::pose2_at(t_s).rotation() * Eigen::Vector2d(Flight::kSpeed_m_s, 0.0);
  };
  for (auto _ : state) {
    Flight flight(obstacle.outline);
    flight.add_movers(obstacle.movers);
    SplinegonPipeline pipeline(params);
    std::vector<std::vector<double>> minutes_us;
    Eigen::Vector2d p_odom_m = Flight::pose2_at(0.0).translation_m, v_odom_m_s = velocity_m_s(0.0) + velocity_error_m_s;
    for (double t_s = 0.0; t_s < kFor_s; t_s += Flight::kPeriod_s) {
      const Scan scan = flight.scan_at(t_s);
      const Pose2 begin{p_odom_m, yaw_rad(t_s)};
      const Pose2 end{p_odom_m + Flight::kSweep_s * v_odom_m_s, yaw_rad(t_s + Flight::kSweep_s)};
      InertialPlacement placement;
      placement.T_world_odom = Flight::pose2_at(t_s) * inverse(begin);
      placement.pose_covariance = Eigen::Vector3d(1.0, 1.0, 0.0025).asDiagonal();
      placement.v_odom_m_s = v_odom_m_s;
      placement.v_world_m_s = velocity_m_s(t_s) + velocity_error_m_s;
      placement.velocity_sigma_m_s = 0.7;
      const double before_us = thread_cpu_us();
      benchmark::DoNotOptimize(pipeline.process(scan, Flight::banked(begin), Flight::banked(end), placement));
      const double scan_us = thread_cpu_us() - before_us;
      if (t_s >= 60.0 * static_cast<double>(minutes_us.size())) minutes_us.emplace_back();
      minutes_us.back().push_back(scan_us);
      for (int i = 0; i < kSteps; ++i) {
        const double dt_s = Flight::kPeriod_s / kSteps;
        const Eigen::Vector2d a_m_s2 =
            Pose2{Eigen::Vector2d::Zero(), yaw_rad(t_s + (i + 0.5) * dt_s)}.rotation() * a_level_m_s2;
        p_odom_m += dt_s * v_odom_m_s + 0.5 * dt_s * dt_s * a_m_s2;
        v_odom_m_s += dt_s * a_m_s2;
      }
    }
    // Half of the scans have a chain that is due, and take three times as long as the others: the median is of one or
    // of the other half by chance. In the first minute the vehicle has not seen all of the outline for 20 s.
    for (std::size_t i = 1; i < minutes_us.size(); ++i) {
      const std::vector<double>& minute_us = minutes_us[i];
      state.counters["minute_" + std::to_string(i + 1) + "_us"] =
          std::accumulate(minute_us.begin(), minute_us.end(), 0.0) / static_cast<double>(minute_us.size());
    }
    state.counters["boundaries"] = static_cast<double>(pipeline.splinegons().boundaries.size());
  }
}

void fit(benchmark::State& state, std::vector<SplinegonElement> (*elements_of)(Random&), bool warm) {
  SplinegonFitParams params;
  params.vertices = static_cast<int>(state.range(0));
  SplinegonFit fit(params);
  Random random(1);
  const std::vector<SplinegonElement> before = elements_of(random), elements = elements_of(random);
  std::vector<SplinegonVertex> known, vertices;
  if (warm) fit_closed(fit, before, known, 0);
  for (auto _ : state) {
    vertices = known;
    benchmark::DoNotOptimize(fit_closed(fit, elements, vertices, 0));
  }
}

BENCHMARK_CAPTURE(fit, lobes_warm, lobes, true)->Arg(16)->Arg(20);
BENCHMARK_CAPTURE(fit, lobes, lobes, false)->Arg(16)->Arg(20);
BENCHMARK_CAPTURE(fit, box_warm, sides, true)->Arg(16)->Arg(20);
BENCHMARK_CAPTURE(fit, box, sides, false)->Arg(16)->Arg(20);
BENCHMARK_CAPTURE(by_inertial_navigation, movers, Obstacle{box(12.0, 7.0), 6})
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(by_inertial_navigation, ellipse, Obstacle{ellipse({10.0, 6.0}), 0})
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(by_inertial_navigation, pilasters, Obstacle{box_with_pilasters(), 0})
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace situation_awareness
