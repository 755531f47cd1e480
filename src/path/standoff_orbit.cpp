// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/standoff_orbit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <variant>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

constexpr std::size_t kNone = ObstaclePiece::kNone;
/// rad. Rounding of the direction of a contact: corners of less are none.
constexpr double kSameDirection_rad = 1e-6;
/// m. Of a circle's place, by which it touches two pieces.
constexpr double kRounding_m = 1e-7;
/// m. Of places of a circle.
constexpr double kSamePlace_m = 1e-4;
/// m, rad. A path that comes so near to its begin is closed: where a circle passes from piece to piece is known to
/// micrometres, from one of two that it touches at a grazing angle to less; and so long it is at least.
constexpr double kClosed_m = 1e-3, kClosed_rad = 1e-3, kLeastOrbit_m = 0.1;
/// m. Of a way along which it is looked what the circle meets: the first part.
constexpr double kFirstPart_m = 1.0;
/// Directions from which the circle comes from outside.
constexpr int kDirections = 16;

Eigen::Vector2d mirrored(const Eigen::Vector2d& v) { return {v.x(), -v.y()}; }

double angle_of(const Eigen::Vector2d& v) { return std::atan2(v.y(), v.x()); }

/// The turn, counter-clockwise, in [0, 2 pi); rounding makes none of nearly 2 pi.
double turn_rad(double from_rad, double to_rad) {
  double turn = std::remainder(to_rad - from_rad, 2.0 * kPi);
  if (turn < -kSameDirection_rad) turn += 2.0 * kPi;
  return std::max(turn, 0.0);
}

/// Direction away from a piece's begin or end, along it.
Eigen::Vector2d into(const Curve& curve, bool from_end) {
  return from_end ? Eigen::Vector2d(-along_at(curve, curve.length_m)) : curve.along;
}

Curve reversed(const Curve& curve) {
  return {point_at(curve, curve.length_m), into(curve, true), -curve.curvature_1_m, curve.length_m};
}

}  // namespace

/// On the path: toward what is touched.
Eigen::Vector2d StandoffOrbit::place_of(const Contact& contact) const {
  return contact.center_m - radius_m_ * contact.out;
}

/// The first piece that comes within reach of a circle whose centre moves along a curve; kNone if none does. Most ways
/// end soon, so near parts come first: these have few pieces near them.
std::size_t StandoffOrbit::first_met(const Curve& way, std::size_t but, std::size_t but_too, double& met_m) const {
  double from_m = 0.0;
  for (double part_m = kFirstPart_m; from_m < way.length_m; part_m *= 2.0) {
    const double to_m = std::min(from_m + part_m, way.length_m);
    const std::size_t met = first_met_on(part_of(way, from_m, to_m), but, but_too, met_m);
    met_m += from_m;
    if (met != kNone) return met;
    from_m = to_m;
  }
  met_m = way.length_m;
  return kNone;
}

std::size_t StandoffOrbit::first_met_on(const Curve& part, std::size_t but, std::size_t but_too, double& met_m) const {
  std::size_t met = kNone;
  met_m = part.length_m;
  const Eigen::Vector2d middle_m = point_at(part, 0.5 * part.length_m);
  const double near_m = 0.5 * part.length_m + reach_m_ + kSamePlace_m;
  for (const PieceRun& run : runs_) {
    const double run_m = near_m + run.radius_m;
    if ((middle_m - run.middle_m).squaredNorm() > run_m * run_m) continue;
    for (std::size_t i = run.first; i < run.end; ++i) {
      if (i == but || i == but_too) continue;
      const double piece_m = near_m + pieces_[i].half_m;
      if ((middle_m - pieces_[i].middle_m).squaredNorm() > piece_m * piece_m) continue;
      std::optional<double> at_m = first_nearer_m(part, pieces_[i].curve, reach_m_);
      if (at_m && *at_m == 0.0) {
        // What it touches may be nearer by rounding.
        at_m = first_nearer_m(part, pieces_[i].curve, distance_m(pieces_[i].curve, part.from_m) - kRounding_m);
      }
      if (!at_m || *at_m >= met_m) continue;
      met_m = *at_m;
      met = i;
    }
  }
  return met;
}

/// How a circle at a place touches a piece. Counter-clockwise: what it touches is to the left of its way.
/// `from`: the piece along which it came, if any.
bool StandoffOrbit::touch(std::size_t piece, std::size_t from, const Eigen::Vector2d& center_m,
                          Contact& contact) const {
  contact.piece = piece;
  contact.way_m = nearest_m(pieces_[piece].curve, center_m);
  // At a joint it may be the other piece, at a grazing angle by rounding.
  const bool at_begin = contact.way_m <= 0.0, at_end = contact.way_m >= pieces_[piece].curve.length_m;
  const std::size_t beside = at_begin ? pieces_[piece].before : at_end ? pieces_[piece].after : kNone;
  if (beside != kNone && beside != from) {
    const double way_m = nearest_m(pieces_[beside].curve, center_m);
    if (way_m > 0.0 && way_m < pieces_[beside].curve.length_m) {
      contact.piece = beside;
      contact.way_m = way_m;
    }
  }
  const Curve& curve = pieces_[contact.piece].curve;
  contact.center_m = center_m;
  const Eigen::Vector2d away = center_m - point_at(curve, contact.way_m);
  if (away.norm() < 0.5 * reach_m_) return false;
  contact.out = away.normalized();
  const Eigen::Vector2d along = along_at(curve, contact.way_m);
  contact.forward = cross(along, contact.out) < 0.0;
  contact.at_end = std::abs(along.dot(contact.out)) > kSameDirection_rad;
  contact.last = contact.way_m > 0.5 * curve.length_m;
  if (!contact.at_end) stand_on_piece(contact);
  return true;
}

/// Exactly, so that errors of rounding do not add up from piece to piece.
void StandoffOrbit::stand_on_piece(Contact& contact) const {
  const Curve& curve = pieces_[contact.piece].curve;
  const Eigen::Vector2d left = left_of(along_at(curve, contact.way_m));
  contact.out = contact.forward ? Eigen::Vector2d(-left) : left;
  contact.center_m = point_at(curve, contact.way_m) + reach_m_ * contact.out;
}

bool StandoffOrbit::come_from(const Eigen::Vector2d& from_m, const Eigen::Vector2d& toward_m, Contact& contact) const {
  if ((toward_m - from_m).norm() < kSamePlace_m) return false;
  for (const PieceRun& run : runs_) {
    if ((from_m - run.middle_m).norm() - run.radius_m >= reach_m_) continue;
    for (std::size_t i = run.first; i < run.end; ++i) {
      if (distance_m(pieces_[i].curve, from_m) < reach_m_) return false;
    }
  }
  double met_m = 0.0;
  const Curve way = straight_curve(from_m, toward_m);
  const std::size_t met = first_met(way, kNone, kNone, met_m);
  return met != kNone && touch(met, kNone, point_at(way, met_m), contact);
}

/// From one piece to the other, both of which the circle touches: a turn to the right on the circle itself.
void StandoffOrbit::fill_corner(const Contact& from, const Contact& to, SegmentPath& orbit) const {
  const double from_rad = angle_of(-from.out);
  const double sweep_rad = turn_rad(angle_of(-to.out), from_rad);
  append(orbit, Arc{from.center_m, radius_m_, from_rad, -sweep_rad});
}

/// At the end of the piece along which it rolled: on the next one, about the end if there is a corner outward.
void StandoffOrbit::pass_to_next(Contact& contact) const {
  const ObstaclePiece& piece = pieces_[contact.piece];
  contact.last = contact.forward;
  const std::size_t next = contact.forward ? piece.after : piece.before;
  contact.at_end = true;
  if (next == kNone) return;
  const bool next_from_end = !contact.forward;
  const Eigen::Vector2d ahead = left_of(contact.out);
  const Eigen::Vector2d beyond = into(pieces_[next].curve, next_from_end);
  if (cross(ahead, beyond) > kSameDirection_rad || ahead.dot(beyond) < 0.0) return;
  // Smooth, or inward by rounding: what is more is met before.
  contact.piece = next;
  contact.forward = !next_from_end;
  contact.way_m = next_from_end ? pieces_[next].curve.length_m : 0.0;
  contact.at_end = false;
  stand_on_piece(contact);
}

bool StandoffOrbit::roll_along(Contact& contact, SegmentPath& orbit) const {
  const Curve& curve = pieces_[contact.piece].curve;
  const Curve rest =
      contact.forward ? part_of(curve, contact.way_m, curve.length_m) : reversed(part_of(curve, 0.0, contact.way_m));
  // Offset to the right by the reach: lengths change by 1 + curvature * offset.
  const double k = rest.curvature_1_m;
  const double wider = 1.0 + k * reach_m_;
  if (wider < 0.0) return false;  // a bow tighter than the circle: its middle is never touched
  const Eigen::Vector2d ahead = left_of(contact.out);
  Curve way{contact.center_m, ahead, wider > 1e-9 ? k / wider : 0.0, rest.length_m * wider};
  double rolled_m = way.length_m;
  const std::size_t met = way.length_m > 0.0 ? first_met(way, contact.piece, kNone, rolled_m) : kNone;
  const double turned_rad = way.curvature_1_m * rolled_m;
  const double rolled_rest_m = wider > 1e-9 ? rolled_m / wider : rest.length_m;
  // The path is nearer by the radius of the circle.
  const double path_wider = 1.0 + k * standoff_m_;
  const double path_m = rolled_rest_m * path_wider;
  const Eigen::Vector2d begin_m = place_of(contact);
  if (std::abs(turned_rad) < 1e-9) {
    append(orbit, Straight{begin_m, begin_m + path_m * ahead, angle_of(ahead)});
  } else {
    const double sign = std::copysign(1.0, k);
    const double path_radius_m = path_wider / std::abs(k);
    const Eigen::Vector2d from_center = -sign * left_of(ahead);
    append(orbit, Arc{begin_m - path_radius_m * from_center, path_radius_m, angle_of(from_center),
                      sign * path_m / path_radius_m});
  }
  const Contact before = contact;
  contact.center_m = point_at(way, rolled_m);
  contact.out = Eigen::Rotation2Dd(rest.curvature_1_m * rolled_rest_m) * before.out;
  contact.way_m = before.way_m + (before.forward ? rolled_rest_m : -rolled_rest_m);
  if (met == kNone) {
    pass_to_next(contact);
    return true;
  }
  const Contact here = contact;
  if (!touch(met, here.piece, here.center_m, contact)) return false;
  fill_corner(here, contact, orbit);
  return true;
}

bool StandoffOrbit::roll_about_end(Contact& contact, SegmentPath& orbit) const {
  const ObstaclePiece& piece = pieces_[contact.piece];
  const Eigen::Vector2d vertex_m = point_at(piece.curve, contact.last ? piece.curve.length_m : 0.0);
  // The piece at this end that it comes to first, with its direction to the left of the circle.
  const double out_rad = angle_of(contact.out);
  const std::size_t other = contact.last ? piece.after : piece.before;
  const auto until = [&](std::size_t at, bool from_end) {
    return turn_rad(out_rad, angle_of(into(pieces_[at].curve, from_end)) - 0.5 * kPi);
  };
  std::size_t next = contact.piece;
  bool from_end = contact.last;
  double sweep_rad = until(next, from_end);
  if (other != kNone) {
    const double other_rad = until(other, !contact.last);
    if (other_rad < sweep_rad) {
      next = other;
      from_end = !contact.last;
      sweep_rad = other_rad;
    }
  }
  const Eigen::Vector2d ahead = left_of(contact.out);
  const Curve way{contact.center_m, ahead, 1.0 / reach_m_, reach_m_ * sweep_rad};
  double rolled_m = way.length_m;
  const std::size_t met = first_met(way, contact.piece, other, rolled_m);
  const double turned_rad = rolled_m / reach_m_;
  append(orbit, Arc{vertex_m, standoff_m_, out_rad, turned_rad});
  contact.center_m = point_at(way, rolled_m);
  contact.out = Eigen::Rotation2Dd(turned_rad) * contact.out;
  if (met == kNone) {
    contact.piece = next;
    contact.forward = !from_end;
    contact.way_m = from_end ? pieces_[next].curve.length_m : 0.0;
    contact.at_end = false;
    stand_on_piece(contact);
    return true;
  }
  const Contact here = contact;
  if (!touch(met, here.piece, here.center_m, contact)) return false;
  fill_corner(here, contact, orbit);
  return true;
}

bool StandoffOrbit::roll(const Contact& start, std::size_t target_piece, SegmentPath& orbit) {
  const std::size_t target = pieces_[target_piece].obstacle;
  Contact contact = start;
  bool touched_target = false;
  const auto step = [&] {
    touched_target = touched_target || pieces_[contact.piece].obstacle == target;
    return contact.at_end ? roll_about_end(contact, orbit) : roll_along(contact, orbit);
  };
  // To the next piece, where the path begins, and then until it is there again, on the same piece or, by rounding, on
  // the one beside it.
  if (!step()) return false;
  clear(orbit);
  const Eigen::Vector2d first_m = place_of(contact);
  const double first_rad = angle_of(left_of(contact.out));
  for (std::size_t i = 0; i < 6 * pieces_.size() + 20; ++i) {
    const double before_m = orbit.length_m;
    if (!step()) return false;
    if (orbit.length_m < kLeastOrbit_m ||
        (place_of(contact) - first_m).norm() > orbit.length_m - before_m + kClosed_m) {
      continue;
    }
    const double way_m = nearest_m(orbit, first_m, std::max(before_m, kLeastOrbit_m), orbit.length_m);
    const Pose2 there = place_at(orbit, way_m).pose;
    if ((there.translation_m - first_m).norm() > kClosed_m ||
        std::abs(wrap_to_pi(there.yaw_rad - first_rad)) > kClosed_rad) {
      continue;
    }
    cut(orbit, way_m);
    return touched_target || turns_around(orbit, pieces_[target_piece].middle_m) == 1;
  }
  return false;
}

bool StandoffOrbit::trace(const Obstacles& obstacles, std::size_t target, double side, double standoff_m,
                          double radius_m, const Eigen::Vector2d& hint_m, SegmentPath& orbit) {
  standoff_m_ = standoff_m;
  radius_m_ = radius_m;
  reach_m_ = standoff_m + radius_m;
  pieces_.assign(obstacles.pieces().begin(), obstacles.pieces().end());
  runs_.assign(obstacles.runs().begin(), obstacles.runs().end());
  if (side < 0.0) {
    for (PieceRun& run : runs_) run.middle_m = mirrored(run.middle_m);
    for (ObstaclePiece& piece : pieces_) {
      piece.curve.from_m = mirrored(piece.curve.from_m);
      piece.curve.along = mirrored(piece.curve.along);
      piece.curve.curvature_1_m = -piece.curve.curvature_1_m;
      piece.middle_m = mirrored(piece.middle_m);
    }
  }
  const Obstacle& wanted = obstacles.obstacles()[target];
  const Eigen::Vector2d hint = side < 0.0 ? mirrored(hint_m) : hint_m;
  Eigen::Vector2d low_m = pieces_[wanted.first].middle_m, high_m = low_m, nearest = low_m;
  double least_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = wanted.first; i < wanted.first + wanted.pieces; ++i) {
    low_m = low_m.cwiseMin(pieces_[i].middle_m);
    high_m = high_m.cwiseMax(pieces_[i].middle_m);
    const Eigen::Vector2d p_m = point_at(pieces_[i].curve, nearest_m(pieces_[i].curve, hint));
    if ((p_m - hint).norm() >= least_m) continue;
    least_m = (p_m - hint).norm();
    nearest = p_m;
  }
  const Eigen::Vector2d middle_m = 0.5 * (low_m + high_m);
  double far_m = 0.0;
  for (const PieceRun& run : runs_) {
    far_m = std::max(far_m, (run.middle_m - middle_m).norm() + run.radius_m + 2.0 * reach_m_);
  }

  bool found = false;
  for (int i = 0; i <= kDirections && !found; ++i) {
    clear(orbit);
    Contact contact;
    const double from_rad = 2.0 * kPi * i / kDirections;
    const Eigen::Vector2d from_m =
        i == 0 ? hint : Eigen::Vector2d(middle_m + far_m * Eigen::Vector2d(std::cos(from_rad), std::sin(from_rad)));
    found = come_from(from_m, i == 0 ? nearest : middle_m, contact) && roll(contact, wanted.first, orbit);
  }
  if (!found) {
    clear(orbit);
    return false;
  }
  if (side < 0.0) {
    for (DubinsSegment& segment : orbit.segments) {
      if (Arc* arc = std::get_if<Arc>(&segment)) {
        *arc = {mirrored(arc->center_m), arc->radius_m, -arc->from_rad, -arc->sweep_rad};
      } else {
        Straight& straight = *std::get_if<Straight>(&segment);
        straight = {mirrored(straight.from_m), mirrored(straight.to_m), -straight.heading_rad};
      }
    }
  }
  return true;
}

}  // namespace situation_awareness
