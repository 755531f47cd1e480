// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/geometry/expected_outline.hpp"
#include "situation_awareness/geometry/line.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// Kind of a segment's end, by the next beam beside it: whether it is the object's own edge.
enum class SegmentEnd : std::uint8_t {
  kFree,        ///< no return beside it: the object's own edge
  kBackground,  ///< a hit farther away beside it: the object's own edge
  kOccluded,    ///< a nearer hit beside it: the object may extend behind it
  kScanEdge,    ///< the end of the scan: the object may extend beyond it
  kContinues,   ///< of a straight piece only: the segment continues in another direction
  kNoReturn,    ///< as kFree, of a scan in which surfaces lose returns, too: the object may extend beyond it
};

/// True where the end of the segment is the silhouette of the object.
inline bool is_silhouette(SegmentEnd end) {
  return end == SegmentEnd::kFree || end == SegmentEnd::kBackground || end == SegmentEnd::kNoReturn;
}

/// True where the object surely ends: at the other silhouettes it may extend over beams without a return.
inline bool is_sure_silhouette(SegmentEnd end) { return is_silhouette(end) && end != SegmentEnd::kNoReturn; }

enum class SegmentKind : std::uint8_t {
  kObject,     ///< may be one object, of a size within the parameters
  kStructure,  ///< a wall, a corner or another surface larger than an object, or a visible part of one
};

/// Reason why a segment is structure.
enum class StructureReason : std::uint8_t {
  kNone,            ///< no structure
  kExtent,          ///< larger than an object
  kInnerCorner,     ///< behind the chord of its ends
  kStraightHidden,  ///< straight, with a hidden end: possibly a wall
  kFlat,            ///< long and flat
  kInLine,          ///< with a hidden end, on the line of a structure beside it
};

/// Reason why a run of hits is no segment.
enum class RunRefusal : std::uint8_t {
  kTooFewPoints,  ///< a run, or a piece of a divided segment, with fewer than SegmentationParams::min_points
  kOutside,       ///< most of it is beyond the range or outside the volume of interest
};

/// The text counted in Segments::refused; empty for kNone.
const char* text_of(StructureReason reason);
const char* text_of(RunRefusal refusal);

/// A run of neighbouring hits on one object.
struct Segment {
  std::size_t first = 0;  ///< index of its first (lowest azimuth) point in Segments::points
  std::size_t count = 0;
  SegmentKind kind = SegmentKind::kObject;
  SegmentEnd right_end = SegmentEnd::kFree;  ///< at its lowest azimuth
  SegmentEnd left_end = SegmentEnd::kFree;   ///< at its highest azimuth
  /// Azimuth beyond that end in which the object may extend: occluded, outside the scan, or (kNoReturn) without
  /// returns; 0 at the other ends.
  double right_hidden_rad = 0.0;
  double left_hidden_rad = 0.0;
  StructureReason structure = StructureReason::kNone;  ///< kNone if and only if the kind is kObject
};

/// A straight part of a structure, from its right end to its left as seen from the sensor.
struct StraightPiece {
  std::size_t segment = 0;  ///< index in Segments::segments
  std::size_t first = 0;    ///< index of its first (lowest azimuth) point in Segments::points
  std::size_t count = 0;
  Line line_level;  ///< through the weighted mean of its hits, the normal away from the sensor
  /// Of the error of (offset along the normal at `through_m` in m, rotation counter-clockwise in rad), from the range
  /// noise only; invariant under rigid motion.
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  double rms_m = 0.0;                                       ///< distance of its hits from the line, root mean square
  Eigen::Vector2d right_level_m = Eigen::Vector2d::Zero();  ///< its first hit, projected onto the line
  Eigen::Vector2d left_level_m = Eigen::Vector2d::Zero();   ///< its last hit, projected onto the line
  SegmentEnd right_end = SegmentEnd::kFree;
  SegmentEnd left_end = SegmentEnd::kFree;
};

/// A line through hits, with its covariance from the range noise.
struct LineEstimate {
  Line line_level;  ///< through the weighted mean of the hits, the normal away from the sensor
  /// Of the error of (offset along the normal at `through_m` in m, rotation counter-clockwise in rad); invariant under
  /// rigid motion.
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
};

/// The maximum likelihood line through points measured from the origin, their ranges with independent normal errors of
/// standard deviation `range_sigma_m` (docs/math/segments.md, "Straight pieces"). At least two distinct points.
/// Covariances do not include deviations of the surface from a line; rms_m shows them.
LineEstimate estimate_line(const Point* points, std::size_t count, double range_sigma_m);

/// A run of neighbouring hits that is no segment.
struct RefusedRun {
  std::size_t first = 0;  ///< index of its first (lowest azimuth) point in Segments::points
  std::size_t count = 0;
  RunRefusal why = RunRefusal::kTooFewPoints;
};

/// The segments of one scan, by increasing azimuth. Every point is a hit, in exactly one segment or refused run. The
/// points of each are contiguous and their azimuths increase, also across the seam of a full circle.
struct Segments {
  std::int64_t stamp_ns = 0;
  Pose2 T_world_level;
  double height_world_m = 0.0;
  double resolution_rad = 0.0;    ///< mean azimuth between neighbouring beams
  double time_increment_s = 0.0;  ///< from beam to beam, 0: all at the stamp
  double range_sigma_m = 0.0;     ///< range noise, as this scan shows it (RangeNoise); 0: unknown
  std::vector<Point> points;
  std::vector<Segment> segments;
  std::vector<RefusedRun> refused_runs;
  std::vector<StraightPiece> straight_pieces;  ///< of the structures, by increasing azimuth
  FreeSpace free_space;                        ///< of the whole scan
  Counters refused;                            ///< runs of hits that became no segment, and structures, by reason
};

/// Mean of the hits of a segment that has any, in the level frame.
Eigen::Vector2d middle_level_m(const Segments& segments, const Segment& segment);

/// Mean of the times of its beams, after the stamp.
double middle_s(const Segments& segments, const Segment& segment);

/// Overlap of a segment's azimuths with an ellipse.
struct Overlap {
  std::size_t segment = 0;
  std::size_t ellipse = 0;
};

/// All overlaps, sorted by segment and then ellipse; ellipses around the sensor overlap none. The cost is that of the
/// overlaps, not of all pairs. `memory`: as for limit_range.
std::vector<Overlap> overlaps_of(const Segments& segments, const std::vector<ExpectedOutline>& ellipses_level,
                                 std::vector<Overlap> memory = {});

}  // namespace situation_awareness
