// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/arc.hpp"
#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness {

// Dubins paths (docs/math/dubins.md; splinegon paper, Sect. II-A; L. E. Dubins, Amer. J. Math. 79, 1957): the shortest
// way of a vehicle that turns on circles, from one pose to another. All in one frame, lengths in m, angles in rad.

/// One end of a path.
struct DubinsEnd {
  Eigen::Vector2d p_m = Eigen::Vector2d::Zero();
  std::optional<double> yaw_rad;  ///< none: free, the best is chosen
  double radius_m = 1.0;          ///< of the circle on which the vehicle turns at this end
};

/// The turns of a path: left (L), right (R), straight (S).
enum class DubinsWord : std::uint8_t { kLsl, kRsr, kLsr, kRsl, kLrl, kRlr };

constexpr std::array<DubinsWord, 6> kDubinsWords = {DubinsWord::kLsl, DubinsWord::kRsr, DubinsWord::kLsr,
                                                    DubinsWord::kRsl, DubinsWord::kLrl, DubinsWord::kRlr};

/// "LSL", ...
const char* name_of(DubinsWord word);

/// A straight segment of a path.
struct Straight {
  Eigen::Vector2d from_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d to_m = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;  ///< also where its length is zero
};

using DubinsSegment = std::variant<Arc, Straight>;

double length_m(const DubinsSegment& segment);

/// A path has one segment for each letter of its word, also where its length is zero. A segment begins where the one
/// before ends, with the same heading.
struct DubinsPath {
  DubinsWord word = DubinsWord::kLsl;
  std::array<DubinsSegment, 3> segments;
  double length_m = 0.0;
};

/// Whether a vehicle of a maximal curvature may turn on a circle: radius >= 1 / curvature, to 1e-12 of the radius.
/// Without limit the curvature is infinite.
inline bool may_turn(double radius_m, double max_curvature_1_m) {
  return radius_m >= (1.0 - 1e-12) / max_curvature_1_m;
}

/// The path of one word between two poses; none, if the circles do not allow it: LSL and RSR need circles of which none
/// lies within the other, LSR and RSL such that do not overlap, LRL and RLR equal radii and centres at most four of
/// them apart. The turn between two others is of more than pi, as in every shortest path. Throws as
/// shortest_dubins_path does, and without both yaws.
///
/// Errors of rounding add no turn: a straight that begins or ends, to 1e-13 of the size of the problem, where the pose
/// has its direction is taken as one that does so, and the path ends as near to the end's pose.
std::optional<DubinsPath> dubins_path(DubinsWord word, const DubinsEnd& from, const DubinsEnd& to);

/// The shortest path: of all words, and of all headings where one is free; of equally long ones the first in the order
/// of kDubinsWords. There always is one: LSL or RSR exists. Allocates nothing. Throws std::invalid_argument naming
/// `from` or `to`, field and bound, unless coordinates are in [-1e9, 1e9] m, yaws in [-1e6, 1e6] rad, radii in [1e-6,
/// 1e9] m.
DubinsPath shortest_dubins_path(const DubinsEnd& from, const DubinsEnd& to);

/// A place on a path.
struct DubinsPlace {
  Pose2 pose;
  double curvature_1_m = 0.0;  ///< left positive; where two segments meet that of the second
};

/// The place `way_m` after the begin of the path; of its begin or end, where that is outside. The yaw is continuous
/// along a segment, and not wrapped.
DubinsPlace place_at(const DubinsPath& path, double way_m);
/// The same of segments in a row, one at least.
DubinsPlace place_at(const DubinsSegment* first, const DubinsSegment* last, double way_m);

/// Poses along the path at equal distances of at most `step_m` > 0, both ends included.
void sample(const DubinsPath& path, double step_m, std::vector<Pose2>& poses);

}  // namespace situation_awareness
