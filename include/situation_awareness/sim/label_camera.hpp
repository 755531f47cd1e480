// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

/// A camera whose images are labels: an ideal semantic segmentation.
struct SimulatedLabelCameraParams {
  double rate_hz = 5.0;
  int width = 320;
  int height = 240;
  double fovy_rad = radians(60.0);
  int color = 0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("rate_hz", self.rate_hz, Bounds{0.01, 100.0}, "Hz", "images per second");
    visit("width", self.width, Bounds{16, 4096}, "px", "columns of an image");
    visit("height", self.height, Bounds{16, 4096}, "px", "rows of an image");
    visit("fovy_rad", self.fovy_rad, Bounds{0.01, 3.0}, "rad", "field of view from the lower edge to the upper");
    visit("color", self.color, Bounds{0, 1}, "", "1: a colour picture with each image, as MuJoCo draws it");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "label_camera"); }
};

/// What each pixel of an image shows; rows from the top.
struct LabelImage {
  std::int64_t stamp_ns = 0;
  int width = 0, height = 0;
  double focal_length_px = 0.0;  ///< in both directions; the optical axis passes through the image's centre
  Eigen::Isometry3d T_world_camera =
      Eigen::Isometry3d::Identity();   ///< z ahead, x to the right and y down in the image
  std::vector<std::uint16_t> objects;  ///< TrueObject::id; 0: no object
  std::vector<std::uint16_t> classes;  ///< index in SimulatedLabelCamera::class_names()
  std::vector<std::uint8_t> rgb;       ///< red, green and blue of each pixel; empty without `color`
};

/// A label camera on the robot of a world: it sees all shapes that a camera sees (camera_view.hpp), with the site's z
/// axis ahead, x to the right and y down. A shape's class is its material in the file; all shapes of an object's body
/// have the object's id. Use it from one thread.
class SimulatedLabelCamera {
 public:
  /// `world` must outlive the camera; what it draws is read from the world's file when it is first needed. Throws
  /// std::invalid_argument for params.
  SimulatedLabelCamera(const World& world, const Eigen::Isometry3d& T_robot_camera,
                       const SimulatedLabelCameraParams& params);
  ~SimulatedLabelCamera();
  SimulatedLabelCamera(SimulatedLabelCamera&&) noexcept;

  const SimulatedLabelCameraParams& params() const;

  /// "nothing" for what is farther than all shapes, "no material", then the materials in the order of the file.
  /// Throws as next().
  const std::vector<std::string>& class_names();

  /// When the next image is due; the first is at time 0.
  double next_time_s() const;

  /// Throws std::runtime_error where rendering is not available.
  LabelImage next();

  /// The image from any other place, the robot being where it is at that time; no image of next() is passed over.
  LabelImage at(double time_s, const Eigen::Isometry3d& T_world_camera);

  /// Passes over the next image without drawing it, which changes no other.
  void skip();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace situation_awareness
