// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/spline_path.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace situation_awareness {
namespace {

using Coefficients = Eigen::Matrix<double, 2, 4>;

// Distance of knots, between which arc length is integrated by five points of Gauss and Legendre: of a bend of radius
// 0.3 m the error is below 1e-12 m. Long segments have few knots: their bends are wide.
constexpr double kKnotSpacing_m = 0.05;
constexpr std::size_t kMostKnots = 256;
// |p'| is about 1, and 0 in a cusp, which no vehicle can follow.
constexpr double kLeastSpeed = 0.02;

Eigen::Vector2d spline_point(const Coefficients& c, double t) {
  return c.col(0) + t * (c.col(1) + t * (c.col(2) + t * c.col(3)));
}

Eigen::Vector2d first_derivative(const Coefficients& c, double t) {
  return c.col(1) + t * (2.0 * c.col(2) + 3.0 * t * c.col(3));
}

Eigen::Vector2d second_derivative(const Coefficients& c, double t) { return 2.0 * c.col(2) + 6.0 * t * c.col(3); }

double arc_length_m(const Coefficients& c, double from, double to) {
  constexpr std::array<double, 5> kAt = {-0.906179845938664, -0.538469310105683, 0.0, 0.538469310105683,
                                         0.906179845938664};
  constexpr std::array<double, 5> kWeight = {0.236926885056189, 0.478628670499366, 0.568888888888889, 0.478628670499366,
                                             0.236926885056189};
  double sum = 0.0;
  for (std::size_t i = 0; i < kAt.size(); ++i) {
    sum += kWeight[i] * first_derivative(c, 0.5 * (from + to) + 0.5 * (to - from) * kAt[i]).norm();
  }
  return 0.5 * (to - from) * sum;
}

/// Solves the system that is tridiagonal: below(i) x(i-1) + diagonal(i) x(i) + above(i) x(i+1) = right(i), for each
/// column of `right` (Thomas). Its diagonal dominates.
Eigen::MatrixX2d solve_tridiagonal(const Eigen::VectorXd& below, Eigen::VectorXd diagonal, const Eigen::VectorXd& above,
                                   Eigen::MatrixX2d right) {
  const Eigen::Index n = diagonal.size();
  for (Eigen::Index i = 1; i < n; ++i) {
    const double factor = below(i) / diagonal(i - 1);
    diagonal(i) -= factor * above(i - 1);
    right.row(i) -= factor * right.row(i - 1);
  }
  for (Eigen::Index i = n - 1; i >= 0; --i) {
    if (i + 1 < n) right.row(i) -= above(i) * right.row(i + 1);
    right.row(i) /= diagonal(i);
  }
  return right;
}

/// The same where the last value is also before the first one: by two systems without the corners (Sherman and
/// Morrison).
Eigen::MatrixX2d solve_cyclic(const Eigen::VectorXd& below, Eigen::VectorXd diagonal, const Eigen::VectorXd& above,
                              const Eigen::MatrixX2d& right) {
  const Eigen::Index n = diagonal.size();
  const double corner_top = below(0), corner_bottom = above(n - 1), gamma = -diagonal(0);
  diagonal(0) -= gamma;
  diagonal(n - 1) -= corner_top * corner_bottom / gamma;
  Eigen::MatrixX2d u = Eigen::MatrixX2d::Zero(n, 2);
  u(0, 0) = gamma;
  u(n - 1, 0) = corner_bottom;
  const Eigen::MatrixX2d y = solve_tridiagonal(below, diagonal, above, right);
  const Eigen::VectorXd z = solve_tridiagonal(below, diagonal, above, u).col(0);
  const Eigen::RowVector2d vy = y.row(0) + corner_top / gamma * y.row(n - 1);
  return y - z * (vy / (1.0 + z(0) + corner_top / gamma * z(n - 1)));
}

}  // namespace

SplinePath::SplinePath(const Path& path, const std::string& source) : closed_(path.closed) {
  check_path(path, source);
  fit(path);
  tabulate(source);
}

// The second derivatives M at the way points follow from the continuity of the first ones:
// h_(i-1) M_(i-1) + 2 (h_(i-1) + h_i) M_i + h_i M_(i+1) = 6 (slope_i - slope_(i-1)), h the chords.
void SplinePath::fit(const Path& path) {
  const auto& points = path.way_points;
  const std::size_t count = points.size();
  const std::size_t segments = closed_ ? count : count - 1;
  const auto point = [&](std::size_t i) { return points[i % count].p_world_m; };
  for (std::size_t i = 0; i < segments; ++i) chords_m_.push_back((point(i + 1) - point(i)).norm());
  const auto slope = [&](std::size_t i) -> Eigen::Vector2d { return (point(i + 1) - point(i)) / chords_m_[i]; };

  const auto n = static_cast<Eigen::Index>(count);
  Eigen::VectorXd below = Eigen::VectorXd::Zero(n), diagonal = Eigen::VectorXd::Ones(n), above = below;
  Eigen::MatrixX2d right = Eigen::MatrixX2d::Zero(n, 2);
  for (std::size_t i = 0; i < count; ++i) {
    if (!closed_ && (i == 0 || i + 1 == count)) continue;  // M = 0
    const std::size_t before = i > 0 ? i - 1 : count - 1;
    const auto row = static_cast<Eigen::Index>(i);
    below(row) = chords_m_[before];
    above(row) = chords_m_[i];
    diagonal(row) = 2.0 * (chords_m_[before] + chords_m_[i]);
    right.row(row) = 6.0 * (slope(i) - slope(before)).transpose();
  }
  const Eigen::MatrixX2d M =
      closed_ ? solve_cyclic(below, diagonal, above, right) : solve_tridiagonal(below, diagonal, above, right);

  std::optional<double> speed_m_s;
  for (std::size_t i = 0; i < segments; ++i) {
    const double h = chords_m_[i];
    const Eigen::Vector2d from = M.row(static_cast<Eigen::Index>(i));
    const Eigen::Vector2d to = M.row(static_cast<Eigen::Index>((i + 1) % count));
    if (points[i].speed_m_s) speed_m_s = points[i].speed_m_s;
    Piece piece;
    piece.c.col(0) = point(i);
    piece.c.col(1) = slope(i) - h / 6.0 * (2.0 * from + to);
    piece.c.col(2) = 0.5 * from;
    piece.c.col(3) = (to - from) / (6.0 * h);
    piece.speed_m_s = speed_m_s;
    pieces_.push_back(piece);
  }
}

void SplinePath::tabulate(const std::string& source) {
  double way_m = 0.0;
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    const auto wanted = static_cast<std::size_t>(std::ceil(chords_m_[i] / kKnotSpacing_m));
    const std::size_t knots = std::clamp<std::size_t>(wanted, 4, kMostKnots);
    pieces_[i].first_knot = ways_m_.size();
    const double step = chords_m_[i] / static_cast<double>(knots);
    for (std::size_t k = 0; k < knots; ++k) {
      const double t = static_cast<double>(k) * step;
      if (first_derivative(pieces_[i].c, t).norm() < kLeastSpeed) {
        throw std::invalid_argument(source + ": the path turns back on the spot after path[" + std::to_string(i) + ']');
      }
      ways_m_.push_back(way_m);
      ts_m_.push_back(t);
      piece_of_knot_.push_back(i);
      way_m += arc_length_m(pieces_[i].c, t, t + step);
    }
  }
  ways_m_.push_back(way_m);
  ts_m_.push_back(chords_m_.back());
  piece_of_knot_.push_back(pieces_.size() - 1);
}

std::size_t SplinePath::knot_before(double way_m) const {
  const auto after = std::upper_bound(ways_m_.begin() + 1, ways_m_.end() - 1, way_m);
  return static_cast<std::size_t>(after - ways_m_.begin()) - 1;
}

/// t of the next knot, in the segment of this one.
double SplinePath::t_after(std::size_t knot) const {
  const std::size_t piece = piece_of_knot_[knot];
  return knot + 1 < intervals() && piece_of_knot_[knot + 1] == piece ? ts_m_[knot + 1] : chords_m_[piece];
}

PathPoint SplinePath::at(double way_m) const {
  double inside_m = way_m;
  if (closed_) {
    inside_m = std::fmod(way_m, length_m());
    if (inside_m < 0.0) inside_m += length_m();
    way_m = inside_m;
  } else {
    inside_m = std::clamp(way_m, 0.0, length_m());
  }
  const std::size_t knot = knot_before(inside_m);
  const Piece& piece = pieces_[piece_of_knot_[knot]];
  const double begin = ts_m_[knot], rest_m = inside_m - ways_m_[knot];
  const double step = t_after(knot) - begin;
  double t = begin + step * rest_m / (ways_m_[knot + 1] - ways_m_[knot]);
  for (int i = 0; i < 4; ++i) {  // Newton
    const double off_m = arc_length_m(piece.c, begin, t) - rest_m;
    t = std::clamp(t - off_m / std::max(first_derivative(piece.c, t).norm(), 1e-9), begin, begin + step);
    if (std::abs(off_m) < 1e-10) break;
  }
  const Eigen::Vector2d d = first_derivative(piece.c, t), dd = second_derivative(piece.c, t);
  PathPoint point;
  point.way_m = way_m;
  point.p_world_m = spline_point(piece.c, t);
  point.yaw_rad = std::atan2(d.y(), d.x());
  point.curvature_1_m = (d.x() * dd.y() - d.y() * dd.x()) / std::max(std::pow(d.norm(), 3), 1e-9);
  point.segment = piece_of_knot_[knot];
  if (way_m != inside_m) {
    point.p_world_m += (way_m - inside_m) * d.normalized();
    point.curvature_1_m = 0.0;
  }
  return point;
}

Eigen::Vector2d SplinePath::place(std::size_t knot) const {
  return spline_point(pieces_[piece_of_knot_[knot]].c, ts_m_[knot]);
}

double SplinePath::nearest_m(const Eigen::Vector2d& p_world_m, double from_way_m) const {
  if (closed_) from_way_m -= std::floor(from_way_m / length_m()) * length_m();
  const std::size_t count = intervals();
  std::size_t knot = knot_before(std::clamp(from_way_m, 0.0, length_m()));
  const auto beside = [&](std::size_t k, bool ahead) {
    if (ahead) return closed_ && k + 1 == count ? std::size_t{0} : std::min(k + 1, count);
    return closed_ && k == 0 ? count - 1 : k > 0 ? k - 1 : k;
  };
  double nearest_m2 = (place(knot) - p_world_m).squaredNorm();
  for (const bool ahead : {true, false}) {
    for (std::size_t walked = 0; walked < count; ++walked) {
      const std::size_t next = beside(knot, ahead);
      const double d_m2 = (place(next) - p_world_m).squaredNorm();
      if (!(d_m2 < nearest_m2)) break;
      nearest_m2 = d_m2;
      knot = next;
    }
  }
  return refine(p_world_m, knot);
}

double SplinePath::nearest_m(const Eigen::Vector2d& p_world_m) const {
  std::size_t nearest = 0;
  double nearest_m2 = std::numeric_limits<double>::infinity();
  for (std::size_t knot = 0; knot < ways_m_.size(); ++knot) {
    const double d_m2 = (place(knot) - p_world_m).squaredNorm();
    if (!(d_m2 < nearest_m2)) continue;
    nearest_m2 = d_m2;
    nearest = knot;
  }
  return refine(p_world_m, closed_ && nearest == intervals() ? 0 : nearest);
}

/// Of the nearest points on both sides of a knot that is nearer than its neighbours.
double SplinePath::refine(const Eigen::Vector2d& p_world_m, std::size_t knot) const {
  double best_m = ways_m_[knot], best_m2 = (place(knot) - p_world_m).squaredNorm();
  const std::size_t before = knot > 0 ? knot - 1 : closed_ ? intervals() - 1 : knot;
  for (const std::size_t interval : {before, knot}) {
    if (interval >= intervals()) continue;
    const double way_m = nearest_between(p_world_m, interval);
    const double d_m2 = (at(way_m).p_world_m - p_world_m).squaredNorm();
    if (!(d_m2 < best_m2)) continue;
    best_m2 = d_m2;
    best_m = way_m;
  }
  return best_m;
}

/// By bisection of the derivative of the distance, between a knot and the next.
double SplinePath::nearest_between(const Eigen::Vector2d& p_world_m, std::size_t knot) const {
  const Piece& piece = pieces_[piece_of_knot_[knot]];
  const double begin = ts_m_[knot];
  double low = begin, high = t_after(knot);
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    const double rises = first_derivative(piece.c, middle).dot(spline_point(piece.c, middle) - p_world_m);
    (rises < 0.0 ? low : high) = middle;
  }
  return std::min(ways_m_[knot] + arc_length_m(piece.c, begin, 0.5 * (low + high)), length_m());
}

}  // namespace situation_awareness
