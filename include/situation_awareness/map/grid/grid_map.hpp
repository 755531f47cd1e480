// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/image/image.hpp"
#include "situation_awareness/map/grid/elevation.hpp"
#include "situation_awareness/map/grid/grid.hpp"

namespace situation_awareness {

struct GridMapParams {
  double cell_m = 0.5;
  double reach_m = 220.0;
  double class_height_m = 1.5;
  double smooth_m = 2.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("cell_m", self.cell_m, Bounds{0.05, 10.0}, "m", "edge of a cell");
    visit("reach_m", self.reach_m, Bounds{5.0, 2000.0}, "m", "cells farther from the camera take no evidence");
    visit("class_height_m", self.class_height_m, Bounds{0.1, 20.0}, "m", "height of what belongs to the class");
    visit("smooth_m", self.smooth_m, Bounds{0.0, 100.0}, "m",
          "standard deviation of the Gaussian that the elevation is smoothed with, as its pixels have errors; 0: it is "
          "not");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "grid"); }
};

/// What an image did.
struct GridUpdate {
  std::size_t observed_cells = 0;  ///< with evidence
  std::size_t class_cells = 0;     ///< of them those with evidence for the class
};

/// The semantic grid of one class by label images with a pose (the ScoutNet paper, Sect. V; docs/math/grid.md). In the
/// place of casting each pixel's ray, the column above each cell, as high as the class, is projected into the image,
/// and the least probability along it is the evidence of this image: a column that is of the class from foot to top.
/// A cell is of the class where the mean of its evidence is at least half of the greatest near it, so that images that
/// miss the class now and then are no harm. An image that shows nothing of the class along a column counts less: it may
/// be hidden. Where something nearer may explain what a column shows, the image did not see it. What is above the
/// ground moves over it when the camera moves, so images from several directions must show the class, and not agree
/// better on something nearer. Elevation models have a common error, so the evidence is kept for nine of them, and that
/// in which the images agree best is believed.
class GridMap {
 public:
  static constexpr int kOffsets = 9;

  /// Throws std::invalid_argument naming field and bound.
  GridMap(const GridMapParams& params, std::shared_ptr<const Elevation> elevation);
  ~GridMap();
  GridMap(GridMap&&) noexcept;
  GridMap& operator=(GridMap&&) noexcept;

  /// Adds an image. Unknown labels are NaN or exactly 0.5. `T_world_camera`: z ahead, x to the right and y down in the
  /// image. Throws std::invalid_argument if the labels cannot be used or the pose is not finite; the map is then
  /// unchanged.
  GridUpdate update(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera);

  /// Other heights of the same ground, where images are next: cells that have a ground keep it.
  void set_elevation(std::shared_ptr<const Elevation> elevation);
  /// How far from the camera an elevation has an influence.
  double needed_reach_m() const;

  /// Forgets the cells farther than that from a place: a grid that scrolls with the vehicle.
  void keep_around(const Eigen::Vector2d& p_world_m, double distance_m);

  /// Keeps of the cells farther than that from a place what the map says of them, and frees the evidence behind. Where
  /// images show them again they are judged by these alone; up to then nothing changes there. `judged`: by read_class,
  /// after the latest image.
  void settle_beyond(const Eigen::Vector2d& p_world_m, double distance_m, const SemanticGrid& judged);

  /// Whether what the map says of a place is by evidence that was freed, and too few images have shown the place since
  /// to say something else.
  bool is_settled(const Eigen::Vector2d& p_world_m) const;

  /// The error of the elevation that is believed: the ground is so much higher than the model says.
  double elevation_offset_m() const;

  /// The cells of the tiles in which something of the class was seen, and which have evidence. Overwrites `grid`, whose
  /// memory it uses again.
  void read_class(SemanticGrid& grid) const;

  /// The cells of all observed tiles.
  SemanticGrid grid() const;

  const GridMapParams& params() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace situation_awareness
