// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/path/path.hpp"

namespace situation_awareness {

/// A point of a path, seen along the way.
struct PathPoint {
  double way_m = 0.0;  ///< from the path's begin along it; beyond an open path's ends as asked for
  Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
  double yaw_rad = 0.0;        ///< of the tangent, not wrapped to any range
  double curvature_1_m = 0.0;  ///< positive where the path turns left
  std::size_t segment = 0;

  Pose2 pose() const { return {p_world_m, yaw_rad}; }
};

/// The cubic spline through the points of a path (docs/math/path.md; polygons paper, Sect. 5.2).
///
///   symbol  meaning                                                              unit
///   u       parameter: sum of the chords between way points                      m
///   p(u)    point of the path; p, p' and p'' are continuous, p'' = 0 at open ends    m
///   s       way: arc length from the first way point                             m
///   kappa   curvature, (x' y'' - y' x'') / |p'|^3                                1/m
///
/// Queries do not allocate.
class SplinePath {
 public:
  /// Throws std::invalid_argument naming `source` as check_path does, and where the path turns back in a cusp.
  explicit SplinePath(const Path& path, const std::string& source = "path");

  bool closed() const { return closed_; }
  double length_m() const { return ways_m_.back(); }
  std::size_t segments() const { return pieces_.size(); }

  /// The way at which a segment begins.
  double begin_m(std::size_t segment) const { return ways_m_[pieces_[segment].first_knot]; }

  /// The greatest speed on a segment, if the path says so.
  std::optional<double> speed_m_s(std::size_t segment) const { return pieces_[segment].speed_m_s; }

  /// The point at a way. A closed path repeats; an open one goes straight on beyond its ends.
  PathPoint at(double way_m) const;

  /// The way of the nearest point in a local search from `from_way_m`: on both sides of it the path leads away from
  /// the place. In [0, length_m()]. From scan to scan its cost is in proportion to the way between.
  double nearest_m(const Eigen::Vector2d& p_world_m, double from_way_m) const;

  /// The same of the whole path, whose cost is in proportion to its length.
  double nearest_m(const Eigen::Vector2d& p_world_m) const;

 private:
  /// A segment: p = c0 + c1 t + c2 t^2 + c3 t^3 with t = u less that of its begin.
  struct Piece {
    Eigen::Matrix<double, 2, 4> c;
    std::size_t first_knot = 0;  ///< of the knots at which arc length is tabulated, one of which is at its begin
    std::optional<double> speed_m_s;
  };

  void fit(const Path& path);
  void tabulate(const std::string& source);
  std::size_t knot_before(double way_m) const;
  double t_after(std::size_t knot) const;
  std::size_t intervals() const { return ways_m_.size() - 1; }
  Eigen::Vector2d place(std::size_t knot) const;
  double nearest_between(const Eigen::Vector2d& p_world_m, std::size_t knot) const;
  double refine(const Eigen::Vector2d& p_world_m, std::size_t knot) const;

  bool closed_ = false;
  std::vector<Piece> pieces_;
  std::vector<double> chords_m_;  ///< of the segments
  std::vector<double> ways_m_;    ///< at the knots, the end included
  std::vector<double> ts_m_;      ///< t at each knot, in the segment that begins or goes on there
  std::vector<std::size_t> piece_of_knot_;
};

}  // namespace situation_awareness
