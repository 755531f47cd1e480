// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <utility>
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

  /// A part of a ground whose extent is that.
  void set_elevation(std::shared_ptr<const Elevation> elevation, const Eigen::AlignedBox3d& extent_world_m);
  /// What may help where the ground is not in view: the end of a sentence.
  void set_remedy(std::string remedy) { remedy_ = std::move(remedy); }

  /// An image, and what the map made of it.
  void add(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera, const GridUpdate& update);

  /// Why no image so far shows ground that is known, in one sentence: where the elevation is and where the camera
  /// looks, or that no label is known. Empty if one does, and without images.
  std::string why_none() const;

  /// For images of which no target came, though they show the class: the height above the elevation at which they agree
  /// where it is (m), to some metres, if that is not the ground; none if there is no such height, or several far apart.
  std::optional<double> agreed_height_m() const;
  /// One sentence that names agreed_height_m() and asks of what zeros elevation and poses are, or says that the class
  /// is nowhere on the ground, though most images show it. Empty if neither is so.
  std::string why_no_target() const;

  /// Why the latest image tells nothing of the ground; empty if it does.
  std::string why_not_latest() const;

  /// For images of which targets came: the same where the height is sharp, and beyond what a map finds of its
  /// elevation's error, so that all targets are beside what they are of. Empty if not.
  std::string why_wrong_targets() const;

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

  std::string why_no_ground() const;
  std::optional<Eigen::Vector3d> looked_at() const;
  void keep(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera);
  /// Images whose directions meet in one cell, at most, and as many as a direction has on average in its cell.
  struct Meeting {
    int most = 0;
    double mean = 0.0;
  };
  /// At which images agree where the class is, above the elevation, if it is not there.
  struct Height {
    std::optional<double> above_m = {};
    bool is_sharp = false;
  };
  Meeting meeting(double height_m, double cell_m) const;
  std::optional<double> sharp_height_m(double low_m, double high_m) const;
  Height find_height() const;
  const Height& height() const;
  std::string why_other_height() const;

  std::shared_ptr<const Elevation> elevation_;
  double reach_m_;
  Eigen::AlignedBox3d box_world_m_;
  std::string remedy_;
  bool is_latest_known_ = true, has_latest_ground_ = true;
  std::size_t images_ = 0, known_images_ = 0, ground_images_ = 0, class_images_ = 0;
  std::size_t label_images_ = 0;                                      ///< that show the class anywhere
  Eigen::Isometry3d T_world_camera_ = Eigen::Isometry3d::Identity();  ///< of the latest image
  std::vector<ClassView> views_;
  std::size_t stride_ = 1;  ///< each such image that shows the class is kept
  std::size_t kept_ = 0;    ///< views so far
  mutable Height height_;   ///< of so many, as it takes long to find
  mutable std::size_t height_of_views_ = 0;
};

}  // namespace situation_awareness
