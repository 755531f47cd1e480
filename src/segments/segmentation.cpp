// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/segments/segmentation.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/segments/lines.hpp"
#include "situation_awareness/segments/structure.hpp"

namespace situation_awareness {
namespace {

/// Beams without a return inside segments, per hit. From this on a beam without one beside a segment is no proof of
/// free space either. On recordings an RPLidar A2 has 0.13 to 0.21 in nine scans of ten, Hokuyo's and SICK's scanners
/// at most 0.017.
constexpr double kManyLost = 0.05;
/// Slope of what may still continue a surface, from its end: few hits do not tell its direction.
constexpr double kMaxBend = 0.05;

/// Fraction of beams without a return up to which a scan is closed: such a beam was lost on a surface. No test bounds
/// it.
constexpr double kClosed = 0.05;
/// Sine of the angle at which sides lose all their returns. No source is recorded, and no test bounds it.
constexpr double kGrazed = 0.25;

/// m. Width of a leg or a post, of which fewer hits are a segment. No source is recorded, and no test bounds it.
constexpr double kNarrow_m = 0.2;

/// True if two hits with `missing` beams without a hit between them are on the same object.
bool same_object(const Point& a, const Point& b, int missing, const SegmentationParams& params) {
  if (missing > params.max_missing_beams) return false;
  if (std::abs(a.range_m - b.range_m) > params.max_range_gap_m) return false;
  const double spacing_m = std::min(a.range_m, b.range_m) * std::abs(b.azimuth_rad - a.azimuth_rad);
  return (a.p_level_m - b.p_level_m).norm() <= params.max_gap_m + spacing_m;
}

/// The points of a scan in reading order: from beam to beam, and for a full circle from a gap between two segments, so
/// that none lies across the seam.
class Reading {
 public:
  Reading(const Points& points, const SegmentationParams& params) : points_(points) {
    if (!points.full_circle) return;
    const std::size_t n = size();
    std::optional<Point> previous;
    int missing = 0;
    for (std::size_t k = 0; k < 2 * n; ++k) {  // the second turn crosses the seam with a known previous hit
      const Point point = at(k);
      if (!is_hit(point.state)) {
        ++missing;
        continue;
      }
      if (previous && !same_object(*previous, point, missing, params)) {
        start_ = k % n;
        return;
      }
      previous = point;
      missing = 0;
    }
  }

  std::size_t size() const { return points_.points.size(); }
  bool full_circle() const { return points_.full_circle; }

  /// The k-th point read; for a full circle k may exceed the size, and azimuths continue to increase.
  Point at(std::size_t k) const {
    std::size_t i = start_ + k;
    int turns = 0;
    for (; i >= size(); i -= size()) ++turns;  // at most three, and faster than a division
    Point point = points_.points[i];
    point.azimuth_rad += 2.0 * kPi * turns;
    return point;
  }

 private:
  const Points& points_;
  std::size_t start_ = 0;
};

/// True if a beam passed beside an end without being blocked.
bool passed(const Point& beside, const Point& end, const SegmentationParams& params) {
  // An object at range_max may extend beyond it.
  if (beside.state == BeamState::kFree) return beside.range_m > end.range_m + params.occlusion_margin_m;
  return is_hit(beside.state) && beside.range_m >= end.range_m - params.occlusion_margin_m;
}

/// Kind of the end at reading position `k`, by the beams in direction `step` (-1: to the right, +1: to the left).
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
  return SegmentEnd::kOccluded;  // no valid beam beside it
}

/// Unknown azimuth beyond the hidden end at reading position `k`: occluded, or outside the scan; up to the maximum
/// extent of an object.
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

/// True if the hit is of a segment wider than a leg or a post.
bool is_on_wide_thing(const Segments& segments, std::size_t hit) {
  const auto& all = segments.segments;
  const auto after = std::upper_bound(all.begin(), all.end(), hit,
                                      [](std::size_t at, const Segment& segment) { return at < segment.first; });
  if (after == all.begin()) return false;
  const Segment& segment = *std::prev(after);
  if (hit >= segment.first + segment.count) return false;
  const Point* const first = &segments.points[segment.first];
  return (first[segment.count - 1].p_level_m - first->p_level_m).norm() > kNarrow_m;
}

/// What a scan tells of beams without a return.
enum class NoReturns {
  kFree,    ///< they passed freely
  kLost,    ///< surfaces lose returns: nothing
  kClosed,  ///< nearly all beams return: they were lost on sides at a grazing angle
};

/// Ends beside beams without a return that a surface may have lost. Where surfaces lose returns, the silhouette may lie
/// anywhere before the next return, if that is from behind; if it continues the surface or is nearer, it says nothing.
/// Few beams beside what is nearer were lost at its edge, and in a closed scan as many as meet its side: it occludes.
/// Legs beside each other have no such sides.
void distrust_free_ends(Segments& segments, NoReturns no_returns, const SegmentationParams& params) {
  const bool may_be_lost = no_returns == NoReturns::kLost;
  for (Segment& segment : segments.segments) {
    const Line line = fit_line(&segments.points[segment.first], segment.count);
    const auto distrust = [&](std::size_t end, int step, SegmentEnd& kind, double& hidden_rad) {
      if (kind != SegmentEnd::kFree) return;
      const Point& from = segments.points[end];
      const double reach_rad = std::min(2.0 * params.max_object_extent_m / from.range_m, kPi);
      if (may_be_lost) {
        kind = SegmentEnd::kNoReturn;
        hidden_rad = reach_rad;
      }
      const auto next = static_cast<std::ptrdiff_t>(end) + step;
      if (next < 0 || next >= static_cast<std::ptrdiff_t>(segments.points.size())) return;
      const Point& beside = segments.points[static_cast<std::size_t>(next)];
      const double gap_rad = std::abs(beside.azimuth_rad - from.azimuth_rad);
      const bool of_beside = may_be_lost ? gap_rad < (params.max_missing_beams + 1.5) * segments.resolution_rad
                                         : beside.range_m * gap_rad < kGrazed * params.max_object_extent_m &&
                                               (is_on_wide_thing(segments, end) ||
                                                is_on_wide_thing(segments, static_cast<std::size_t>(next)));
      if (of_beside && !passed(beside, from, params)) {
        kind = SegmentEnd::kOccluded;
        hidden_rad = reach_rad;
      }
      if (kind != SegmentEnd::kNoReturn) return;
      const bool behind = beside.range_m > from.range_m + params.occlusion_margin_m;
      const double beyond_m = (beside.p_level_m - from.p_level_m).norm();
      const bool continues = std::abs(offset_m(line, beside.p_level_m)) < kMaxStructureOffset_m + kMaxBend * beyond_m;
      if (behind && !continues) hidden_rad = std::min(hidden_rad, gap_rad);
    };
    distrust(segment.first, -1, segment.right_end, segment.right_hidden_rad);
    distrust(segment.first + segment.count - 1, +1, segment.left_end, segment.left_hidden_rad);
  }
}

/// The points of a scan from the end of a segment on, in direction `step`.
class Beyond {
 public:
  Beyond(const Segments& segments, std::size_t end, int step)
      : segments_(segments), end_(static_cast<std::ptrdiff_t>(end)), step_(step) {}

  /// The i-th one, the end itself the 0th.
  const Point& at(std::size_t i) const { return segments_.points[static_cast<std::size_t>(index(i))]; }

  /// The number of hits of the run that begins with the i-th, if they are too few for a segment, else 0.
  std::size_t few_hits_at(std::size_t i) const {
    const std::vector<RefusedRun>& runs = segments_.refused_runs;
    const auto after = std::upper_bound(
        runs.begin(), runs.end(), index(i),
        [](std::ptrdiff_t at, const RefusedRun& run) { return at < static_cast<std::ptrdiff_t>(run.first); });
    if (after == runs.begin()) return 0;
    const RefusedRun& run = *std::prev(after);
    const bool is_in = index(i) < static_cast<std::ptrdiff_t>(run.first + run.count);
    return is_in && run.why == RunRefusal::kTooFewPoints ? run.count : 0;
  }

 private:
  std::ptrdiff_t index(std::size_t i) const { return end_ + step_ * static_cast<std::ptrdiff_t>(i); }

  const Segments& segments_;
  std::ptrdiff_t end_;
  int step_;
};

/// Number of hits beyond an end that belong to its surface. On one at a grazing angle hits are farther apart than
/// max_gap_m: runs of few hits follow, each hit behind the one before, on one line with the end.
std::size_t grazing_hits(const Segments& segments, std::size_t end, int step, const SegmentationParams& params) {
  const Beyond beyond(segments, end, step);
  const Point& from = beyond.at(0);
  const double next_beam_rad = (params.max_missing_beams + 1.5) * segments.resolution_rad;
  const auto goes_on = [&](const Point& point, const Point& before) {
    return std::abs(point.azimuth_rad - before.azimuth_rad) < next_beam_rad && point.range_m > before.range_m &&
           (point.p_level_m - from.p_level_m).norm() < params.max_object_extent_m;
  };
  std::size_t count = 0;
  while (const std::size_t few = beyond.few_hits_at(count + 1)) {
    for (std::size_t i = 0; i < few; ++i, ++count) {
      if (!goes_on(beyond.at(count + 1), beyond.at(count))) return 0;
    }
  }
  if (count < 2) return 0;  // any two points are on one line
  const Eigen::Vector2d along = (beyond.at(count).p_level_m - from.p_level_m).normalized();
  const Line line{from.p_level_m, {along.y(), -along.x()}};
  for (std::size_t i = 1; i < count; ++i) {
    if (std::abs(offset_m(line, beyond.at(i).p_level_m)) > params.max_line_offset_m) return 0;
  }
  return count;
}

void join_grazing_hits(Segments& segments, const SegmentationParams& params) {
  for (Segment& segment : segments.segments) {
    if (segment.left_end == SegmentEnd::kBackground) {
      segment.count += grazing_hits(segments, segment.first + segment.count - 1, +1, params);
    }
    if (segment.right_end == SegmentEnd::kBackground) {
      const std::size_t joined = grazing_hits(segments, segment.first, -1, params);
      segment.first -= joined;
      segment.count += joined;
    }
  }
  const auto is_joined = [&](const RefusedRun& run) {
    const auto after =
        std::upper_bound(segments.segments.begin(), segments.segments.end(), run.first,
                         [](std::size_t first, const Segment& segment) { return first < segment.first; });
    if (after == segments.segments.begin()) return false;
    const Segment& segment = *std::prev(after);
    return run.first < segment.first + segment.count;
  };
  std::vector<RefusedRun>& runs = segments.refused_runs;
  runs.erase(std::remove_if(runs.begin(), runs.end(), is_joined), runs.end());
}

}  // namespace

void SegmentationParams::validate() const { check_bounds(*this, "segments"); }

Segments segment(const Points& points, const SegmentationParams& params, Segments memory) {
  Segments result = std::move(memory);
  result.points.clear();
  result.segments.clear();
  result.refused_runs.clear();
  result.straight_pieces.clear();
  result.refused.reset();
  result.stamp_ns = points.stamp_ns;
  result.T_world_level = points.T_world_level;
  result.height_world_m = points.height_world_m;
  result.resolution_rad = points.resolution_rad;
  result.time_increment_s = points.time_increment_s;
  result.free_space = free_space(points, std::move(result.free_space));
  result.points.reserve(points.points.size());
  result.segments.reserve(kUsualRoom);
  result.refused_runs.reserve(kUsualRoom);
  result.straight_pieces.reserve(kUsualRoom);
  if (points.points.empty()) return result;

  const auto beams = static_cast<double>(points.points.size());
  const auto min_points = std::max(static_cast<std::size_t>(params.min_points),
                                   static_cast<std::size_t>(std::ceil(params.min_points_fraction * beams)));

  const Reading reading(points, params);
  std::size_t first = 0;       // of the open segment, in result.points
  std::size_t first_read = 0;  // reading positions of its ends
  std::size_t last_read = 0;
  std::size_t inside = 0;  // its points in the volume of interest
  // Narrow things end on both sides: pieces of a surface that lost returns do not.
  const auto is_narrow = [&](std::size_t count) {
    return count >= static_cast<std::size_t>(params.min_narrow_points) &&
           (result.points.back().p_level_m - result.points[first].p_level_m).norm() <= kNarrow_m &&
           end_at(reading, first_read, -1, params) == SegmentEnd::kBackground &&
           end_at(reading, last_read, +1, params) == SegmentEnd::kBackground;
  };
  const auto close_segment = [&] {
    const std::size_t count = result.points.size() - first;
    const bool too_few = count < min_points && !is_narrow(count);
    if (too_few || 2 * inside < count) {
      if (count > 0) {
        const RunRefusal why = too_few ? RunRefusal::kTooFewPoints : RunRefusal::kOutside;
        result.refused_runs.push_back({first, count, why});
      }
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
      result.segments.push_back(segment);
    }
    first = result.points.size();
    inside = 0;
  };

  int missing = 0;
  int lost = 0;  // beams without a return inside segments
  int free_beams = 0;
  for (std::size_t k = 0; k < reading.size(); ++k) {
    const Point point = reading.at(k);
    if (!is_hit(point.state)) {
      ++missing;
      free_beams += point.state == BeamState::kFree ? 1 : 0;
      continue;
    }
    const bool open = result.points.size() > first;
    if (open && !same_object(result.points.back(), point, missing, params)) close_segment();
    if (result.points.size() == first) {
      first_read = k;
    } else {
      lost += missing;
    }
    last_read = k;
    missing = 0;
    if (point.state == BeamState::kHit) ++inside;
    result.points.push_back(point);
  }
  close_segment();
  const NoReturns no_returns = lost > kManyLost * static_cast<double>(result.points.size()) ? NoReturns::kLost
                               : free_beams <= kClosed * beams                              ? NoReturns::kClosed
                                                                                            : NoReturns::kFree;
  if (no_returns != NoReturns::kFree) distrust_free_ends(result, no_returns, params);
  join_grazing_hits(result, params);
  for (const RefusedRun& run : result.refused_runs) ++result.refused[text_of(run.why)];
  return classify_structure(std::move(result), params);
}

}  // namespace situation_awareness
