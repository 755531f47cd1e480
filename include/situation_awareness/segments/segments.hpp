// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/geometry/line.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// What is beside a segment at one of its ends, and so whether the end is the object's own.
enum class SegmentEnd : std::uint8_t {
  kFree,        ///< nothing within range beside it: the object's own edge
  kBackground,  ///< something farther beside it: the object's own edge
  kOccluded,    ///< something nearer beside it: the object may go on behind
  kScanEdge,    ///< the scan ends: the object may go on
  kContinues,   ///< of a straight piece only: the same thing goes on, in another direction
};

/// True where the end of the segment is the silhouette of the object.
inline bool is_silhouette(SegmentEnd end) { return end == SegmentEnd::kFree || end == SegmentEnd::kBackground; }

enum class SegmentKind : std::uint8_t {
  kObject,     ///< may be one object of the size the map is for
  kStructure,  ///< a wall, a corner or another thing larger than an object, or a visible piece of one
};

/// Why a segment is structure.
enum class StructureReason : std::uint8_t {
  kNone,            ///< it is none
  kExtent,          ///< it is larger than an object
  kInnerCorner,     ///< it lies behind the chord of its ends
  kStraightHidden,  ///< it is straight and an end is hidden: any wall
  kFlat,            ///< it is long and flat
  kInLine,          ///< an end is hidden and it lies on the line of a structure beside it
};

/// Of runs of hits with fewer than SegmentationParams::min_points, or what a segment is divided into.
constexpr const char* kTooFewPoints = "segment refused: too few points";

/// A run of neighbouring hits on one thing.
struct Segment {
  std::size_t first = 0;  ///< index of its first (lowest azimuth) point in Segments::points
  std::size_t count = 0;
  SegmentKind kind = SegmentKind::kObject;
  SegmentEnd right_end = SegmentEnd::kFree;  ///< at its lowest azimuth
  SegmentEnd left_end = SegmentEnd::kFree;   ///< at its highest azimuth
  /// Azimuth beyond that end which something nearer blocks, or the scan does not reach; 0 at a silhouette.
  double right_hidden_rad = 0.0;
  double left_hidden_rad = 0.0;
  StructureReason structure = StructureReason::kNone;  ///< kNone if and only if the kind is kObject
};

/// A straight part of a structure, seen from the sensor: from its right end to its left.
struct StraightPiece {
  std::size_t segment = 0;  ///< index in Segments::segments
  std::size_t first = 0;    ///< index of its first (lowest azimuth) point in Segments::points
  std::size_t count = 0;
  Line line_level;  ///< through the weighted mean of its hits, the normal away from the sensor
  /// Of the error of (offset along the normal at `through_m` in m, turn counter-clockwise in rad), from the noise of
  /// the ranges alone; a rigid motion of everything leaves it as it is.
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  double rms_m = 0.0;                                       ///< distance of its hits from the line, root mean square
  Eigen::Vector2d right_level_m = Eigen::Vector2d::Zero();  ///< its first hit, moved onto the line
  Eigen::Vector2d left_level_m = Eigen::Vector2d::Zero();   ///< its last hit, moved onto the line
  SegmentEnd right_end = SegmentEnd::kFree;
  SegmentEnd left_end = SegmentEnd::kFree;
};

/// The segments of one scan, by growing azimuth. Every point is a hit; the points of a segment are contiguous and their
/// azimuths grow, also across the seam of a full circle.
struct Segments {
  std::int64_t stamp_ns = 0;
  Pose2 T_world_level;
  double height_world_m = 0.0;
  double resolution_rad = 0.0;    ///< mean azimuth between neighbouring beams
  double time_increment_s = 0.0;  ///< from beam to beam, 0: all at one instant
  std::vector<Point> points;
  std::vector<Segment> segments;
  std::vector<StraightPiece> straight_pieces;  ///< of the structures, by growing azimuth
  FreeSpace free_space;                        ///< of the whole scan
  Counters refused;                            ///< why runs of hits are no segment, and why segments are structure
};

/// Which ellipses a segment's azimuths overlap.
struct Overlap {
  std::size_t segment = 0;
  std::size_t ellipse = 0;
};

/// All overlaps, by growing segment and then ellipse; ellipses around the sensor overlap none. Costs grow with what
/// overlaps, not with all pairs. `memory`: as for limit_range.
std::vector<Overlap> overlaps_of(const Segments& segments, const std::vector<Ellipse>& ellipses_level,
                                 std::vector<Overlap> memory = {});

}  // namespace situation_awareness
