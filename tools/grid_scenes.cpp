// SPDX-License-Identifier: BSD-3-Clause
// Semantic grids of analytic scenes against their truth.
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
#include "situation_awareness/map/grid/grid_map.hpp"

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
      double overlap = 0.0, shadow = 0.0, time_ms = 0.0, offset_m = 0.0;
      std::size_t images = 0;
      for (std::uint32_t seed = 1; seed <= seeds; ++seed) {
        const GridCase given = make_grid_case(name, seed);
        const double f = 0.5 * size / std::tan(radians(30.0));
        const PinholeCamera camera{size, size, f, f, 0.5 * (size - 1), 0.5 * (size - 1)};
        GridMap map(GridMapParams{}, std::make_shared<Elevation>(elevation_of(given, 1.0, seed)));
        for (std::size_t i = 0; i < given.T_world_camera.size(); ++i) {
          const SoftLabels labels = labels_of(given, camera, i, seed);
          const auto begin = std::chrono::steady_clock::now();
          map.update(labels, given_pose(given, i, seed));
          time_ms += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
          ++images;
        }
        const GridScore found = score(given, map.grid());
        overlap += found.intersection_over_union / seeds;
        shadow += found.shadow_share / seeds;
        offset_m += map.elevation_offset_m() / seeds;
      }
      std::printf("%-16s %4d  IoU %.3f  shadow %.3f  offset %5.2f  %6.2f ms\n", name.c_str(), size, overlap, shadow,
                  offset_m, time_ms / static_cast<double>(images));
      std::fflush(stdout);
    }
  }
}
