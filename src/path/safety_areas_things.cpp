// SPDX-License-Identifier: BSD-3-Clause
// What SafetyAreas finds in and near the areas: hits, outlines, objects, and places that are hidden.
#include "situation_awareness/path/safety_areas.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <variant>

#include <Eigen/Geometry>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/simplify.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// m. A hit is on a chain or an object that is so near, and nearer than sigmas of both.
constexpr double kExplain_m = 0.08;
/// s. What counted and is out of view since counts for so long.
constexpr double kCountedMemory_s = 3.0;

// A place is seen if one of these beams gets there: a shadow as narrow as that of a lost beam hides nobody.
constexpr int kBeamsToEachSide = 2;
constexpr double kForgetTolerance_m = 0.1;
constexpr int kNeighbours = 4;  // beams on each side in which a hit may have neighbours
constexpr double kNeighbour_m = 0.2;
constexpr double kMostExplain_m = 0.25;  // however uncertain chain and pose are
constexpr int kMoverPoints = 16;
// A beam through a chain so near to a hit says that the chain is not there: about half of a person.
constexpr double kSeenThrough_m = 0.4;
constexpr double kPassSpacing_m = 0.1;
// A map that a blind scanner no longer feeds is still a map of what it should see.
constexpr double kContradiction_s = 10.0;
constexpr double kChainSpacing_m = 0.05;

// An outline of which a part is less certain is doubted: beams passed there.
constexpr double kLeastKnown = 0.75;
constexpr double kWall_m = 1.6;             // as large as this, what is fixed is no thing that is taken away at once
constexpr double kBoundarySpacing_m = 0.1;  // lines in the place of arcs; of a radius of 0.5 m they are 2.5 mm off

/// It is sure to have stood for long.
bool has_stood_long(const Feature& feature, double min_p_exists) {
  return feature.motion == Motion::kFixed && feature.p_exists >= std::max(min_p_exists, kLeastKnown);
}

bool may_move(const Feature& feature) {
  return feature.p_moving >= 0.5 || feature.motion == Motion::kMoving || feature.object_class == ObjectClass::kPerson;
}

/// A hit on an edge is so near to it.
double reach_of_m(const ChainVertex& from, const ChainVertex& to, const SafetyParams& params) {
  return std::min(kExplain_m + params.sigmas * std::max(from.sigma_m, to.sigma_m), kMostExplain_m);
}

}  // namespace

/// The lines of what stands: polylines, and boundaries, whose arcs are cut into lines.
void SafetyAreas::find_outlines(const Map& map) {
  outlines_.clear();
  lines_.clear();
  for (const Feature& feature : map.features) {
    if (const auto* const lines = std::get_if<PolylineShape>(&feature.shape)) {
      outlines_.push_back(
          {&feature, lines->vertices.data(), 0, lines->vertices.size(), lines->closed, may_move(feature)});
    }
    const auto* const arcs = std::get_if<ArcShape>(&feature.shape);
    if (arcs == nullptr || arcs->vertices.empty()) continue;
    boundary_.closed = arcs->closed;
    boundary_.vertices.assign(arcs->vertices.begin(), arcs->vertices.end());
    points_ = sampled(boundary_, kBoundarySpacing_m, std::move(points_));
    outlines_.push_back({&feature, nullptr, lines_.size(), points_.size(), arcs->closed, may_move(feature)});
    for (const SplinegonPoint& point : points_) lines_.push_back({point.p_world_m, point.sigma_m});
  }
  for (Outline& outline : outlines_) {
    if (outline.vertices == nullptr) outline.vertices = lines_.data() + outline.first;
  }
}

/// A boundary may lead over gaps that nobody saw, and what a camera sees may drive off.
bool SafetyAreas::is_known(const Outline& outline) const {
  const Feature& feature = *outline.feature;
  return has_stood_long(feature, params_.min_p_exists) && !outline.may_move && !feature.seen_by.camera &&
         std::holds_alternative<PolylineShape>(feature.shape);
}

void SafetyAreas::gather_edges(const Map& map) {
  edges_.clear();
  const bool map_is_fresh = is_fresh(map.stamp_ns, params_.max_map_age_s);
  for (const Outline& outline : outlines_) {
    const Feature& feature = *outline.feature;
    const bool explains = map_is_fresh && is_fresh(feature.last_seen_ns, params_.max_map_age_s);
    const bool stands =
        !outline.may_move && seconds_between(feature.first_seen_ns, decision_.stamp_ns) >= params_.standing_s;
    const Weight weight = is_known(outline) ? Weight::kKnown : stands ? Weight::kStands : Weight::kMayMove;
    for (std::size_t i = 0; i < outline.count; ++i) {
      if (i + 1 == outline.count && !outline.closed) break;
      const ChainVertex& from = outline.vertices[i];
      const ChainVertex& to = outline.vertices[(i + 1) % outline.count];
      const Eigen::Vector2d low_m = from.p_world_m.cwiseMin(to.p_world_m),
                            high_m = from.p_world_m.cwiseMax(to.p_world_m);
      const bool beside =
          ((low_m - high_m_).array() > kMostExplain_m).any() || ((low_m_ - high_m).array() > kMostExplain_m).any();
      if (beside) continue;
      edges_.push_back({from.p_world_m, to.p_world_m, reach_of_m(from, to, params_), weight, feature.id, explains,
                        outline.may_move});
    }
  }
}

/// What the scan should see of the outlines, near and far, and which of them it sees through.
void SafetyAreas::view_chains(const Points& points, const Map& map) {
  view_.begin(points, params_.reliable_range_m, params_.sigmas * sigma_m_, params_.sigmas * sigma_rad_);
  const bool map_is_fresh = is_fresh(map.stamp_ns, kContradiction_s);
  for (const Outline& outline : outlines_) {
    const Feature& feature = *outline.feature;
    const bool was_seen = map_is_fresh && is_fresh(feature.last_seen_ns, kContradiction_s);
    const bool is_sure = has_stood_long(feature, params_.min_p_exists);
    const double least_m = feature.motion == Motion::kFixed ? kWall_m : ChainView::kFixed_m;
    const bool is_fixed = outline.count > 0 && box_around(feature.shape).diagonal().norm() >= least_m;
    for (std::size_t i = 0; i + 1 < outline.count + (outline.closed ? 1 : 0); ++i) {
      const ChainVertex& from = outline.vertices[i];
      const ChainVertex& to = outline.vertices[(i + 1) % outline.count];
      view_.add(from.p_world_m, to.p_world_m, reach_of_m(from, to, params_), feature.id, is_sure, is_fixed, was_seen);
    }
  }
  view_.judge();
  // A single beam may be lost: of two neighbours that pass through the same chain, the place where the second does.
  seen_through_.clear();
  const std::vector<ChainView::Beam>& beams = view_.beams();
  const auto passes = [](const ChainView::Beam& beam) {
    return beam.was_seen && (beam.look == ChainView::Look::kPasses || beam.look == ChainView::Look::kWithoutReturn);
  };
  for (std::size_t i = 1; i < beams.size() && seen_through_.size() < kMostPasses; ++i) {
    if (!passes(beams[i]) || !passes(beams[i - 1]) || beams[i].id != beams[i - 1].id) continue;
    const double azimuth_rad = points.points[i].azimuth_rad;
    const Eigen::Vector2d p_world_m =
        points.T_world_level * (beams[i].near_m * Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad)));
    const bool is_new = seen_through_.empty() || seen_through_.back().id != beams[i].id ||
                        (seen_through_.back().p_world_m - p_world_m).norm() >= kPassSpacing_m;
    if (is_new) seen_through_.push_back({p_world_m, beams[i].id});
  }
}

bool SafetyAreas::is_seen_through(const Edge& edge, const Eigen::Vector2d& p_world_m) const {
  return std::any_of(seen_through_.begin(), seen_through_.end(), [&](const SeenThrough& place) {
    return place.id == edge.id && (place.p_world_m - p_world_m).squaredNorm() <= kSeenThrough_m * kSeenThrough_m;
  });
}

/// Bodies, and what else of the map counts by itself.
void SafetyAreas::gather_movers(const Map& map) {
  movers_.clear();
  for (const Outline& outline : outlines_) {
    if (!outline.may_move || !is_fresh(map.stamp_ns, params_.max_map_age_s)) continue;
    for (std::size_t i = 0; i < outline.count; ++i) {
      const Eigen::Vector2d& p_world_m = outline.vertices[i].p_world_m;
      if (is_near(p_world_m))
        things_.push_back({p_world_m, Weight::kMayMove, SafetyDecision::Kind::kObject, outline.feature->id});
    }
  }
  const bool are_fresh = is_fresh(map);
  const double age_s = seconds_between(map.objects_stamp_ns, decision_.stamp_ns);
  for (const Feature& feature : map.features) {
    if (const auto* const target = std::get_if<FootprintShape>(&feature.shape)) gather_target(feature, *target);
    if (!are_fresh || feature.p_exists < params_.min_p_exists) continue;
    if (const auto* const ellipse = std::get_if<EllipseShape>(&feature.shape))
      gather_mover(feature, ellipse->ellipse_world, ellipse->body, age_s);
    if (const auto* const box = std::get_if<BoxShape>(&feature.shape))
      gather_mover(feature, moment_equal_ellipse(box->box_world), box->body, age_s);
  }
}

void SafetyAreas::gather_mover(const Feature& feature, Ellipse ellipse, const BodyState& body, double age_s) {
  ellipse.center_m += age_s * body.velocity_world_m_s;
  if (!is_near(ellipse.center_m, std::max(ellipse.rx_m, ellipse.ry_m))) return;
  const bool moves = may_move(feature);
  const bool stands = seconds_between(feature.first_seen_ns, decision_.stamp_ns) >= params_.standing_s;
  movers_.push_back({ellipse, moves || !stands ? Weight::kMayMove : Weight::kStands, feature.id});
  // It counts itself, also where the scan does not see it.
  if (moves) gather_rim(ellipse, Weight::kMayMove, feature.id);
}

/// What an image shows and no scan, such as a car that is too low for them. Where the vehicle is it is the vehicle.
void SafetyAreas::gather_target(const Feature& feature, const FootprintShape& target) {
  const double radius_m = std::sqrt(target.area_m2 / kPi);
  const Ellipse circle{target.p_world_m.head<2>(), 0.0, radius_m, radius_m};
  if (!is_near(circle.center_m, radius_m)) return;
  if (clearance_m(vehicle_.footprint, inverse(T_world_base_) * circle.center_m) <= radius_m) return;
  gather_rim(circle, Weight::kStands, feature.id);
}

void SafetyAreas::gather_rim(const Ellipse& ellipse, Weight weight, FeatureId id) {
  for (int i = 0; i < kMoverPoints; ++i) {
    const double angle_rad = 2.0 * kPi * i / kMoverPoints;
    const Eigen::Vector2d p_ellipse_m(ellipse.rx_m * std::cos(angle_rad), ellipse.ry_m * std::sin(angle_rad));
    const Eigen::Vector2d p_world_m = ellipse.center_m + Eigen::Rotation2Dd(ellipse.psi_rad) * p_ellipse_m;
    if (is_near(p_world_m)) things_.push_back({p_world_m, weight, SafetyDecision::Kind::kObject, id});
  }
}

/// What a hit is on. What may move comes first: where it is beside a wall, the wall explains nothing.
void SafetyAreas::explain(Thing& thing) const {
  const auto take = [&thing](Weight weight, SafetyDecision::Kind kind, FeatureId id) {
    thing.weight = weight;
    thing.kind = kind;
    thing.id = id;
  };
  const Mover* standing = nullptr;
  for (const Mover& mover : movers_) {
    const double most_m = std::max(mover.ellipse.rx_m, mover.ellipse.ry_m) + kExplain_m;
    if ((thing.p_world_m - mover.ellipse.center_m).squaredNorm() > most_m * most_m) continue;
    if (offset_m(mover.ellipse, thing.p_world_m) > kExplain_m) continue;
    if (mover.weight == Weight::kMayMove) return take(mover.weight, SafetyDecision::Kind::kObject, mover.id);
    standing = &mover;
  }
  const Edge* nearest = nullptr;
  double nearest_m = kNoLimit;
  for (const Edge& edge : edges_) {
    if (!edge.explains) continue;
    const double d_m = distance_from_segment_m(thing.p_world_m, edge.from_m, edge.to_m);
    if (d_m > edge.reach_m || is_seen_through(edge, thing.p_world_m)) continue;
    if (edge.may_move) return take(edge.weight, SafetyDecision::Kind::kObject, edge.id);
    // A known chain explains it rather than one that is not; of several alike the nearest does.
    if (nearest != nullptr && std::pair(nearest->weight, -nearest_m) >= std::pair(edge.weight, -d_m)) continue;
    nearest = &edge;
    nearest_m = d_m;
  }
  if (nearest != nullptr && nearest->weight != Weight::kMayMove) {
    return take(nearest->weight, SafetyDecision::Kind::kChain, nearest->id);
  }
  if (standing != nullptr) return take(standing->weight, SafetyDecision::Kind::kObject, standing->id);
  if (nearest != nullptr) take(nearest->weight, SafetyDecision::Kind::kChain, nearest->id);
}

void SafetyAreas::gather_things(const Points& points) {
  const double beside_m = reach_m_ + margins_.protective_m + warning_margin_m(full_speed_m_s_);
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    const Point& point = points.points[i];
    Thing thing;
    thing.point = static_cast<int>(i);
    if (point.state == BeamState::kHit) {
      thing.p_world_m = points.T_world_level * point.p_level_m;
    } else if (point.state == BeamState::kTooClose) {
      thing.p_world_m = points.T_world_level.translation_m;  // nearer than the scanner can measure
    } else {
      continue;
    }
    if (!is_near(thing.p_world_m)) continue;
    const bool is_beside = std::any_of(steps_.begin(), steps_.end(), [&](const Step& step) {
      return (step.pose.translation_m - thing.p_world_m).squaredNorm() <= beside_m * beside_m;
    });
    if (!is_beside) continue;
    explain(thing);
    things_.push_back(thing);
  }
}

/// Places of chains that the scan does not see, which the tail of the footprint may swing into.
void SafetyAreas::gather_unseen_chains(const Points& points) {
  const Pose2 T_level_world = inverse(points.T_world_level);
  const double beside_m = reach_m_ + margins_.floor_m;
  for (const Edge& edge : edges_) {
    const int pieces = std::max(1, static_cast<int>(std::ceil((edge.to_m - edge.from_m).norm() / kChainSpacing_m)));
    for (int k = 0; k <= pieces; ++k) {
      const Eigen::Vector2d p_world_m = edge.from_m + (static_cast<double>(k) / pieces) * (edge.to_m - edge.from_m);
      if (!is_near(p_world_m)) continue;
      const bool is_beside = std::any_of(steps_.begin(), steps_.end(), [&](const Step& step) {
        return (step.pose.translation_m - p_world_m).squaredNorm() <= beside_m * beside_m;
      });
      if (!is_beside) continue;
      const Eigen::Vector2d p_level_m = T_level_world * p_world_m;
      if (seen_range_m(points, p_level_m) >= p_level_m.norm() - kForgetTolerance_m) continue;
      things_.push_back({p_world_m, Weight::kUnseen, SafetyDecision::Kind::kChain, edge.id});
    }
  }
}

/// Unknown hits without neighbours, as at edges between near and far, count in the hard floor alone.
void SafetyAreas::count_neighbours() {
  const auto is_unknown = [](const Thing& thing) {
    return thing.kind == SafetyDecision::Kind::kUnknownHit && thing.point >= 0;
  };
  for (std::size_t i = 0; i < things_.size(); ++i) {
    Thing& thing = things_[i];
    if (!is_unknown(thing)) continue;
    int hits = 1;
    const auto look = [&](std::size_t k) {
      const int apart = std::abs(things_[k].point - thing.point);
      if (things_[k].point < 0 || apart > kNeighbours * params_.min_hits) return false;
      const bool is_neighbour =
          is_unknown(things_[k]) && (things_[k].p_world_m - thing.p_world_m).norm() <= kNeighbour_m;
      hits += is_neighbour ? 1 : 0;
      return true;
    };
    for (std::size_t k = i; k-- > 0 && look(k);) {
    }
    for (std::size_t k = i + 1; k < things_.size() && look(k); ++k) {
    }
    if (hits < params_.min_hits) thing.weight = Weight::kFloorAlone;
  }
}

/// The range to which the scan sees in the direction of a place; 0 where it does not look.
double SafetyAreas::seen_range_m(const Points& points, const Eigen::Vector2d& p_level_m) const {
  if (points.points.empty()) return 0.0;
  const double first_rad = points.points.front().azimuth_rad, last_rad = points.points.back().azimuth_rad;
  double azimuth_rad = std::atan2(p_level_m.y(), p_level_m.x());
  azimuth_rad += 2.0 * kPi * std::ceil((first_rad - azimuth_rad) / (2.0 * kPi));
  if (azimuth_rad > last_rad + points.resolution_rad && !points.full_circle) return 0.0;
  const auto at = std::lower_bound(points.points.begin(), points.points.end(), azimuth_rad,
                                   [](const Point& point, double a_rad) { return point.azimuth_rad < a_rad; });
  const auto count = static_cast<std::ptrdiff_t>(points.points.size());
  const std::ptrdiff_t middle = at - points.points.begin();
  double range_m = 0.0;
  for (std::ptrdiff_t i = middle - kBeamsToEachSide; i < middle + kBeamsToEachSide; ++i) {
    if (!points.full_circle && (i < 0 || i >= count)) continue;
    const Point& point = points.points[static_cast<std::size_t>(((i % count) + count) % count)];
    if (is_hit(point.state) || point.state == BeamState::kFree) range_m = std::max(range_m, point.range_m);
  }
  return range_m;
}

/// What counted before and is out of view still counts. What the present scan sees, or sees through, it says itself.
void SafetyAreas::recall(const Points& points) {
  const Pose2 T_level_world = inverse(points.T_world_level);
  const auto forget = [&](const Remembered& place) {
    const double age_s = seconds_between(place.stamp_ns, points.stamp_ns);
    if (age_s < 0.0 || age_s > kCountedMemory_s) return true;
    const Eigen::Vector2d p_level_m = T_level_world * place.p_world_m;
    if (seen_range_m(points, p_level_m) >= p_level_m.norm() - kForgetTolerance_m) return true;
    Thing thing;
    thing.p_world_m = place.p_world_m;
    explain(thing);
    return thing.weight != Weight::kMayMove;
  };
  remembered_.erase(std::remove_if(remembered_.begin(), remembered_.end(), forget), remembered_.end());
  for (const Remembered& place : remembered_) {
    if (is_near(place.p_world_m))
      things_.push_back({place.p_world_m, Weight::kMayMove, SafetyDecision::Kind::kUnknownHit, 0});
  }
}

}  // namespace situation_awareness
