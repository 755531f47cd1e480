// SPDX-License-Identifier: BSD-3-Clause
// Files of every kind that the package reads and writes.
#include "situation_awareness/common/file.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gdal.h>

#include "situation_awareness/map/grid/elevation.hpp"
#include "situation_awareness/map/grid/geotiff.hpp"
#include "situation_awareness/map/objects/map_file.hpp"
#include "situation_awareness/map/objects/object_map.hpp"
#include "situation_awareness/map/saved_map.hpp"
#include "situation_awareness/path/local_maps.hpp"
#include "situation_awareness/pipeline/map_pipeline.hpp"
#include "situation_awareness/pose/reflector_map.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::file_test {
namespace {

class FileTest : public testing::Test {
 protected:
  FileTest() : folder_(testing::TempDir() + "file_test_" + std::to_string(::getpid())) {
    std::filesystem::create_directories(folder_);
  }
  ~FileTest() override { std::filesystem::remove_all(folder_); }

  std::string file(const std::string& name) const { return folder_ + "/" + name; }
  static std::string content(const std::string& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  }
  static void write(const std::string& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }
  std::ptrdiff_t files() const {
    return std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator());
  }

  std::string folder_;
  const FileKind songs_ = kind_with_mark("a song", "\nla la");
};

TEST_F(FileTest, ManyWritersOfOnePathLeaveACompleteFile) {
  const std::string path = file("song");
  const auto song = [](char singer) { return "la la" + std::string(100'000, singer); };
  const auto sing = [&](char singer) {
    for (int i = 0; i < 30; ++i) replace_file(path, songs_, song(singer));
  };
  std::vector<pid_t> children;
  for (const char singer : {'a', 'b', 'c'}) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      try {
        sing(singer);
        ::_exit(0);
      } catch (...) {
        ::_exit(1);
      }
    }
    children.push_back(child);
  }
  std::vector<std::thread> threads;
  for (const char singer : {'d', 'e', 'f'}) threads.emplace_back([&sing, singer] { sing(singer); });
  for (int i = 0; i < 100; ++i) {
    const std::string found = content(path);
    if (!found.empty()) {
      ASSERT_EQ(found, song(found.back()));
    }
  }
  for (std::thread& thread : threads) thread.join();
  for (const pid_t child : children) {
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);
  }
  EXPECT_EQ(files(), 1);
}

TEST_F(FileTest, WhatAKilledWriterLeftIsRemovedAndThatOfARunningOneIsNot) {
  const std::string path = file("song");
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    NewFile unfinished(path, songs_);
    unfinished.write("la");
    ::_exit(0);
  }
  waitpid(child, nullptr, 0);
  ASSERT_EQ(files(), 1);
  NewFile slow(path, songs_);
  slow.write("la la slow");
  EXPECT_EQ(files(), 1) << "its place was taken";
  replace_file(path, songs_, "la la quick");
  EXPECT_EQ(content(path), "la la quick");
  slow.finish();
  EXPECT_EQ(content(path), "la la slow");
  EXPECT_EQ(files(), 1);
}

TEST_F(FileTest, OthersAreNotReplaced) {
  const std::string path = file("thesis.tex");
  write(path, "years of work, la la\n");
  EXPECT_TRUE(names(refusal_of<std::runtime_error>([&] { replace_file(path, songs_, "la la"); }), {path, "a song"}));
  EXPECT_EQ(content(path), "years of work, la la\n");
  write(path, "# a song\nla la\n");
  replace_file(path, songs_, "la la la");
  EXPECT_EQ(content(path), "la la la");
  write(path, "");
  replace_file(path, songs_, "la la");
  EXPECT_EQ(content(path), "la la") << "there was nothing";
  for (const std::string& no_file : {folder_, std::string("/dev/null"), file("missing/song")}) {
    EXPECT_TRUE(names(refusal_of<std::runtime_error>([&] { replace_file(no_file, songs_, "la la"); }), {no_file}));
  }
  EXPECT_EQ(files(), 1);
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
}

TEST_F(FileTest, WhatIsTooLargeOrNoFileIsRefusedAtOnce) {
  write(file("small"), "12345");
  EXPECT_EQ(read_file(file("small"), 5), "12345");
  EXPECT_TRUE(names(refusal_of([&] { read_file(file("small"), 4); }), {file("small"), "5", "4"}));
  ASSERT_EQ(::mkfifo(file("pipe").c_str(), 0600), 0);
  for (const std::string& no_file : {folder_, std::string("/dev/zero"), file("pipe"), file("missing")}) {
    EXPECT_TRUE(names(refusal_of<std::runtime_error>([&] { read_file(no_file, 1000); }), {no_file}));
  }
}

// --- each kind ----------------------------------------------------------------------------------------------------

struct Format {
  std::string name;
  std::function<void(const std::string&path)> save, load;
};

Chain some_chain() {
  Chain chain;
  chain.id = 1;
  chain.vertices = {{{0.0, 0.0}, 0.02}, {{1.0, 0.0}, 0.02}};
  return chain;
}

/// A map of a wall.
SavedMap some_map() {
  SavedMap saved;
  saved.world_frame = "odom";
  Feature& wall = saved.map.features.emplace_back();
  wall.id = 1;
  wall.shape = PolylineShape{some_chain().vertices, false};
  return saved;
}

std::vector<Format> formats() {
  return {
      {"objects",
       [](const std::string& path) {
         MapSnapshot snapshot;
         snapshot.world_frame = "odom";
         save_map(path, snapshot);
       },
       [](const std::string& path) { load_map(path); }},
      {"features", [](const std::string& path) { save_features(path, some_map()); },
       [](const std::string& path) { load_features(path, "odom"); }},
      {"grid",
       [](const std::string& path) {
         SemanticGrid grid;
         grid.cell_m = 0.5;
         save_geotiff(path, grid);
       },
       [](const std::string& path) { load_geotiff(path); }},
      {"elevation",
       [](const std::string& path) {
         Elevation(1, 1, {0.0, 0.0}, {1.0, 1.0}, {3.0F}).save(path);
       },
       [](const std::string& path) { Elevation::load(path); }},
      {"reflectors",
       [](const std::string& path) {
         save_reflector_map(path, {{{{1.0, 2.0}, 0.05}}});
       },
       [](const std::string& path) { load_reflector_map(path); }},
      {"local maps",
       [](const std::string& path) {
         save_local_maps({{0, {some_chain()}}}, path);
       },
       [](const std::string& path) { load_local_maps(path, 1); }},
  };
}

TEST_F(FileTest, NoKindReplacesAnother) {
  const std::string path = file("map");
  std::vector<std::pair<std::string, std::string>> others = {
      {"parameters", "objects:\n  max_elements: 3\nreflectors_file: a.yaml\n"},
      {"path", "path:\n  - {x: 0, y: 0}\n  - {x: 1, y: 0}\n"},
      {"lines", "{\"stamp_ns\": 1}\n"},
      {"bag", "#ROSBAG V2.0\n"}};
  for (const Format& format : formats()) {
    format.save(path);
    format.save(path);
    format.load(path);
    others.emplace_back(format.name, content(path));
    std::filesystem::remove(path);
  }
  for (const auto& [name, text] : others) {
    for (const Format& format : formats()) {
      if (format.name == name) continue;
      write(path, text);
      EXPECT_TRUE(names(refusal_of<std::runtime_error>([&, &f = format] { f.save(path); }), {path}))
          << format.name << " in place of " << name;
      EXPECT_EQ(content(path), text) << format.name << " in place of " << name;
    }
  }
  EXPECT_EQ(files(), 1);
}

TEST_F(FileTest, EachKindNamesTheFileThatCannotBeRead) {
  write(file("text"), "no map\n");
  write(file("huge"), "x");
  std::filesystem::resize_file(file("huge"), std::uintmax_t{1} << 34);
  for (const Format& format : formats()) {
    for (const std::string& path : {file("text"), file("huge"), file("missing"), folder_, std::string("/dev/zero")}) {
      const std::string refusal = refusal_of<std::exception>([&, &f = format] { f.load(path); });
      EXPECT_EQ(refusal.rfind(path + ": ", 0), 0U) << format.name << ": " << refusal;
    }
  }
}

/// MB, the greatest so far.
double most_memory_MB() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

/// A GeoTIFF of few bytes that says that it has very many cells.
void write_sparse_tiff(const std::string& path, int edge, int bands) {
  GDALAllRegister();
  const char* options[] = {"SPARSE_OK=TRUE", "TILED=YES", "BLOCKXSIZE=16384", "BLOCKYSIZE=16384", nullptr};
  GDALDatasetH dataset = GDALCreate(GDALGetDriverByName("GTiff"), path.c_str(), edge, edge, bands, GDT_Float32,
                                    const_cast<char**>(options));
  ASSERT_NE(dataset, nullptr);
  double transform[6] = {0.0, 1.0, 0.0, 0.0, 0.0, -1.0};
  GDALSetGeoTransform(dataset, transform);
  GDALClose(dataset);
  ASSERT_LT(std::filesystem::file_size(path), 100'000U);
}

TEST_F(FileTest, AFileOfFewBytesTakesLittleMemory) {
  const std::string begin =
      R"({"format": "situation_awareness features", "version": 1, "world_frame": "odom", "stamp": 0, "height": 0,)"
      R"("next_id": 1, "features": [{"kind": )";
  const std::string line = begin + R"("polyline", "outline": [[-9e5, 0], [9e5, 0]]}]})";
  const std::string arc = begin + R"("boundary", "outline": [[0, 0, 900], [1e3, 1, 900], [2e3, 0, 0]]}]})";
  const auto resume = [](const std::string& text) {
    MapPipeline({}, {false, true, true, false}).resume(map_from_json(text, "text", "odom"));
  };
  write_sparse_tiff(file("dem.tif"), 16000, 1);
  write_sparse_tiff(file("grid.tif"), 16000, 2);
  std::string vertices, aliases;
  for (int i = 0; i < 2000; ++i) vertices += i == 0 ? "[0, 0, 1]" : ", [0, 0, 1]";
  for (int i = 0; i < 20'000; ++i) aliases += ", *a";
  const std::string maps =
      "local_maps:\n  - segment: 0\n    chains: [&a {id: 1, closed: false, state: wall, p_exists: 1, first_seen_ns: 0, "
      "last_seen_ns: 0, vertices: [" +
      vertices + "]}" + aliases + "]\n";
  const std::vector<std::pair<std::string, std::function<void()>>> reads = {
      {"line", [&] { resume(line); }},
      {"arc", [&] { resume(arc); }},
      {"deep", [&] { map_from_json(std::string(10'000'000, '['), "deep", "odom"); }},
      {"elevation", [&] { Elevation::load(file("dem.tif")); }},
      {"grid", [&] { load_geotiff(file("grid.tif")); }},
      {"aliases", [&] { read_local_maps(maps, 1, "maps"); }},
  };
  for (const auto& [name, read] : reads) {
    const double before_MB = most_memory_MB();
    EXPECT_NE(refusal_of<std::exception>(read), "") << name;
    EXPECT_LT(most_memory_MB() - before_MB, 60.0) << name;
  }
}

using FileTestLong = FileTest;

TEST_F(FileTestLong, TheLargestMapsAreReadAsTheyWereWritten) {
  MapSnapshot objects;
  objects.world_frame = "odom";
  objects.stamp_ns = 1;
  MapElement element;
  for (ObjectEstimate* estimate : {&element.estimate.standing, &element.estimate.moving}) {
    estimate->x << 1.0 / 3.0, -2.0 / 3.0, 0.0, 0.0, 0.0, 0.1 + 0.2, 0.0, 0.0;
    estimate->P = Matrix8d::Identity() / 3.0;
  }
  element.P_view = Matrix8d::Identity() / 7.0;
  element.observations = std::numeric_limits<int>::max() / 4;
  const auto too_many = map_bounds::kMaxElements + 1;
  for (std::uint64_t id = 1; id < too_many; ++id) {
    element.id = id;
    objects.elements.push_back(element);
  }
  objects.next_id = too_many;
  save_map(file("objects.yaml"), objects);
  const MapSnapshot read = load_map(file("objects.yaml"), "odom");
  ASSERT_EQ(read.elements.size(), objects.elements.size());
  EXPECT_EQ(read.elements.back().estimate.moving.P, element.estimate.moving.P);
  ObjectMap map{ObjectMapParams()};
  map.restore(read);
  EXPECT_EQ(map.snapshot().elements.size(), objects.elements.size());
}

}  // namespace
}  // namespace situation_awareness::file_test
