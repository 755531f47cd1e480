// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/bodies.hpp"

#include <algorithm>
#include <utility>

#include "situation_awareness/map/objects/existence.hpp"

namespace situation_awareness {

using namespace object_state;

namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// m. Maximum mean radius of an element that may be part of a body (a limb).
constexpr double kMaxPartRadius_m = 0.15;
/// m. Maximum gap between a part and its body.
constexpr double kMaxPartGap_m = 0.3;
/// m. Distance that two elements must move together to become one body.
constexpr double kMinPartTravel_m = 0.4;

// No source is recorded for any of these; the bounds are those of bodies_test. In flights, half and twice each value
// change no figure beyond chance.

/// Factor on the mean radius by which an element is the larger of two. No test bounds it.
constexpr double kLargerRadius = 1.5;
/// Factor on kMaxPartGap_m: beyond it a part is released from its body. From 1.7 to 2.3.
constexpr double kPartingGap = 2.0;
/// Fraction of the body's displacement that its part must share. Above 0, at most 1.
constexpr double kSameWay = 0.5;

double mean_radius_m(const Ellipse& ellipse) { return 0.5 * (ellipse.rx_m + ellipse.ry_m); }

/// Distance between the outlines of two ellipses along the line of their centres; negative if they overlap.
double gap_m(const Ellipse& a, const Ellipse& b) {
  const Eigen::Vector2d d = b.center_m - a.center_m;
  const double distance_m = d.norm();
  if (distance_m < 1e-9) return -(a.rx_m + b.rx_m);
  const Eigen::Vector2d n = d / distance_m;
  return distance_m - half_width_m(a, n) - half_width_m(b, n);
}

}  // namespace

void BodyJoiner::find_bodies(std::int64_t stamp_ns, const std::vector<MapElement>& elements) {
  by_x_.clear();
  largest_radius_m_ = 0.0;
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const MapElement& element = elements[i];
    if (element.is_part || element.state == TrackState::kDeleted) continue;
    if (element.estimate.p_moving < 0.5 || is_out_of_sight(element, stamp_ns)) continue;
    by_x_.push_back({ellipse_world(element.estimate.moving.x), i});
    largest_radius_m_ = std::max(largest_radius_m_, by_x_.back().ellipse_world.rx_m);
  }
  std::sort(by_x_.begin(), by_x_.end(), [](const Body& a, const Body& b) {
    return std::make_pair(a.ellipse_world.center_m.x(), a.element) <
           std::make_pair(b.ellipse_world.center_m.x(), b.element);
  });
}

/// The nearest body that is larger, or as large and older.
const BodyJoiner::Body* BodyJoiner::nearest_body(const MapElement& part, const Ellipse& ellipse_world, double max_gap_m,
                                                 const std::vector<MapElement>& elements) const {
  const double part_radius_m = mean_radius_m(ellipse_world);
  const double reach_m = largest_radius_m_ + ellipse_world.rx_m + max_gap_m;
  auto near = std::lower_bound(by_x_.begin(), by_x_.end(), ellipse_world.center_m.x() - reach_m,
                               [](const Body& body, double x_m) { return body.ellipse_world.center_m.x() < x_m; });
  const Body* nearest = nullptr;
  double nearest_m = max_gap_m;
  for (; near != by_x_.end() && near->ellipse_world.center_m.x() <= ellipse_world.center_m.x() + reach_m; ++near) {
    const MapElement& body = elements[near->element];
    if (body.id == part.id || body.is_part) continue;
    const double body_radius_m = mean_radius_m(near->ellipse_world);
    const bool larger = body_radius_m > kLargerRadius * part_radius_m;
    const bool as_large = body_radius_m > part_radius_m / kLargerRadius;
    if (!larger && !(as_large && body.id < part.id)) continue;
    const double gap = gap_m(near->ellipse_world, ellipse_world);
    if (gap > nearest_m) continue;
    nearest_m = gap;
    nearest = &*near;
  }
  return nearest;
}

void BodyJoiner::join_parts(std::int64_t stamp_ns, std::vector<MapElement>& elements) {
  find_bodies(stamp_ns, elements);
  for (MapElement& part : elements) {
    if (part.last_seen_ns != stamp_ns || part.state == TrackState::kDeleted) continue;
    const Ellipse ellipse = ellipse_world(likelier(part.estimate).x);
    if (part.is_part) {
      const MapElement* const body = find_element(part.body, elements);
      if (body != nullptr && gap_m(ellipse_world(combine(body->estimate).x), ellipse) <= kPartingGap * kMaxPartGap_m) {
        continue;
      }
      part.is_part = false;
      part.body = 0;
    }
    if (mean_radius_m(ellipse) > kMaxPartRadius_m) continue;
    const Body* const nearest = nearest_body(part, ellipse, kMaxPartGap_m, elements);
    if (nearest == nullptr) {
      part.body = 0;
      continue;
    }
    MapElement& body = elements[nearest->element];
    const Eigen::Vector2d& body_center_m = nearest->ellipse_world.center_m;
    if (part.body != body.id) {
      part.body = body.id;
      part.met_world_m = ellipse.center_m;
      part.body_met_world_m = body_center_m;
    }
    const Eigen::Vector2d body_way_m = body_center_m - part.body_met_world_m;
    const Eigen::Vector2d way_m = ellipse.center_m - part.met_world_m;
    const bool together =
        body_way_m.norm() >= kMinPartTravel_m && way_m.dot(body_way_m) >= kSameWay * body_way_m.squaredNorm();
    // A body with parts may have another; an element that stood there before is none.
    const bool limb = body.has_parts && (part.observations == 1 || part.mobile);
    if (!together && !limb) continue;
    part.is_part = true;
    body.has_parts = true;
    for (MapElement& other : elements) {
      if (other.is_part && other.body == part.id) other.body = body.id;
    }
  }
}

std::size_t transfer_body_ids(std::int64_t stamp_ns, std::vector<MapElement>& elements, std::vector<char>& dropped) {
  std::size_t off_the_map = 0;
  for (std::size_t i = 0; i < elements.size(); ++i) {
    MapElement& body = elements[i];
    const bool off = body.state != TrackState::kTentative && body.state != TrackState::kDeleted && body.log_odds <= 0.0;
    if (!(dropped[i] != 0 || off) || !body.has_parts || body.is_part) continue;
    std::size_t heir = elements.size();
    double heir_m = 0.0;
    for (std::size_t j = 0; j < elements.size(); ++j) {
      if (dropped[j] != 0 || !elements[j].is_part || elements[j].body != body.id) continue;
      if (dropped[i] == 0 && elements[j].last_seen_ns != stamp_ns) continue;
      const double radius_m = likelier(elements[j].estimate).x(kShape);
      if (radius_m <= heir_m) continue;
      heir = j;
      heir_m = radius_m;
    }
    if (heir == elements.size()) continue;
    if (dropped[i] == 0) ++off_the_map;
    MapElement& part = elements[heir];
    part.is_part = false;
    part.body = 0;
    part.has_parts = true;
    take_over_id(i, heir, elements, dropped);
  }
  return off_the_map;
}

}  // namespace situation_awareness
