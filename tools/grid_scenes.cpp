// SPDX-License-Identifier: BSD-3-Clause
// Semantic grids of analytic scenes against their truth, or what a camera sees of these scenes.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "situation_awareness/evaluation/grid_scenes.hpp"
#include "situation_awareness/evaluation/paper_grid.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/grid/geotiff.hpp"
#include "situation_awareness/pipeline/grid_pipeline.hpp"

namespace situation_awareness {
namespace {

constexpr double kElevationPixel_m = 1.0;

PinholeCamera camera_of(int size) {
  const double f = 0.5 * size / std::tan(radians(30.0));
  return {size, size, f, f, 0.5 * (size - 1), 0.5 * (size - 1)};
}

/// Sums over seeds.
struct Result {
  double overlap = 0.0, shadow = 0.0, offset_m = 0.0, distance_m = 0.0, time_ms = 0.0;
  int cars = 0, missed = 0, wrong = 0, inside = 0, seeds = 0;
  std::size_t images = 0;
};

/// By the paper's grid, which has no targets. Returns the grid.
SemanticGrid add_paper_run(Result& result, PaperGridMethod method, const GridCase& given, const PinholeCamera& camera,
                           std::uint32_t seed) {
  PaperGrid paper(method, std::make_shared<Elevation>(elevation_of(given, kElevationPixel_m, seed)));
  for (std::size_t i = 0; i < given.T_world_camera.size(); ++i) {
    const SoftLabels labels = labels_of(given, camera, i, seed);
    const auto begin = std::chrono::steady_clock::now();
    paper.update(labels, given_pose(given, i, seed));
    result.time_ms += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    ++result.images;
  }
  SemanticGrid grid = paper.grid();
  const GridScore cells = score(given, grid);
  result.overlap += cells.intersection_over_union;
  result.shadow += cells.shadow_share;
  ++result.seeds;
  return grid;
}

/// Returns the grid.
SemanticGrid add_run(Result& result, const GridCase& given, const PinholeCamera& camera, std::uint32_t seed) {
  GridPipeline pipeline(GridPipelineParams{},
                        std::make_shared<Elevation>(elevation_of(given, kElevationPixel_m, seed)));
  for (std::size_t i = 0; i < given.T_world_camera.size(); ++i) {
    const SoftLabels labels = labels_of(given, camera, i, seed);
    const auto begin = std::chrono::steady_clock::now();
    pipeline.process(labels, given_pose(given, i, seed), given_covariance(given));
    result.time_ms += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    ++result.images;
  }
  SemanticGrid grid = pipeline.map().grid();
  const GridScore cells = score(given, grid);
  const TargetScore targets = score(given, pipeline.targets());
  result.overlap += cells.intersection_over_union;
  result.shadow += cells.shadow_share;
  result.offset_m += pipeline.map().elevation_offset_m();
  result.cars += targets.cars;
  result.missed += targets.missed;
  result.wrong += targets.wrong;
  result.inside += targets.inside;
  result.distance_m += targets.distance_sum_m;
  ++result.seeds;
  return grid;
}

void print(const std::string& name, int size, const std::string& method, const Result& result, bool as_json) {
  const double n = result.seeds;
  const int found = result.cars - result.missed;
  const double centroid_m = found > 0 ? result.distance_m / found : std::numeric_limits<double>::quiet_NaN();
  const nlohmann::json line{{"scene", name},
                            {"size_px", size},
                            {"method", method},
                            {"seeds", result.seeds},
                            {"iou", result.overlap / n},
                            {"shadow", result.shadow / n},
                            {"offset_m", result.offset_m / n},
                            {"cars", result.cars},
                            {"missed", result.missed},
                            {"wrong", result.wrong},
                            {"centroid_m", centroid_m},  // null where none was found
                            {"inside", result.inside},
                            {"time_ms", result.time_ms / static_cast<double>(result.images)}};
  if (as_json) {
    std::printf("%s\n", line.dump().c_str());
  } else {
    std::printf(
        "%-14s %4d  IoU %.3f  shadow %.3f  offset %5.2f m  missed %d of %d  wrong %d  centroid %.2f m  in 99 %% %d  "
        "%.2f ms\n",
        name.c_str(), size, result.overlap / n, result.shadow / n, result.offset_m / n, result.missed, result.cars,
        result.wrong, centroid_m, result.inside, result.time_ms / static_cast<double>(result.images));
  }
  std::fflush(stdout);
}

nlohmann::json json_of(const Eigen::Isometry3d& T) {
  const Eigen::Quaterniond q(T.linear());
  return {T.translation().x(), T.translation().y(), T.translation().z(), q.x(), q.y(), q.z(), q.w()};
}

nlohmann::json json_of(const std::vector<SceneBox>& boxes) {
  nlohmann::json all = nlohmann::json::array();
  for (const SceneBox& box : boxes) {
    all.push_back({{"x", box.T_world_box.translation_m.x()},
                   {"y", box.T_world_box.translation_m.y()},
                   {"yaw", box.T_world_box.yaw_rad},
                   {"bottom", box.bottom_m},
                   {"size", {box.size_m.x(), box.size_m.y(), box.size_m.z()}}});
  }
  return all;
}

/// FOLDER/NAME_SIZE_SEED/: dem.tif, case.json, and labels.f32 with the images one behind the other, rows from the top.
void write(const std::filesystem::path& folder, const GridCase& given, const PinholeCamera& camera,
           std::uint32_t seed) {
  const std::filesystem::path path =
      folder / (given.name + '_' + std::to_string(camera.width) + '_' + std::to_string(seed));
  std::filesystem::create_directories(path);
  elevation_of(given, kElevationPixel_m, seed).save((path / "dem.tif").string());
  std::ofstream pixels(path / "labels.f32", std::ios::binary);
  nlohmann::json images = nlohmann::json::array(), cars = nlohmann::json::array();
  for (std::size_t i = 0; i < given.T_world_camera.size(); ++i) {
    const SoftLabels labels = labels_of(given, camera, i, seed);
    pixels.write(reinterpret_cast<const char*>(labels.probability.data()),
                 static_cast<std::streamsize>(labels.probability.size() * sizeof(float)));
    images.push_back({{"stamp_ns", labels.stamp_ns},
                      {"pose", json_of(given_pose(given, i, seed))},
                      {"true_pose", json_of(given.T_world_camera[i])}});
  }
  for (const SceneCar& car : given.scene.cars) {
    const Eigen::Vector2d p_m = car.T_world_car.translation_m;
    cars.push_back({{"x", p_m.x()},
                    {"y", p_m.y()},
                    {"z", given.scene.ground(p_m.x(), p_m.y())},
                    {"yaw", car.T_world_car.yaw_rad},
                    {"size", {car.size_m.x(), car.size_m.y(), car.size_m.z()}}});
  }
  nlohmann::json trees = nlohmann::json::array();
  for (const SceneTree& tree : given.scene.trees) {
    trees.push_back({{"x", tree.p_world_m.x()}, {"y", tree.p_world_m.y()}, {"radius", tree.radius_m}});
  }
  const nlohmann::json all{{"width", camera.width},
                           {"height", camera.height},
                           {"fx", camera.fx_px},
                           {"fy", camera.fy_px},
                           {"cx", camera.cx_px},
                           {"cy", camera.cy_px},
                           {"images", images},
                           {"cars", cars},
                           {"trees", trees},
                           {"houses", json_of(given.scene.houses)},
                           {"signs", json_of(given.scene.signs)},
                           {"hidden_cars", given.hidden_cars}};
  std::ofstream file(path / "case.json");
  file << all.dump(1) << '\n';
  if (!pixels || !file) throw std::runtime_error(path.string() + ": cannot be written");
}

struct Options {
  std::vector<std::string> scenes = grid_case_names();
  std::vector<int> sizes{224, 112, 56};
  std::uint32_t first_seed = 1, seeds = 4;
  std::string folder, grids, method = "ours";
  bool json = false;
};

void run(const Options& options) {
  for (const std::string& name : options.scenes) {
    for (const int size : options.sizes) {
      Result result;
      for (std::uint32_t i = 0; i < options.seeds; ++i) {
        const std::uint32_t seed = options.first_seed + i;
        const GridCase given = make_grid_case(name, seed);
        if (!options.folder.empty()) {
          write(options.folder, given, camera_of(size), seed);
          continue;
        }
        const SemanticGrid grid = options.method == "ours" ? add_run(result, given, camera_of(size), seed)
                                                           : add_paper_run(result, paper_grid_method(options.method),
                                                                           given, camera_of(size), seed);
        if (!options.grids.empty()) {
          save_geotiff(options.grids + '/' + name + '_' + std::to_string(size) + '_' + std::to_string(seed) + '_' +
                           options.method + ".tif",
                       grid);
        }
      }
      if (options.folder.empty()) print(name, size, options.method, result, options.json);
    }
  }
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  Options options;
  CommandLine app("grid_scenes",
                  "Semantic grids of analytic scenes against their truth, or what a camera sees of these scenes");
  app.add_option("--scenes", options.scenes, "their names").take_all().check(one_of(grid_case_names()));
  app.add_option("--sizes", options.sizes, "pixels across the label images").take_all().check(in_range(8, 2048));
  app.add_option("--first-seed", options.first_seed, "the first seed");
  app.add_option("--seeds", options.seeds, "number of seeds");
  app.add_option("--method", options.method, "of the grid; all but ours are the ScoutNet paper's")
      .check(one_of({"ours", "full", "projection", "rays"}));
  app.add_option("--grids", options.grids, "save each grid in this folder, a GeoTIFF");
  app.add_flag("--json", options.json, "one line of JSON per scene and size");
  app.add_option("--write", options.folder, "write label images, poses, elevation and truth into this folder instead");
  return run_program(app, argc, argv, [&options] {
    run(options);
    return 0;
  });
}
