// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Detections of what the map knows already, found again from there (`refit_ellipse`): a detector that looks at one
/// scan cannot know how its answer is biased, the map that has seen many can. `known_level` is what the map expects in
/// this scan; detections whose hits lie on none of it stay as they are, and so do those that would not be trusted
/// after.
Detections refine(Detections detections, const Segments& segments, const std::vector<Ellipse>& known_level,
                  const EllipseFitParams& params);

}  // namespace situation_awareness
