// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/segments/divide.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "situation_awareness/geometry/outline.hpp"

namespace situation_awareness {
namespace {

constexpr int kNobody = -1;
constexpr std::size_t kMinRun = 3;        // hits in a row of one owner: fewer are noise
constexpr double kMinSticksOut_m = 0.12;  // what sticks out of a known object by less is that object, seen badly

/// Neighbouring hits of one owner.
struct Run {
  std::size_t first = 0;
  std::size_t count = 0;
  int owner = kNobody;
};

/// The hits of a segment by owner, short runs given to the run before.
std::vector<Run> runs_of(const Segments& segments, const Segment& segment, const std::vector<int>& candidates,
                         const std::vector<Outline>& outlines, double max_offset_m) {
  std::vector<Run> runs;
  for (std::size_t i = segment.first; i < segment.first + segment.count; ++i) {
    int owner = kNobody;
    double nearest_m = max_offset_m;
    for (const int candidate : candidates) {
      const double offset =
          std::abs(offset_m(outlines[static_cast<std::size_t>(candidate)], segments.points[i].p_level_m));
      if (offset > nearest_m) continue;
      nearest_m = offset;
      owner = candidate;
    }
    if (runs.empty() || runs.back().owner != owner) runs.push_back({i, 0, owner});
    ++runs.back().count;
  }
  std::vector<Run> smooth;
  for (const Run& run : runs) {
    if (!smooth.empty() && (run.count < kMinRun || run.owner == smooth.back().owner)) {
      smooth.back().count += run.count;
    } else if (!smooth.empty() && smooth.back().count < kMinRun) {  // only the first can be short
      smooth.back() = {smooth.back().first, smooth.back().count + run.count, run.owner};
    } else {
      smooth.push_back(run);
    }
  }
  return smooth;
}

/// True if the runs are worth being segments of their own.
bool hold_several(const Segments& segments, const std::vector<Run>& runs, const std::vector<Outline>& outlines,
                  const SegmentationParams& params) {
  if (runs.size() < 2) return false;
  const auto min_points = static_cast<std::size_t>(params.min_points);
  int known = kNobody;
  for (const Run& run : runs) {
    if (run.owner == kNobody || run.count < min_points) continue;
    if (known != kNobody && known != run.owner) return true;
    known = run.owner;
  }
  if (known == kNobody) return false;
  const Outline& outline = outlines[static_cast<std::size_t>(known)];
  return std::any_of(runs.begin(), runs.end(), [&](const Run& run) {
    if (run.owner != kNobody || run.count < min_points) return false;
    const Point* points = &segments.points[run.first];
    return std::any_of(points, points + run.count, [&](const Point& point) {
      return std::abs(offset_m(outline, point.p_level_m)) > kMinSticksOut_m;
    });
  });
}

/// What is beside a piece where the segment was cut, and how far that may hide it.
SegmentEnd end_at_cut(const Point& end, const Point& beside, double margin_m) {
  return beside.range_m > end.range_m + margin_m ? SegmentEnd::kBackground : SegmentEnd::kOccluded;
}

}  // namespace

Segments divide(Segments segments, const std::vector<Ellipse>& known_level, const SegmentationParams& params) {
  if (known_level.empty()) return segments;
  const std::vector<Outline> outlines = outlines_of(known_level);
  const std::vector<std::vector<int>> candidates = ellipses_by_segment(segments, known_level);
  const std::vector<Segment> wholes = std::exchange(segments.segments, {});
  for (std::size_t s = 0; s < wholes.size(); ++s) {
    const Segment& whole = wholes[s];
    std::vector<Run> runs;
    if (!candidates[s].empty()) {
      runs = runs_of(segments, whole, candidates[s], outlines, params.max_division_offset_m);
    }
    if (!hold_several(segments, runs, outlines, params)) {
      segments.segments.push_back(whole);
      continue;
    }
    for (std::size_t r = 0; r < runs.size(); ++r) {
      const Run& run = runs[r];
      if (run.count < static_cast<std::size_t>(params.min_points)) continue;
      Segment piece = whole;
      piece.first = run.first;
      piece.count = run.count;
      const auto width_rad = [&](const Run& other) {
        return segments.points[other.first + other.count - 1].azimuth_rad - segments.points[other.first].azimuth_rad;
      };
      if (r > 0) {
        piece.right_end =
            end_at_cut(segments.points[run.first], segments.points[run.first - 1], params.occlusion_margin_m);
        piece.right_hidden_rad = is_silhouette(piece.right_end) ? 0.0 : width_rad(runs[r - 1]);
      }
      if (r + 1 < runs.size()) {
        const std::size_t last = run.first + run.count - 1;
        piece.left_end = end_at_cut(segments.points[last], segments.points[last + 1], params.occlusion_margin_m);
        piece.left_hidden_rad = is_silhouette(piece.left_end) ? 0.0 : width_rad(runs[r + 1]);
      }
      if (run.owner != kNobody) {
        piece.kind = is_flat(segments, piece, params) ? SegmentKind::kStructure : SegmentKind::kObject;
      }
      segments.segments.push_back(piece);
    }
  }
  return segments;
}

}  // namespace situation_awareness
