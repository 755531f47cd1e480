// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/polylines/polyline_extraction.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <utility>

#include <Eigen/LU>

#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/geometry/simplify.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// rad. At an end beside background, a hit behind its neighbour at less than this angle to the beam is a mixture of
/// both surfaces.
constexpr double kMinIncidence_rad = 0.35;
/// m. Standard deviation of the ranges, where a scan has too few hits to show it.
constexpr double kRangeSigma_m = 0.012;

constexpr const char* kMixed = "between two surfaces";
/// Edges that turn by less at a vertex have no intersection that is worth anything.
constexpr double kMinTurn_rad = 0.15;
/// m. An intersection farther from the hits at the vertex is none of the boundary.
constexpr double kMaxCorner_m = 0.15;
/// Range errors and the width of the beam make a line at least so uncertain across, as a fraction of a beam's spacing.
constexpr double kAzimuthSigma = 0.1;

/// An edge whose orientation is less certain, or which has fewer hits, has no normal: two hits may be of two surfaces.
constexpr double kMaxTurnSigma_rad = 0.3;
constexpr std::size_t kFewestWithNormal = 3;
/// Standard deviations of a hit from its edge's line, beyond which it has no normal: it may be of the next surface.
constexpr double kOnEdgeSigmas = 2.5;
/// The same along the beam, for a hit that is behind the one beside it.
constexpr double kBehindSigmas = 3.0;
/// m. A shorter step between two hits is none from one surface to another.
constexpr double kShortStep_m = 0.05;

/// A hit between two surfaces is off either by so many standard deviations of the range noise, and by more than this
/// multiple of the steps between the hits next to it, as a surface that beams graze has steps of one size.
constexpr double kMixedSigmas = 3.0;
constexpr double kMixedStep = 1.2;
constexpr int kSurfaceSteps = 2;

/// Points [first, last] of a polyline between two vertices. Neighbouring edges share the hit between them.
struct Edge {
  std::size_t first = 0;
  std::size_t last = 0;
  LineEstimate line;
};

/// Kept for their memory.
struct Workspace {
  Simplification simplification;
  std::vector<std::size_t> corners;
  std::vector<Edge> edges;
  std::vector<bool> mixed;  ///< of each hit of the scan
};

double sine_between(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return std::abs(a.x() * b.y() - a.y() * b.x()) / std::max(a.norm() * b.norm(), 1e-12);
}

/// The vertices of the simplified chain of points, as indices.
void simplify(const Point* points, std::size_t count, double max_offset_m, Workspace& work) {
  work.corners.assign(1, 0);
  if (count < 2) return;
  const auto at = [points](std::size_t i) -> const Eigen::Vector2d& { return points[i].p_level_m; };
  work.simplification.add(
      0, count - 1, max_offset_m, at, [](std::size_t /*i*/) { return 0.0; }, work.corners);
}

/// A line through the only hit or hits on the beam, square to it.
LineEstimate square_to_beam(const Point& point, double range_sigma_m) {
  LineEstimate result;
  result.line_level = {point.p_level_m, point.p_level_m / point.range_m};
  result.covariance << range_sigma_m * range_sigma_m, 0.0, 0.0, 1.0;
  return result;
}

double variance_at(const LineEstimate& line, const Eigen::Vector2d& p_m) {
  const Eigen::Vector2d along(-line.line_level.normal.y(), line.line_level.normal.x());
  const double s_m = along.dot(p_m - line.line_level.through_m);
  return line.covariance(0, 0) + 2.0 * s_m * line.covariance(0, 1) + s_m * s_m * line.covariance(1, 1);
}

/// A point on the line, known along it with the variance of a uniform place within a beam's spacing.
PolylineVertex vertex_on(const LineEstimate& line, const Point& point, double resolution_rad) {
  const Eigen::Vector2d& n = line.line_level.normal;
  const Eigen::Vector2d along(-n.y(), n.x());
  PolylineVertex vertex;
  vertex.p_level_m = point.p_level_m - n * n.dot(point.p_level_m - line.line_level.through_m);
  const Eigen::Vector2d u = point.p_level_m / point.range_m;
  const double spacing_m = point.range_m * resolution_rad / std::max(std::abs(n.dot(u)), 0.1);
  vertex.covariance = variance_at(line, vertex.p_level_m) * n * n.transpose() +
                      spacing_m * spacing_m / 12.0 * along * along.transpose();
  return vertex;
}

PolylineVertex vertex_between(const LineEstimate& right, const LineEstimate& left, const Point& at,
                              double resolution_rad) {
  Eigen::Matrix2d N;
  N.row(0) = right.line_level.normal.transpose();
  N.row(1) = left.line_level.normal.transpose();
  if (std::abs(N.determinant()) > std::sin(kMinTurn_rad)) {
    const Eigen::Matrix2d inverse = N.inverse();
    PolylineVertex vertex;
    vertex.p_level_m = inverse * Eigen::Vector2d(right.line_level.normal.dot(right.line_level.through_m),
                                                 left.line_level.normal.dot(left.line_level.through_m));
    if ((vertex.p_level_m - at.p_level_m).norm() < kMaxCorner_m) {
      const Eigen::Vector2d variances(variance_at(right, vertex.p_level_m), variance_at(left, vertex.p_level_m));
      vertex.covariance = inverse * variances.asDiagonal() * inverse.transpose();
      return vertex;
    }
  }
  const PolylineVertex on_right = vertex_on(right, at, resolution_rad);
  const PolylineVertex on_left = vertex_on(left, at, resolution_rad);
  return {0.5 * (on_right.p_level_m + on_left.p_level_m), 0.5 * (on_right.covariance + on_left.covariance)};
}

class Extraction {
 public:
  Extraction(const Segments& segments, const PolylineParams& params, Polylines& result, Workspace& work)
      : segments_(segments), params_(params), result_(result), work_(work) {}

  void add(std::size_t first, std::size_t count, SegmentEnd right_end, SegmentEnd left_end) {
    // From right to left: the parts before each hit between two surfaces, then the rest.
    const std::size_t end = first + count;
    for (std::size_t i = first; i < end; ++i) {
      if (!work_.mixed[i]) continue;
      ++result_.refused[kMixed];
      const bool nearer = i > 0 && segments_.points[i - 1].range_m < segments_.points[i].range_m;
      if (i > first) add_part(first, i - first, right_end, nearer ? SegmentEnd::kBackground : SegmentEnd::kOccluded);
      right_end = nearer ? SegmentEnd::kOccluded : SegmentEnd::kBackground;
      first = i + 1;
    }
    if (first < end) add_part(first, end - first, right_end, left_end);
  }

 private:
  void add_part(std::size_t first, std::size_t count, SegmentEnd right_end, SegmentEnd left_end) {
    drop_mixed_ends(first, count, right_end, left_end);
    const Point* points = &segments_.points[first];
    simplify(points, count, params_.max_offset_m, work_);
    // From right to left: the parts before each jump, then the rest.
    for (std::size_t last = next_jump(points); last != kNoJump; last = next_jump(points)) {
      const bool nearer = points[last].range_m < points[last + 1].range_m;
      add_one(first, last + 1, right_end, nearer ? SegmentEnd::kBackground : SegmentEnd::kOccluded);
      right_end = nearer ? SegmentEnd::kOccluded : SegmentEnd::kBackground;
      first += last + 1;
      count -= last + 1;
      points = &segments_.points[first];
      simplify(points, count, params_.max_offset_m, work_);
    }
    add_one(first, count, right_end, left_end);
  }

  static constexpr std::size_t kNoJump = std::numeric_limits<std::size_t>::max();

  /// The hit on the right of the first edge that leads from one surface to another behind it: it is along the beam,
  /// and of two hits only.
  std::size_t next_jump(const Point* points) const {
    for (std::size_t k = 0; k + 1 < work_.corners.size(); ++k) {
      const std::size_t i = work_.corners[k];
      if (work_.corners[k + 1] != i + 1) continue;
      const Eigen::Vector2d step_m = points[i + 1].p_level_m - points[i].p_level_m;
      if (step_m.norm() > kShortStep_m && sine_between(step_m, points[i].p_level_m) < std::sin(kMinIncidence_rad)) {
        return i;
      }
    }
    return kNoJump;
  }

  void add_one(std::size_t first, std::size_t count, SegmentEnd right_end, SegmentEnd left_end) {
    const Point* const points = &segments_.points[first];
    Polyline polyline;
    polyline.first_hit = result_.hits.size();
    polyline.hits = count;
    polyline.first_vertex = result_.vertices.size();
    polyline.right_end = right_end;
    polyline.left_end = left_end;
    simplify(points, count, params_.max_offset_m, work_);
    fit_edges(points, count);
    add_vertices(points);
    add_hits(first, count);
    polyline.vertices = result_.vertices.size() - polyline.first_vertex;
    result_.polylines.push_back(polyline);
  }

  /// A beam that meets an edge measures between the thing and its background.
  void drop_mixed_ends(std::size_t& first, std::size_t& count, SegmentEnd right_end, SegmentEnd left_end) {
    const Point* const points = segments_.points.data();
    const auto is_mixed = [&](std::size_t end, std::size_t beside) {
      const Eigen::Vector2d step_m = points[end].p_level_m - points[beside].p_level_m;
      return points[end].range_m > points[beside].range_m + kMixedSigmas * result_.range_sigma_m &&
             sine_between(step_m, points[end].p_level_m) < std::sin(kMinIncidence_rad);
    };
    if (count > 2 && right_end == SegmentEnd::kBackground && is_mixed(first, first + 1)) {
      ++first;
      --count;
      ++result_.refused[kMixed];
    }
    if (count > 2 && left_end == SegmentEnd::kBackground && is_mixed(first + count - 1, first + count - 2)) {
      --count;
      ++result_.refused[kMixed];
    }
  }

  void fit_edges(const Point* points, std::size_t count) {
    work_.edges.clear();
    if (count == 1) {
      work_.edges.push_back({0, 0, square_to_beam(points[0], result_.range_sigma_m)});
      return;
    }
    for (std::size_t k = 0; k + 1 < work_.corners.size(); ++k) {
      Edge edge{work_.corners[k], work_.corners[k + 1], {}};
      const Eigen::Vector2d chord_m = points[edge.last].p_level_m - points[edge.first].p_level_m;
      edge.line = chord_m.norm() > 1e-6
                      ? estimate_line(points + edge.first, edge.last - edge.first + 1, result_.range_sigma_m)
                      : square_to_beam(points[edge.first], result_.range_sigma_m);
      work_.edges.push_back(edge);
    }
  }

  void add_vertices(const Point* points) {
    const std::vector<Edge>& edges = work_.edges;
    result_.vertices.push_back(vertex_on(edges.front().line, points[edges.front().first], segments_.resolution_rad));
    for (std::size_t k = 0; k + 1 < edges.size(); ++k) {
      result_.vertices.push_back(
          vertex_between(edges[k].line, edges[k + 1].line, points[edges[k].last], segments_.resolution_rad));
    }
    if (edges.back().last > edges.front().first) {
      result_.vertices.push_back(vertex_on(edges.back().line, points[edges.back().last], segments_.resolution_rad));
    }
  }

  std::size_t hits_of(std::size_t edge) const { return work_.edges[edge].last - work_.edges[edge].first; }

  /// Whether a beam beside a hit ends before it.
  bool is_behind_beside(std::size_t i) const {
    const std::vector<Point>& points = segments_.points;
    const auto is_nearer = [&](std::size_t beside) {
      return std::abs(points[beside].beam - points[i].beam) == 1 &&
             points[beside].range_m < points[i].range_m - kBehindSigmas * result_.range_sigma_m;
    };
    return (i > 0 && is_nearer(i - 1)) || (i + 1 < points.size() && is_nearer(i + 1));
  }

  void add_hits(std::size_t first, std::size_t count) {
    const Point* const points = &segments_.points[first];
    std::size_t edge = 0;
    for (std::size_t i = 0; i < count; ++i) {
      while (edge + 1 < work_.edges.size() && i > work_.edges[edge].last) ++edge;
      // A corner is of the edge with more hits: the other one's line is less certain.
      if (edge + 1 < work_.edges.size() && i == work_.edges[edge].last && hits_of(edge + 1) > hits_of(edge)) ++edge;
      const Point& point = points[i];
      const Eigen::Vector2d u = point.p_level_m / point.range_m;
      const LineEstimate& line = work_.edges[edge].line;
      const Eigen::Vector2d line_normal = line.line_level.normal;
      const double along_beam_of_line = std::abs(line_normal.dot(u));
      const bool has_normal = hits_of(edge) + 1 >= kFewestWithNormal &&
                              line.covariance(1, 1) < kMaxTurnSigma_rad * kMaxTurnSigma_rad &&
                              std::abs(line_normal.dot(point.p_level_m - line.line_level.through_m)) <
                                  kOnEdgeSigmas * std::hypot(along_beam_of_line * result_.range_sigma_m,
                                                             kAzimuthSigma * point.range_m * segments_.resolution_rad);
      Eigen::Vector2d normal = has_normal ? line_normal : u;
      if (normal.dot(u) > 0.0) normal = -normal;
      const double along_beam = std::abs(normal.dot(u));
      const double across_beam = std::sqrt(std::max(0.0, 1.0 - along_beam * along_beam));
      const double sigma_m = std::hypot(along_beam * result_.range_sigma_m,
                                        across_beam * kAzimuthSigma * point.range_m * segments_.resolution_rad);
      result_.hits.push_back({point.p_level_m, normal, has_normal, is_behind_beside(first + i), sigma_m,
                              point.azimuth_rad, point.range_m});
    }
  }

  const Segments& segments_;
  const PolylineParams& params_;
  Polylines& result_;
  Workspace& work_;
};

/// Whether a hit lies between a nearer and a farther one of the beams beside it, on neither surface: a beam over an
/// edge measures a mixture of both.
bool is_mixed(const std::vector<Point>& points, std::size_t i, double range_sigma_m) {
  if (i == 0 || i + 1 >= points.size()) return false;
  const auto are_neighbours = [&](std::size_t a, std::size_t b) {
    return std::abs(points[a].beam - points[b].beam) == 1;
  };
  if (!are_neighbours(i - 1, i) || !are_neighbours(i, i + 1)) return false;
  const double right_m = points[i].range_m - points[i - 1].range_m;
  const double left_m = points[i + 1].range_m - points[i].range_m;
  if (right_m * left_m <= 0.0) return false;
  // On the other side of the hit beside it the steps are those of a surface.
  const auto is_jump = [&](double step_m, std::size_t beside, std::ptrdiff_t direction) {
    double on_surface_m = 0.0;
    auto from = static_cast<std::ptrdiff_t>(beside);
    for (int k = 0; k < kSurfaceSteps; ++k, from += direction) {
      const std::ptrdiff_t to = from + direction;
      if (to < 0 || to >= static_cast<std::ptrdiff_t>(points.size())) break;
      const auto a = static_cast<std::size_t>(from), b = static_cast<std::size_t>(to);
      if (!are_neighbours(a, b)) break;
      on_surface_m = std::max(on_surface_m, std::abs(points[a].range_m - points[b].range_m));
    }
    return std::abs(step_m) > kMixedSigmas * range_sigma_m + kMixedStep * on_surface_m;
  };
  return is_jump(right_m, i - 1, -1) && is_jump(left_m, i + 1, 1);
}

}  // namespace

Polylines extract_polylines(const Segments& segments, const PolylineParams& params, Polylines memory) {
  Polylines result = std::move(memory);
  result.stamp_ns = segments.stamp_ns;
  result.T_world_level = segments.T_world_level;
  result.height_world_m = segments.height_world_m;
  result.resolution_rad = segments.resolution_rad;
  result.range_sigma_m = segments.range_sigma_m > 0.0 ? segments.range_sigma_m : kRangeSigma_m;
  result.hits.clear();
  result.vertices.clear();
  result.polylines.clear();
  result.refused.reset();
  result.free_space = segments.free_space;
  result.hits.reserve(segments.points.size());
  result.vertices.reserve(2 * segments.points.size());
  result.polylines.reserve(segments.points.size());

  thread_local Workspace work;
  assign_with_room(work.mixed, segments.points.size(), false);
  for (std::size_t i = 0; i < segments.points.size(); ++i) {
    work.mixed[i] = is_mixed(segments.points, i, result.range_sigma_m);
  }
  Extraction extraction(segments, params, result, work);
  // Segments and refused runs are each by increasing azimuth: merged.
  std::size_t run = 0;
  const auto add_runs_before = [&](double azimuth_rad) {
    for (; run < segments.refused_runs.size(); ++run) {
      const RefusedRun& refused = segments.refused_runs[run];
      if (segments.points[refused.first].azimuth_rad > azimuth_rad) return;
      if (refused.why != RunRefusal::kTooFewPoints) {
        result.refused[text_of(refused.why)] += refused.count;
      } else {
        extraction.add(refused.first, refused.count, SegmentEnd::kFree, SegmentEnd::kFree);
      }
    }
  };
  for (const Segment& segment : segments.segments) {
    add_runs_before(segments.points[segment.first].azimuth_rad);
    extraction.add(segment.first, segment.count, segment.right_end, segment.left_end);
  }
  add_runs_before(std::numeric_limits<double>::infinity());
  return result;
}

}  // namespace situation_awareness
