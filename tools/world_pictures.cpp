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

struct Arguments {
  bool help = false;
  std::string world_file, out, camera = "overview", times = "0";
  double width = 640.0, height = 480.0;
};

Arguments parse_arguments(int argc, char** argv) {
  Arguments arguments;
  arguments.help = read_options(argc, argv,
                                {{"--world", into(arguments.world_file)},
                                 {"--out", into(arguments.out)},
                                 {"--camera", into(arguments.camera)},
                                 {"--times", into(arguments.times)},
                                 {"--width", into(arguments.width, number)},
                                 {"--height", into(arguments.height, number)}});
  if (arguments.help) return arguments;
  require("--world", arguments.world_file);
  require("--out", arguments.out);
  return arguments;
}

void take_pictures(const Arguments& arguments) {
  const World world(arguments.world_file);
  CameraView view(arguments.world_file, arguments.camera, static_cast<int>(arguments.width),
                  static_cast<int>(arguments.height));
  std::istringstream words(arguments.times);
  int count = 0;
  for (std::string word; std::getline(words, word, ',');) {
    const double time_s = number("--times", word);
    std::array<char, 16> name{};
    std::snprintf(name.data(), name.size(), "%04d.ppm", count++);
    write_ppm(arguments.out + name.data(), view.at(time_s, world.robot_at(time_s).T_world_robot));
  }
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  return run_program("world_pictures", kUsage, argc, argv, parse_arguments, [](const Arguments& arguments) {
    take_pictures(arguments);
    return 0;
  });
}
