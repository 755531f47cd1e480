// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Geometry>

namespace situation_awareness {

/// Rows from the top, three bytes (red, green, blue) per pixel.
struct Picture {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;
};

/// A camera of a world as MuJoCo draws it, without a screen (EGL, in software where there is no GPU). It draws all
/// shapes and colours of the file, also those invisible to the scanner. Use it from one thread.
class CameraView {
 public:
  /// Throws std::runtime_error where the file is no world, has no camera of that name, or rendering is not available;
  /// std::invalid_argument for sizes outside [16, 4096].
  CameraView(const std::string& mjcf_path, const std::string& camera, int width, int height);
  ~CameraView();

  /// Image of the world at that time, with the robot at the given pose.
  Picture at(double time_s, const Eigen::Isometry3d& T_world_robot);

  /// Pose of the camera at the last image: z ahead, x to the right and y down in the image.
  const Eigen::Isometry3d& T_world_camera() const;

  /// Focal length in pixels, the same in both directions; the optical axis passes through the image's centre.
  double focal_length_px() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace situation_awareness
