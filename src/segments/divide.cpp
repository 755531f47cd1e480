// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/segments/divide.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/geometry/outline.hpp"
#include "situation_awareness/segments/structure.hpp"

namespace situation_awareness {
namespace {

constexpr std::size_t kNobody = static_cast<std::size_t>(-1);
constexpr std::size_t kMinRun = 3;          // consecutive hits with one assignment: fewer are noise
constexpr double kMaxPBoxToDivide = 0.1;    // only what is surely an ellipse divides a segment
constexpr double kMaxClaimOffset_m = 0.06;  // mean distance of the hits of a known box from its outline
constexpr double kMinSticksOut_m = 0.12;    // hits that stick out of a known object by less belong to it

/// Neighbouring hits with one assignment, an index into the expected outlines.
struct OwnedRun {
  std::size_t first = 0;
  std::size_t count = 0;
  std::size_t owner = kNobody;
};

/// Memory reused from scan to scan, with room from the start.
struct DivideWorkspace {
  std::vector<Overlap> overlaps;
  std::vector<Segment> wholes;
  std::vector<Outline> expected;  ///< in a segment
  std::vector<OwnedRun> raw;
  std::vector<OwnedRun> runs;

  DivideWorkspace() {
    wholes.reserve(kUsualRoom);
    expected.reserve(kUsualRoom);
    raw.reserve(kUsualRoom);
    runs.reserve(kUsualRoom);
  }
};

/// Runs of a segment's hits by assignment, short ones merged into the run before: into `work.runs`.
void find_runs(const Segments& segments, const Segment& segment, double max_offset_m, DivideWorkspace& work) {
  work.raw.clear();
  for (std::size_t i = segment.first; i < segment.first + segment.count; ++i) {
    std::size_t owner = kNobody;
    double nearest_m = max_offset_m;
    for (std::size_t k = 0; k < work.expected.size(); ++k) {
      const double offset = std::abs(offset_m(work.expected[k], segments.points[i].p_level_m));
      if (offset > nearest_m) continue;
      nearest_m = offset;
      owner = k;
    }
    if (work.raw.empty() || work.raw.back().owner != owner) work.raw.push_back({i, 0, owner});
    ++work.raw.back().count;
  }
  std::vector<OwnedRun>& smooth = work.runs;
  for (const OwnedRun& run : work.raw) {
    if (!smooth.empty() && (run.count < kMinRun || run.owner == smooth.back().owner)) {
      smooth.back().count += run.count;
    } else if (!smooth.empty() && smooth.back().count < kMinRun) {  // only the first can be short
      smooth.back() = {smooth.back().first, smooth.back().count + run.count, run.owner};
    } else {
      smooth.push_back(run);
    }
  }
}

/// Merge neighbouring runs where the segment is convex from the middle of one to that of the other: between two objects
/// there is a corner or a step. One object that was mapped as two by mistake would otherwise be cut in two for ever.
void join_convex(const Segments& segments, std::vector<OwnedRun>& runs) {
  std::size_t kept = 0;
  for (std::size_t r = 1; r < runs.size(); ++r) {
    OwnedRun& last = runs[kept];
    const OwnedRun& next = runs[r];
    const std::size_t from = last.first + last.count / 2;
    const std::size_t to = next.first + next.count / 2;
    if (concavity_m(&segments.points[from], to - from + 1) >= 0.0) {
      runs[++kept] = next;
      continue;
    }
    if (next.count > last.count) last.owner = next.owner;
    last.count += next.count;
  }
  if (!runs.empty()) runs.resize(kept + 1);
}

/// True if the runs are to become separate segments.
bool holds_several(const Segments& segments, const DivideWorkspace& work, const SegmentationParams& params) {
  if (work.runs.size() < 2) return false;
  const auto min_points = static_cast<std::size_t>(params.min_points);
  std::size_t known = kNobody;
  for (const OwnedRun& run : work.runs) {
    if (run.owner == kNobody || run.count < min_points) continue;
    if (known != kNobody && known != run.owner) return true;
    known = run.owner;
  }
  if (known == kNobody) return false;
  const Outline& outline = work.expected[known];
  return std::any_of(work.runs.begin(), work.runs.end(), [&](const OwnedRun& run) {
    if (run.owner != kNobody || run.count < min_points) return false;
    const Point* points = &segments.points[run.first];
    return std::any_of(points, points + run.count, [&](const Point& point) {
      return std::abs(offset_m(outline, point.p_level_m)) > kMinSticksOut_m;
    });
  });
}

/// Kind of a piece's end at a cut, and its hidden azimuth.
SegmentEnd end_at_cut(const Point& end, const Point& beside, double margin_m) {
  return beside.range_m > end.range_m + margin_m ? SegmentEnd::kBackground : SegmentEnd::kOccluded;
}

/// A piece that was taken for structure, but lies on a known box, is part of that box.
void claim_known(Segments& segments, Segment& segment, const ExpectedOutline& known) {
  if (segment.kind != SegmentKind::kStructure || segment.structure == StructureReason::kExtent) return;
  if (known.p_box < 0.5) return;
  double sum_m = 0.0;
  for (std::size_t i = segment.first; i < segment.first + segment.count; ++i) {
    sum_m += std::abs(offset_m(known.box, segments.points[i].p_level_m));
  }
  if (sum_m > kMaxClaimOffset_m * static_cast<double>(segment.count)) return;
  segment.kind = SegmentKind::kObject;
  segment.structure = StructureReason::kNone;
}

}  // namespace

Segments divide(Segments segments, const std::vector<ExpectedOutline>& known_level, const SegmentationParams& params) {
  if (known_level.empty()) return segments;
  thread_local DivideWorkspace work;
  work.overlaps = overlaps_of(segments, known_level, std::move(work.overlaps));
  for (const Overlap& overlap : work.overlaps) {
    claim_known(segments, segments.segments[overlap.segment], known_level[overlap.ellipse]);
  }
  work.wholes = segments.segments;  // a swap would hand a short memory to the next caller on this thread
  segments.segments.clear();
  auto overlap = work.overlaps.cbegin();
  for (std::size_t s = 0; s < work.wholes.size(); ++s) {
    const Segment& whole = work.wholes[s];
    work.expected.clear();
    for (; overlap != work.overlaps.cend() && overlap->segment == s; ++overlap) {
      const ExpectedOutline& known = known_level[overlap->ellipse];
      if (known.p_box < kMaxPBoxToDivide) work.expected.push_back(outline_of(known.ellipse));
    }
    work.runs.clear();
    if (!work.expected.empty()) find_runs(segments, whole, params.max_division_offset_m, work);
    join_convex(segments, work.runs);
    if (!holds_several(segments, work, params)) {
      segments.segments.push_back(whole);
      continue;
    }
    const std::vector<OwnedRun>& runs = work.runs;
    for (std::size_t r = 0; r < runs.size(); ++r) {
      const OwnedRun& run = runs[r];
      if (run.count < static_cast<std::size_t>(params.min_points)) {
        segments.refused_runs.push_back({run.first, run.count, RunRefusal::kTooFewPoints});
        ++segments.refused[text_of(RunRefusal::kTooFewPoints)];
        continue;
      }
      Segment piece = whole;
      piece.first = run.first;
      piece.count = run.count;
      const auto width_rad = [&](const OwnedRun& other) {
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
        const bool flat = is_flat(segments, piece, params);
        piece.kind = flat ? SegmentKind::kStructure : SegmentKind::kObject;
        piece.structure = flat ? StructureReason::kFlat : StructureReason::kNone;
      }
      segments.segments.push_back(piece);
    }
  }
  return segments;
}

}  // namespace situation_awareness
