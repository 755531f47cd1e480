// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/path/obstacles.hpp"
#include "situation_awareness/path/segment_path.hpp"

namespace situation_awareness {

/// Paths around obstacles at a constant distance (docs/math/circumnavigation.md).
///
/// A circle of the turning radius R rolls around the obstacles, grown by the stand-off D, and the path is where its
/// edge touches them: the offset of the boundary by D, which consists of arcs, where that turns no tighter than the
/// vehicle; elsewhere, in a corner between two pieces, an arc of radius R, which comes no nearer than D to either. So
/// with D >= R the path has a curvature of at most 1 / R, everything is D away from it at least, and beside each of its
/// places, on the side away from the obstacle, there is a free circle on which the vehicle can turn. Obstacles between
/// which it cannot pass so are gone around together. Around the open end of an outline it leads to the other side.
///
/// Keeps its memory: no allocation after warm-up.
class StandoffOrbit {
 public:
  /// `usual_pieces`: memory for so many from the begin on.
  explicit StandoffOrbit(std::size_t usual_pieces = 0) {
    pieces_.reserve(usual_pieces);
    runs_.reserve(usual_pieces);
  }

  /// The closed path around obstacle `target`, and others that are near it, counter-clockwise (`side` +1: the obstacle
  /// is to the left) or clockwise (-1). `hint_m`: a point from which the circle rolls off if it is free there, else it
  /// comes from outside. `standoff_m` >= `radius_m` > 0. A target that others hide is gone around with these. False,
  /// and an empty path, if there is no path around it from these places. The cost is the product of the numbers of
  /// pieces and of the path's.
  bool trace(const Obstacles& obstacles, std::size_t target, double side, double standoff_m, double radius_m,
             const Eigen::Vector2d& hint_m, SegmentPath& orbit);

 private:
  /// Where the circle is, and what it touches: a piece, or the end of one.
  struct Contact {
    std::size_t piece = ObstaclePiece::kNone;
    bool at_end = false;  ///< it touches the piece's begin (not `last`) or its end
    bool last = false;
    bool forward = true;  ///< rolls along the piece's direction
    double way_m = 0.0;   ///< along the piece
    Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
    Eigen::Vector2d out = Eigen::Vector2d::UnitX();  ///< unit, from what it touches to its centre
  };

  void stand_on_piece(Contact& contact) const;
  bool come_from(const Eigen::Vector2d& from_m, const Eigen::Vector2d& toward_m, Contact& contact) const;
  bool touch(std::size_t piece, std::size_t from, const Eigen::Vector2d& center_m, Contact& contact) const;
  bool roll(const Contact& start, std::size_t target_piece, SegmentPath& orbit);
  bool roll_along(Contact& contact, SegmentPath& orbit) const;
  bool roll_about_end(Contact& contact, SegmentPath& orbit) const;
  void pass_to_next(Contact& contact) const;
  std::size_t first_met(const Curve& way, std::size_t but, std::size_t but_too, double& met_m) const;
  std::size_t first_met_on(const Curve& part, std::size_t but, std::size_t but_too, double& met_m) const;
  Eigen::Vector2d place_of(const Contact& contact) const;
  void fill_corner(const Contact& from, const Contact& to, SegmentPath& orbit) const;

  double standoff_m_ = 0.0, radius_m_ = 0.0, reach_m_ = 0.0;
  std::vector<ObstaclePiece> pieces_;  ///< mirrored to go around clockwise
  std::vector<PieceRun> runs_;         ///< as well
};

}  // namespace situation_awareness
