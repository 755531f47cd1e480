// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/path/dubins.hpp"
#include "situation_awareness/path/dubins_following.hpp"

namespace situation_awareness {

/// A path of any number of arcs and straights, in one frame: a segment begins where the one before ends, with the same
/// heading. None is without length.
struct SegmentPath {
  std::vector<DubinsSegment> segments;
  double length_m = 0.0;
};

/// Without its memory being given back.
void clear(SegmentPath& path);

/// Adds what has a length, more than 1 nm.
void append(SegmentPath& path, const DubinsSegment& segment);
void append(SegmentPath& path, const DubinsPath& dubins);

/// Adds the part of a path between two ways; of a closed one, `to_m` may be beyond its length, at most once.
void append_part(SegmentPath& path, const SegmentPath& from, double from_m, double to_m);

/// Leaves off what is beyond a way.
void cut(SegmentPath& path, double to_m);

/// As for a DubinsPath. The path has a segment.
DubinsPlace place_at(const SegmentPath& path, double way_m);
double nearest_m(const SegmentPath& path, const Eigen::Vector2d& p_m, double from_m, double to_m);
DubinsFollowingResult follow(const SegmentPath& path, const DubinsFollowingParams& params, const Pose2& T_world_base,
                             double speed_m_s, double way_m);

/// Whether a closed path goes around a point, which is not on it: once counter-clockwise (+1), clockwise (-1), or not
/// (0).
int turns_around(const SegmentPath& closed, const Eigen::Vector2d& p_m);

/// The greatest curvature of a path, not negative.
double greatest_curvature_1_m(const SegmentPath& path);

}  // namespace situation_awareness
