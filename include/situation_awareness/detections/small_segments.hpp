// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

struct Detections;
struct Segments;

/// A few hits side by side that are no ellipse: too few, or of several things. A leg of a known person may be one
/// (docs/math/people.md); nothing else is made of them.
struct SmallSegment {
  Eigen::Vector2d center_level_m = Eigen::Vector2d::Zero();  ///< mean of its hits
  double width_m = 0.0;                                      ///< between its first and its last hit
  double time_offset_s = 0.0;                                ///< of the middle of its beams after the stamp
  int beams = 0;                                             ///< number of its hits
};

/// The segments and refused runs without a detection that are small, of at least `kMinSmallHits` hits. `memory`: as for
/// limit_range.
std::vector<SmallSegment> small_segments(const Segments& segments, const Detections& detections,
                                         std::vector<SmallSegment> memory = {});

constexpr std::size_t kMinSmallHits = 3;
/// m. Two legs side by side are no wider.
constexpr double kMaxSmallWidth_m = 0.45;

}  // namespace situation_awareness
