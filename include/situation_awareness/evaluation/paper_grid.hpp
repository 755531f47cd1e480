// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>

#include <Eigen/Geometry>

#include "situation_awareness/image/image.hpp"
#include "situation_awareness/map/grid/elevation.hpp"
#include "situation_awareness/map/grid/grid.hpp"

namespace situation_awareness {

/// How the ScoutNet paper's grid takes a label image (Sect. V and Fig. 8).
enum class PaperGridMethod {
  kFull,        ///< rays through all cells that they pass below the class's height, and its cases
  kProjection,  ///< each pixel's label where its ray meets the ground
  kRays,        ///< each ray by itself: its label in all cells that it passes below the class's height
};

/// Throws std::invalid_argument if it is not full, projection or rays.
PaperGridMethod paper_grid_method(const std::string& name);

/// The ScoutNet paper's semantic grid, for comparison. Eq. 1 as it can be meant, phi = exp(alpha h_l / h_c)
/// exp(beta max(0, h_c - h_u) / h_c) p_f / n_f; eq. 2 as printed, but for a bound of the log odds. One ray per pixel,
/// of the class where its label is above a half.
class PaperGrid {
 public:
  PaperGrid(PaperGridMethod method, std::shared_ptr<const Elevation> elevation);

  void update(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera);

  SemanticGrid grid() const;

 private:
  /// Of one image: Table I.
  struct Cell {
    double highest_m = 0.0, lowest_m = 0.0;  ///< h_u, h_l of rays of the class
    bool has_class_ray = false;
    bool below = false, above = false;        ///< rays of the class pass below h_c, above it
    double n_for = 0.0, p_for = 0.0;          ///< n_f, p_f
    double n_against = 0.0, p_against = 0.0;  ///< n_a, p_a
  };
  using Place = std::pair<int, int>;  ///< column, row

  void cast(const Eigen::Vector3d& from_m, const Eigen::Vector3d& along, double probability,
            std::map<Place, Cell>& cells) const;
  void integrate(const std::map<Place, Cell>& cells);

  PaperGridMethod method_;
  std::shared_ptr<const Elevation> elevation_;
  std::map<Place, std::pair<double, int>> log_odds_;  ///< and images with evidence
};

}  // namespace situation_awareness
