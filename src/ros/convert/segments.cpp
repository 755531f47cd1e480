// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/segments.hpp"

#include <cmath>
#include <stdexcept>

#include "situation_awareness/ros/convert/free_space.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

// The message has the same constants.
static_assert(static_cast<int>(SegmentKind::kObject) == LaserSegment::OBJECT);
static_assert(static_cast<int>(SegmentKind::kStructure) == LaserSegment::STRUCTURE);
static_assert(static_cast<int>(SegmentEnd::kFree) == LaserSegment::FREE);
static_assert(static_cast<int>(SegmentEnd::kNoReturn) == LaserSegment::NO_RETURN);
static_assert(static_cast<int>(SegmentEnd::kBackground) == LaserSegment::BACKGROUND);
static_assert(static_cast<int>(SegmentEnd::kOccluded) == LaserSegment::OCCLUDED);
static_assert(static_cast<int>(SegmentEnd::kScanEdge) == LaserSegment::SCAN_EDGE);
static_assert(static_cast<int>(SegmentEnd::kContinues) == LaserSegment::CONTINUES);
static_assert(static_cast<int>(StructureReason::kNone) == LaserSegment::NONE);
static_assert(static_cast<int>(StructureReason::kExtent) == LaserSegment::EXTENT);
static_assert(static_cast<int>(StructureReason::kInnerCorner) == LaserSegment::INNER_CORNER);
static_assert(static_cast<int>(StructureReason::kStraightHidden) == LaserSegment::STRAIGHT_HIDDEN);
static_assert(static_cast<int>(StructureReason::kFlat) == LaserSegment::FLAT);
static_assert(static_cast<int>(StructureReason::kInLine) == LaserSegment::IN_LINE);
static_assert(static_cast<int>(RunRefusal::kTooFewPoints) == LaserRefusedRun::TOO_FEW_POINTS);
static_assert(static_cast<int>(RunRefusal::kOutside) == LaserRefusedRun::OUTSIDE);

void check(bool truth, const char* sentence) {
  if (!truth) throw std::invalid_argument(sentence);
}

StraightPiece straight_piece_from_msg(const LaserStraightPiece& msg, const SegmentArray& array) {
  check(msg.segment < array.segments.size(), "the segment index of a straight piece is out of range");
  const LaserSegment& segment = array.segments[msg.segment];
  check(segment.kind == LaserSegment::STRUCTURE, "a straight piece is not of a structure");
  check(msg.count > 0 && msg.first >= segment.first &&
            std::size_t{msg.first} + msg.count <= std::size_t{segment.first} + segment.count,
        "a straight piece has points that are not of its segment");
  check(msg.right_end <= LaserSegment::NO_RETURN && msg.left_end <= LaserSegment::NO_RETURN,
        "an end of a straight piece is of an unknown kind");
  StraightPiece piece;
  piece.segment = msg.segment;
  piece.first = msg.first;
  piece.count = msg.count;
  piece.line_level = {{msg.x, msg.y}, {msg.normal_x, msg.normal_y}};
  piece.covariance << msg.covariance[0], msg.covariance[1], msg.covariance[2], msg.covariance[3];
  piece.rms_m = msg.rms;
  piece.right_level_m = {msg.right_x, msg.right_y};
  piece.left_level_m = {msg.left_x, msg.left_y};
  piece.right_end = static_cast<SegmentEnd>(msg.right_end);
  piece.left_end = static_cast<SegmentEnd>(msg.left_end);
  check(piece.line_level.through_m.allFinite() && std::abs(piece.line_level.normal.norm() - 1.0) < 1e-6 &&
            piece.covariance.allFinite() && std::isfinite(piece.rms_m) && piece.right_level_m.allFinite() &&
            piece.left_level_m.allFinite(),
        "the line of a straight piece is invalid");
  return piece;
}

LaserStraightPiece straight_piece_to_msg(const StraightPiece& piece) {
  LaserStraightPiece msg;
  msg.segment = static_cast<std::uint32_t>(piece.segment);
  msg.first = static_cast<std::uint32_t>(piece.first);
  msg.count = static_cast<std::uint32_t>(piece.count);
  msg.x = piece.line_level.through_m.x();
  msg.y = piece.line_level.through_m.y();
  msg.normal_x = piece.line_level.normal.x();
  msg.normal_y = piece.line_level.normal.y();
  msg.covariance = {piece.covariance(0, 0), piece.covariance(0, 1), piece.covariance(1, 0), piece.covariance(1, 1)};
  msg.rms = piece.rms_m;
  msg.right_x = piece.right_level_m.x();
  msg.right_y = piece.right_level_m.y();
  msg.left_x = piece.left_level_m.x();
  msg.left_y = piece.left_level_m.y();
  msg.right_end = static_cast<std::uint8_t>(piece.right_end);
  msg.left_end = static_cast<std::uint8_t>(piece.left_end);
  return msg;
}

}  // namespace

SegmentArray segments_to_msg(const Segments& segments, const std::string& world_frame) {
  SegmentArray msg;
  msg.header.stamp = to_ros_time(segments.stamp_ns);
  msg.header.frame_id = world_frame;
  msg.level = level_to_msg(segments.T_world_level, segments.height_world_m);
  msg.resolution = segments.resolution_rad;
  msg.time_increment = segments.time_increment_s;
  msg.range_sigma = segments.range_sigma_m;
  free_space_to_msg(segments.free_space, msg);
  msg.points.resize(segments.points.size());
  for (std::size_t i = 0; i < segments.points.size(); ++i) {
    const Point& point = segments.points[i];
    msg.points[i].azimuth = point.azimuth_rad;
    msg.points[i].range = point.range_m;
    msg.points[i].x = point.p_level_m.x();
    msg.points[i].y = point.p_level_m.y();
    msg.points[i].beam = point.beam;
  }
  msg.segments.resize(segments.segments.size());
  for (std::size_t i = 0; i < segments.segments.size(); ++i) {
    const Segment& segment = segments.segments[i];
    msg.segments[i].first = static_cast<std::uint32_t>(segment.first);
    msg.segments[i].count = static_cast<std::uint32_t>(segment.count);
    msg.segments[i].kind = static_cast<std::uint8_t>(segment.kind);
    msg.segments[i].structure = static_cast<std::uint8_t>(segment.structure);
    msg.segments[i].right_end = static_cast<std::uint8_t>(segment.right_end);
    msg.segments[i].left_end = static_cast<std::uint8_t>(segment.left_end);
    msg.segments[i].right_hidden = segment.right_hidden_rad;
    msg.segments[i].left_hidden = segment.left_hidden_rad;
  }
  msg.refused_runs.resize(segments.refused_runs.size());
  for (std::size_t i = 0; i < segments.refused_runs.size(); ++i) {
    msg.refused_runs[i].first = static_cast<std::uint32_t>(segments.refused_runs[i].first);
    msg.refused_runs[i].count = static_cast<std::uint32_t>(segments.refused_runs[i].count);
    msg.refused_runs[i].why = static_cast<std::uint8_t>(segments.refused_runs[i].why);
  }
  msg.straight_pieces.reserve(segments.straight_pieces.size());
  for (const StraightPiece& piece : segments.straight_pieces) {
    msg.straight_pieces.push_back(straight_piece_to_msg(piece));
  }
  return msg;
}

Segments segments_from_msg(const SegmentArray& msg) {
  Segments segments;
  segments.stamp_ns = to_nanoseconds(msg.header.stamp);
  level_from_msg(msg.level, segments.T_world_level, segments.height_world_m);
  segments.resolution_rad = msg.resolution;
  check(std::isfinite(msg.resolution) && msg.resolution > 0.0, "resolution is not a positive number");
  segments.time_increment_s = msg.time_increment;
  check(std::isfinite(msg.time_increment) && msg.time_increment >= 0.0, "time increment is not a number >= 0");
  segments.range_sigma_m = msg.range_sigma;
  check(std::isfinite(msg.range_sigma) && msg.range_sigma >= 0.0, "range noise is not a number >= 0");
  segments.free_space = free_space_from_msg(msg);
  segments.points.resize(msg.points.size());
  for (std::size_t i = 0; i < msg.points.size(); ++i) {
    const SegmentPoint& point = msg.points[i];
    check(std::isfinite(point.azimuth + point.range + point.x + point.y), "a point is not finite");
    segments.points[i] = {point.azimuth, point.range, {point.x, point.y}, point.beam, BeamState::kHit};
  }
  segments.segments.resize(msg.segments.size());
  for (std::size_t i = 0; i < msg.segments.size(); ++i) {
    const LaserSegment& segment = msg.segments[i];
    check(segment.count > 0, "a segment has no points");
    check(std::size_t{segment.first} + segment.count <= msg.points.size(),
          "the point indices of a segment are out of range");
    check(segment.kind <= LaserSegment::STRUCTURE, "a segment is of an unknown kind");
    check(segment.structure <= LaserSegment::IN_LINE &&
              (segment.structure == LaserSegment::NONE) == (segment.kind == LaserSegment::OBJECT),
          "the reason why a segment is structure does not fit its kind");
    check(segment.right_end <= LaserSegment::NO_RETURN && segment.left_end <= LaserSegment::NO_RETURN &&
              segment.right_end != LaserSegment::CONTINUES && segment.left_end != LaserSegment::CONTINUES,
          "an end of a segment is of an unknown kind");
    check(std::isfinite(segment.right_hidden + segment.left_hidden) && segment.right_hidden >= 0.0 &&
              segment.left_hidden >= 0.0,
          "a hidden azimuth of a segment is not a number >= 0");
    segments.segments[i] = {segment.first,
                            segment.count,
                            static_cast<SegmentKind>(segment.kind),
                            static_cast<SegmentEnd>(segment.right_end),
                            static_cast<SegmentEnd>(segment.left_end),
                            segment.right_hidden,
                            segment.left_hidden,
                            static_cast<StructureReason>(segment.structure)};
  }
  segments.refused_runs.reserve(msg.refused_runs.size());
  for (const LaserRefusedRun& run : msg.refused_runs) {
    check(run.count > 0, "a refused run has no points");
    check(std::size_t{run.first} + run.count <= msg.points.size(),
          "the point indices of a refused run are out of range");
    check(run.why <= LaserRefusedRun::OUTSIDE, "a refused run has an unknown reason");
    segments.refused_runs.push_back({run.first, run.count, static_cast<RunRefusal>(run.why)});
  }
  segments.straight_pieces.reserve(msg.straight_pieces.size());
  for (const auto& piece : msg.straight_pieces) {
    segments.straight_pieces.push_back(straight_piece_from_msg(piece, msg));
  }
  return segments;
}

}  // namespace situation_awareness
