// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/refine.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/detections/box_fit.hpp"
#include "situation_awareness/geometry/outline.hpp"

namespace situation_awareness {
namespace {

constexpr double kSureOfShape = 0.9;  // probability from which on a known object is refined as this shape
/// A known object is refined as an ellipse from this probability on: a view of one side of something else, such as the
/// rounded rear of a car, is an ellipse with up to 0.91 (overtake_ego), and then what it does not show would be known.
constexpr double kSureOfEllipse = 0.97;
constexpr double kMaxOffset_m = 0.1;  // mean distance of an object's hits from its expected outline
constexpr double kLarger = 1.3;       // factor on a known ellipse's length from which on a segment is more than it
constexpr double kHitsOnIt = 0.25;    // least part of such a segment's hits that is on the ellipse

double mean_offset_m(const Segments& segments, const Segment& segment, const Outline& outline) {
  double sum_m = 0.0;
  for (std::size_t i = segment.first; i < segment.first + segment.count; ++i) {
    sum_m += std::abs(offset_m(outline, segments.points[i].p_level_m));
  }
  return sum_m / static_cast<double>(segment.count);
}

/// Whether the hits lie, on average, on the near side of the outline, where beams enter it; on its far side no beam can
/// end.
bool on_near_side(const Segments& segments, const Segment& segment, const Outline& outline) {
  double sum = 0.0;
  for (std::size_t i = segment.first; i < segment.first + segment.count; ++i) {
    const Eigen::Vector2d& p_m = segments.points[i].p_level_m;
    sum += p_m.dot(outline.inverse_shape * (p_m - outline.center_m));
  }
  return sum < 0.0;
}

/// Where the predicted box is so wrong that a few steps do not reach the hits, the box is fitted anew, and then about
/// that one: else the prior of what is not seen would count again in every scan.
Detection refined_box(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                      const Box& known_level) {
  const Detection refined = refit_box(segments, segment, params, known_level);
  const double cost = box_cost(segments, segment, params, refined.box_level);
  if (cost <= static_cast<double>(refined.beams) + kGoodBoxCostMargin) return refined;
  const Detection anew = fit_box(segments, segment, params);
  if (box_cost(segments, segment, params, anew.box_level) + kGoodBoxCostMargin >= cost) return refined;
  return refit_box(segments, segment, params, anew.box_level);
}

/// Whether the segment holds more than an object that is surely an ellipse: hits on it, and others beyond its length.
bool holds_more_than(const Segments& segments, const Segment& segment, const Ellipse& known_level) {
  const Eigen::Vector2d ends_m =
      segments.points[segment.first + segment.count - 1].p_level_m - segments.points[segment.first].p_level_m;
  if (ends_m.norm() < 2.0 * kLarger * known_level.rx_m) return false;
  const Outline outline = outline_of(known_level);
  const auto* const first = &segments.points[segment.first];
  const auto on_it = std::count_if(first, first + segment.count, [&](const Point& point) {
    return std::abs(offset_m(outline, point.p_level_m)) < kMaxOffset_m;
  });
  return static_cast<double>(on_it) > kHitsOnIt * static_cast<double>(segment.count);
}

bool moves(const ExpectedOutline& known) {
  return known.velocity_m_s != Eigen::Vector2d::Zero() || known.angular_velocity_rad_s != 0.0;
}

/// The segment alone, each hit where it would be at the mean time of its beams, being of something that moves like
/// `known_level`, which is that of this time. Beams of one turn of a scanner are up to a whole turn apart where its
/// first and its last meet.
void set_at_one_time(const Segments& segments, const Segment& segment, const ExpectedOutline& known_level,
                     Segments& result) {
  result.resolution_rad = segments.resolution_rad;
  result.time_increment_s = segments.time_increment_s;
  const auto* const first = &segments.points[segment.first];
  make_room(result.points, segment.count);
  result.points.assign(first, first + segment.count);
  result.segments.assign(1, segment);
  result.segments[0].first = 0;
  const double time_s = middle_s(segments, segment);
  const Eigen::Vector2d& center_m = known_level.box.center_m;
  for (Point& hit : result.points) {
    const double later_s = hit.beam * segments.time_increment_s - time_s;
    const Eigen::Vector2d before_m = hit.p_level_m;
    hit.p_level_m = center_m + Eigen::Rotation2Dd(-later_s * known_level.angular_velocity_rad_s) *
                                   (before_m - later_s * known_level.velocity_m_s - center_m);
    const double cross = before_m.x() * hit.p_level_m.y() - before_m.y() * hit.p_level_m.x();
    hit.azimuth_rad += std::atan2(cross, before_m.dot(hit.p_level_m));
    hit.range_m = hit.p_level_m.norm();
  }
  std::sort(result.points.begin(), result.points.end(), [](const Point& a, const Point& b) {
    return std::make_pair(a.azimuth_rad, a.beam) < std::make_pair(b.azimuth_rad, b.beam);
  });
}

/// Of the overlaps, in the order of their segments, those of one segment.
auto overlaps_with(std::size_t segment, const std::vector<Overlap>& overlaps) {
  struct BySegment {
    bool operator()(const Overlap& o, std::size_t wanted) const { return o.segment < wanted; }
    bool operator()(std::size_t wanted, const Overlap& o) const { return wanted < o.segment; }
  };
  return std::equal_range(overlaps.begin(), overlaps.end(), segment, BySegment{});
}

/// Kept for their memory.
thread_local KnownObjects known_objects;

}  // namespace

void KnownObjects::set(const Segments& segments, const std::vector<ExpectedOutline>& known_level) {
  segments_ = &segments;
  known_level_ = &known_level;
  overlaps_ = overlaps_of(segments, known_level, std::move(overlaps_));
}

std::size_t KnownObjects::known_of(std::size_t segment) const {
  std::size_t result = kNotKnown;
  double nearest_m = kMaxOffset_m;
  auto [overlap, last] = overlaps_with(segment, overlaps_);
  for (; overlap != last; ++overlap) {
    const Segment& piece = segments_->segments[segment];
    const ExpectedOutline known = later((*known_level_)[overlap->ellipse], middle_s(*segments_, piece));
    const Outline outline = outline_of(known.ellipse);
    const double offset =
        known.p_box > 0.5 ? mean_offset_m(*segments_, piece, known.box) : mean_offset_m(*segments_, piece, outline);
    if (!(offset < nearest_m) || !on_near_side(*segments_, piece, outline)) continue;
    nearest_m = offset;
    result = overlap->ellipse;
  }
  return result;
}

bool KnownObjects::refined(std::size_t segment, double p_ellipse, double log_box_ratio, const EllipseFitParams& params,
                           Detection& result) {
  const std::size_t known = known_of(segment);
  if (known == kNotKnown) return false;
  const ExpectedOutline& expected = (*known_level_)[known];
  const bool is_box = expected.p_box > kSureOfShape;
  if (!is_box && expected.p_box > 1.0 - kSureOfEllipse) return false;  // one scan's detection holds for either shape
  if (!is_box) {
    result = refit_ellipse(*segments_, segment, params, expected.ellipse);
  } else if (segments_->time_increment_s == 0.0 || !moves(expected)) {
    result = refined_box(*segments_, segment, params, expected.box);
  } else {
    const Segment& piece = segments_->segments[segment];
    const ExpectedOutline now = later(expected, middle_s(*segments_, piece));
    set_at_one_time(*segments_, piece, now, at_one_time_);
    result = refined_box(at_one_time_, 0, params, now.box);
    result.segment = segment;
  }
  result.p_ellipse = p_ellipse;
  result.log_box_ratio = log_box_ratio;
  return *detection_defect(result, params) == '\0';
}

void KnownObjects::refuse_composites(Detections& found) const {
  const auto is_composite = [&](const Detection& detection) {
    if (detection.log_box_ratio <= 0.0) return false;
    const auto [first, last] = overlaps_with(detection.segment, overlaps_);
    return std::any_of(first, last, [&](const Overlap& overlap) {
      const ExpectedOutline& known = (*known_level_)[overlap.ellipse];
      return known.p_box < 1.0 - kSureOfShape &&
             holds_more_than(*segments_, segments_->segments[detection.segment], known.ellipse);
    });
  };
  std::size_t kept = 0;
  for (const Detection& detection : found.detections) {
    if (is_composite(detection)) {
      found.refuse(detection.segment, detection_refusal::kNotOneEllipse);
    } else {
      found.detections[kept++] = detection;
    }
  }
  found.detections.resize(kept);
}

std::vector<std::size_t> known_of_each(const Detections& detections, const Segments& segments,
                                       const std::vector<ExpectedOutline>& known_level,
                                       std::vector<std::size_t> memory) {
  known_objects.set(segments, known_level);
  std::vector<std::size_t> result = std::move(memory);
  assign_with_room(result, detections.detections.size(), kNotKnown);
  for (std::size_t i = 0; i < result.size(); ++i) {
    result[i] = known_objects.known_of(detections.detections[i].segment);
  }
  return result;
}

Detections refine(Detections detections, const Segments& segments, const std::vector<ExpectedOutline>& known_level,
                  const EllipseFitParams& params) {
  if (known_level.empty()) return detections;
  known_objects.set(segments, known_level);
  known_objects.refuse_composites(detections);
  for (Detection& detection : detections.detections) {
    Detection refined;
    if (known_objects.refined(detection.segment, detection.p_ellipse, detection.log_box_ratio, params, refined)) {
      detection = refined;
    }
  }
  return detections;
}

}  // namespace situation_awareness
