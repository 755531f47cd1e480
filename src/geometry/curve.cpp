// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/geometry/curve.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

/// rad. Below this turn an arc is a line to 1e-10 of its length.
constexpr double kNoTurn_rad = 1e-9;
/// Of lengths: rounding of where curves meet.
constexpr double kRounding = 1e-9;
/// Of a direction: below it a curve touches a region's edge and does not cross it.
constexpr double kTouches = 1e-6;

bool is_straight(const Curve& curve) { return std::abs(curve.curvature_1_m) * curve.length_m < kNoTurn_rad; }

Eigen::Vector2d center_m(const Curve& curve) { return curve.from_m + left_of(curve.along) / curve.curvature_1_m; }

/// Ways at which a curve meets something; at most two for a line or a circle.
class Ways {
 public:
  void add(double way_m, double length_m) {
    const double slack_m = kRounding * (1.0 + length_m);
    if (way_m < -slack_m || way_m > length_m + slack_m) return;
    ways_m_[count_++] = std::clamp(way_m, 0.0, length_m);
  }
  const double* begin() const { return ways_m_.data(); }
  const double* end() const { return ways_m_.data() + count_; }

 private:
  std::array<double, 8> ways_m_;
  std::size_t count_ = 0;
};

/// Of a point on an arc's circle.
void add_way_of(const Curve& arc, const Eigen::Vector2d& p_m, Ways& ways) {
  const Eigen::Vector2d v = p_m - arc.from_m;
  const double k = arc.curvature_1_m;
  double turn_rad = std::atan2(k * arc.along.dot(v), 1.0 - k * left_of(arc.along).dot(v)) * std::copysign(1.0, k);
  if (turn_rad < -kRounding) turn_rad += 2.0 * kPi;
  ways.add(turn_rad / std::abs(k), arc.length_m);
}

/// Where a curve meets the line normal . (x - through) = offset.
void add_line(const Curve& curve, const Eigen::Vector2d& through_m, const Eigen::Vector2d& normal, double offset_m,
              Ways& ways) {
  if (is_straight(curve)) {
    const double rate = normal.dot(curve.along);
    if (std::abs(rate) < 1e-12) return;
    ways.add((offset_m - normal.dot(curve.from_m - through_m)) / rate, curve.length_m);
    return;
  }
  const Eigen::Vector2d center = center_m(curve);
  const double radius_m = 1.0 / std::abs(curve.curvature_1_m);
  const double height_m = offset_m - normal.dot(center - through_m);
  const double half2_m2 = radius_m * radius_m - height_m * height_m;
  if (half2_m2 < 0.0) return;
  const Eigen::Vector2d half = std::sqrt(half2_m2) * left_of(normal);
  add_way_of(curve, center + height_m * normal + half, ways);
  add_way_of(curve, center + height_m * normal - half, ways);
}

void add_circle(const Curve& curve, const Eigen::Vector2d& center, double radius_m, Ways& ways) {
  if (is_straight(curve)) {
    const Eigen::Vector2d v = center - curve.from_m;
    const double middle_m = curve.along.dot(v), height_m = left_of(curve.along).dot(v);
    const double half2_m2 = radius_m * radius_m - height_m * height_m;
    if (half2_m2 < 0.0) return;
    const double half_m = std::sqrt(half2_m2);
    ways.add(middle_m - half_m, curve.length_m);
    ways.add(middle_m + half_m, curve.length_m);
    return;
  }
  const Eigen::Vector2d own = center_m(curve);
  const double own_m = 1.0 / std::abs(curve.curvature_1_m);
  const double apart_m = (center - own).norm();
  if (apart_m < 1e-12 * (1.0 + own_m)) return;  // the same circle or none in common
  const Eigen::Vector2d toward = (center - own) / apart_m;
  const double along_m = 0.5 * (apart_m + (own_m - radius_m) * (own_m + radius_m) / apart_m);
  const double half2_m2 = own_m * own_m - along_m * along_m;
  if (half2_m2 < 0.0) return;
  const Eigen::Vector2d half = std::sqrt(half2_m2) * left_of(toward);
  add_way_of(curve, own + along_m * toward + half, ways);
  add_way_of(curve, own + along_m * toward - half, ways);
}

/// Points of `a` where its normal is one of `b` too, seen from their centres.
double common_normals_m(const Curve& a, const Curve& b) {
  if (is_straight(a) && is_straight(b)) return std::numeric_limits<double>::infinity();
  Ways ways;
  if (is_straight(a)) {
    ways.add(a.along.dot(center_m(b) - a.from_m), a.length_m);
  } else if (is_straight(b)) {
    const Eigen::Vector2d normal = left_of(b.along) / std::abs(a.curvature_1_m);
    add_way_of(a, center_m(a) + normal, ways);
    add_way_of(a, center_m(a) - normal, ways);
  } else {
    const Eigen::Vector2d apart = center_m(b) - center_m(a);
    const double apart_m = apart.norm();
    if (apart_m < 1e-12) {
      // All normals in common: those at the ends are computed anyway.
      return std::numeric_limits<double>::infinity();
    }
    const Eigen::Vector2d out = apart / (apart_m * std::abs(a.curvature_1_m));
    add_way_of(a, center_m(a) + out, ways);
    add_way_of(a, center_m(a) - out, ways);
  }
  double least_m = std::numeric_limits<double>::infinity();
  for (const double way_m : ways) least_m = std::min(least_m, distance_m(b, point_at(a, way_m)));
  return least_m;
}

bool meet(const Curve& a, const Curve& b) {
  Ways ways;
  if (is_straight(b)) {
    add_line(a, b.from_m, left_of(b.along), 0.0, ways);
  } else {
    add_circle(a, center_m(b), 1.0 / std::abs(b.curvature_1_m), ways);
  }
  return std::any_of(ways.begin(), ways.end(), [&](double way_m) {
    return distance_m(b, point_at(a, way_m)) < kRounding * (1.0 + a.length_m + b.length_m);
  });
}

}  // namespace

Curve straight_curve(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m) {
  const Eigen::Vector2d way = to_m - from_m;
  const double length = way.norm();
  return {from_m, length > 0.0 ? Eigen::Vector2d(way / length) : Eigen::Vector2d::UnitX(), 0.0, length};
}

Curve curve_of(const Arc& arc) {
  const double sign = std::copysign(1.0, arc.sweep_rad);
  const Eigen::Vector2d out(std::cos(arc.from_rad), std::sin(arc.from_rad));
  return {arc.center_m + arc.radius_m * out, sign * left_of(out), sign / arc.radius_m,
          arc.radius_m * std::min(std::abs(arc.sweep_rad), 2.0 * kPi)};
}

Curve curve_with_bulge(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m, double bulge) {
  const Eigen::Vector2d chord = to_m - from_m;
  const double b2 = bulge * bulge, chord_m = chord.norm();
  // Half the sweep is 2 atan(b).
  Curve curve;
  curve.from_m = from_m;
  curve.along = ((1.0 - b2) * chord - 2.0 * bulge * left_of(chord)) / ((1.0 + b2) * chord_m);
  curve.curvature_1_m = 4.0 * bulge / ((1.0 + b2) * chord_m);
  curve.length_m = std::abs(bulge) < kNoTurn_rad ? chord_m : 4.0 * std::atan(bulge) / curve.curvature_1_m;
  return curve;
}

Eigen::Vector2d point_at(const Curve& curve, double way_m) {
  const double half_rad = 0.5 * way_m * curve.curvature_1_m;
  const double chord_m = way_m * (std::abs(half_rad) < 1e-8 ? 1.0 : std::sin(half_rad) / half_rad);
  return curve.from_m + chord_m * (std::cos(half_rad) * curve.along + std::sin(half_rad) * left_of(curve.along));
}

Eigen::Vector2d along_at(const Curve& curve, double way_m) {
  const double turn_rad = way_m * curve.curvature_1_m;
  return std::cos(turn_rad) * curve.along + std::sin(turn_rad) * left_of(curve.along);
}

Curve part_of(const Curve& curve, double from_m, double to_m) {
  return {point_at(curve, from_m), along_at(curve, from_m), curve.curvature_1_m, to_m - from_m};
}

double nearest_m(const Curve& curve, const Eigen::Vector2d& p_m) {
  const Eigen::Vector2d v = p_m - curve.from_m;
  const double ahead_m = curve.along.dot(v), k = curve.curvature_1_m;
  if (is_straight(curve)) return std::clamp(ahead_m, 0.0, curve.length_m);
  const double all_rad = curve.length_m * std::abs(k);
  double turn_rad = std::atan2(k * ahead_m, 1.0 - k * left_of(curve.along).dot(v)) * std::copysign(1.0, k);
  // What is beyond the ends is nearest to one of them: the one at the smaller angle.
  if (turn_rad < 0.0 && 2.0 * turn_rad + 2.0 * kPi < all_rad) turn_rad += 2.0 * kPi;
  if (turn_rad < 0.0 && turn_rad + 2.0 * kPi - all_rad < -turn_rad) turn_rad = all_rad;
  if (turn_rad > all_rad && turn_rad - all_rad > 2.0 * kPi - turn_rad) turn_rad = 0.0;
  return std::clamp(turn_rad / std::abs(k), 0.0, curve.length_m);
}

double distance_m(const Curve& curve, const Eigen::Vector2d& p_m) {
  return (point_at(curve, nearest_m(curve, p_m)) - p_m).norm();
}

double distance_m(const Curve& a, const Curve& b) {
  if (meet(a, b)) return 0.0;
  const double ends_m = std::min(std::min(distance_m(b, a.from_m), distance_m(b, point_at(a, a.length_m))),
                                 std::min(distance_m(a, b.from_m), distance_m(a, point_at(b, b.length_m))));
  return std::min(ends_m, common_normals_m(a, b));
}

std::optional<double> first_nearer_m(const Curve& a, const Curve& b, double margin_m) {
  const double slack_m = kRounding * (1.0 + margin_m);
  const Eigen::Vector2d from_b = a.from_m - point_at(b, nearest_m(b, a.from_m));
  const double begin_m = from_b.norm();
  if (begin_m < margin_m - slack_m) return 0.0;
  if (begin_m > margin_m + a.length_m + slack_m) return std::nullopt;
  Ways ways;
  if (is_straight(b)) {
    add_line(a, b.from_m, left_of(b.along), margin_m, ways);
    add_line(a, b.from_m, left_of(b.along), -margin_m, ways);
  } else {
    const double radius_m = 1.0 / std::abs(b.curvature_1_m);
    add_circle(a, center_m(b), radius_m + margin_m, ways);
    if (radius_m > margin_m) add_circle(a, center_m(b), radius_m - margin_m, ways);
  }
  add_circle(a, b.from_m, margin_m, ways);
  add_circle(a, point_at(b, b.length_m), margin_m, ways);
  std::optional<double> first_m;
  for (const double way_m : ways) {
    if (first_m && way_m >= *first_m) continue;
    const Eigen::Vector2d p_m = point_at(a, way_m);
    const Eigen::Vector2d away = p_m - point_at(b, nearest_m(b, p_m));
    // Elsewhere it is the edge of what the whole circles and lines have beside them.
    if (std::abs(away.norm() - margin_m) > 1e3 * slack_m) continue;
    if (along_at(a, way_m).dot(away) < -kTouches * margin_m) first_m = way_m;
  }
  return first_m;
}

}  // namespace situation_awareness
