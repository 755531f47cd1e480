// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/splinegons/splinegon_fit.hpp"
#include "situation_awareness/map/splinegons/splinegons.hpp"

namespace situation_awareness {

struct SplinegonMapParams {
  double min_extent_m = 2.5;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("min_extent_m", self.min_extent_m, Bounds{0.1, 1000.0}, "m",
          "largest distance of two places of an obstacle's boundary, at least; what is smaller is no large obstacle");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "boundaries"); }
};

/// What is known of the boundary of an obstacle: its elements, in order and counter-clockwise around the obstacle.
struct ObstacleBoundary {
  std::uint64_t id = 0;  ///< never used twice
  bool closed = false;
  bool moved = false;  ///< its elements are elsewhere than at the update before, though no scan hit them
  std::vector<SplinegonElement> elements;
  Pose2 motion;  ///< by which it is going to move, as far as is known
  std::int64_t first_seen_ns = 0, last_seen_ns = 0;
};

/// The boundaries of the large obstacles as splinegons. A boundary is fitted anew with each scan that hit it, or once
/// it moved, from the fit before. None that is given crosses itself, and closed ones run counter-clockwise: where a fit
/// does not, also from nothing, it is the polygon of the elements; where these do not, either, the boundary stays as it
/// was, and of a new one an open part is given. So none vanishes while it is there. An open one that is within a closed
/// one, or will be once it moves, is not given. It keeps its memory: no allocation after warm-up.
class SplinegonMap {
 public:
  /// Throws std::invalid_argument naming field and bound.
  SplinegonMap(const SplinegonMapParams& params, const SplinegonFitParams& fit);

  /// `boundaries`: all that are known after the scan with this stamp, those that are not given are gone. In the result
  /// closed ones come first. Its standard deviations are those of its elements: an error that all places share is not
  /// in them.
  const Splinegons& update(std::int64_t stamp_ns, const std::vector<ObstacleBoundary>& boundaries);

  /// The boundaries of the latest update.
  const Splinegons& splinegons() const { return splinegons_; }

  /// Number of boundaries of the latest update that are polygons, all or in part, as arcs do not follow their elements;
  /// and of those that stayed as they were, as their elements cross themselves.
  std::size_t polygons() const;
  std::size_t kept() const;

 private:
  enum class Outcome : std::uint8_t { kArcs, kPolygon, kKept };
  struct Fit {
    Outcome outcome = Outcome::kArcs;
    std::int64_t tips_failed_ns = StampOrder::kNone;  ///< when the ends of slim things made it cross itself
  };
  bool is_large(const ObstacleBoundary& boundary) const;
  bool is_inner(const ObstacleBoundary& boundary, std::size_t count) const;
  Fit fit(const ObstacleBoundary& boundary, std::int64_t stamp_ns, Splinegon& result);
  std::size_t count_of(Outcome outcome) const;
  void fit_part(const std::vector<SplinegonElement>& elements, Splinegon& result);
  bool is_sound(const Splinegon& splinegon, const std::vector<SplinegonElement>& elements);

  SplinegonMapParams params_;
  SplinegonFit fit_;
  Splinegons splinegons_, before_;
  std::vector<Fit> fits_, fits_before_;
  std::vector<SplinegonElement> part_;
  std::vector<Eigen::Vector2d> points_m_;  ///< of is_simple
};

}  // namespace situation_awareness
