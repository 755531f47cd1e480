// SPDX-License-Identifier: BSD-3-Clause
// What an image costs the semantic grid: of 224 x 224 and of 56 x 56 labels over one place, and on lanes of 1.8 km side
// by side, where the map grows and what is in view does not.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "measures.hpp"
#include "situation_awareness/evaluation/grid_scenes.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/pipeline/grid_pipeline.hpp"
#include "support/thread_cpu.hpp"

namespace situation_awareness {
namespace {

constexpr double kLane_m = 1800.0, kBetweenLanes_m = 160.0, kStep_m = 10.0, kUp_m = 25.0;
constexpr int kLanes = 8;
constexpr int kRounds = 8;  ///< of the 40 images of an orbit

PinholeCamera camera_of(int size_px) {
  const double f_px = 0.5 * size_px / std::tan(radians(30.0)), middle_px = 0.5 * (size_px - 1);
  return {size_px, size_px, f_px, f_px, middle_px, middle_px};
}

/// An image costs the map alone so much, and all from labels to targets, from the second round of an orbit on.
void orbit(benchmark::State& state) {
  const auto size_px = static_cast<int>(state.range(0));
  const GridCase given = make_grid_case("orbit", 1);
  std::vector<SoftLabels> labels;
  for (std::size_t i = 0; i < given.T_world_camera.size(); ++i) {
    labels.push_back(labels_of(given, camera_of(size_px), i, 1));
  }
  const auto elevation = std::make_shared<Elevation>(elevation_of(given, 1.0, 1));
  for (auto _ : state) {
    GridMap map(GridMapParams{}, elevation);
    GridPipeline pipeline(GridPipelineParams{}, elevation);
    std::vector<double> map_us, pipeline_us, cells;
    std::int64_t stamp_ns = 0;
    for (int round = 0; round < kRounds; ++round) {
      for (std::size_t i = 0; i < labels.size(); ++i) {
        labels[i].stamp_ns = stamp_ns += 500'000'000;
        const double begin_us = thread_cpu_us();
        const GridUpdate update = map.update(labels[i], given.T_world_camera[i]);
        const double between_us = thread_cpu_us();
        pipeline.process(labels[i], given.T_world_camera[i]);
        const double end_us = thread_cpu_us();
        if (round == 0) continue;
        cells.push_back(static_cast<double>(update.observed_cells));
        map_us.push_back(between_us - begin_us);
        pipeline_us.push_back(end_us - between_us);
      }
    }
    state.counters["update_us"] = median(map_us);
    state.counters["pipeline_us"] = median(pipeline_us);
    state.counters["cells"] = median(cells);
  }
}
BENCHMARK(orbit)->Arg(56)->Arg(112)->Arg(224)->Iterations(1)->Unit(benchmark::kMillisecond);

double ground_m(double x_m, double y_m) { return 3.0 * std::sin(x_m / 90.0) + 2.0 * std::cos(y_m / 70.0); }

Elevation relief() {
  constexpr double kPixel_m = 4.0, kBeside_m = 300.0;
  const int width = static_cast<int>((kLane_m + 2.0 * kBeside_m) / kPixel_m);
  const int height = static_cast<int>((kLanes * kBetweenLanes_m + 2.0 * kBeside_m) / kPixel_m);
  const double north_m = height * kPixel_m - kBeside_m;
  std::vector<float> heights_m;
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      heights_m.push_back(
          static_cast<float>(ground_m(-kBeside_m + (column + 0.5) * kPixel_m, north_m - (row + 0.5) * kPixel_m)));
    }
  }
  return {width, height, {-kBeside_m, north_m}, {kPixel_m, kPixel_m}, std::move(heights_m)};
}

/// The pixels of the box around each car's corners in the image: no more is asked of labels here.
SoftLabels labels_of_cars(const std::vector<Eigen::Vector2d>& cars_m, const PinholeCamera& camera,
                          const Eigen::Isometry3d& T_world_camera) {
  SoftLabels labels;
  labels.camera = camera;
  labels.probability.assign(static_cast<std::size_t>(camera.width * camera.height), 0.0F);
  const Eigen::Isometry3d T_camera_world = T_world_camera.inverse();
  for (const Eigen::Vector2d& car_m : cars_m) {
    if ((car_m - T_world_camera.translation().head<2>()).norm() > 150.0) continue;
    Eigen::Array2d least = Eigen::Array2d::Constant(1e9), greatest = -least;
    bool is_ahead = true;
    for (int corner = 0; corner < 8; ++corner) {
      const double x_m = car_m.x() + (corner % 2 == 0 ? -2.2 : 2.2),
                   y_m = car_m.y() + (corner / 2 % 2 == 0 ? -0.9 : 0.9);
      const Eigen::Vector3d p =
          T_camera_world * Eigen::Vector3d(x_m, y_m, ground_m(car_m.x(), car_m.y()) + (corner < 4 ? 0.0 : 1.5));
      is_ahead = is_ahead && p.z() > 1.0;
      const Eigen::Array2d at(camera.fx_px * p.x() / p.z() + camera.cx_px, camera.fy_px * p.y() / p.z() + camera.cy_px);
      least = least.min(at);
      greatest = greatest.max(at);
    }
    if (!is_ahead) continue;
    for (int v = std::max(0, static_cast<int>(std::lround(least.y()))); v <= greatest.y() && v < camera.height; ++v) {
      for (int u = std::max(0, static_cast<int>(std::lround(least.x()))); u <= greatest.x() && u < camera.width; ++u) {
        labels.probability[static_cast<std::size_t>(v * camera.width + u)] = 1.0F;
      }
    }
  }
  return labels;
}

/// Lanes to and fro over cars, two in each hundred metres of a lane.
void lanes(benchmark::State& state) {
  std::vector<Eigen::Vector2d> cars_m;
  for (int lane = 0; lane < kLanes; ++lane) {
    for (int i = 0; i < 36; ++i) {
      cars_m.emplace_back(50.0 * i + 7.0 * (i % 5), lane * kBetweenLanes_m + 23.0 * ((i + lane) % 5 - 2));
    }
  }
  const PinholeCamera camera = camera_of(112);
  for (auto _ : state) {
    const std::int64_t without_bytes = memory().heap_bytes;
    GridPipeline pipeline(GridPipelineParams{}, std::make_shared<Elevation>(relief()));
    std::int64_t stamp_ns = 0;
    std::vector<double> lane_us, lane_MB;
    for (int lane = 0; lane < kLanes; ++lane) {
      std::vector<double> image_us;
      std::int64_t most_bytes = 0;
      for (double along_m = 0.0; along_m <= kLane_m; along_m += kStep_m) {
        const bool is_to = lane % 2 == 0;
        const Eigen::Vector2d p_m(is_to ? along_m : kLane_m - along_m, lane * kBetweenLanes_m);
        const Eigen::Isometry3d T = camera_pose({p_m.x(), p_m.y(), ground_m(p_m.x(), p_m.y()) + kUp_m},
                                                is_to ? 0.0 : radians(180.0), radians(-25.0));
        SoftLabels labels = labels_of_cars(cars_m, camera, T);
        labels.stamp_ns = stamp_ns += 500'000'000;
        const double begin_us = thread_cpu_us();
        pipeline.process(labels, T);
        image_us.push_back(thread_cpu_us() - begin_us);
        most_bytes = std::max(most_bytes, memory().heap_bytes - without_bytes);
      }
      lane_us.push_back(std::accumulate(image_us.begin(), image_us.end(), 0.0) / static_cast<double>(image_us.size()));
      lane_MB.push_back(1e-6 * static_cast<double>(most_bytes));
      state.counters["lane_" + std::to_string(lane + 1) + "_us"] = lane_us.back();
      state.counters["lane_" + std::to_string(lane + 1) + "_MB"] = lane_MB.back();
    }
    state.counters["time_growth"] = lane_us.back() / lane_us.front();
    state.counters["memory_growth"] = lane_MB.back() / lane_MB.front();
    state.counters["targets"] = static_cast<double>(pipeline.targets().targets.size());
  }
}
BENCHMARK(lanes)->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace situation_awareness
