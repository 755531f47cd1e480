// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// The box with the least cost for one segment: hits lie on the faces towards the sensor, beams beside a silhouette end
/// miss it, a hidden end is no nearer than its last hit, and half lengths that were not seen follow a wide prior: that
/// of things of a person's size, or, of larger ones, as much as was seen, give or take nearly all of it. As a
/// detection: the ellipse of equal moments, and its covariance, wide in depth where only a face was seen.
Detection fit_box(const Segments& segments, std::size_t segment, const EllipseFitParams& params);

/// The same for a known object: one Gauss-Newton step from the predicted box, without a prior: what was not seen keeps
/// the predicted value, with a covariance so wide that it does not count.
Detection refit_box(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                    const Box& known_level);

/// The cost of a good fit exceeds the number of its hits by at most this.
constexpr double kGoodBoxCostMargin = 5.0;

/// Twice the negative log-likelihood of hits and silhouettes for a box, up to a constant that it shares with
/// `ellipse_cost`; outlying hits count up to a bound.
double box_cost(const Segments& segments, std::size_t segment, const EllipseFitParams& params, const Box& box_level);

/// Root mean square of the distances of a segment's hits from the faces of a box towards the sensor.
double residual_rms_m(const Segments& segments, std::size_t segment, const Box& box_level);

/// Mean distance of a segment's hits from the faces of a box towards the sensor.
double mean_offset_m(const Segments& segments, const Segment& segment, const Box& box_level);

}  // namespace situation_awareness
