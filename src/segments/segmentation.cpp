// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/segments/segmentation.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include <Eigen/Eigenvalues>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// True if two hits with `missing` beams between them, none of which saw something else, are on the same thing.
bool same_thing(const Point& a, const Point& b, int missing, const SegmentationParams& params) {
  if (missing > params.max_missing_beams) return false;
  if (std::abs(a.range_m - b.range_m) > params.max_range_gap_m) return false;
  const double spacing_m = std::min(a.range_m, b.range_m) * std::abs(b.azimuth_rad - a.azimuth_rad);
  return (a.p_level_m - b.p_level_m).norm() <= params.max_gap_m + spacing_m;
}

/// The points of a scan in reading order: from beam to beam, and for a full circle from a place where two things part,
/// so that no thing lies across the seam.
class Reading {
 public:
  Reading(const Points& points, const SegmentationParams& params) : points_(points) {
    if (!points.full_circle) return;
    const std::size_t n = size();
    std::optional<Point> previous;
    int missing = 0;
    for (std::size_t k = 0; k < 2 * n; ++k) {  // a second turn meets the seam with a known previous hit
      const Point point = at(k);
      if (!is_hit(point.state)) {
        ++missing;
        continue;
      }
      if (previous && !same_thing(*previous, point, missing, params)) {
        start_ = k % n;
        return;
      }
      previous = point;
      missing = 0;
    }
  }

  std::size_t size() const { return points_.points.size(); }
  bool full_circle() const { return points_.full_circle; }

  /// The k-th point read; for a full circle k may exceed the size, and azimuths go on growing.
  Point at(std::size_t k) const {
    const std::size_t i = start_ + k;
    const std::size_t turns = i / size();
    Point point = points_.points[i % size()];
    point.azimuth_rad += 2.0 * kPi * static_cast<double>(turns);
    return point;
  }

 private:
  const Points& points_;
  std::size_t start_ = 0;
};

/// True if a beam went by beside an end: nothing blocked it there.
bool passed(const Point& beside, const Point& end, const SegmentationParams& params) {
  // What is at the end of a free beam's reach may go on beyond it.
  if (beside.state == BeamState::kFree) return beside.range_m > end.range_m + params.occlusion_margin_m;
  return is_hit(beside.state) && beside.range_m >= end.range_m - params.occlusion_margin_m;
}

/// What is beside the end at reading position `k`, looking in direction `step` (-1: to the right, +1: to the left).
SegmentEnd end_at(const Reading& reading, std::size_t k, int step, const SegmentationParams& params) {
  const auto n = static_cast<std::ptrdiff_t>(reading.size());
  const Point end = reading.at(k);
  auto position = static_cast<std::ptrdiff_t>(k);
  for (int skipped = 0; skipped <= params.max_missing_beams; ++skipped) {
    position += step;
    if (position < 0 || position >= n) {
      if (!reading.full_circle()) return SegmentEnd::kScanEdge;
      position = (position + n) % n;
    }
    const Point beside = reading.at(static_cast<std::size_t>(position));
    if (beside.state == BeamState::kInvalid) continue;
    if (!passed(beside, end, params)) return SegmentEnd::kOccluded;
    return beside.state == BeamState::kFree ? SegmentEnd::kFree : SegmentEnd::kBackground;
  }
  return SegmentEnd::kOccluded;  // nothing known about what is beside it
}

/// Azimuth beyond the hidden end at reading position `k` of which nothing is known: blocked by something nearer, or not
/// in the scan. Looked for as far as an object could reach.
double hidden_rad(const Reading& reading, std::size_t k, int step, double resolution_rad,
                  const SegmentationParams& params) {
  const auto n = static_cast<std::ptrdiff_t>(reading.size());
  const Point end = reading.at(k);
  const double reach_rad = std::min(2.0 * params.max_object_extent_m / end.range_m, kPi);
  const auto most = std::min(static_cast<std::ptrdiff_t>(reach_rad / resolution_rad), n - 1);
  auto position = static_cast<std::ptrdiff_t>(k);
  for (std::ptrdiff_t blocked = 0; blocked < most; ++blocked) {
    position += step;
    if (position < 0 || position >= n) {
      if (!reading.full_circle()) break;
      position = (position + n) % n;
    }
    const Point beside = reading.at(static_cast<std::size_t>(position));
    if (passed(beside, end, params)) return static_cast<double>(blocked) * resolution_rad;
  }
  return reach_rad;
}

/// Largest distance between two points, found from one end by two sweeps: never more than 1 / sqrt(3) too small.
double extent_m(const Point* points, std::size_t count) {
  std::size_t far = 0;
  double extent = 0.0;
  for (int sweep = 0; sweep < 2; ++sweep) {
    const Eigen::Vector2d from = points[far].p_level_m;
    for (std::size_t i = 0; i < count; ++i) {
      const double distance = (points[i].p_level_m - from).norm();
      if (distance > extent) {
        extent = distance;
        far = i;
      }
    }
  }
  return extent;
}

/// A straight line through points, by total least squares.
struct Line {
  Eigen::Vector2d through = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal = Eigen::Vector2d::UnitX();
};

Line fit_line(const Point* points, std::size_t count) {
  Line line;
  for (std::size_t i = 0; i < count; ++i) line.through += points[i].p_level_m;
  line.through /= static_cast<double>(count);
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector2d d = points[i].p_level_m - line.through;
    scatter += d * d.transpose();
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(scatter);
  line.normal = solver.eigenvectors().col(0);
  return line;
}

/// Root mean square distance of points from a line.
double rms_m(const Line& line, const Point* points, std::size_t count) {
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) sum += std::pow(line.normal.dot(points[i].p_level_m - line.through), 2);
  return std::sqrt(sum / static_cast<double>(count));
}

/// How far the middle of points along a line stands out before their ends, towards the sensor, as part of half their
/// length (by the parabola over the line), and that half length.
struct Bulge {
  double ratio = 0.0;
  double half_m = 0.0;
};

Bulge bulge_of(const Line& line, const Point* points, std::size_t count) {
  const Eigen::Vector2d along(-line.normal.y(), line.normal.x());
  const double towards = line.normal.dot(line.through) > 0.0 ? -1.0 : 1.0;  // the sensor is at the origin
  Bulge bulge;
  double s2 = 0.0;
  double s3 = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const double s = along.dot(points[i].p_level_m - line.through);
    s2 += s * s;
    s3 += s * s * s;
    bulge.half_m = std::max(bulge.half_m, std::abs(s));
  }
  if (!(s2 > 0.0)) return bulge;
  double rq = 0.0;
  double qq = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector2d d = points[i].p_level_m - line.through;
    const double s = along.dot(d);
    const double q = s * s - s2 / static_cast<double>(count) - s3 / s2 * s;  // of s^2 what no line has
    rq += towards * line.normal.dot(d) * q;
    qq += q * q;
  }
  if (qq > 0.0) bulge.ratio = -rq / qq * bulge.half_m;
  return bulge;
}

/// Why a segment is structure by its own hits and ends, whatever is beside it; empty text if it may be an object.
const char* structure_alone(const Segments& segments, const Segment& segment, const SegmentationParams& params) {
  const Point* points = &segments.points[segment.first];
  if (extent_m(points, segment.count) > params.max_object_extent_m) return "structure: larger than an object";
  if (concavity_m(points, segment.count) > params.max_concavity_m) return "structure: inner corner";
  const bool hidden = !is_silhouette(segment.right_end) || !is_silhouette(segment.left_end);
  const bool straight =
      hidden && rms_m(fit_line(points, segment.count), points, segment.count) < params.max_straight_rms_m;
  if (straight) return "structure: straight, an end hidden";
  return is_flat(segments, segment, params) ? "structure: flat" : "";
}

/// Mark pieces that a nearer object cuts off a structure: a piece with a hidden end that lies on the line of a
/// structure a few segments further on that side. `step` is the side to look to, and the pieces are visited from there,
/// so that a structure cut many times is followed piece by piece.
void extend_structures(Segments& segments, int step, const SegmentationParams& params) {
  constexpr std::ptrdiff_t kReach = 4;  // segments: the occluders between two pieces
  constexpr std::size_t kLinePoints = 30;
  const auto n = static_cast<std::ptrdiff_t>(segments.segments.size());
  for (std::ptrdiff_t visit = 0; visit < n; ++visit) {
    const std::ptrdiff_t i = step < 0 ? visit : n - 1 - visit;
    Segment& piece = segments.segments[static_cast<std::size_t>(i)];
    const SegmentEnd end = step < 0 ? piece.right_end : piece.left_end;
    if (piece.kind != SegmentKind::kObject || is_silhouette(end)) continue;
    for (std::ptrdiff_t reach = 1; reach <= kReach; ++reach) {
      const std::ptrdiff_t j = i + step * reach;
      if (j < 0 || j >= n) break;
      const Segment& structure = segments.segments[static_cast<std::size_t>(j)];
      if (structure.kind != SegmentKind::kStructure) continue;
      const std::size_t line_points = std::min(structure.count, kLinePoints);
      const std::size_t line_first = step < 0 ? structure.first + structure.count - line_points : structure.first;
      const Line line = fit_line(&segments.points[line_first], line_points);
      const auto* points = &segments.points[piece.first];
      const bool on_line = std::all_of(points, points + piece.count, [&](const Point& point) {
        return std::abs(line.normal.dot(point.p_level_m - line.through)) <= params.max_structure_offset_m;
      });
      if (on_line) {
        piece.kind = SegmentKind::kStructure;
        ++segments.refused["structure: in line with another"];
        break;
      }
    }
  }
}

}  // namespace

void SegmentationParams::validate() const { check_bounds(*this, "segments"); }

double concavity_m(const Point* points, std::size_t count) {
  if (count < 3) return 0.0;
  const Eigen::Vector2d right = points[0].p_level_m;
  const Eigen::Vector2d chord = points[count - 1].p_level_m - right;
  if (chord.norm() < 1e-9) return 0.0;
  Eigen::Vector2d away(chord.y(), -chord.x());
  away.normalize();
  if (away.dot(right) < 0.0) away = -away;
  double sum = 0.0;
  for (std::size_t i = 1; i + 1 < count; ++i) sum += away.dot(points[i].p_level_m - right);
  return sum / static_cast<double>(count - 2);
}

bool is_flat(const Segments& segments, const Segment& segment, const SegmentationParams& params) {
  const Point* points = &segments.points[segment.first];
  if (extent_m(points, segment.count) < params.flat_extent_m) return false;
  const Line line = fit_line(points, segment.count);
  const Bulge bulge = bulge_of(line, points, segment.count);
  return bulge.ratio < params.min_bulge && rms_m(line, points, segment.count) < params.min_bulge * bulge.half_m;
}

Segments segment(const Points& points, const SegmentationParams& params, Segments memory) {
  Segments result = std::move(memory);
  result.points.clear();
  result.segments.clear();
  result.refused.reset();
  result.stamp_ns = points.stamp_ns;
  result.T_world_level = points.T_world_level;
  result.height_world_m = points.height_world_m;
  result.resolution_rad = points.resolution_rad;
  result.time_increment_s = points.time_increment_s;
  result.free_space = free_space(points, std::move(result.free_space));
  result.points.reserve(points.points.size());
  if (points.points.empty()) return result;

  const auto beams = static_cast<double>(points.points.size());
  const auto min_points = std::max(static_cast<std::size_t>(params.min_points),
                                   static_cast<std::size_t>(std::ceil(params.min_points_fraction * beams)));

  const Reading reading(points, params);
  std::size_t first = 0;       // of the open segment, in result.points
  std::size_t first_read = 0;  // reading positions of its ends
  std::size_t last_read = 0;
  std::size_t inside = 0;  // its points in the volume of interest
  const auto close_segment = [&] {
    const std::size_t count = result.points.size() - first;
    const bool too_few = count < min_points;
    if (too_few || 2 * inside < count) {
      if (count > 0) ++result.refused[too_few ? kTooFewPoints : "segment refused: out of range or volume"];
      result.points.resize(first);
    } else {
      Segment segment;
      segment.first = first;
      segment.count = count;
      segment.right_end = end_at(reading, first_read, -1, params);
      segment.left_end = end_at(reading, last_read, +1, params);
      const auto hidden_beside = [&](SegmentEnd end, std::size_t k, int step) {
        return is_silhouette(end) ? 0.0 : hidden_rad(reading, k, step, points.resolution_rad, params);
      };
      segment.right_hidden_rad = hidden_beside(segment.right_end, first_read, -1);
      segment.left_hidden_rad = hidden_beside(segment.left_end, last_read, +1);
      const char* const structure = structure_alone(result, segment, params);
      if (*structure != '\0') {
        segment.kind = SegmentKind::kStructure;
        ++result.refused[structure];
      }
      result.segments.push_back(segment);
    }
    first = result.points.size();
    inside = 0;
  };

  int missing = 0;
  for (std::size_t k = 0; k < reading.size(); ++k) {
    const Point point = reading.at(k);
    if (!is_hit(point.state)) {
      ++missing;
      continue;
    }
    const bool open = result.points.size() > first;
    if (open && !same_thing(result.points.back(), point, missing, params)) close_segment();
    if (result.points.size() == first) first_read = k;
    last_read = k;
    missing = 0;
    if (point.state == BeamState::kHit) ++inside;
    result.points.push_back(point);
  }
  close_segment();

  extend_structures(result, -1, params);
  extend_structures(result, +1, params);
  return result;
}

}  // namespace situation_awareness
