// SPDX-License-Identifier: BSD-3-Clause
// Labels images by a network, as the nodelets do: for scripts/evaluate labels.
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "command_line.hpp"
#include "situation_awareness/image/label_network.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kDescription =
    "Labels images (binary PPM) by a network and writes, for each NAME.ppm, OUT/NAME.pgm: the probability of the "
    "class\n"
    "at each label pixel times 255. Prints one line each: the image and the milliseconds that it took on one core.\n";

struct Options {
  std::string model, out, class_name = "car";
  std::vector<std::string> images;
  LabelNetworkParams size;
};

void add_options(CommandLine& app, Options& options) {
  app.add_option("--model", options.model, "the network").required().type_name("FILE.onnx");
  app.add_option("--out", options.out, "where the labels go").required().type_name("FOLDER");
  app.add_option("--class", options.class_name, "of the network").type_name("NAME");
  app.add_option("--width", options.size.width, "to which images are scaled, a multiple of 32").type_name("N");
  app.add_option("--height", options.size.height, "to which images are scaled, a multiple of 32").type_name("N");
  app.add_option("images", options.images, "to label").required().type_name("FILE.ppm");
}

ColorImage read_ppm(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string kind;
  int most = 0;
  ColorImage image;
  if (!(file >> kind >> image.camera.width >> image.camera.height >> most) || kind != "P6" || most != 255 ||
      image.camera.width < 1 || image.camera.height < 1 || image.camera.width > 16384 || image.camera.height > 16384) {
    throw std::runtime_error(path + ": not a binary PPM of 8 bits");
  }
  file.get();
  image.rgb.resize(3 * static_cast<std::size_t>(image.camera.width) * static_cast<std::size_t>(image.camera.height));
  file.read(reinterpret_cast<char*>(image.rgb.data()), static_cast<std::streamsize>(image.rgb.size()));
  if (!file) throw std::runtime_error(path + ": ends too early");
  image.camera.fx_px = image.camera.fy_px = image.camera.width;  // not known, and without influence
  return image;
}

void write_pgm(const std::string& path, const SoftLabels& labels) {
  std::ofstream stream(path, std::ios::binary);
  stream << "P5\n" << labels.camera.width << ' ' << labels.camera.height << "\n255\n";
  for (const float p : labels.probability)
    stream.put(static_cast<char>(static_cast<unsigned char>(std::lround(255.0F * p))));
  stream.close();
  if (!stream) throw std::runtime_error(path + ": cannot be written");
}

void label(const Options& options) {
  LabelNetwork network(options.model, options.size);
  const std::size_t of_class = network.index_of(options.class_name);
  std::filesystem::create_directories(options.out);
  for (const std::string& path : options.images) {
    const ColorImage image = read_ppm(path);
    const auto start = std::chrono::steady_clock::now();
    const SoftLabels& labels = network.label(image)[of_class];
    const std::chrono::duration<double, std::milli> taken = std::chrono::steady_clock::now() - start;
    const std::filesystem::path name = std::filesystem::path(path).filename().replace_extension(".pgm");
    write_pgm((options.out / name).string(), labels);
    std::printf("%s %.3f\n", path.c_str(), taken.count());
  }
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  Options options;
  CommandLine app("label_images", kDescription);
  add_options(app, options);
  return run_program(app, argc, argv, [&options] {
    label(options);
    return 0;
  });
}
