// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/dubins.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>

#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {

// The symbols are those of docs/math/dubins.md:
//
//   symbol       meaning                                                                                 unit
//   e_s, e_f     sign of the first and the last turn, left +1                                            1
//   u, n         direction of a heading, and its left normal                                             1
//   O_s, O_f     centres of the circles at the start and at the end, seen from the start: O = p + e rho n  m
//   v, c         O_f - O_s and its length                                                                m
//   w            e_f rho_f - e_s rho_s: offset of the circles' centres across their tangent              m
//   t_s, m, t_f  first turn, length of the straight or turn of the middle circle, last turn              rad, m or rad

namespace {

using Eigen::Vector2d;

/// Errors of rounding, of the size of a problem and of the magnitude of its coordinates: of what is given, and of a few
/// operations. They are a hundred times smaller, and stay within 1e-9 m for paths of some kilometres.
constexpr double kRounding = 1e-13;
constexpr double kCoordinateRounding = 8.0 * std::numeric_limits<double>::epsilon();
/// The same of angles.
constexpr double kRounding_rad = 1e-12;

struct Letters {
  double first = 1.0;
  double last = 1.0;
  bool is_straight = true;  ///< in the middle; otherwise the middle turns against the two others
};

constexpr Letters letters_of(DubinsWord word) {
  switch (word) {
    case DubinsWord::kLsl:
      return {1.0, 1.0, true};
    case DubinsWord::kRsr:
      return {-1.0, -1.0, true};
    case DubinsWord::kLsr:
      return {1.0, -1.0, true};
    case DubinsWord::kRsl:
      return {-1.0, 1.0, true};
    case DubinsWord::kLrl:
      return {1.0, 1.0, false};
    case DubinsWord::kRlr:
      return {-1.0, -1.0, false};
  }
  return {};
}

constexpr DubinsWord straight_word(double first, double last) {
  if (first > 0.0) return last > 0.0 ? DubinsWord::kLsl : DubinsWord::kLsr;
  return last > 0.0 ? DubinsWord::kRsl : DubinsWord::kRsr;
}

Vector2d right_of(const Vector2d& u) { return {u.y(), -u.x()}; }
Vector2d direction(double heading_rad) { return {std::cos(heading_rad), std::sin(heading_rad)}; }

/// The turn from one direction to another, in [0, 2 pi), to the left for sign 1. One short of a full turn by rounding
/// is none.
double turn(const Vector2d& from, const Vector2d& to, double sign) {
  const double angle_rad = sign * std::atan2(cross(from, to), from.dot(to));
  if (angle_rad >= 0.0) return std::abs(angle_rad);  // not -0.0
  return angle_rad > -kRounding_rad ? 0.0 : angle_rad + 2.0 * kPi;
}

/// What a path is made from, with its start and its radii.
struct Solution {
  DubinsWord word = DubinsWord::kLsl;
  double first_rad = 0.0;  ///< t_s
  double middle = 0.0;     ///< m
  double last_rad = 0.0;   ///< t_f
  double length_m = std::numeric_limits<double>::infinity();
};

/// Two ends, seen from the first.
struct Problem {
  Vector2d d = Vector2d::Zero();  ///< from the start to the end
  double rho_s = 1.0, rho_f = 1.0;
  Vector2d u_s = Vector2d::UnitX(), u_f = Vector2d::UnitX();  ///< u_f is not used where the end's heading is free
  double tolerance_m = 0.0;

  Solution solution(DubinsWord word, double first_rad, double middle, double last_rad) const {
    const double middle_m = letters_of(word).is_straight ? middle : rho_s * middle;
    return {word, first_rad, middle, last_rad, rho_s * first_rad + middle_m + rho_f * last_rad};
  }
};

struct Tangent {
  Vector2d u;
  double length_m = 0.0;
};

/// Whether a tangent of heading `u` fits to circles whose centres are `v` apart: v = L u + w n, L >= 0.
bool fits(const Vector2d& v, double w, const Vector2d& u, double tolerance_m) {
  return std::abs(cross(u, v) - w) <= tolerance_m && u.dot(v) >= -tolerance_m;
}

/// The tangent of two circles, v = L u + w n; a heading of which the path has no turn to make is preferred.
std::optional<Tangent> tangent(const Vector2d& v, double w, const Vector2d& u_s, const Vector2d* u_f,
                               double tolerance_m) {
  if (fits(v, w, u_s, tolerance_m)) return Tangent{u_s, std::max(0.0, u_s.dot(v))};
  if (u_f != nullptr && fits(v, w, *u_f, tolerance_m)) return Tangent{*u_f, std::max(0.0, u_f->dot(v))};
  const double c = v.norm();
  if (c < std::abs(w) - tolerance_m) return std::nullopt;  // one circle lies in the other, or they overlap
  if (c <= tolerance_m) return Tangent{u_s, 0.0};          // the same circle
  const double length_m = std::sqrt(std::max(0.0, (c - std::abs(w)) * (c + std::abs(w))));
  return Tangent{(length_m * v - w * left_of(v)).normalized(), length_m};
}

std::optional<Solution> with_straight(const Problem& problem, DubinsWord word) {
  const Letters e = letters_of(word);
  const Vector2d v =
      problem.d + e.last * problem.rho_f * left_of(problem.u_f) - e.first * problem.rho_s * left_of(problem.u_s);
  const double w = e.last * problem.rho_f - e.first * problem.rho_s;
  const auto found = tangent(v, w, problem.u_s, &problem.u_f, problem.tolerance_m);
  if (!found) return std::nullopt;
  return problem.solution(word, turn(problem.u_s, found->u, e.first), found->length_m,
                          turn(found->u, problem.u_f, e.last));
}

/// Three turns on circles of one radius. The middle one turns by more than pi, so its centre is on the side of v to
/// which the others turn.
std::optional<Solution> with_three_turns(const Problem& problem, DubinsWord word) {
  if (problem.rho_s != problem.rho_f) return std::nullopt;
  const double e = letters_of(word).first;
  const double rho = problem.rho_s;
  const Vector2d v = problem.d + e * rho * (left_of(problem.u_f) - left_of(problem.u_s));
  const double c = v.norm();
  if (c > 4.0 * rho + problem.tolerance_m || c <= problem.tolerance_m) return std::nullopt;
  const double height_m = std::sqrt(std::max(0.0, (2.0 * rho - 0.5 * c) * (2.0 * rho + 0.5 * c)));
  const Vector2d to_middle = 0.5 * v + (e * height_m / c) * left_of(v);  // from O_s
  // Where circles touch, e rho n points from the vehicle to its centre.
  const Vector2d u_1 = e * left_of(to_middle).normalized();
  const Vector2d u_2 = e * left_of(to_middle - v).normalized();
  return problem.solution(word, turn(problem.u_s, u_1, e), turn(u_1, u_2, -e), turn(u_2, problem.u_f, e));
}

std::optional<Solution> solve(const Problem& problem, DubinsWord word) {
  return letters_of(word).is_straight ? with_straight(problem, word) : with_three_turns(problem, word);
}

/// Keeps the shorter one, the earlier one of equally long ones.
void keep(const std::optional<Solution>& candidate, const Problem& problem, Solution& best) {
  if (candidate && !(candidate->length_m >= best.length_m - problem.tolerance_m)) best = *candidate;
}

Solution shortest(const Problem& problem) {
  Solution best;
  for (const DubinsWord word : kDubinsWords) keep(solve(problem, word), problem, best);
  return best;
}

/// The end's heading free. In a shortest path the last turn is none, or the straight is: where neither is, the path
/// gets shorter as the heading changes (docs/math/dubins.md).
Solution shortest_to_point(const Problem& problem) {
  Solution best;
  const Vector2d& d = problem.d;
  for (const double e : {1.0, -1.0}) {
    const Vector2d O_s = e * problem.rho_s * left_of(problem.u_s);
    const auto found = tangent(d - O_s, -e * problem.rho_s, problem.u_s, nullptr, problem.tolerance_m);
    if (!found) continue;
    keep(problem.solution(straight_word(e, e), turn(problem.u_s, found->u, e), found->length_m, 0.0), problem, best);
  }
  // Two turns: O_f is rho_f from the end, and so far from O_s that the circles touch.
  for (const double e : {1.0, -1.0}) {
    const Vector2d O_s = e * problem.rho_s * left_of(problem.u_s);
    const Vector2d v = d - O_s;
    const double c = v.norm();
    for (const double e_f : {-e, e}) {
      const double w = e_f * problem.rho_f - e * problem.rho_s;
      const bool is_centre = c <= problem.tolerance_m;  // the end: any direction of v will do
      if (w == 0.0 || (is_centre && std::abs(std::abs(w) - problem.rho_f) > problem.tolerance_m)) continue;
      const Vector2d ahead = is_centre ? problem.u_s : Vector2d(v / c);
      // The triangle O_s, O_f, end: its height on c from the shorter of the other sides, so that rounding of the longer
      // one does not count.
      const double R = std::abs(w);
      const bool from_start = R <= problem.rho_f;
      const double foot_m = is_centre    ? 0.0
                            : from_start ? 0.5 * (c + (R - problem.rho_f) * (R + problem.rho_f) / c)
                                         : 0.5 * ((c - R) * (c + R) + problem.rho_f * problem.rho_f) / c;
      const double side_m = from_start ? R : problem.rho_f;
      const double squared_m2 = (side_m - foot_m) * (side_m + foot_m);
      if (squared_m2 < -problem.tolerance_m * side_m) continue;
      for (const double side : {1.0, -1.0}) {
        const double across_m = side * std::sqrt(std::max(0.0, squared_m2));
        const Vector2d from_O_s = (from_start ? foot_m : c - foot_m) * ahead + across_m * left_of(ahead);
        const Vector2d from_end = (from_start ? foot_m - c : -foot_m) * ahead + across_m * left_of(ahead);
        const Vector2d u = right_of(from_O_s / w);  // v = w n, of the circles that touch
        const Vector2d u_f = right_of(from_end / (e_f * problem.rho_f));
        keep(problem.solution(straight_word(e, e_f), turn(problem.u_s, u, e), 0.0, turn(u, u_f, e_f)), problem, best);
      }
    }
  }
  return best;
}

void check(const DubinsEnd& end, const std::string& name) {
  const auto fail = [&name](const std::string& sentence) { throw std::invalid_argument(name + ": " + sentence); };
  // Unlike the greatest coefficient, all() passes over none that is not a number.
  if (!(end.p_m.array().abs() <= 1e9).all()) fail("coordinates must be in [-1e9, 1e9] m");
  if (end.yaw_rad && !(std::abs(*end.yaw_rad) <= 1e6)) fail("yaw must be in [-1e6, 1e6] rad");
  if (!(end.radius_m >= 1e-6 && end.radius_m <= 1e9)) fail("radius must be in [1e-6, 1e9] m");
}

Problem problem_of(const DubinsEnd& from, const DubinsEnd& to) {
  check(from, "from");
  check(to, "to");
  Problem problem;
  problem.d = to.p_m - from.p_m;
  problem.rho_s = from.radius_m;
  problem.rho_f = to.radius_m;
  if (from.yaw_rad) problem.u_s = direction(*from.yaw_rad);
  if (to.yaw_rad) problem.u_f = direction(*to.yaw_rad);
  problem.tolerance_m = kRounding * (problem.d.lpNorm<1>() + problem.rho_s + problem.rho_f) +
                        kCoordinateRounding * (from.p_m.lpNorm<1>() + to.p_m.lpNorm<1>());
  return problem;
}

/// The arc that begins at a pose.
Arc arc_from(const Vector2d& p_m, double heading_rad, double radius_m, double sign, double sweep_rad) {
  const Vector2d n = left_of(direction(heading_rad));
  return {p_m + sign * radius_m * n, radius_m, wrap_to_pi(heading_rad - sign * 0.5 * kPi), sign * sweep_rad};
}

/// The segments, one after the other.
DubinsPath path_of(const Solution& solution, const Vector2d& p_m, double yaw_rad, double rho_s, double rho_f) {
  DubinsPath path;
  path.word = solution.word;
  path.length_m = solution.length_m;
  const Letters e = letters_of(solution.word);
  const Arc first = arc_from(p_m, yaw_rad, rho_s, e.first, solution.first_rad);
  Pose2 at = pose_at(first, length_m(first));
  path.segments[0] = first;
  if (e.is_straight) {
    const Straight straight{at.translation_m, at.translation_m + solution.middle * direction(at.yaw_rad),
                            wrap_to_pi(at.yaw_rad)};
    at.translation_m = straight.to_m;
    path.segments[1] = straight;
  } else {
    const Arc middle = arc_from(at.translation_m, at.yaw_rad, rho_s, -e.first, solution.middle);
    at = pose_at(middle, length_m(middle));
    path.segments[1] = middle;
  }
  path.segments[2] = arc_from(at.translation_m, at.yaw_rad, rho_f, e.last, solution.last_rad);
  return path;
}

/// The way back of a path that ends at a free heading: its turns are the others.
Solution reversed(const Solution& solution) {
  const Letters e = letters_of(solution.word);
  return {straight_word(-e.last, -e.first), solution.last_rad, solution.middle, solution.first_rad, solution.length_m};
}

}  // namespace

const char* name_of(DubinsWord word) {
  switch (word) {
    case DubinsWord::kLsl:
      return "LSL";
    case DubinsWord::kRsr:
      return "RSR";
    case DubinsWord::kLsr:
      return "LSR";
    case DubinsWord::kRsl:
      return "RSL";
    case DubinsWord::kLrl:
      return "LRL";
    case DubinsWord::kRlr:
      return "RLR";
  }
  return "";
}

double length_m(const DubinsSegment& segment) {
  if (const Arc* arc = std::get_if<Arc>(&segment)) return length_m(*arc);
  const Straight& straight = *std::get_if<Straight>(&segment);
  return (straight.to_m - straight.from_m).norm();
}

std::optional<DubinsPath> dubins_path(DubinsWord word, const DubinsEnd& from, const DubinsEnd& to) {
  const Problem problem = problem_of(from, to);
  if (!from.yaw_rad || !to.yaw_rad) throw std::invalid_argument("the path of one word needs yaw at both ends");
  const auto solution = solve(problem, word);
  if (!solution) return std::nullopt;
  return path_of(*solution, from.p_m, *from.yaw_rad, from.radius_m, to.radius_m);
}

DubinsPath shortest_dubins_path(const DubinsEnd& from, const DubinsEnd& to) {
  Problem problem = problem_of(from, to);
  Solution solution;
  double yaw_rad = 0.0;
  if (from.yaw_rad) {
    yaw_rad = *from.yaw_rad;
    solution = to.yaw_rad ? shortest(problem) : shortest_to_point(problem);
  } else if (to.yaw_rad) {
    Problem back = problem;
    back.d = -problem.d;
    std::swap(back.rho_s, back.rho_f);
    back.u_s = -problem.u_f;
    const Solution found = shortest_to_point(back);
    const Letters e = letters_of(found.word);
    yaw_rad = *to.yaw_rad + e.first * found.first_rad + e.last * found.last_rad;
    solution = reversed(found);
  } else {
    yaw_rad = std::atan2(problem.d.y(), problem.d.x());
    solution = problem.solution(DubinsWord::kLsl, 0.0, problem.d.norm(), 0.0);
  }
  return path_of(solution, from.p_m, yaw_rad, from.radius_m, to.radius_m);
}

DubinsPlace place_at(const DubinsSegment* first, const DubinsSegment* last, double way_m) {
  const DubinsSegment* segment = first;  // at the end of the path the last that is not empty
  double in_segment_m = 0.0;
  way_m = std::max(way_m, 0.0);
  for (const DubinsSegment* next = first; next != last; ++next) {
    const double next_m = length_m(*next);
    if (next_m > 0.0) {
      segment = next;
      in_segment_m = std::min(way_m, next_m);
    }
    if (way_m < next_m) break;
    way_m -= next_m;
  }
  if (const Arc* arc = std::get_if<Arc>(segment)) {
    return {pose_at(*arc, in_segment_m), std::copysign(1.0 / arc->radius_m, arc->sweep_rad)};
  }
  const Straight& straight = *std::get_if<Straight>(segment);
  return {{straight.from_m + in_segment_m * direction(straight.heading_rad), straight.heading_rad}, 0.0};
}

DubinsPlace place_at(const DubinsPath& path, double way_m) {
  return place_at(path.segments.data(), path.segments.data() + path.segments.size(), std::min(way_m, path.length_m));
}

void sample(const DubinsPath& path, double step_m, std::vector<Pose2>& poses) {
  const auto steps = static_cast<std::size_t>(std::max(1.0, std::ceil(path.length_m / step_m)));
  poses.resize(steps + 1);
  for (std::size_t i = 0; i <= steps; ++i) {
    poses[i] = place_at(path, path.length_m * static_cast<double>(i) / static_cast<double>(steps)).pose;
  }
}

}  // namespace situation_awareness
