// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/splinegons/splinegon_map.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

/// Of a boundary over that of the polygon of its elements: around a corner that nobody saw 1.42.
constexpr double kMostLength = 1.5;
/// Part of its elements, at least, by which a boundary is within a closed one, and how far (m) they may be before that.
constexpr double kWithin = 0.9;
constexpr double kBefore_m = 0.1;
/// s. Where the ends of slim things made a boundary cross itself they are followed again after so long.
constexpr double kTipsAgain_s = 1.0;

/// Nobody can have seen anything there: errors of poses put it behind a boundary that was drawn before, or again.
bool is_within(const ObstacleBoundary& boundary, const Splinegon& closed) {
  const Eigen::Matrix2d R = boundary.motion.rotation();
  const double most_outside = (1.0 - kWithin) * static_cast<double>(boundary.elements.size());
  std::size_t outside = 0;
  // Around all of it: no place of an arc is farther from its chord than in its middle.
  Eigen::AlignedBox2d around_m;
  double most_height_m = 0.0;
  for (std::size_t k = 0; k < closed.vertices.size(); ++k) {
    const SplinegonVertex& from = closed.vertices[k];
    const SplinegonVertex& to = closed.vertices[k + 1 < closed.vertices.size() ? k + 1 : 0];
    around_m.extend(from.p_world_m);
    most_height_m = std::max(most_height_m, 0.5 * std::abs(from.bulge) * (to.p_world_m - from.p_world_m).norm());
  }
  const Eigen::Vector2d margin_m = Eigen::Vector2d::Constant(most_height_m + 2.0 * kBefore_m);
  around_m = Eigen::AlignedBox2d(around_m.min() - margin_m, around_m.max() + margin_m);
  for (const SplinegonElement& element : boundary.elements) {
    const Eigen::Vector2d p_m = R * element.p_world_m + boundary.motion.translation_m;
    if (around_m.contains(p_m) && (contains(closed, p_m) || distance_m(closed, p_m) < kBefore_m)) continue;
    if (static_cast<double>(++outside) > most_outside) return false;
  }
  return true;
}

}  // namespace

SplinegonMap::SplinegonMap(const SplinegonMapParams& params, const SplinegonFitParams& fit)
    : params_((params.validate(), params)), fit_(fit) {}

/// By the box around its elements, whose diagonal is at most 1.42 times as large as the distance.
bool SplinegonMap::is_large(const ObstacleBoundary& boundary) const {
  if (boundary.elements.empty()) return false;
  Eigen::Vector2d low_m = boundary.elements.front().p_world_m, high_m = low_m;
  for (const SplinegonElement& element : boundary.elements) {
    low_m = low_m.cwiseMin(element.p_world_m);
    high_m = high_m.cwiseMax(element.p_world_m);
  }
  return (high_m - low_m).norm() >= params_.min_extent_m;
}

/// Elements that were put together wrongly may ask for a boundary that crosses itself, or that swings out between them,
/// or there is none at all.
bool SplinegonMap::is_sound(const Splinegon& splinegon, const std::vector<SplinegonElement>& elements) {
  if (splinegon.vertices.empty()) return false;
  double elements_length_m = 0.0;
  for (std::size_t i = splinegon.closed ? 0 : 1; i < elements.size(); ++i) {
    elements_length_m += (elements[i].p_world_m - elements[i > 0 ? i - 1 : elements.size() - 1].p_world_m).norm();
  }
  // Not true of numbers that are not finite, either.
  if (!(length_m(splinegon) <= kMostLength * elements_length_m)) return false;
  return is_simple(splinegon, points_m_) && (!splinegon.closed || area_m2(splinegon) > 0.0);
}

const Splinegons& SplinegonMap::update(std::int64_t stamp_ns, const std::vector<ObstacleBoundary>& boundaries) {
  std::swap(splinegons_, before_);
  std::swap(fits_, fits_before_);
  fits_.clear();
  splinegons_.stamp_ns = stamp_ns;
  std::size_t count = 0;
  for (const bool closed : {true, false}) {
    for (const ObstacleBoundary& boundary : boundaries) {
      if (boundary.closed != closed || !is_large(boundary) || (!closed && is_inner(boundary, count))) continue;
      if (splinegons_.boundaries.size() == count) splinegons_.boundaries.emplace_back();
      Splinegon& result = splinegons_.boundaries[count];
      fits_.resize(count);
      fits_.push_back(fit(boundary, stamp_ns, result));
      if (!result.vertices.empty()) ++count;
    }
  }
  fits_.resize(count);
  splinegons_.boundaries.resize(count);
  return splinegons_;
}

std::size_t SplinegonMap::count_of(Outcome outcome) const {
  return static_cast<std::size_t>(
      std::count_if(fits_.begin(), fits_.end(), [&](const Fit& fit) { return fit.outcome == outcome; }));
}

std::size_t SplinegonMap::polygons() const { return count_of(Outcome::kPolygon); }

std::size_t SplinegonMap::kept() const { return count_of(Outcome::kKept); }

/// Of the first ones of this update.
bool SplinegonMap::is_inner(const ObstacleBoundary& boundary, std::size_t count) const {
  const auto begin = splinegons_.boundaries.begin();
  return std::any_of(begin, begin + static_cast<std::ptrdiff_t>(count),
                     [&](const Splinegon& other) { return other.closed && is_within(boundary, other); });
}

/// Without vertices if there is none.
SplinegonMap::Fit SplinegonMap::fit(const ObstacleBoundary& boundary, std::int64_t stamp_ns, Splinegon& result) {
  const auto earlier = std::find_if(before_.boundaries.begin(), before_.boundaries.end(),
                                    [&](const Splinegon& other) { return other.id == boundary.id; });
  result.id = boundary.id;
  result.first_seen_ns = boundary.first_seen_ns;
  result.vertices.clear();
  result.closed = boundary.closed;
  const auto stay = [&] {
    result.vertices.assign(earlier->vertices.begin(), earlier->vertices.end());
    result.closed = earlier->closed;
    result.last_seen_ns = earlier->last_seen_ns;
  };
  const bool is_known = earlier != before_.boundaries.end(), is_same = is_known && earlier->closed == boundary.closed;
  Fit fit;
  if (is_same) {
    stay();
    fit = fits_before_[static_cast<std::size_t>(earlier - before_.boundaries.begin())];
    const bool was_seen = boundary.last_seen_ns == stamp_ns || boundary.last_seen_ns > before_.stamp_ns;
    if (!boundary.moved && !was_seen) return fit;
  }
  result.last_seen_ns = boundary.last_seen_ns;
  const auto is_sound_fit = [&](bool follow_tips) {
    const SplinegonFitQuality quality = fit_.fit(boundary.elements, boundary.closed, result.vertices, follow_tips);
    fit.outcome = quality.as_polygon > 0 ? Outcome::kPolygon : Outcome::kArcs;
    if (is_sound(result, boundary.elements)) return true;
    result.vertices.clear();
    return false;
  };
  const double since_s = seconds_between(fit.tips_failed_ns, stamp_ns);
  const bool follow_tips = fit.tips_failed_ns == StampOrder::kNone || since_s < 0.0 || since_s >= kTipsAgain_s;
  // A fit from nothing is tried once, after that from the fit before where there is one.
  const bool has_before = !result.vertices.empty();
  if (is_sound_fit(follow_tips) || (has_before && is_sound_fit(follow_tips))) {
    if (follow_tips) fit.tips_failed_ns = StampOrder::kNone;
    return fit;
  }
  if (follow_tips) {
    fit.tips_failed_ns = stamp_ns;
    if (is_sound_fit(false)) return fit;
  }
  fit.outcome = Outcome::kPolygon;
  fit_.fit_polygon(boundary.elements, boundary.closed, result.vertices);
  if (is_sound(result, boundary.elements)) return fit;
  if (is_known) {
    stay();
    fit.outcome = Outcome::kKept;
  } else {
    fit_part(boundary.elements, result);
  }
  return fit;
}

/// Of elements that cross themselves, of halves of halves of them: the first of the longest that does not.
void SplinegonMap::fit_part(const std::vector<SplinegonElement>& elements, Splinegon& result) {
  result.closed = false;
  for (std::size_t parts = 1; 3 * parts <= elements.size(); parts *= 2) {
    for (std::size_t part = 0; part < parts; ++part) {
      const auto at = [&](std::size_t i) {
        return elements.begin() + static_cast<std::ptrdiff_t>(i * elements.size() / parts);
      };
      part_.assign(at(part), at(part + 1));
      fit_.fit_polygon(part_, false, result.vertices);
      if (is_sound(result, part_)) return;
    }
  }
  result.vertices.clear();
}

}  // namespace situation_awareness
