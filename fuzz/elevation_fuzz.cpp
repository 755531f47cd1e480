// SPDX-License-Identifier: BSD-3-Clause
// Elevations in files, as they were saved and damaged, and any bytes as a file.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <cpl_vsi.h>

#include "input.hpp"
#include "situation_awareness/common/file.hpp"
#include "situation_awareness/map/grid/elevation.hpp"

namespace situation_awareness::fuzz {
namespace {

constexpr const char* kFile = "/vsimem/elevation.tif";  // in memory, of GDAL
constexpr std::size_t kMostBytes = 1 << 20;             ///< more than a saved elevation has here

/// A folder of this process alone, which is removed at its end.
class Folder {
 public:
  Folder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "elevation_fuzz.XXXXXX").string();
    require(::mkdtemp(pattern.data()) != nullptr, "a temporary folder can be made");
    path_ = pattern;
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// The elevation of a file, unless it is refused with a sentence that names the file.
std::optional<Elevation> load(const std::string& path) {
  try {
    return Elevation::load(path);
  } catch (const std::runtime_error& error) {
    require(std::string(error.what()).rfind(path, 0) == 0, "a refusal names the file");
    return std::nullopt;
  }
}

void write(std::string& bytes) {
  VSILFILE* const file = VSIFileFromMemBuffer(kFile, reinterpret_cast<GByte*>(bytes.data()), bytes.size(), FALSE);
  if (file != nullptr) VSIFCloseL(file);
}

void check_heights(const Elevation& elevation, Input& input) {
  for (int i = 0; i < 8; ++i) {
    const double x_m = elevation.corner_world_m().x() + input.uniform(-1.0, 5.0) * elevation.pixel_m().x();
    const double y_m = elevation.corner_world_m().y() - input.uniform(-1.0, 5.0) * elevation.pixel_m().y();
    require(!std::isinf(elevation.at(x_m, y_m)), "a height is a number or not known");
  }
}

void run(Input input) {
  if (input.flag()) {
    std::string bytes = input.rest();
    write(bytes);
    if (const auto elevation = load(kFile)) check_heights(*elevation, input);
    VSIUnlink(kFile);
    return;
  }
  const int width = input.integer(1, 6), height = input.integer(1, 6);
  std::vector<float> heights_m;
  for (int i = 0; i < width * height; ++i) heights_m.push_back(input.any<float>());
  const Elevation saved(width, height, {input.uniform(-1e6, 1e6), input.uniform(-1e6, 1e6)},
                        {input.by_magnitude(1e-3, 1e3), input.by_magnitude(1e-3, 1e3)}, std::move(heights_m));
  // Elevation::save renames what it has written, which files in GDAL's memory do not know.
  static const Folder folder;
  const std::string path = (folder.path() / "elevation.tif").string();
  saved.save(path);
  const auto read = load(path);
  require(read.has_value(), "what is saved is read");
  require(read->width() == width && read->height() == height, "with its size");
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      const double x_m = saved.corner_world_m().x() + (column + 0.5) * saved.pixel_m().x();
      const double y_m = saved.corner_world_m().y() - (row + 0.5) * saved.pixel_m().y();
      require(std::isnan(saved.at(x_m, y_m)) == std::isnan(read->at(x_m, y_m)), "and what is known");
    }
  }
  std::string bytes = read_file(path, kMostBytes);
  for (int i = input.integer(1, 4); i > 0; --i) {
    bytes[input.count(bytes.size() - 1)] ^= static_cast<char>(1 << input.integer(0, 7));
  }
  if (input.flag()) bytes.resize(input.count(bytes.size()));
  write(bytes);
  if (const auto elevation = load(kFile)) check_heights(*elevation, input);
  VSIUnlink(kFile);
}

}  // namespace
}  // namespace situation_awareness::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  situation_awareness::fuzz::run({data, size});
  return 0;
}
