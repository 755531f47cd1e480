// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/objects/map_element.hpp"
#include "situation_awareness/map/objects/object_map_params.hpp"
#include "situation_awareness/map/objects/visibility.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

// The probability that an element exists, and its life (docs/math/objects.md, "Existence"): what a detection and what
// beams without one say, when it is confirmed, lost and deleted.

/// s. Not detected for longer, an element is out of sight: nothing is known of how it moves meanwhile, it matches less,
/// and a confirmed one is lost. Ten scans at 20 Hz; no other source is recorded. From 0.4 to 0.6 by
/// WhatLiesOnAnElementSeenHalfASecondAgoIsNotANewOne; not measured in flights.
constexpr double kLostAfter_s = 0.5;

/// Natural logarithm of p / (1 - p), and p of it.
double log_odds(double p);
double probability(double log_odds);

/// True if it was not detected for kLostAfter_s, whatever its state.
bool is_out_of_sight(const MapElement& element, std::int64_t stamp_ns);

/// Whether a scan should have a detection of an element.
struct ExpectedDetection {
  Ellipse ellipse_world;  ///< where, by the more probable motion
  Sight sight = Sight::kHidden;
  double probability = 0.0;  ///< p_D: that there is one, if the element exists
};

/// Looks where an element should be: p_D is `detection_probability` where beams reach it, the less the less certain its
/// place is, and zero where something hides it. `T_level_world` is that of the scan.
ExpectedDetection expect_detection(const MapElement& element, const Pose2& T_level_world, const FreeSpace& free_space,
                                   double detection_probability);

/// A new element, after its first detection.
void begin_existence(MapElement& element, const ObjectMapParams& params);

/// A detection of the element: it exists more probably, is confirmed from `confirmation_probability` on, and no longer
/// lost. True if it was confirmed by this one.
bool detection_update(MapElement& element, bool hidden_end, const ObjectMapParams& params);

/// No detection of the element: it exists less probably, but only where beams say that it is not there; what is hidden
/// keeps its existence. `another_there`: another element was detected at its place. What can move is not where it
/// should be, but may be elsewhere: it is off the map, and remembered.
void missed_detection_update(MapElement& element, const ExpectedDetection& expected, bool another_there,
                             const ObjectMapParams& params);

/// Time has passed, to `stamp_ns`: a confirmed element that is out of sight is lost.
void age(MapElement& element, std::int64_t stamp_ns);

/// Why an element is to be deleted after the update at `stamp_ns`; empty text if it stays (circle paper, Sect. V-B3).
const char* deletion_reason(const MapElement& element, std::int64_t stamp_ns, const ObjectMapParams& params);

/// Standard deviation of the position as the map gives it, in its least certain direction: under both motions unless
/// one is all but certain, with the errors that repeat from scan to scan.
double published_position_sigma_m(const MapElement& element, const ObjectMapParams& params);

/// True if the element is on the map: confirmed, more likely there than not, no part of another, its place certain.
bool is_on_map(const MapElement& element, const ObjectMapParams& params);

}  // namespace situation_awareness
