// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/grid/geotiff.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>

#include "situation_awareness/map/grid/elevation.hpp"

namespace situation_awareness::geotiff_test {
namespace {

std::string path_of(const std::string& name) {
  const std::filesystem::path folder = testing::TempDir() + "geotiff_test_" + std::to_string(::getpid());
  std::filesystem::create_directories(folder);
  return (folder / name).string();
}

SemanticGrid some_grid() {
  SemanticGrid grid;
  grid.cell_m = 0.5;
  grid.first_column = -3;
  grid.first_row = 7;
  grid.width = 3;
  grid.height = 2;
  grid.probability = {0.1F, 0.9F, std::numeric_limits<float>::quiet_NaN(), 0.25F, 0.75F, 1.0F};
  grid.images = {1, 2, 0, 4, 5, 60000};
  grid.ground_world_m.assign(6, std::numeric_limits<float>::quiet_NaN());
  return grid;
}

TEST(GridGeoTiff, IsReadBackAsItWas) {
  const SemanticGrid grid = some_grid();
  save_geotiff(path_of("grid.tif"), grid);
  const SemanticGrid read = load_geotiff(path_of("grid.tif"));
  EXPECT_EQ(read.cell_m, grid.cell_m);
  EXPECT_EQ(read.first_column, grid.first_column);
  EXPECT_EQ(read.first_row, grid.first_row);
  ASSERT_EQ(read.width, grid.width);
  ASSERT_EQ(read.height, grid.height);
  EXPECT_EQ(read.images, grid.images);
  for (std::size_t i = 0; i < grid.probability.size(); ++i) {
    if (std::isnan(grid.probability[i])) {
      EXPECT_TRUE(std::isnan(read.probability[i]));
    } else {
      EXPECT_EQ(read.probability[i], grid.probability[i]);
    }
  }
}

TEST(GridGeoTiff, HasItsCellsWhereARasterInTheWorldHasThem) {
  const SemanticGrid grid = some_grid();
  save_geotiff(path_of("grid.tif"), grid);
  const Elevation raster = Elevation::load(path_of("grid.tif"));  // reads the first band
  for (const auto& [column, row] : {std::pair{0, 0}, {1, 0}, {1, 1}, {2, 1}}) {
    const Eigen::Vector2d p = grid.middle_world_m(column, row);
    EXPECT_FLOAT_EQ(static_cast<float>(raster.at(p.x(), p.y())), grid.probability[grid.index(column, row)]);
  }
}

TEST(GridGeoTiff, WithoutCellsIsACellThatWasNotObserved) {
  save_geotiff(path_of("empty.tif"), SemanticGrid{});
  const SemanticGrid read = load_geotiff(path_of("empty.tif"));
  ASSERT_EQ(read.probability.size(), 1U);
  EXPECT_TRUE(std::isnan(read.probability[0]));
  EXPECT_EQ(read.images[0], 0);
}

TEST(GridGeoTiff, RefusesWhatIsNoGrid) {
  EXPECT_THROW(load_geotiff("/nowhere/grid.tif"), std::runtime_error);
  EXPECT_THROW(save_geotiff("/nowhere/grid.tif", some_grid()), std::runtime_error);
  std::ofstream(path_of("text.tif")) << "no raster";
  EXPECT_THROW(load_geotiff(path_of("text.tif")), std::runtime_error);
  SemanticGrid off = some_grid();
  off.probability[0] = 1.5F;
  save_geotiff(path_of("off.tif"), off);
  EXPECT_THROW(load_geotiff(path_of("off.tif")), std::runtime_error);
}

}  // namespace
}  // namespace situation_awareness::geotiff_test
