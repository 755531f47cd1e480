// SPDX-License-Identifier: BSD-3-Clause
// Draws a world without a screen. Private to sim/, because it shows MuJoCo.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>
#include <Eigen/Geometry>

#include "world_model.hpp"

namespace situation_awareness {

/// A world with an OpenGL context of its own (EGL), to be used from the thread that made it; others may be beside it.
/// Its calls of MuJoCo are to be guarded by MujocoThrows.
class OffscreenWorld {
 public:
  /// Throws std::runtime_error where the file is no world or rendering is not available; std::invalid_argument for
  /// sizes outside [16, 4096].
  OffscreenWorld(const std::string& mjcf_path, int width, int height);
  ~OffscreenWorld();
  OffscreenWorld(const OffscreenWorld&) = delete;
  OffscreenWorld& operator=(const OffscreenWorld&) = delete;

  int width() const { return width_; }
  int height() const { return height_; }
  WorldModel& world() { return world_; }
  mjvScene& scene() { return scene_; }

  /// Puts everything where it is at that time, the robot where it is said to be, and what `camera` sees into the scene.
  void update_scene(double time_s, const Eigen::Isometry3d& T_world_robot, mjvCamera& camera);

  /// The scene: rows from the top, three bytes (red, green, blue) per pixel.
  std::vector<std::uint8_t> render();

 private:
  class Context;

  int width_, height_;
  WorldModel world_;
  std::unique_ptr<Context> context_;
  mjvScene scene_;
  mjrContext renderer_;
  mjvOption option_;
};

}  // namespace situation_awareness
