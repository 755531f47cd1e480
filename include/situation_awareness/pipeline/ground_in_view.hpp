// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/image/image.hpp"
#include "situation_awareness/map/grid/elevation.hpp"
#include "situation_awareness/map/grid/grid_map.hpp"

namespace situation_awareness {

/// What images of a camera show of an elevation's ground, to tell why nothing can be mapped by them. Time and memory
/// are bounded, whatever the number of images.
class GroundInView {
 public:
  GroundInView(std::shared_ptr<const Elevation> elevation, double reach_m);

  /// An image, and what the map made of it.
  void add(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera, const GridUpdate& update);

  /// Why no image so far shows ground that is known, in one sentence: where the elevation is and where the camera
  /// looks, or that no label is known. Empty if one does, and without images.
  std::string why_none() const;

  /// For images of which no target came, though they show the class: the height above the elevation at which they agree
  /// where it is (m), to some metres, if that is not the ground; none if there is no such height, or several far apart.
  std::optional<double> agreed_height_m() const;
  /// The same as a sentence: of what zeros are elevation and poses? Empty if there is none.
  std::string why_no_target() const;

  std::size_t images() const { return images_; }
  std::size_t class_images() const { return class_images_; }  ///< that show the class somewhere on the ground

  /// "it spans x -100 to 100, y -100 to 100, z 0 to 0 m; the camera at (-34.6, -20.0, 22.0) looks at (1.0, 1.0, 0.0)",
  /// of the latest image.
  std::string places() const;

 private:
  /// Some of the directions in which an image shows the class.
  struct ClassView {
    Eigen::Vector3d p_world_m;
    std::vector<Eigen::Vector3d> rays_world;
  };

  std::optional<Eigen::Vector3d> looked_at() const;
  void keep(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera);
  int most_agreeing(double height_m) const;

  std::shared_ptr<const Elevation> elevation_;
  double reach_m_;
  Eigen::AlignedBox3d box_world_m_;
  std::size_t images_ = 0, known_images_ = 0, ground_images_ = 0, class_images_ = 0;
  Eigen::Isometry3d T_world_camera_ = Eigen::Isometry3d::Identity();  ///< of the latest image
  std::vector<ClassView> views_;
  std::size_t stride_ = 1;  ///< each such image that shows the class is kept
};

}  // namespace situation_awareness
