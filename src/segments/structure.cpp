// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/segments/structure.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "situation_awareness/segments/lines.hpp"
#include "situation_awareness/segments/range_noise.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// m. Maximum mean distance of an object's points behind the chord of its ends, seen from the sensor; a segment with
/// more is structure (an inner corner), with free_faces only if not both ends have something farther away beside them.
constexpr double kMaxConcavity_m = 0.03;
/// m. A partially occluded segment whose RMS distance from a line is below this is structure; between two occluders
/// below 1.6 times the range noise that the scan shows, if that is more.
constexpr double kMaxStraightRms_m = 0.008;
/// m. Minimum extent of a flat segment that is structure (the front of a wall or a cabinet).
constexpr double kFlatExtent_m = 0.4;

/// Of the range noise: the largest RMS distance from a line of what is seen between two occluders and shows no bend. 4
/// to 6 hits on a wall exceed it in 1 of 200 scans. With half of it, 10 pieces of walls are on a map of 60 objects.
constexpr double kStraightByNoise = 1.6;

/// Largest distance between two points by two sweeps from one end: too small by a factor of at most 1 / sqrt(3).
/// Returns any distance above `enough_m` where there is one.
double extent_m(const Point* points, std::size_t count, double enough_m) {
  const double enough_m2 = enough_m * enough_m;
  std::size_t far = 0;
  double extent_m2 = 0.0;
  for (int sweep = 0; sweep < 2; ++sweep) {
    const Eigen::Vector2d from = points[far].p_level_m;
    for (std::size_t i = 0; i < count; ++i) {
      const double distance_m2 = (points[i].p_level_m - from).squaredNorm();
      if (distance_m2 > extent_m2) {
        extent_m2 = distance_m2;
        far = i;
        if (extent_m2 > enough_m2) return std::sqrt(extent_m2);
      }
    }
  }
  return std::sqrt(extent_m2);
}

/// True if the distances of points from a line, and their bulge, are too small for an object of elliptic outline.
bool flat_along(const Line& line, double rms_m, const Point* points, std::size_t count,
                const SegmentationParams& params) {
  const Bulge bulge = bulge_of(line, points, count);
  return bulge.ratio < params.min_bulge && rms_m < params.min_bulge * bulge.half_m;
}

void mark(Segments& segments, Segment& segment, StructureReason reason) {
  segment.structure = reason;
  segment.kind = reason == StructureReason::kNone ? SegmentKind::kObject : SegmentKind::kStructure;
  if (reason != StructureReason::kNone) ++segments.refused[text_of(reason)];
}

/// True if all points from `first` to `end` lie on one line.
bool is_straight(const Segments& segments, std::size_t first, std::size_t end) {
  const Point* const points = &segments.points[first];
  const Line line = fit_line(points, end - first);
  return std::all_of(points, points + (end - first), [&](const Point& point) {
    return std::abs(offset_m(line, point.p_level_m)) <= kMaxStructureOffset_m;
  });
}

/// Mark pieces of a structure behind occluders: a piece with a hidden end on the line of a structure a few segments
/// away on that side. `step` is the side; pieces are visited from there, so that a structure with several occluders is
/// followed piece by piece.
void extend_structures(Segments& segments, int step) {
  constexpr std::ptrdiff_t kReach = 4;  // segments: the occluders between two pieces
  constexpr std::size_t kLinePoints = 30;
  const auto n = static_cast<std::ptrdiff_t>(segments.segments.size());
  for (std::ptrdiff_t visit = 0; visit < n; ++visit) {
    const std::ptrdiff_t i = step < 0 ? visit : n - 1 - visit;
    Segment& piece = segments.segments[static_cast<std::size_t>(i)];
    const SegmentEnd end = step < 0 ? piece.right_end : piece.left_end;
    if (piece.kind != SegmentKind::kObject || is_sure_silhouette(end)) continue;
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
        return std::abs(offset_m(line, point.p_level_m)) <= kMaxStructureOffset_m;
      });
      if (on_line) {
        mark(segments, piece, StructureReason::kInLine);
        break;
      }
    }
  }
}

/// Mark pieces of a surface that lost returns: neighbours on one line, apart only by beams without a return, which
/// together are larger than an object.
void join_broken_structures(Segments& segments, const SegmentationParams& params) {
  std::vector<Segment>& all = segments.segments;
  for (std::size_t first = 0; first < all.size();) {
    std::size_t last = first;
    while (last + 1 < all.size() && all[last].left_end == SegmentEnd::kNoReturn &&
           all[last + 1].right_end == SegmentEnd::kNoReturn &&
           is_straight(segments, all[first].first, all[last + 1].first + all[last + 1].count)) {
      ++last;
    }
    const Point* const points = &segments.points[all[first].first];
    const std::size_t count = all[last].first + all[last].count - all[first].first;
    if (last > first && extent_m(points, count, params.max_object_extent_m) > params.max_object_extent_m) {
      for (std::size_t i = first; i <= last; ++i) {
        if (all[i].kind == SegmentKind::kObject) mark(segments, all[i], StructureReason::kInLine);
      }
    }
    first = std::max(last, first + 1);
  }
}

/// True if something farther away is seen beside both ends.
bool stands_free(const Segment& segment) {
  return segment.right_end == SegmentEnd::kBackground && segment.left_end == SegmentEnd::kBackground;
}

/// True if a segment with one hidden end surely ends at the other: something farther away is seen beside it. The walls
/// of a room have no such end.
bool ends_before_background(const Segment& segment) {
  return (is_silhouette(segment.right_end) ? segment.right_end : segment.left_end) == SegmentEnd::kBackground;
}

/// True if a straight segment with one hidden end surely ends behind what hides it: a beam beyond passes through the
/// line of the segment, near enough for one object. It is the face of a box then, no piece of a wall.
bool ends_behind_occluder(const Segments& segments, const Segment& segment, const Line& line,
                          const SegmentationParams& params) {
  const bool left_hidden = !is_silhouette(segment.left_end);
  if ((left_hidden ? segment.left_end : segment.right_end) != SegmentEnd::kOccluded) return false;
  const Point* const right = &segments.points[segment.first];
  const Point* const left = right + segment.count - 1;
  const Eigen::Vector2d seen_end_m = (left_hidden ? right : left)->p_level_m;
  const Point* const begin = segments.points.data();
  const Point* const end = begin + segments.points.size();
  const int step = left_hidden ? 1 : -1;
  for (const Point* beside = (left_hidden ? left : right) + step; beside >= begin && beside < end; beside += step) {
    const Eigen::Vector2d u = beside->p_level_m / beside->range_m;
    const double line_range_m = line.normal.dot(line.through_m) / line.normal.dot(u);
    if (!(line_range_m > 0.0)) return false;
    if ((line_range_m * u - seen_end_m).norm() > params.max_object_extent_m) return false;
    if (beside->range_m > line_range_m + params.max_range_gap_m) return true;
  }
  return false;
}

}  // namespace

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
  if (extent_m(points, segment.count, kFlatExtent_m) < kFlatExtent_m) return false;
  const Line line = fit_line(points, segment.count);
  return flat_along(line, rms_m(line, points, segment.count), points, segment.count, params);
}

StructureReason structure_reason(const Segments& segments, const Segment& segment, const SegmentationParams& params) {
  const Point* points = &segments.points[segment.first];
  const double extent = extent_m(points, segment.count, params.max_object_extent_m);
  if (extent > params.max_object_extent_m) return StructureReason::kExtent;
  if (!(params.free_faces && stands_free(segment)) && concavity_m(points, segment.count) > kMaxConcavity_m) {
    return StructureReason::kInnerCorner;
  }
  const int hidden_ends = (is_silhouette(segment.right_end) ? 0 : 1) + (is_silhouette(segment.left_end) ? 0 : 1);
  const bool hidden = hidden_ends > 0;
  const bool is_long = extent >= kFlatExtent_m;
  if (!hidden && (!is_long || params.free_faces)) return StructureReason::kNone;
  const Line line = fit_line(points, segment.count);
  const double rms = rms_m(line, points, segment.count);
  // Between two occluders nothing but its bend tells a piece of an object from one of a wall.
  const double straight_m =
      hidden_ends == 2 ? std::max(kMaxStraightRms_m, kStraightByNoise * segments.range_sigma_m) : kMaxStraightRms_m;
  if (params.free_faces && hidden_ends == 1 &&
      (ends_before_background(segment) || ends_behind_occluder(segments, segment, line, params))) {
    return StructureReason::kNone;
  }
  if (hidden && rms < straight_m) return StructureReason::kStraightHidden;
  return is_long && flat_along(line, rms, points, segment.count, params) ? StructureReason::kFlat
                                                                         : StructureReason::kNone;
}

Segments classify_structure(Segments segments, const SegmentationParams& params) {
  thread_local RangeNoise noise;  // kept for its memory
  segments.range_sigma_m = noise.sigma_m(segments);
  for (Segment& segment : segments.segments) mark(segments, segment, structure_reason(segments, segment, params));
  join_broken_structures(segments, params);
  extend_structures(segments, -1);
  extend_structures(segments, +1);
  return segments;
}

}  // namespace situation_awareness
