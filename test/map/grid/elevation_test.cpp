// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/grid/elevation.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <gdal.h>

namespace situation_awareness::elevation_test {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

double plane(double x, double y) { return 3.0 + 0.25 * x - 0.5 * y; }

/// Of 4 x 3 pixels of 2 m x 4 m, its north-west corner at (10, 20).
std::vector<float> plane_heights() {
  std::vector<float> heights;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      heights.push_back(static_cast<float>(plane(10 + 2 * (column + 0.5), 20 - 4 * (row + 0.5))));
    }
  }
  return heights;
}

Elevation plane_elevation() { return {4, 3, {10.0, 20.0}, {2.0, 4.0}, plane_heights()}; }

std::string write_geotiff(const std::string& name, std::array<double, 6> transform, double no_data) {
  GDALAllRegister();
  const std::string path = (std::filesystem::path(testing::TempDir()) / name).string();
  GDALDatasetH dataset = GDALCreate(GDALGetDriverByName("GTiff"), path.c_str(), 4, 3, 1, GDT_Float32, nullptr);
  GDALSetGeoTransform(dataset, transform.data());
  GDALRasterBandH band = GDALGetRasterBand(dataset, 1);
  GDALSetRasterNoDataValue(band, no_data);
  std::vector<float> heights = plane_heights();
  EXPECT_EQ(GDALRasterIO(band, GF_Write, 0, 0, 4, 3, heights.data(), 4, 3, GDT_Float32, 0, 0), CE_None);
  GDALClose(dataset);
  return path;
}

std::string refusal_of(const std::string& path) {
  try {
    Elevation::load(path);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST(Elevation, IsExactOnAPlaneBetweenTheMiddlesOfItsPixels) {
  const Elevation elevation = plane_elevation();
  for (const double x : {11.0, 12.3, 15.5, 17.0}) {
    for (const double y : {18.0, 14.1, 10.0}) EXPECT_NEAR(elevation.at(x, y), plane(x, y), 1e-5) << x << ' ' << y;
  }
}

TEST(Elevation, IsThatOfTheNearestMiddleAtTheEdgeAndUnknownBeyond) {
  const Elevation elevation = plane_elevation();
  EXPECT_NEAR(elevation.at(10.1, 14.0), plane(11.0, 14.0), 1e-5);
  EXPECT_NEAR(elevation.at(18.0, 8.0), plane(17.0, 10.0), 1e-5);
  for (const auto& [x, y] : {std::pair{9.9, 14.0}, {18.1, 14.0}, {14.0, 20.1}, {14.0, 7.9}}) {
    EXPECT_TRUE(std::isnan(elevation.at(x, y))) << x << ' ' << y;
  }
  EXPECT_TRUE(std::isnan(elevation.at(std::nan(""), 14.0)));
}

TEST(Elevation, IsUnknownBesideAPixelWithoutDataOnly) {
  std::vector<float> heights = plane_heights();
  heights[0] = kNaN;
  const Elevation elevation(4, 3, {10.0, 20.0}, {2.0, 4.0}, heights);
  EXPECT_TRUE(std::isnan(elevation.at(11.5, 17.0)));
  EXPECT_NEAR(elevation.at(13.0, 18.0), plane(13.0, 18.0), 1e-5);  // at the middle of the next pixel
  EXPECT_NEAR(elevation.at(15.5, 17.0), plane(15.5, 17.0), 1e-5);
}

TEST(Elevation, SmoothingKeepsPlanesAndWhatIsUnknown) {
  std::vector<float> heights = plane_heights();
  heights[0] = kNaN;
  const Elevation smooth = Elevation(4, 3, {10.0, 20.0}, {2.0, 4.0}, heights).smoothed(3.0);
  EXPECT_TRUE(std::isnan(smooth.at(11.0, 18.0)));
  EXPECT_FALSE(std::isnan(smooth.at(13.0, 18.0)));
  const Elevation plane_smooth = plane_elevation().smoothed(3.0);
  for (const double x : {11.0, 13.7, 17.0}) EXPECT_NEAR(plane_smooth.at(x, 13.0), plane(x, 13.0), 1e-5);
}

TEST(Elevation, SmoothingTakesNoiseAsAGaussianDoes) {
  constexpr int kPixels = 200;
  std::mt19937 random(1);
  std::normal_distribution<float> normal;
  std::vector<float> heights;
  for (int i = 0; i < kPixels * kPixels; ++i) heights.push_back(normal(random));
  const double sigma_m = 2.0;
  const Elevation smooth = Elevation(kPixels, kPixels, {0.0, 200.0}, {1.0, 1.0}, heights).smoothed(sigma_m);
  double sum = 0.0;
  int count = 0;
  for (double x = 20.5; x < 180.0; ++x) {
    for (double y = 20.5; y < 180.0; ++y, ++count) sum += smooth.at(x, y) * smooth.at(x, y);
  }
  EXPECT_NEAR(std::sqrt(sum / count), 1.0 / (2.0 * std::sqrt(M_PI) * sigma_m), 0.01);  // of white noise
}

TEST(Elevation, SmoothingTakesMillionsOfPixelsThatAreFarSmallerThanItsGaussian) {
  constexpr int kPixels = 2000;
  const std::vector<float> level(static_cast<std::size_t>(kPixels) * kPixels, 7.0F);
  const Elevation degrees = Elevation(kPixels, kPixels, {10.0, 50.0}, {9e-7, 9e-7}, level).smoothed(2.0);
  EXPECT_EQ(degrees.at(10.0009, 49.9991), 7.0);
  EXPECT_TRUE(std::isnan(degrees.at(10.01, 49.9991)));
}

TEST(Elevation, SmoothingMergesPixelsOnlyWhereTheyAreFine) {
  // Of a wave a Gaussian leaves exp(-(k sigma)^2 / 2), but for what is beyond three standard deviations.
  constexpr double sigma_m = 0.5, k_1_m = 2.0;
  for (const int pixels : {50, 201, 800}) {
    const double pixel_m = 8.0 / pixels;
    std::vector<float> heights;
    for (int row = 0; row < pixels; ++row) {
      for (int column = 0; column < pixels; ++column) {
        heights.push_back(static_cast<float>(std::sin(k_1_m * (column + 0.5) * pixel_m)));
      }
    }
    const Elevation smooth = Elevation(pixels, pixels, {0.0, 8.0}, {pixel_m, pixel_m}, heights).smoothed(sigma_m);
    EXPECT_EQ(smooth.width(), pixels == 800 ? 266 : pixels);
    for (double x_m = 2.0; x_m < 6.0; x_m += 0.1) {
      EXPECT_NEAR(smooth.at(x_m, 4.0), std::exp(-0.5 * std::pow(k_1_m * sigma_m, 2)) * std::sin(k_1_m * x_m), 0.02);
    }
  }
}

TEST(Elevation, AlongALineIsThatAtItsPlaces) {
  std::vector<float> heights = plane_heights();
  heights[5] = std::numeric_limits<float>::quiet_NaN();
  const Elevation elevation(4, 3, {10.0, 20.0}, {2.0, 4.0}, heights);
  std::vector<double> distances_m, found_m(100);
  for (int i = 0; i < 100; ++i) distances_m.push_back(0.15 * i);
  const Eigen::Vector2d begin(9.0, 7.5), direction(0.6, 0.8);
  elevation.along(begin, direction, distances_m.data(), distances_m.size(), found_m.data());
  int known = 0;
  for (std::size_t i = 0; i < 100; ++i) {
    const Eigen::Vector2d p_m = begin + distances_m[i] * direction;
    const double expected_m = elevation.at(p_m.x(), p_m.y());
    EXPECT_EQ(std::isnan(found_m[i]), std::isnan(expected_m)) << i;
    if (std::isnan(expected_m)) continue;
    EXPECT_EQ(found_m[i], expected_m) << i;
    ++known;
  }
  EXPECT_GT(known, 10);
  EXPECT_LT(known, 90);
}

TEST(Elevation, OfOnePixelIsFlat) {
  const Elevation elevation(1, 1, {0.0, 0.0}, {10.0, 10.0}, {7.0F});
  EXPECT_EQ(elevation.at(5.0, -5.0), 7.0);
  EXPECT_EQ(elevation.at(0.5, -9.5), 7.0);
}

TEST(Elevation, ReadsAGeoTiff) {
  const Elevation elevation = Elevation::load(write_geotiff("plane.tif", {10.0, 2.0, 0.0, 20.0, 0.0, -4.0}, -9999.0));
  EXPECT_EQ(elevation.width(), 4);
  EXPECT_EQ(elevation.height(), 3);
  for (const double x : {11.0, 13.7, 17.0}) EXPECT_EQ(elevation.at(x, 13.0), plane_elevation().at(x, 13.0));
}

TEST(Elevation, IsReadBackAsItWasSaved) {
  std::vector<float> heights = plane_heights();
  heights[5] = kNaN;
  const std::string path =
      (std::filesystem::path(testing::TempDir()) / ("saved_" + std::to_string(::getpid()) + ".tif")).string();
  const Elevation elevation(4, 3, {10.0, 20.0}, {2.0, 4.0}, heights);
  elevation.save(path);
  const Elevation read = Elevation::load(path);
  for (double x = 9.5; x < 19.0; x += 0.5) {
    for (double y = 7.5; y < 21.0; y += 0.5) {
      const double saved = elevation.at(x, y);
      EXPECT_TRUE(std::isnan(saved) ? std::isnan(read.at(x, y)) : read.at(x, y) == saved) << x << ' ' << y;
    }
  }
  EXPECT_THROW(elevation.save("/nowhere/dem.tif"), std::runtime_error);
}

TEST(Elevation, TakesTheValueForNoDataForUnknown) {
  const auto no_data = static_cast<double>(plane_heights()[5]);
  const Elevation elevation = Elevation::load(write_geotiff("hole.tif", {10.0, 2.0, 0.0, 20.0, 0.0, -4.0}, no_data));
  EXPECT_TRUE(std::isnan(elevation.at(13.0, 14.0)));
}

TEST(Elevation, RefusesFilesThatAreNoElevation) {
  EXPECT_NE(refusal_of("/nowhere/dem.tif").find("/nowhere/dem.tif"), std::string::npos);
  EXPECT_NE(refusal_of(write_geotiff("line.tif", {10.0, 2.0, 4.0, 20.0, 1.0, 2.0}, -1.0)).find("no area"),
            std::string::npos);
  const std::string text = (std::filesystem::path(testing::TempDir()) / "text.tif").string();
  std::ofstream(text) << "no raster";
  EXPECT_NE(refusal_of(text).find("cannot be read"), std::string::npos);
}

TEST(Elevation, RefusesNumbersThatDoNotFit) {
  EXPECT_THROW(Elevation(2, 2, {0.0, 0.0}, {1.0, 1.0}, {1.0F}), std::invalid_argument);
  EXPECT_THROW(Elevation(1, 1, {0.0, 0.0}, {1.0, 0.0}, {1.0F}), std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness::elevation_test
