// SPDX-License-Identifier: BSD-3-Clause
// Rasters as people have them, laid over the world: each is of the same ground.
#include "situation_awareness/map/grid/elevation_file.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <gdal.h>
#include <ogr_srs_api.h>
#include <GeographicLib/LocalCartesian.hpp>

#include "support/refusal.hpp"

namespace situation_awareness::elevation_file_test {
namespace {

constexpr EarthOrigin kOrigin{47.5, 8.5, 460.0};
constexpr double kGeoid_m = 47.42;  // of EGM96 at the origin

double ground_m(double x_m, double y_m) { return 3.0 + 0.05 * x_m - 0.02 * y_m; }

/// A raster: what it says, and what its pixels are.
struct Raster {
  std::string name;
  std::array<double, 6> transform{-60.0, 2.0, 0.0, 60.0, 0.0, -2.0};
  int columns = 60, rows = 60;
  GDALDataType type = GDT_Float32;
  std::string crs = {}, unit = {};
  double scale = 1.0, offset = 0.0, no_data = std::numeric_limits<double>::quiet_NaN();
  /// What is stored at the middle of a pixel.
  std::function<double(double x, double y)> stored = ground_m;
  std::function<bool(double x, double y)> is_masked = {};
  bool is_point = false;
  std::string geotiff = "1.1";  ///< its version: the older one has no compound CRS, but their keys
};

std::string write(const Raster& raster) {
  GDALAllRegister();
  const std::string path = (std::filesystem::path(testing::TempDir()) /
                            ("elevation_" + std::to_string(::getpid()) + "_" + raster.name + ".tif"))
                               .string();
  std::string version = "GEOTIFF_VERSION=" + raster.geotiff;
  std::array<char*, 2> options = {version.data(), nullptr};
  GDALDatasetH dataset = GDALCreate(GDALGetDriverByName("GTiff"), path.c_str(), raster.columns, raster.rows, 1,
                                    raster.type, options.data());
  std::array<double, 6> transform = raster.transform;
  if (raster.is_point) GDALSetMetadataItem(dataset, "AREA_OR_POINT", "Point", nullptr);
  GDALSetGeoTransform(dataset, transform.data());
  if (!raster.crs.empty()) {
    OGRSpatialReferenceH srs = OSRNewSpatialReference(nullptr);
    EXPECT_EQ(OSRSetFromUserInput(srs, raster.crs.c_str()), OGRERR_NONE);
    GDALSetSpatialRef(dataset, srs);
    OSRDestroySpatialReference(srs);
  }
  GDALRasterBandH band = GDALGetRasterBand(dataset, 1);
  if (!raster.unit.empty()) GDALSetRasterUnitType(band, raster.unit.c_str());
  if (raster.scale != 1.0) GDALSetRasterScale(band, raster.scale);
  if (raster.offset != 0.0) GDALSetRasterOffset(band, raster.offset);
  if (!std::isnan(raster.no_data)) GDALSetRasterNoDataValue(band, raster.no_data);
  std::vector<double> values;
  std::vector<unsigned char> mask;
  const auto& t = raster.transform;
  for (int r = 0; r < raster.rows; ++r) {
    for (int c = 0; c < raster.columns; ++c) {
      const double x = t[0] + (c + 0.5) * t[1] + (r + 0.5) * t[2], y = t[3] + (c + 0.5) * t[4] + (r + 0.5) * t[5];
      values.push_back((raster.stored(x, y) - raster.offset) / raster.scale);
      mask.push_back(raster.is_masked && raster.is_masked(x, y) ? 0 : 255);
    }
  }
  EXPECT_EQ(GDALRasterIO(band, GF_Write, 0, 0, raster.columns, raster.rows, values.data(), raster.columns, raster.rows,
                         GDT_Float64, 0, 0),
            CE_None);
  if (raster.is_masked) {
    GDALCreateDatasetMaskBand(dataset, GMF_PER_DATASET);
    EXPECT_EQ(GDALRasterIO(GDALGetMaskBand(band), GF_Write, 0, 0, raster.columns, raster.rows, mask.data(),
                           raster.columns, raster.rows, GDT_Byte, 0, 0),
              CE_None);
  }
  GDALClose(dataset);
  return path;
}

ElevationSource over(const std::string& path) { return {path, kOrigin, {}, 0.0}; }

std::shared_ptr<const Elevation> loaded(const ElevationSource& source) {
  return ElevationFile(source).around({0.0, 0.0}, 50.0, 0.1);
}

/// The ground within 40 m of the world's origin, to an error.
void expect_ground(const Elevation& elevation, double error_m, double higher_m = 0.0) {
  for (double x_m = -40.0; x_m <= 40.0; x_m += 7.0) {
    for (double y_m = -40.0; y_m <= 40.0; y_m += 7.0) {
      EXPECT_NEAR(elevation.at(x_m, y_m), ground_m(x_m, y_m) + higher_m, error_m) << x_m << ' ' << y_m;
    }
  }
}

TEST(ElevationFile, HeedsWhatABandSaysOfItsNumbers) {
  Raster as_is{"as_is"}, scaled{"scaled"}, lifted{"lifted"}, feet{"feet"}, survey{"survey"}, centimetres{"centimetres"};
  scaled.type = GDT_Int16;
  scaled.scale = 0.1;
  scaled.offset = -100.0;
  lifted.offset = 400.0;
  feet.unit = "ft";
  feet.stored = [](double x, double y) { return ground_m(x, y) / 0.3048; };
  survey.unit = "US survey foot";
  survey.stored = [](double x, double y) { return ground_m(x, y) * 3937.0 / 1200.0; };
  centimetres.unit = "cm";
  centimetres.type = GDT_Int32;
  centimetres.stored = [](double x, double y) { return std::round(100.0 * ground_m(x, y)); };
  for (const Raster& raster : {as_is, scaled, lifted, feet, survey, centimetres}) {
    SCOPED_TRACE(raster.name);
    expect_ground(*loaded({write(raster)}), raster.type == GDT_Int16 ? 0.06 : 0.006);
  }
}

TEST(ElevationFile, LaysOutRowsAndColumnsAsTheGeotransformSays) {
  Raster south_up{"south_up"}, turned{"turned"}, oblong{"oblong"}, point{"point"};
  south_up.transform = {-60.0, 2.0, 0.0, -60.0, 0.0, 2.0};
  const double c = 2.0 * std::cos(0.5), s = 2.0 * std::sin(0.5);
  turned.columns = turned.rows = 100;
  turned.transform = {-50.0 * (c + s), c, s, 50.0 * (c - s), s, -c};
  oblong.columns = 120;
  oblong.transform = {-60.0, 1.0, 0.0, 60.0, 0.0, -2.0};
  point.is_point = true;
  for (const Raster& raster : {south_up, turned, oblong, point}) {
    SCOPED_TRACE(raster.name);
    expect_ground(*loaded({write(raster)}), 1e-3);
  }
}

TEST(ElevationFile, WhatIsMaskedOrAVoidIsNotKnown) {
  const auto is_hole = [](double x, double y) { return std::hypot(x - 20.0, y - 10.0) < 8.0; };
  const auto with = [is_hole](double value) {
    return [is_hole, value](double x, double y) { return is_hole(x, y) ? value : ground_m(x, y); };
  };
  Raster masked{"masked"}, declared{"declared"}, nines{"nines"}, least{"least"}, huge{"huge"};
  masked.is_masked = is_hole;
  masked.stored = with(0.0);
  declared.no_data = -77.0;
  declared.stored = with(-77.0);
  nines.stored = with(-9999.0);
  least.type = GDT_Int16;
  least.stored = with(-32768.0);
  huge.stored = with(-3.4e38);
  for (const Raster& raster : {masked, declared, nines, least, huge}) {
    SCOPED_TRACE(raster.name);
    ElevationFile file({write(raster)});
    const auto elevation = file.around({0.0, 0.0}, 50.0, 0.1);
    EXPECT_TRUE(std::isnan(elevation->at(20.0, 10.0)));
    EXPECT_NEAR(elevation->at(-20.0, 10.0), ground_m(-20.0, 10.0), 0.6);
    const bool is_undeclared = raster.name != "masked" && raster.name != "declared";
    ASSERT_EQ(file.warnings().size(), is_undeclared ? 1U : 0U);
    if (is_undeclared) {
      EXPECT_NE(file.warnings()[0].find("not declared as no data"), std::string::npos) << file.warnings()[0];
    }
  }
  Raster deep{"deep"};  // where all is about as deep it is no void
  deep.stored = [](double x, double y) { return -9999.0 + (x > 0.0 ? 0.0 : y); };
  EXPECT_NEAR(loaded({write(deep)})->at(20.0, 10.0), -9999.0, 1e-3);
}

/// A raster in a CRS of the ground that the world has: each pixel's height above the ellipsoid, less what is to be
/// added.
Raster in_crs(const std::string& name, const std::string& crs, double pixel, double zero_m = 0.0) {
  Raster raster{name};
  raster.crs = crs;
  OGRSpatialReferenceH to = OSRNewSpatialReference(nullptr), degrees = OSRNewSpatialReference(nullptr);
  OSRSetFromUserInput(to, (crs[0] == '+' ? crs : crs.substr(0, crs.find('+'))).c_str());
  OSRSetFromUserInput(degrees, "EPSG:4326");
  for (const auto srs : {to, degrees}) OSRSetAxisMappingStrategy(srs, OAMS_TRADITIONAL_GIS_ORDER);
  OGRCoordinateTransformationH there = OCTNewCoordinateTransformation(degrees, to),
                               back = OCTNewCoordinateTransformation(to, degrees);
  double x = kOrigin.longitude_deg, y = kOrigin.latitude_deg;
  OCTTransform(there, 1, &x, &y, nullptr);
  raster.columns = raster.rows = 160;
  raster.transform = {x - 80.0 * pixel, pixel, 0.0, y + 80.0 * pixel, 0.0, -pixel};
  raster.stored = [back, zero_m](double u, double v) {
    OCTTransform(back, 1, &u, &v, nullptr);
    const GeographicLib::LocalCartesian world(kOrigin.latitude_deg, kOrigin.longitude_deg, kOrigin.altitude_m);
    double height_m = kOrigin.altitude_m;
    for (int i = 0; i < 4; ++i) {
      double x_m = 0.0, y_m = 0.0, z_m = 0.0;
      world.Forward(v, u, height_m, x_m, y_m, z_m);
      height_m += ground_m(x_m, y_m) - z_m;
    }
    return height_m - zero_m;
  };
  OSRDestroySpatialReference(to);
  OSRDestroySpatialReference(degrees);
  return raster;
}

TEST(ElevationFile, LaysACrsOverTheWorldOfAnOrigin) {
  for (const auto& [name, crs, pixel] : {std::tuple{"degrees", "EPSG:4326", 1e-5},
                                         {"utm", "EPSG:32632", 1.0},
                                         {"web", "EPSG:3857", 1.5},
                                         {"swiss", "EPSG:2056", 1.0},
                                         {"mercator", "+proj=tmerc +lat_0=47.5 +lon_0=8.5 +datum=WGS84", 1.0}}) {
    SCOPED_TRACE(name);
    ElevationFile file(over(write(in_crs(name, crs, pixel))));
    expect_ground(*file.around({0.0, 0.0}, 50.0, 0.1), 0.01);
    ASSERT_EQ(file.warnings().size(), 1U);
    EXPECT_NE(file.warnings()[0].find("does not say what its heights are above"), std::string::npos);
  }
}

/// With the grid of its geoid the ground is that of the world to `error_m`; without, the source is refused: never are
/// heights taken unchanged.
void expect_raised_or_refused(const ElevationSource& source, double error_m) {
  std::shared_ptr<const Elevation> elevation;
  const std::string refusal = refusal_of<std::runtime_error>([&] { elevation = loaded(source); });
  if (refusal.empty()) return expect_ground(*elevation, error_m);
  EXPECT_TRUE(names(refusal, {source.path, "above the sea", "dem_geoid_m", "dem_vertical"})) << refusal;
}

TEST(ElevationFile, HeightsAboveTheSeaAreNotTakenAsAboveTheEllipsoid) {
  const std::string path = write(in_crs("sea", "EPSG:32632", 1.0, kGeoid_m));
  expect_raised_or_refused({path, kOrigin, "egm96", 0.0}, 0.1);
  expect_raised_or_refused({path, kOrigin, "egm2008", 0.0}, 1.0);
  expect_ground(*loaded({path, kOrigin, "egm2008", kGeoid_m}), 0.01);
  for (const std::string crs : {"EPSG:32632+5773", "EPSG:32632+3855", "EPSG:4326+3855", "EPSG:32632+5703"}) {
    SCOPED_TRACE(crs);
    const double pixel = crs.find("4326") == std::string::npos ? 1.0 : 1e-5;
    const std::string of_crs = write(in_crs("compound", crs, pixel, kGeoid_m));
    expect_raised_or_refused(over(of_crs), crs.find("5773") == std::string::npos ? 1.0 : 0.1);
    expect_ground(*loaded({of_crs, kOrigin, "", kGeoid_m}), 0.01);
    expect_ground(*loaded({of_crs, kOrigin, "ellipsoid", 0.0}), 0.01, -kGeoid_m);
    EXPECT_EQ(ElevationFile({of_crs, kOrigin, "ellipsoid", 0.0}).warnings().size(), 0U);
  }
}

TEST(ElevationFile, AnOlderGeoTiffSaysWhatItsHeightsAreAbove) {
  Raster raster = in_crs("older", "EPSG:32632+5773", 1.0, kGeoid_m);
  raster.geotiff = "1.0";
  const std::string path = write(raster);
  expect_raised_or_refused(over(path), 0.1);
  expect_ground(*loaded({path, kOrigin, "", kGeoid_m}), 0.01);
}

TEST(ElevationFile, LocalHeightsAreThoseOfTheWorld) {
  Raster raster = in_crs("local", "EPSG:32632", 1.0);
  raster.stored = [](double /*x*/, double /*y*/) { return 7.0; };
  EXPECT_NEAR(loaded({write(raster), kOrigin, "local", 0.0})->at(20.0, 30.0), 7.0, 1e-6);
  expect_ground(*loaded({write(Raster{"no_crs"}), kOrigin, "", 0.0}), 1e-3);
  Raster high{"high"};
  high.stored = [](double x, double y) { return kOrigin.altitude_m + ground_m(x, y); };
  expect_ground(*loaded({write(high), kOrigin, "ellipsoid", 0.0}), 0.01);
}

TEST(ElevationFile, RefusesWhatHasNoPlaceAndTellsWhatHelps) {
  const auto refusal = [](const ElevationSource& source) {
    return refusal_of<std::runtime_error>([&source] { ElevationFile file(source); });
  };
  Raster feet{"new_york"}, tiny{"tiny"}, celsius{"celsius"}, flat{"flat"};
  feet.crs = "EPSG:2263";
  tiny.transform = {8.5, 9e-7, 0.0, 47.5, 0.0, -9e-7};
  celsius.unit = "degC";
  flat.scale = std::numeric_limits<double>::infinity();
  flat.stored = [](double, double) { return 0.0; };
  const std::string degrees = refusal({write(in_crs("no_origin", "EPSG:4326", 1e-5))});
  EXPECT_TRUE(names(degrees, {"EPSG:4326", "origin", "gdalwarp", "+lat_0=47.5000000"})) << degrees;
  EXPECT_TRUE(names(refusal({write(feet)}), {"EPSG:2263", "gdalwarp"}));
  EXPECT_TRUE(names(refusal({write(tiny)}), {"9e-07", "degrees"}));
  EXPECT_TRUE(names(refusal({write(celsius)}), {"degC"}));
  EXPECT_TRUE(names(refusal({write(flat)}), {"scale"}));
  EXPECT_TRUE(names(refusal({write(Raster{"as_is"}), {}, "egm96", 0.0}), {"egm96", "origin"}));
  EXPECT_TRUE(names(refusal({write(Raster{"as_is"}), kOrigin, "sea", 0.0}), {"dem_vertical", "sea"}));
  Raster utm = in_crs("utm_no_origin", "EPSG:32632", 1.0);
  EXPECT_TRUE(names(ElevationFile({write(utm)}).remedy(), {"EPSG:32632", "origin", "gdalwarp"}));
}

/// A raster of 9e-7 degrees, 1.6e9 pixels, of which a part is written.
std::string write_huge(bool is_in_degrees) {
  GDALAllRegister();
  const std::string path =
      (std::filesystem::path(testing::TempDir()) / ("huge_" + std::to_string(::getpid()) + ".tif")).string();
  const char* options[] = {"SPARSE_OK=TRUE", "TILED=YES", "BIGTIFF=YES", nullptr};
  constexpr int kEdge = 40000;
  const double pixel = is_in_degrees ? 9e-7 : 0.1;
  GDALDatasetH dataset =
      GDALCreate(GDALGetDriverByName("GTiff"), path.c_str(), kEdge, kEdge, 1, GDT_Float32, const_cast<char**>(options));
  std::array<double, 6> transform{-0.5 * kEdge * pixel, pixel, 0.0, 0.5 * kEdge * pixel, 0.0, -pixel};
  if (is_in_degrees) {
    transform[0] += kOrigin.longitude_deg;
    transform[3] += kOrigin.latitude_deg;
    OGRSpatialReferenceH srs = OSRNewSpatialReference(nullptr);
    OSRSetFromUserInput(srs, "EPSG:4326");
    GDALSetSpatialRef(dataset, srs);
    OSRDestroySpatialReference(srs);
  }
  GDALSetGeoTransform(dataset, transform.data());
  std::vector<float> heights(2000 * 2000, is_in_degrees ? 465.0F : 5.0F);
  EXPECT_EQ(GDALRasterIO(GDALGetRasterBand(dataset, 1), GF_Write, 19000, 19000, 2000, 2000, heights.data(), 2000, 2000,
                         GDT_Float32, 0, 0),
            CE_None);
  GDALClose(dataset);
  return path;
}

/// Seconds of the processor, and MB of memory at most, so far.
std::pair<double, double> used() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return {static_cast<double>(usage.ru_utime.tv_sec) + 1e-6 * static_cast<double>(usage.ru_utime.tv_usec),
          static_cast<double>(usage.ru_maxrss) / 1024.0};
}

TEST(ElevationFile, OfAHugeRasterThePartInViewIsRead) {
  for (const bool is_in_degrees : {false, true}) {
    SCOPED_TRACE(is_in_degrees);
    const std::string path = write_huge(is_in_degrees);
    const double begin_s = used().first;
    ElevationFile file(over(path));
    const auto here = file.around({0.0, 0.0}, 50.0, 0.25);
    for (const double x_m : {-50.0, 0.0, 50.0}) EXPECT_NEAR(here->at(x_m, 50.0), 5.0, 0.01);
    EXPECT_LT(here->width(), 3000);
    EXPECT_LT(here->smoothed(2.0).width(), 3000);
    EXPECT_EQ(file.around({20.0, -20.0}, 50.0, 0.25), here);
    const auto there = file.around({60.0, 0.0}, 50.0, 0.25);
    EXPECT_NE(there, here);
    EXPECT_NEAR(there->at(60.0, 0.0), 5.0, 0.01);
    EXPECT_TRUE(std::isnan(file.around({9e4, 0.0}, 50.0, 0.25)->at(9e4, 0.0)));
    EXPECT_LT(used().first - begin_s, 5.0);
    EXPECT_LT(used().second, 700.0);
    std::filesystem::remove(path);
  }
}

}  // namespace
}  // namespace situation_awareness::elevation_file_test
