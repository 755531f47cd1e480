// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "biarc_chain.hpp"
#include "biarc_residuals.hpp"
#include "boundary_elements.hpp"
#include "situation_awareness/geometry/simplify.hpp"
#include "situation_awareness/map/splinegons/splinegons.hpp"

namespace situation_awareness {

/// The parts of a chain of biarcs that do not follow the elements, where the polygon of these is given.
class PolygonParts {
 public:
  PolygonParts(const BoundaryElements& elements, const BiarcChain& chain) : elements_(elements), chain_(chain) {}

  /// Finds the polygons by the chain's residuals.
  void find();

  /// Whether a biarc is of a polygon, and the number of those that are.
  bool contains(std::size_t biarc) const { return is_polygon_[biarc]; }
  std::ptrdiff_t count() const { return std::count(is_polygon_.begin(), is_polygon_.end(), true); }
  const BiarcResiduals& residuals(std::size_t biarc) const { return residuals_[biarc]; }
  /// Where a biarc begins that is given as arcs.
  Eigen::Vector2d begin_of(std::size_t biarc) const;
  /// The length of an arc beside a polygon that lies beyond, at its biarc's begin or end; else 0.
  double cut_m(std::size_t arc) const { return cut_m_[arc]; }

  /// Appends the polygon of the elements of some biarcs in a row but for its last vertex, which is the begin of what is
  /// after them.
  void append(std::size_t biarc, std::size_t count, std::vector<SplinegonVertex>& vertices);

  /// Appends the polygon of these places.
  void clear_corners() { corners_m_.clear(); }
  void add_corner(const Eigen::Vector2d& p_m, double sigma_m) { corners_m_.push_back({p_m, sigma_m}); }
  /// Simplified: with the last corner as the end of an open boundary, around a closed one, or up to it.
  void append_corners(bool is_end, bool is_whole, std::vector<SplinegonVertex>& vertices);

 private:
  /// Elements in a row.
  struct Run {
    std::size_t first = 0, elements = 0;
  };
  struct PolygonCorner {
    Eigen::Vector2d p_m;
    double sigma_m;
  };

  void find_misfits();
  void spread();
  bool cut_beside();
  std::size_t first_element(std::size_t biarc) const;
  Run elements_of(std::size_t biarc, std::size_t count) const;
  Eigen::Vector2d end_of(std::size_t biarc) const;

  const BoundaryElements& elements_;
  const BiarcChain& chain_;
  std::vector<BiarcResiduals> residuals_;
  std::vector<bool> is_polygon_;  ///< of biarcs
  std::vector<double> cut_m_;     ///< of each arc
  std::vector<PolygonCorner> corners_m_;
  std::vector<std::size_t> kept_;
  Simplification simplification_;
};

}  // namespace situation_awareness
