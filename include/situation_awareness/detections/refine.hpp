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

/// Refine detections of known objects about the ellipses that the map predicts (`refit_ellipse`), without the bias of a
/// detector that uses one scan. `known_level` are the expected outlines in this scan; detections whose hits lie on none
/// of them are unchanged, and so are those whose refined result would be untrustworthy.
Detections refine(Detections detections, const Segments& segments, const std::vector<ExpectedOutline>& known_level,
                  const EllipseFitParams& params);

}  // namespace situation_awareness
