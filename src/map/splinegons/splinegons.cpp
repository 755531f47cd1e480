// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/splinegons/splinegons.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

/// m. Largest distance of an arc from the polygon that is_simple takes for it.
constexpr double kFlat_m = 1e-4;

/// An arc that may be straight, by its begin.
struct Way {
  Eigen::Vector2d from_m, along;
  double curvature_1pm, sweep_rad, length_m;

  Way(const SplinegonVertex& from, const SplinegonVertex& to) : from_m(from.p_world_m) {
    const Eigen::Vector2d chord = to.p_world_m - from.p_world_m;
    const double b = from.bulge, b2 = b * b, chord_m = chord.norm();
    // Half the sweep is 2 atan(b).
    along = ((1.0 - b2) * chord - 2.0 * b * left_of(chord)) / ((1.0 + b2) * chord_m);
    curvature_1pm = 4.0 * b / ((1.0 + b2) * chord_m);
    sweep_rad = 4.0 * std::atan(b);
    length_m = std::abs(b) < 1e-8 ? chord_m : sweep_rad / curvature_1pm;
  }

  Eigen::Vector2d at(double part) const {
    const double half_rad = 0.5 * part * sweep_rad;
    const double chord_m = part * length_m * (std::abs(half_rad) < 1e-8 ? 1.0 : std::sin(half_rad) / half_rad);
    return from_m + chord_m * (std::cos(half_rad) * along + std::sin(half_rad) * left_of(along));
  }

  Eigen::Vector2d along_at(double part) const {
    const double turn_rad = part * sweep_rad;
    return std::cos(turn_rad) * along + std::sin(turn_rad) * left_of(along);
  }

  /// Part of the arc at which it is nearest.
  double nearest(const Eigen::Vector2d& p_m) const {
    const Eigen::Vector2d v = p_m - from_m;
    const double a = along.dot(v), b = left_of(along).dot(v);
    if (std::abs(sweep_rad) < 1e-8) return std::clamp(a / length_m, 0.0, 1.0);
    double turn_rad = std::atan2(curvature_1pm * a, 1.0 - curvature_1pm * b) * std::copysign(1.0, sweep_rad);
    const double all_rad = std::abs(sweep_rad);
    // What is beyond the ends is nearest to one of them: the one at the smaller angle.
    if (turn_rad < 0.0 && 2.0 * turn_rad + 2.0 * kPi < all_rad) turn_rad += 2.0 * kPi;
    if (turn_rad > all_rad && turn_rad - all_rad > 2.0 * kPi - turn_rad) turn_rad = 0.0;
    return std::clamp(turn_rad / all_rad, 0.0, 1.0);
  }
};

const SplinegonVertex& after(const Splinegon& splinegon, std::size_t arc) {
  return splinegon.vertices[arc + 1 < splinegon.vertices.size() ? arc + 1 : 0];
}

Way way_of(const Splinegon& splinegon, std::size_t arc) { return {splinegon.vertices[arc], after(splinegon, arc)}; }

SplinegonPoint point_of(const Splinegon& splinegon, std::size_t arc, const Way& way, double part) {
  const double from_m = splinegon.vertices[arc].sigma_m, to_m = after(splinegon, arc).sigma_m;
  return {way.at(part), way.along_at(part), from_m + part * (to_m - from_m), arc, part};
}

/// Whether the ray from p to +x meets the edge from a to b; of edges in a row exactly one meets it at their vertex.
bool ray_meets(const Eigen::Vector2d& p, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return (a.y() > p.y()) != (b.y() > p.y()) && (cross(b - a, p - a) > 0.0) == (b.y() > a.y());
}

bool edges_meet(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c,
                const Eigen::Vector2d& d) {
  return cross(b - a, c - a) * cross(b - a, d - a) <= 0.0 && cross(d - c, a - c) * cross(d - c, b - c) <= 0.0 &&
         std::max(a.x(), b.x()) >= std::min(c.x(), d.x()) && std::max(c.x(), d.x()) >= std::min(a.x(), b.x()) &&
         std::max(a.y(), b.y()) >= std::min(c.y(), d.y()) && std::max(c.y(), d.y()) >= std::min(a.y(), b.y());
}

/// The edges of a chain of points, with boxes around halves of halves of it: whether any two meet that are no
/// neighbours. What is not near takes no time. The boxes are behind the points.
class EdgeTree {
 public:
  EdgeTree(std::vector<Eigen::Vector2d>& points_m, bool closed)
      : points_m_(points_m), edges_(points_m.size() - 1), closed_(closed) {
    std::size_t boxes = 2;
    while (boxes < 2 * edges_) boxes *= 2;
    const std::size_t size = points_m_.size() + 2 * boxes;
    if (points_m_.capacity() < size) points_m_.reserve(2 * size);  // the next chain is about as long
    points_m_.resize(size);
    bound(whole());
  }

  bool meets_itself() const { return meets_itself(whole()); }

 private:
  struct Part {
    std::size_t node, begin, end;  ///< of the tree; edges

    bool is_edge() const { return end - begin == 1; }
    Part first() const { return {2 * node, begin, begin + (end - begin + 1) / 2}; }
    Part second() const { return {2 * node + 1, begin + (end - begin + 1) / 2, end}; }
  };

  Part whole() const { return {1, 0, edges_}; }
  Eigen::Vector2d& low(const Part& part) const { return points_m_[edges_ + 1 + 2 * part.node]; }
  Eigen::Vector2d& high(const Part& part) const { return points_m_[edges_ + 2 + 2 * part.node]; }

  void bound(const Part& part) {
    if (part.is_edge()) {
      low(part) = points_m_[part.begin].cwiseMin(points_m_[part.end]);
      high(part) = points_m_[part.begin].cwiseMax(points_m_[part.end]);
      return;
    }
    bound(part.first());
    bound(part.second());
    low(part) = low(part.first()).cwiseMin(low(part.second()));
    high(part) = high(part.first()).cwiseMax(high(part.second()));
  }

  bool meets_itself(const Part& part) const {
    return !part.is_edge() &&
           (meets_itself(part.first()) || meets_itself(part.second()) || meet(part.first(), part.second()));
  }

  bool meet(const Part& a, const Part& b) const {
    if ((low(a).array() > high(b).array()).any() || (low(b).array() > high(a).array()).any()) return false;
    if (a.is_edge() && b.is_edge()) {
      if (b.begin == a.begin + 1 || (closed_ && a.begin == 0 && b.end == edges_)) return false;  // neighbours
      return edges_meet(points_m_[a.begin], points_m_[a.end], points_m_[b.begin], points_m_[b.end]);
    }
    const bool part_a = b.is_edge() || (!a.is_edge() && a.end - a.begin >= b.end - b.begin);
    return part_a ? meet(a.first(), b) || meet(a.second(), b) : meet(a, b.first()) || meet(a, b.second());
  }

  std::vector<Eigen::Vector2d>& points_m_;
  std::size_t edges_;
  bool closed_;
};

}  // namespace

std::size_t arcs_of(const Splinegon& splinegon) {
  return splinegon.closed || splinegon.vertices.empty() ? splinegon.vertices.size() : splinegon.vertices.size() - 1;
}

double length_m(const Splinegon& splinegon) {
  double sum_m = 0.0;
  for (std::size_t arc = 0; arc < arcs_of(splinegon); ++arc) sum_m += way_of(splinegon, arc).length_m;
  return sum_m;
}

double area_m2(const Splinegon& splinegon) {
  double sum_m2 = 0.0;
  for (std::size_t arc = 0; arc < splinegon.vertices.size(); ++arc) {
    const SplinegonVertex& from = splinegon.vertices[arc];
    const SplinegonVertex& to = after(splinegon, arc);
    // Relative to the first vertex: far from the world's origin the area would be lost in rounding.
    const Eigen::Vector2d origin_m = splinegon.vertices[0].p_world_m;
    sum_m2 += 0.5 * cross(from.p_world_m - origin_m, to.p_world_m - origin_m);
    // Of the segment between arc and chord: r^2 / 2 (sweep - sin(sweep)), for a small sweep its series.
    const double b = from.bulge, chord2_m2 = (to.p_world_m - from.p_world_m).squaredNorm();
    if (std::abs(b) < 1e-3) {
      sum_m2 += chord2_m2 * b * (1.0 + 0.4 * b * b) / 3.0;
    } else {
      const double radius_over_chord = 0.25 * (1.0 + b * b) / b, sweep_rad = 4.0 * std::atan(b);
      sum_m2 += 0.5 * chord2_m2 * radius_over_chord * radius_over_chord * (sweep_rad - std::sin(sweep_rad));
    }
  }
  return sum_m2;
}

SplinegonPoint point_at(const Splinegon& splinegon, std::size_t arc, double part) {
  return point_of(splinegon, arc, way_of(splinegon, arc), part);
}

SplinegonPoint nearest_on(const Splinegon& splinegon, const Eigen::Vector2d& p_world_m) {
  SplinegonPoint best;
  double least_m2 = std::numeric_limits<double>::infinity();
  for (std::size_t arc = 0; arc < arcs_of(splinegon); ++arc) {
    const Way way = way_of(splinegon, arc);
    const double part = way.nearest(p_world_m);
    const double distance_m2 = (way.at(part) - p_world_m).squaredNorm();
    if (distance_m2 < least_m2) {
      least_m2 = distance_m2;
      best = point_of(splinegon, arc, way, part);
    }
  }
  return best;
}

double distance_m(const Splinegon& splinegon, const Eigen::Vector2d& p_world_m) {
  return (nearest_on(splinegon, p_world_m).p_world_m - p_world_m).norm();
}

bool contains(const Splinegon& splinegon, const Eigen::Vector2d& p_world_m) {
  // Inside the polygon of the vertices, changed by each segment between arc and chord that the point is in.
  bool inside = false;
  for (std::size_t arc = 0; arc < arcs_of(splinegon); ++arc) {
    const SplinegonVertex& from = splinegon.vertices[arc];
    const SplinegonVertex& to = after(splinegon, arc);
    inside ^= ray_meets(p_world_m, from.p_world_m, to.p_world_m);
    if (from.bulge == 0.0) continue;
    const Way way(from, to);
    const Eigen::Vector2d v = p_world_m - way.from_m;
    const bool within_circle = std::abs(way.curvature_1pm) * v.squaredNorm() <
                               2.0 * std::copysign(1.0, way.curvature_1pm) * left_of(way.along).dot(v);
    const bool beyond_chord = cross(to.p_world_m - from.p_world_m, v) * from.bulge < 0.0;
    inside ^= within_circle && beyond_chord;
  }
  return inside && splinegon.closed;
}

std::vector<SplinegonPoint> sampled(const Splinegon& splinegon, double spacing_m, std::vector<SplinegonPoint> memory) {
  std::vector<SplinegonPoint> points = std::move(memory);
  points.clear();
  for (std::size_t arc = 0; arc < arcs_of(splinegon); ++arc) {
    const Way way = way_of(splinegon, arc);
    const double steps = std::max(std::ceil(way.length_m / spacing_m), 1.0);
    for (double step = 0.0; step < steps; step += 1.0) points.push_back(point_of(splinegon, arc, way, step / steps));
  }
  if (!splinegon.closed && arcs_of(splinegon) > 0) points.push_back(point_at(splinegon, arcs_of(splinegon) - 1, 1.0));
  return points;
}

bool is_simple(const Splinegon& splinegon) {
  std::vector<Eigen::Vector2d> points_m;
  return is_simple(splinegon, points_m);
}

bool is_simple(const Splinegon& splinegon, std::vector<Eigen::Vector2d>& points_m) {
  points_m.clear();
  for (std::size_t arc = 0; arc < arcs_of(splinegon); ++arc) {
    const Way way = way_of(splinegon, arc);
    // An arc of length s is s^2 kappa / 8 from its chord.
    const double steps =
        std::max(std::ceil(way.length_m * std::sqrt(std::abs(way.curvature_1pm) / (8.0 * kFlat_m))), 1.0);
    for (double step = 0.0; step < steps; step += 1.0) points_m.push_back(way.at(step / steps));
  }
  points_m.push_back(splinegon.closed ? points_m.front() : splinegon.vertices.back().p_world_m);
  return !EdgeTree(points_m, splinegon.closed).meets_itself();
}

SplinegonEnvelope envelope_of(const Splinegon& splinegon, double spacing_m) {
  SplinegonEnvelope envelope;
  for (const SplinegonPoint& point : sampled(splinegon, spacing_m)) {
    const Eigen::Vector2d offset_m = kSigmasOf99Percent * point.sigma_m * left_of(point.along_world);
    envelope.free_side_world_m.push_back(point.p_world_m - offset_m);
    envelope.obstacle_side_world_m.push_back(point.p_world_m + offset_m);
  }
  return envelope;
}

bool is_in_envelope(const Splinegon& splinegon, const Eigen::Vector2d& p_world_m) {
  const SplinegonPoint nearest = nearest_on(splinegon, p_world_m);
  return (nearest.p_world_m - p_world_m).norm() <= kSigmasOf99Percent * nearest.sigma_m;
}

}  // namespace situation_awareness
