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

// Probability of existence and state of an element (docs/math/objects.md, "Existence"): updates by detections and
// missed detections; when it is confirmed, lost and deleted.

/// s. An element without a detection for longer is out of sight: its motion is unknown meanwhile, its matches are
/// restricted, and a confirmed one is lost. Ten scans at 20 Hz; no other source is recorded. Between 0.4 and 0.6 by the
/// test ADetectionOnAnElementSeenHalfASecondAgoIsNoNewElement; in flights 0.25 and 1 s change no figure beyond chance.
constexpr double kLostAfter_s = 0.5;

/// m. Beams that end nearer to the outline than this end on it: ten times the range noise of 1 cm. Half and twice it
/// change nothing in flights.
constexpr double kSightMargin_m = 0.1;

/// Natural logarithm of p / (1 - p), and p of it.
double log_odds(double p);
double probability(double log_odds);

/// True if it was not detected for kLostAfter_s, whatever its state.
bool is_out_of_sight(const MapElement& element, std::int64_t stamp_ns);

/// The detection of an element that is expected in a scan.
struct ExpectedDetection {
  Ellipse ellipse_world;  ///< by the more probable motion
  Sight sight = Sight::kHidden;
  double probability = 0.0;  ///< p_D: that it is detected, if it exists
};

/// Checks the beams at an element's predicted place: p_D is `detection_probability` where beams reach it, reduced by
/// the uncertainty of its position, and zero where it is hidden. `T_level_world` is that of the scan.
ExpectedDetection expect_detection(const MapElement& element, const Pose2& T_level_world, const FreeSpace& free_space,
                                   double detection_probability);

/// A new element, after its first detection.
void begin_existence(MapElement& element, const ObjectMapParams& params);

/// Update by a detection: raises the probability of existence, confirms the element from `confirmation_probability` on,
/// and ends the state lost. True if this detection confirmed it. `step_s`: time since the scan before.
bool detection_update(MapElement& element, const Detection& detection, double step_s, const ObjectMapParams& params);

/// Missed-detection update: lowers the probability of existence only where beams show that the element is not there;
/// hidden elements are unchanged. `another_there`: another element was detected at its place. An element that can move
/// may be elsewhere: it is off the map, and kept for re-identification.
void missed_detection_update(MapElement& element, const ExpectedDetection& expected, bool another_there,
                             const ObjectMapParams& params);

/// Time update to `stamp_ns`: a confirmed element that is out of sight becomes lost.
void age(MapElement& element, std::int64_t stamp_ns);

/// Reason to delete an element after the update at `stamp_ns`; empty if it stays (circle paper, Sect. V-B3).
const char* deletion_reason(const MapElement& element, std::int64_t stamp_ns, const ObjectMapParams& params);

/// Standard deviation of the published position, in its least certain direction: under both motions unless one is
/// almost certain, with correlated errors.
double published_position_sigma_m(const MapElement& element, const ObjectMapParams& params);

/// True if the element is on the map: confirmed, more likely to exist than not, no part of another, and its position
/// certain once it is lost. What is seen is there, however little is known of how far it extends behind its hits.
bool is_on_map(const MapElement& element, const ObjectMapParams& params);

}  // namespace situation_awareness
