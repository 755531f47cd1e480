// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/map/splinegons/splinegons.hpp"

namespace situation_awareness {

/// A place of a boundary, known across it.
struct SplinegonElement {
  Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal_world = Eigen::Vector2d::UnitX();  ///< unit, toward the free side
  double variance_m2 = 0.0;                                 ///< across, above zero, independent of other elements'
};

struct SplinegonFitParams {
  int vertices = 16;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("vertices", self.vertices, Bounds{4, 64}, "",
          "main vertices of a boundary, a joint between any two: more where these do not follow it, fewer where there "
          "are "
          "not three elements for each");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// How well a boundary's elements were met.
struct SplinegonFitQuality {
  int as_polygon = 0;  ///< biarcs that do not follow the elements, where the polygon of these is given
  bool warm = false;   ///< began with the fit before
};

/// Fits splinegons to ordered elements of boundaries: the weighted least squares chain of biarcs, with Huber's loss,
/// over places and tangents of the main vertices; those are placed where the curvature changes, and there are as many
/// as it takes to follow the elements. Where arcs do not, it has the corners of the elements' polygon. Standard
/// deviations include what arcs do not follow (docs/math/splinegons.md). Its time is linear in the number of elements.
/// The same input gives the same output. It keeps its memory: no allocation after warm-up.
class SplinegonFit {
 public:
  /// Throws std::invalid_argument naming field and bound.
  explicit SplinegonFit(const SplinegonFitParams& params);
  ~SplinegonFit();
  SplinegonFit(SplinegonFit&&) noexcept;
  SplinegonFit& operator=(SplinegonFit&&) noexcept;

  /// Fits the elements, in order and counter-clockwise around the obstacle, some 0.05 to 0.5 m apart; there may be
  /// gaps. `vertices` holds an earlier fit of this boundary, from which a fit begins if it still holds, or nothing; it
  /// is overwritten with the new one as Splinegon has it. With fewer than 6 elements, or if they extend over less than
  /// 0.2 m, it is empty afterwards. Without `follow_tips` two neighbours that are off are left out as outliers are:
  /// where elements are in disorder the boundary would cross itself.
  SplinegonFitQuality fit(const std::vector<SplinegonElement>& elements, bool closed,
                          std::vector<SplinegonVertex>& vertices, bool follow_tips = true);

  /// The polygon of the elements instead, as a splinegon of straight arcs, simplified by 2 cm, which its standard
  /// deviations include. It is empty of fewer than 3 places.
  void fit_polygon(const std::vector<SplinegonElement>& elements, bool closed, std::vector<SplinegonVertex>& vertices);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace situation_awareness
