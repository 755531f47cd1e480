// SPDX-License-Identifier: BSD-3-Clause
// Draws images with labels to train networks on: scripts/train/image_scenes.py writes the worlds and calls this.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "command_line.hpp"
#include "situation_awareness/sim/label_camera.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kDescription =
    "Draws a world from the poses in a file, one per line: X Y Z YAW PITCH ROLL, in metres and radians, at yaw 0 "
    "looking\n"
    "along x, at negative pitch down. Writes PREFIX0000.ppm, the image, and PREFIX0000.pgm, 255 where a pixel shows a\n"
    "shape whose material's name begins with CLASS and 0 elsewhere, PREFIX0001.ppm, ...\n";

struct Options {
  std::string world, poses, out, label = "car";
  int width = 448, height = 448;
  double fovy_rad = 1.0;
};

void add_options(CommandLine& app, Options& options) {
  app.add_option("--world", options.world, "the world").required().type_name("FILE");
  app.add_option("--poses", options.poses, "of the camera").required().type_name("FILE");
  app.add_option("--out", options.out, "where the images go").required().type_name("PREFIX");
  app.add_option("--class", options.label, "begin of the names of its materials").type_name("CLASS");
  app.add_option("--width", options.width, "of an image, in pixels").type_name("N").check(from_to(16.0, 4096.0));
  app.add_option("--height", options.height, "of an image, in pixels").type_name("N").check(from_to(16.0, 4096.0));
  app.add_option("--fovy", options.fovy_rad, "field of view from the lower edge to the upper")
      .type_name("RAD")
      .check(from_to(0.01, 3.0));
}

/// A camera (z ahead, x right, y down) by the direction in which it looks.
Eigen::Isometry3d pose_of(const std::array<double, 6>& numbers) {
  const auto& [x, y, z, yaw, pitch, roll] = numbers;
  Eigen::Matrix3d R_level_camera;
  R_level_camera << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << x, y, z;
  T.linear() = (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(-pitch, Eigen::Vector3d::UnitY()) *
                Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
                   .toRotationMatrix() *
               R_level_camera;
  return T;
}

std::vector<Eigen::Isometry3d> read_poses(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + ": cannot be read");
  std::vector<Eigen::Isometry3d> poses;
  std::string line;
  while (std::getline(file, line)) {
    std::istringstream words(line);
    std::array<double, 6> numbers{};
    for (double& number : numbers) {
      if (!(words >> number) || !std::isfinite(number)) {
        throw std::runtime_error(path + ": line " + std::to_string(poses.size() + 1) + " is not six numbers");
      }
    }
    poses.push_back(pose_of(numbers));
  }
  return poses;
}

void write_netpbm(const std::string& path, const char* kind, const LabelImage& image,
                  const std::vector<std::uint8_t>& bytes) {
  std::ofstream stream(path, std::ios::binary);
  stream << kind << '\n' << image.width << ' ' << image.height << "\n255\n";
  stream.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  stream.close();
  if (!stream) throw std::runtime_error(path + ": cannot be written");
}

void draw(const Options& options) {
  const World world(options.world);
  SimulatedLabelCameraParams params;
  params.width = options.width;
  params.height = options.height;
  params.fovy_rad = options.fovy_rad;
  params.color = 1;
  SimulatedLabelCamera camera(world, Eigen::Isometry3d::Identity(), params);
  std::vector<std::uint8_t> value_of_class;
  for (const std::string& name : camera.class_names()) {
    value_of_class.push_back(name.rfind(options.label, 0) == 0 ? 255 : 0);
  }
  const std::vector<Eigen::Isometry3d> poses = read_poses(options.poses);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const LabelImage image = camera.at(0.0, poses[i]);
    std::array<char, 32> number{};
    std::snprintf(number.data(), number.size(), "%04zu", i);
    write_netpbm(options.out + number.data() + ".ppm", "P6", image, image.rgb);
    std::vector<std::uint8_t> labels;
    labels.reserve(image.classes.size());
    for (const std::uint16_t index : image.classes) labels.push_back(value_of_class.at(index));
    write_netpbm(options.out + number.data() + ".pgm", "P5", image, labels);
  }
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  Options options;
  CommandLine app("image_samples", kDescription);
  add_options(app, options);
  return run_program(app, argc, argv, [&options] {
    draw(options);
    return 0;
  });
}
