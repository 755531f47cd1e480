// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/map/splinegons/splinegon_map.hpp"
#include "situation_awareness/map/splinegons/splinegons.hpp"

namespace situation_awareness {

/// From the chains of a map of polygons to the boundaries of large obstacles: those whose extent is large, with the
/// small things in their gaps, are fitted by splinegons (docs/math/splinegons.md).
class ObstacleBoundaries {
 public:
  /// `spacing_m` and `max_gap_m` of the elements of chains (PolygonMapParams). Throws std::invalid_argument naming
  /// field and bound.
  ObstacleBoundaries(const SplinegonMapParams& boundaries, const SplinegonFitParams& fit, double spacing_m,
                     double max_gap_m);

  /// By which motion the places that were drawn at a time are going to move, where poses drift.
  using MotionOf = std::function<Pose2(std::int64_t first_seen_ns)>;

  /// Takes the chains of a map, whose latest polygons() these are. `moved`: they are elsewhere than before, though no
  /// scan hit them.
  void take(const PolygonMap& map, const Polygons& polygons, bool moved, const MotionOf& motion_of);

  /// Fits what was taken, those anew that a scan hit since the fit before: all boundaries, closed ones first.
  const Splinegons& fit(std::int64_t stamp_ns) { return map_.update(stamp_ns, boundaries_); }

  /// How they were fitted.
  const SplinegonMap& map() const { return map_; }

  /// By ascending chain: those that were taken. A boundary of theirs is given if it is large, and not within another
  /// one.
  const std::vector<ChainOfBoundary>& chains() const { return chains_; }

  /// As if all that was taken had moved.
  void move();

  /// Forgets what was taken.
  void clear();

 private:
  void take_elements(std::vector<SplinegonElement>& elements) const;
  void follow_puts();
  const ChainOfBoundary* was_of_closed(std::uint64_t chain) const;
  void name_closed(ObstacleBoundary& boundary, std::size_t first);
  void put_into_gaps(ObstacleBoundary& boundary);
  bool lead_around(ObstacleBoundary& boundary);
  void join_parts();
  void give_parts(ObstacleBoundary& boundary);
  bool find_parts(const ObstacleBoundary& boundary, Eigen::Vector2d from_m, const Eigen::Vector2d& to_m,
                  double reach_m);

  std::size_t in_a_row_;  ///< elements that are one
  double reach_m_;        ///< from one element of a chain to the next, at most
  SplinegonMap map_;
  std::vector<BoundaryElement> elements_;
  std::vector<ObstacleBoundary> boundaries_;
  std::vector<ObstacleBoundary*> parts_;  ///< others that lead from one place to another, in order
  std::vector<SplinegonElement> joined_;  ///< of a boundary and of parts_, kept for its memory
  std::vector<ChainOfBoundary> chains_;
  std::vector<ChainOfBoundary> put_;      ///< chains, and those that they were put into
  std::vector<ChainOfBoundary> closed_;   ///< of closed ones, as they were taken before, by chain
  std::vector<ChainOfBoundary> closing_;  ///< the same of what is taken now
};

}  // namespace situation_awareness
