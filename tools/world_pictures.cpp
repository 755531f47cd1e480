// SPDX-License-Identifier: BSD-3-Clause
// Images of a world by one of its cameras, at chosen times: for documents and animations.
#include <array>
#include <cstddef>
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "command_line.hpp"
#include "situation_awareness/sim/camera_view.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kDescription =
    "Draws a world (models/worlds/README.md) into PREFIX0000.ppm, PREFIX0001.ppm, ...\n";

struct Options {
  std::string world, out, camera = "overview";
  std::vector<double> times_s = {0.0};
  int width = 640, height = 480;
};

void add_options(CommandLine& app, Options& options) {
  app.add_option("--world", options.world, "the world").required().type_name("FILE");
  app.add_option("--out", options.out, "where the pictures go").required().type_name("PREFIX");
  app.add_option("--camera", options.camera, "of the world").type_name("NAME");
  app.add_option("--times", options.times_s, "one picture each")
      .type_name("S,S,...")
      .delimiter(',')
      .take_all()
      .check(from_to(0.0, 1e6));
  app.add_option("--width", options.width, "of a picture, in pixels").type_name("N").check(from_to(1.0, 1e5));
  app.add_option("--height", options.height, "of a picture, in pixels").type_name("N").check(from_to(1.0, 1e5));
}

void write_ppm(const std::string& path, const Picture& picture) {
  std::ofstream stream(path, std::ios::binary);
  stream << "P6\n" << picture.width << ' ' << picture.height << "\n255\n";
  stream.write(reinterpret_cast<const char*>(picture.rgb.data()), static_cast<std::streamsize>(picture.rgb.size()));
  stream.close();
  if (!stream) throw std::runtime_error(path + ": cannot be written");
}

void take_pictures(const Options& options) {
  const World world(options.world);
  CameraView view(options.world, options.camera, options.width, options.height);
  for (std::size_t i = 0; i < options.times_s.size(); ++i) {
    const double time_s = options.times_s[i];
    std::array<char, 32> name{};
    std::snprintf(name.data(), name.size(), "%04zu.ppm", i);
    write_ppm(options.out + name.data(), view.at(time_s, world.robot_at(time_s).T_world_robot));
  }
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  Options options;
  CommandLine app("world_pictures", kDescription);
  add_options(app, options);
  return run_program(app, argc, argv, [&options] {
    take_pictures(options);
    return 0;
  });
}
