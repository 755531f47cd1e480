// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/geometry/expected_outline.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

constexpr std::size_t kNotKnown = static_cast<std::size_t>(-1);

/// Index of the expected outline in `known_level` on which the hits of each detection lie, or kNotKnown. `memory`: as
/// for limit_range.
std::vector<std::size_t> known_of_each(const Detections& detections, const Segments& segments,
                                       const std::vector<ExpectedOutline>& known_level,
                                       std::vector<std::size_t> memory = {});

/// What the map expects of the segments of one scan, for `refine`. It keeps its memory from scan to scan.
class KnownObjects {
 public:
  /// Both are used until the next call.
  void set(const Segments& segments, const std::vector<ExpectedOutline>& known_level);

  /// Index of the expected outline on which the hits of the segment lie, or kNotKnown.
  std::size_t known_of(std::size_t segment) const;

  /// The detection of the segment as that of the known object on which it lies, and true; false if it lies on none, may
  /// be of either shape, or if this detection would be untrustworthy. Of the detection of the segment alone it has
  /// `p_ellipse` and `log_box_ratio`; nothing else of that counts.
  bool refined(std::size_t segment, double p_ellipse, double log_box_ratio, const EllipseFitParams& params,
               Detection& result);

  /// Refuses what looks like a box and holds an object that is surely an ellipse: these are two things side by side.
  void refuse_composites(Detections& found) const;

 private:
  const Segments* segments_ = nullptr;
  const std::vector<ExpectedOutline>* known_level_ = nullptr;
  std::vector<Overlap> overlaps_;
  Segments at_one_time_;  ///< one segment
};

/// Refine detections of known objects about the ellipses that the map predicts (`refit_ellipse`), without the bias of a
/// detector that uses one scan. `known_level` are the expected outlines in this scan; detections whose hits lie on none
/// of them are unchanged, and so are those whose refined result would be untrustworthy.
Detections refine(Detections detections, const Segments& segments, const std::vector<ExpectedOutline>& known_level,
                  const EllipseFitParams& params);

}  // namespace situation_awareness
