// SPDX-License-Identifier: BSD-3-Clause
// Semantic grids of analytic scenes against their truth.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "situation_awareness/evaluation/grid_scenes.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/pipeline/grid_pipeline.hpp"

int main(int argc, char** argv) {
  using namespace situation_awareness;
  CLI::App app("Semantic grids of analytic scenes against their truth", "grid_scenes");
  std::vector<std::string> names = grid_case_names();
  std::vector<int> sizes{224, 112, 56};
  std::uint32_t seeds = 4;
  app.add_option("--scenes", names, "their names");
  app.add_option("--sizes", sizes, "pixels across the label images");
  app.add_option("--seeds", seeds, "number of seeds, from 1 on");
  CLI11_PARSE(app, argc, argv);
  for (const std::string& name : names) {
    for (const int size : sizes) {
      double overlap = 0.0, shadow = 0.0, time_ms = 0.0, offset_m = 0.0, distance_m = 0.0, inside = 0.0;
      int missed = 0, wrong = 0;
      std::uint64_t ids = 0;
      std::size_t images = 0;
      for (std::uint32_t seed = 1; seed <= seeds; ++seed) {
        const GridCase given = make_grid_case(name, seed);
        const double f = 0.5 * size / std::tan(radians(30.0));
        const PinholeCamera camera{size, size, f, f, 0.5 * (size - 1), 0.5 * (size - 1)};
        GridPipeline pipeline(GridPipelineParams{}, std::make_shared<Elevation>(elevation_of(given, 1.0, seed)));
        for (std::size_t i = 0; i < given.T_world_camera.size(); ++i) {
          const SoftLabels labels = labels_of(given, camera, i, seed);
          const auto begin = std::chrono::steady_clock::now();
          pipeline.process(labels, given_pose(given, i, seed));
          time_ms += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
          ++images;
        }
        const GridScore found = score(given, pipeline.map().grid());
        const TargetScore targets = score(given, pipeline.targets());
        missed += targets.missed;
        wrong += targets.wrong;
        distance_m += targets.mean_distance_m / seeds;
        inside += targets.in_regions / seeds;
        for (const GridTarget& target : pipeline.targets().targets) ids = std::max(ids, target.id);
        overlap += found.intersection_over_union / seeds;
        shadow += found.shadow_share / seeds;
        offset_m += pipeline.map().elevation_offset_m() / seeds;
      }
      std::printf(
          "%-16s %4d  IoU %.3f  shadow %.3f  offset %5.2f  missed %d  wrong %d  centroid %.2f m  in 99 %% %.2f  "
          "greatest id %llu  %.2f ms\n",
          name.c_str(), size, overlap, shadow, offset_m, missed, wrong, distance_m, inside,
          static_cast<unsigned long long>(ids), time_ms / static_cast<double>(images));
      std::fflush(stdout);
    }
  }
}
