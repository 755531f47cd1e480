// SPDX-License-Identifier: BSD-3-Clause
// Pictures of a world as one of its cameras sees it, at chosen times: for documents, and for films.
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>

#include "options.hpp"
#include "situation_awareness/sim/camera_view.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kUsage =
    "usage: world_pictures --world FILE.xml --out PREFIX [options]\n"
    "\n"
    "Draws a world (models/worlds/README.md) into PREFIX0000.ppm, PREFIX0001.ppm, ...\n"
    "\n"
    "  --camera NAME          of the world (overview)\n"
    "  --times S,S,...        one picture each (0)\n"
    "  --width N --height N   of a picture, in pixels (640 x 480)\n"
    "  --help                 this text\n";

double number(const std::string& option, const std::string& text) {
  const double value = number_of(text);
  if (!(value >= 0.0 && value <= 1e6)) {
    throw UsageError(option + " needs a number from 0 to 1e6, not " + text);
  }
  return value;
}

void write_ppm(const std::string& path, const Picture& picture) {
  std::ofstream stream(path, std::ios::binary);
  stream << "P6\n" << picture.width << ' ' << picture.height << "\n255\n";
  stream.write(reinterpret_cast<const char*>(picture.rgb.data()), static_cast<std::streamsize>(picture.rgb.size()));
  stream.close();
  if (!stream) throw std::runtime_error(path + ": cannot be written");
}

int run(int argc, char** argv) {
  std::string world_file, out, camera = "overview", times = "0";
  double width = 640.0, height = 480.0;
  const auto number_into = [](double& place) {
    return [&place](const std::string& option, const std::string& text) { place = number(option, text); };
  };
  const bool help = read_options(argc, argv,
                                 {{"--world", into(world_file)},
                                  {"--out", into(out)},
                                  {"--camera", into(camera)},
                                  {"--times", into(times)},
                                  {"--width", number_into(width)},
                                  {"--height", number_into(height)}});
  if (help) {
    std::printf("%s", kUsage);
    return 0;
  }
  require("--world", world_file);
  require("--out", out);
  const World world(world_file, {}, 0);
  CameraView view(world_file, camera, static_cast<int>(width), static_cast<int>(height));
  std::istringstream words(times);
  int count = 0;
  for (std::string word; std::getline(words, word, ',');) {
    const double time_s = number("--times", word);
    std::array<char, 16> name{};
    std::snprintf(name.data(), name.size(), "%04d.ppm", count++);
    write_ppm(out + name.data(), view.at(time_s, world.robot_at(time_s).T_world_robot));
  }
  return 0;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  return run_program("world_pictures", kUsage, [&] { return run(argc, argv); });
}
