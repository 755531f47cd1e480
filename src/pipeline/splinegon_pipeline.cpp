// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/splinegon_pipeline.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/polygons/map_snapshot.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"

namespace situation_awareness {
namespace {

/// Elements of a boundary, at least: fewer are no large obstacle.
constexpr std::size_t kFewestElements = 6;

/// How long the scans are kept of which the velocity at the first one is learned, from such a number of hits on; how
/// often; and how well it is known then.
constexpr double kBegin_s = 2.0, kPause_s = 1.0;
constexpr std::ptrdiff_t kFewestHits = 20;
constexpr int kPasses = 3;
constexpr double kSecondVelocitySigma_m_s = 0.3, kFirstVelocitySigma_m_s = 0.1;
/// The velocity was told if its standard deviation is less than this; otherwise later scans are awaited, so many times:
/// a single wall never tells that along it.
constexpr double kToldVelocitySigma_m_s = 0.4;
constexpr int kMostBegins = 4;

/// Both ends of a boundary are one place if it has turned once around, up to this angle (rad), and they are no farther
/// apart than this (m): a lap that ends half a metre beside its begin has been around nevertheless.
constexpr double kOnceAround_rad = 0.8;
constexpr double kSeam_m = 1.0;
/// What a boundary has twice is cut off its end where that is so near to its begin (m).
constexpr double kTwice_m = 2.0;
/// A gap in a boundary is at least so long, and the ends of what is in it are so near to its own (m).
constexpr double kLeastGap_m = 0.3, kAtGap_m = 0.5;
/// One that was closed stays so while no more than this part of it has gone.
constexpr double kLost = 0.15;
/// So many elements at least.
constexpr std::size_t kFewestOfClosed = 20;

double turn_between(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
}

/// Whether the elements, counter-clockwise, go once around an obstacle; what they have twice is then cut off their end.
bool go_around(std::vector<SplinegonElement>& elements, bool was_closed) {
  std::size_t count = elements.size();
  if (count < kFewestOfClosed) return false;
  double turn_rad = 0.0, length_m = 0.0;
  for (std::size_t i = 1; i < count; ++i) {
    turn_rad += turn_between(elements[i - 1].normal_world, elements[i].normal_world);
    length_m += (elements[i].p_world_m - elements[i - 1].p_world_m).norm();
  }
  const SplinegonElement& first = elements.front();
  const Eigen::Vector2d along(-first.normal_world.y(), first.normal_world.x());
  const auto ahead_m = [&] { return along.dot(elements[count - 1].p_world_m - first.p_world_m); };
  const auto apart_m = [&] { return (elements[count - 1].p_world_m - first.p_world_m).norm(); };
  while (count > kFewestOfClosed && ahead_m() > 0.0 && apart_m() < kTwice_m) {
    turn_rad -= turn_between(elements[count - 2].normal_world, elements[count - 1].normal_world);
    --count;
  }
  // A seam at a corner has its turn.
  if (was_closed || apart_m() < kAtGap_m) {
    turn_rad += turn_between(elements[count - 1].normal_world, first.normal_world);
  }
  if (was_closed) {
    if (apart_m() > std::max(kTwice_m, kLost * length_m)) return false;
  } else if (apart_m() > kSeam_m) {
    return false;
  }
  if (std::abs(turn_rad - 2.0 * kPi) > kOnceAround_rad) return false;
  elements.resize(count);
  return true;
}

/// Where the scanner is at the last beam, by the velocity as the map knows it: an error of odom's lasts.
Eigen::Isometry3d swept(const MapAlignment& alignment, const Scan& scan, const Eigen::Isometry3d& T_odom_lidar_end,
                        const InertialPlacement& placement) {
  const double sweep_s = scan.time_increment_s * static_cast<double>(std::max<std::size_t>(scan.beams.size(), 1) - 1);
  Eigen::Isometry3d T = T_odom_lidar_end;
  T.translation().head<2>() += sweep_s * alignment.velocity_correction_m_s(placement);
  return T;
}

/// Vertices of chains or splinegons, from the map, with the variance of its place.
template <class Vertices>
void place_in_world(const Pose2& T_world_map, double variance_m2, Vertices& vertices) {
  const Eigen::Matrix2d R_world_map = T_world_map.rotation();
  for (auto& vertex : vertices) {
    vertex.p_world_m = R_world_map * vertex.p_world_m + T_world_map.translation_m;
    vertex.sigma_m = std::sqrt(vertex.sigma_m * vertex.sigma_m + variance_m2);
  }
}

/// Of the map's variance at its boundaries.
constexpr double kFromMiddle_m = 10.0;

/// Of elements on boundaries that were loaded, at least: a file may say 0.
constexpr double kLeastLoadedSigma_m = 1e-3;
/// That such a boundary exists.
constexpr double kLoadedProbability = 0.99;

}  // namespace

SplinegonPipeline::SplinegonPipeline(const SplinegonPipelineParams& params)
    : params_(params),
      chains_(params.polygons),
      alignment_(params.alignment),
      map_(params.boundaries, params.splinegons) {
  params_.scan.validate();
  params_.segments.validate();
  params_.polylines.validate();
}

const Splinegons& SplinegonPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                             const Eigen::Isometry3d& T_world_lidar_end,
                                             const Eigen::Matrix3d& pose_covariance) {
  take_polylines(scan, T_world_lidar, T_world_lidar_end);
  return map_polylines(pose_covariance, std::max(pose_covariance(0, 0), pose_covariance(1, 1)));
}

const Splinegons& SplinegonPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_odom_lidar,
                                             const Eigen::Isometry3d& T_odom_lidar_end,
                                             const InertialPlacement& placement) {
  if (!alignment_.has_begun()) {
    take_polylines(scan, T_odom_lidar, T_odom_lidar_end);
    if (!begin({scan, T_odom_lidar, T_odom_lidar_end, placement})) {
      return fit_boundaries(scan.stamp_ns);  // loaded ones, if any
    }
  }
  take_polylines(scan, T_odom_lidar, swept(alignment_, scan, T_odom_lidar_end, placement));
  const Eigen::Matrix3d covariance = alignment_.align(chains_, placement, polylines_);
  return map_polylines(covariance, alignment_.variance_m2(kFromMiddle_m));
}

/// Whether the latest scan is to be mapped: those before it are. The velocity is learned by one pass over them with
/// each scan, so that none takes the time of all.
bool SplinegonPipeline::begin(FirstScan scan) {
  const auto since_s = [&](const FirstScan& first) { return seconds_between(first.scan.stamp_ns, scan.scan.stamp_ns); };
  const bool has_paused = !first_scans_.empty() && (passes_ == 0 ? since_s(first_scans_.front()) > kPause_s + kBegin_s
                                                                 : since_s(first_scans_.back()) > kPause_s);
  if (has_paused) {
    first_scans_.clear();
    passes_ = 0;
  }
  const auto hits = std::count_if(polylines_.hits.begin(), polylines_.hits.end(),
                                  [](const PolylineHit& hit) { return hit.has_normal; });
  if (first_scans_.empty() && hits < kFewestHits) return false;
  if (first_scans_.empty() || (passes_ == 0 && since_s(first_scans_.front()) < kBegin_s)) {
    first_scans_.push_back(std::move(scan));
    return false;
  }
  const auto map_first_scans = [&](PolygonMap& chains, MapAlignment& alignment, bool whole) {
    for (const FirstScan& first : first_scans_) {
      take_polylines(first.scan, first.T_odom_lidar,
                     swept(alignment, first.scan, first.T_odom_lidar_end, first.placement));
      const Eigen::Matrix3d covariance = alignment.align(chains, first.placement, polylines_);
      update_ = chains.update(polylines_, covariance, std::move(update_));
      if (whole) polygons_ = chains.polygons(std::move(polygons_));
    }
  };
  if (passes_ == kPasses) {
    alignment_.begin_with(first_velocity_m_s_, kFirstVelocitySigma_m_s);
    map_first_scans(chains_, alignment_, true);
    are_taken_ = false;
    first_scans_.clear();
    begins_ = passes_ = 0;
    return true;
  }
  PolygonMap chains(params_.polygons);
  MapAlignment alignment(params_.alignment);
  if (passes_ > 0) alignment.begin_with(first_velocity_m_s_, kSecondVelocitySigma_m_s);
  map_first_scans(chains, alignment, false);
  if (passes_ == 0 && alignment.velocity_sigma_m_s() > kToldVelocitySigma_m_s && begins_ < kMostBegins) {
    ++begins_;
    first_scans_.erase(first_scans_.begin(),
                       first_scans_.begin() + static_cast<std::ptrdiff_t>(first_scans_.size() / 2));
  } else {
    first_velocity_m_s_ = alignment.first_velocity_m_s();
    ++passes_;
  }
  first_scans_.push_back(std::move(scan));
  return false;
}

void SplinegonPipeline::take_polylines(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                       const Eigen::Isometry3d& T_world_lidar_end) {
  const std::string defect = scan_defect(scan);
  if (!defect.empty()) throw std::invalid_argument(defect);
  limited_ = limit_range(scan, T_world_lidar, params_.scan, std::move(limited_));
  points_ = project_horizontally(limited_, T_world_lidar, T_world_lidar_end, std::move(points_));
  segments_ = segment(points_, params_.segments, std::move(segments_));
  polylines_ = extract_polylines(segments_, params_.polylines, std::move(polylines_));
}

const Splinegons& SplinegonPipeline::map_polylines(const Eigen::Matrix3d& covariance, double common_variance_m2) {
  update_ = chains_.update(polylines_, covariance, std::move(update_));
  common_variance_m2_ = common_variance_m2;
  const ChainChanges& changes = chains_.update_due_chains();
  if (are_taken_ && changes.changed.empty() && changes.gone.empty()) {
    polygons_.stamp_ns = polylines_.stamp_ns;
    return place_boundaries(polylines_.stamp_ns);
  }
  polygons_ = chains_.latest_polygons(std::move(polygons_));
  take_boundaries();
  are_taken_ = true;
  return fit_boundaries(polylines_.stamp_ns);
}

/// Fits the boundaries in the map, and places them in the world.
const Splinegons& SplinegonPipeline::fit_boundaries(std::int64_t stamp_ns) {
  map_.update(stamp_ns, boundaries_);
  return place_boundaries(stamp_ns);
}

/// Places all boundaries where the map is in the world now, whatever the scan hit.
const Splinegons& SplinegonPipeline::place_boundaries(std::int64_t stamp_ns) {
  splinegons_ = map_.splinegons();
  splinegons_.stamp_ns = stamp_ns;
  for (Splinegon& splinegon : splinegons_.boundaries) {
    place_in_world(alignment_.T_world_map(), common_variance_m2_, splinegon.vertices);
  }
  return splinegons_;
}

const Polygons& SplinegonPipeline::polygons_in_world() {
  polygons_in_world_ = polygons_;
  for (Chain& chain : polygons_in_world_.chains) {
    place_in_world(alignment_.T_world_map(), common_variance_m2_, chain.vertices);
  }
  return polygons_in_world_;
}

/// In the map. Chains run clockwise around what they are the boundary of.
void SplinegonPipeline::take_boundaries() {
  std::size_t count = 0;
  for (std::size_t c = 0; c < polygons_.chains.size(); ++c) {
    const Chain& chain = polygons_.chains[c];
    chains_.elements_of(c, elements_);
    if (elements_.size() < kFewestElements) continue;
    if (boundaries_.size() == count) boundaries_.emplace_back();
    ObstacleBoundary& boundary = boundaries_[count++];
    boundary.id = chain.id;
    boundary.closed = chain.closed;
    boundary.moved = alignment_.loop_closed_ns() == polygons_.stamp_ns;
    boundary.motion = alignment_.motion_of(chain.first_seen_ns);
    boundary.first_seen_ns = chain.first_seen_ns;
    boundary.last_seen_ns = chain.last_seen_ns;
    boundary.elements.clear();
    std::for_each(elements_.rbegin(), elements_.rend(), [&](const BoundaryElement& element) {
      boundary.elements.push_back(
          {element.p_world_m, {-element.along_world.y(), element.along_world.x()}, element.variance_m2});
    });
    boundary.closed = boundary.closed || go_around(boundary.elements, was_of_closed(boundary.id) != nullptr);
  }
  boundaries_.resize(count);
  closing_.clear();
  for (ObstacleBoundary& boundary : boundaries_) {
    const std::size_t first = closing_.size();
    put_into_gaps(boundary);
    if (!boundary.closed && lead_around(boundary)) put_into_gaps(boundary);  // also of what leads around
    if (boundary.closed) {
      closing_.push_back({boundary.id, boundary.id});
      name_closed(boundary, first);
    } else {
      closing_.resize(first);
    }
  }
  std::sort(closing_.begin(), closing_.end(), [](const OfClosed& a, const OfClosed& b) { return a.chain < b.chain; });
  closed_.swap(closing_);
}

const SplinegonPipeline::OfClosed* SplinegonPipeline::was_of_closed(std::uint64_t chain) const {
  const auto of_closed = std::lower_bound(closed_.begin(), closed_.end(), chain,
                                          [](const OfClosed& a, std::uint64_t id) { return a.chain < id; });
  return of_closed != closed_.end() && of_closed->chain == chain ? &*of_closed : nullptr;
}

/// A closed boundary keeps its id, whichever of its chains is the longest now or has become one with another, unless a
/// chain of that id is elsewhere again. Its chains are those in closing_ from `first` on.
void SplinegonPipeline::name_closed(ObstacleBoundary& boundary, std::size_t first) {
  for (std::size_t i = closing_.size(); i-- > first;) {  // its own chain first
    const OfClosed* const before = was_of_closed(closing_[i].chain);
    if (before == nullptr) continue;
    const bool is_elsewhere = std::any_of(boundaries_.begin(), boundaries_.end(), [&](const ObstacleBoundary& other) {
      return &other != &boundary && other.id == before->id && !other.elements.empty();
    });
    if (is_elsewhere) continue;
    boundary.id = before->id;
    break;
  }
  for (std::size_t i = first; i < closing_.size(); ++i) closing_[i].id = boundary.id;
}

/// Small things that lead from one end of a gap in a boundary to the other, one or several in a row, are a part of it:
/// a column in front of a wall, which was linked across its foot before it was seen well. Elements of what was put
/// somewhere are empty then.
void SplinegonPipeline::put_into_gaps(ObstacleBoundary& boundary) {
  std::vector<SplinegonElement>& elements = boundary.elements;
  for (std::size_t i = elements.size(); i-- > 0;) {  // those before stay where they are
    if (i == 0 && !boundary.closed) return;
    const Eigen::Vector2d from_m = elements[i > 0 ? i - 1 : elements.size() - 1].p_world_m,
                          to_m = elements[i].p_world_m;
    if ((to_m - from_m).norm() < kLeastGap_m || !find_parts(boundary, from_m, to_m, kAtGap_m)) continue;
    joined_.clear();
    join_parts();
    elements.insert(elements.begin() + static_cast<std::ptrdiff_t>(i), joined_.begin(), joined_.end());
    give_parts(boundary);
  }
}

/// What leads from the end of an open boundary to its begin, and turns once around with it, closes it: walls that were
/// seen from too far away to know that they meet in a corner. They are as far apart as elements of one chain may be.
bool SplinegonPipeline::lead_around(ObstacleBoundary& boundary) {
  if (boundary.elements.empty()) return false;
  const bool stays = was_of_closed(boundary.id) != nullptr;
  const double reach_m = stays ? kTwice_m : params_.polygons.max_gap_m + params_.polygons.spacing_m;
  if (!find_parts(boundary, boundary.elements.back().p_world_m, boundary.elements.front().p_world_m, reach_m)) {
    return false;
  }
  joined_ = boundary.elements;
  join_parts();
  if (!go_around(joined_, true)) return false;
  boundary.elements.swap(joined_);
  boundary.closed = true;
  give_parts(boundary);
  return true;
}

/// Appends the elements of parts_ to joined_.
void SplinegonPipeline::join_parts() {
  for (const ObstacleBoundary* const part : parts_) {
    joined_.insert(joined_.end(), part->elements.begin(), part->elements.end());
  }
}

/// Gives the boundary what else is known of parts_, whose elements were put into it, and leaves them empty.
void SplinegonPipeline::give_parts(ObstacleBoundary& boundary) {
  for (ObstacleBoundary* const part : parts_) {
    boundary.first_seen_ns = std::min(boundary.first_seen_ns, part->first_seen_ns);
    boundary.last_seen_ns = std::max(boundary.last_seen_ns, part->last_seen_ns);
    closing_.push_back({part->id, boundary.id});
    part->elements.clear();
  }
}

/// Whether others lead from one place to the other, each the nearest to what is before it: parts_, in order.
bool SplinegonPipeline::find_parts(const ObstacleBoundary& boundary, Eigen::Vector2d from_m,
                                   const Eigen::Vector2d& to_m, double reach_m) {
  parts_.clear();
  do {
    ObstacleBoundary* next = nullptr;
    double least_m = reach_m;
    for (ObstacleBoundary& other : boundaries_) {
      if (&other == &boundary || other.closed || other.elements.empty() ||
          other.elements.size() >= boundary.elements.size() ||
          std::find(parts_.begin(), parts_.end(), &other) != parts_.end()) {
        continue;
      }
      const double apart_m = (other.elements.front().p_world_m - from_m).norm();
      if (apart_m < least_m) next = &other, least_m = apart_m;
    }
    if (next == nullptr) return false;
    parts_.push_back(next);
    from_m = next->elements.back().p_world_m;
  } while ((from_m - to_m).norm() > reach_m);
  return true;
}

void SplinegonPipeline::reset() {
  chains_.restore({});
  alignment_ = MapAlignment(params_.alignment);
  first_scans_.clear();
  begins_ = passes_ = 0;
  polygons_.chains.clear();
  boundaries_.clear();
  closed_.clear();
  fit_boundaries(0);
}

void SplinegonPipeline::resume(const Splinegons& splinegons) {
  const Pose2 T_map_world = inverse(alignment_.T_world_map());
  Polygons polygons;
  polygons.stamp_ns = splinegons.stamp_ns;
  double elements = 0.0;
  for (const Splinegon& splinegon : splinegons.boundaries) elements += length_m(splinegon) / params_.polygons.spacing_m;
  if (!(elements <= static_cast<double>(polygon_bounds::kMaxElements))) {
    throw std::invalid_argument("the boundaries are too long for a map: they would be more than " +
                                std::to_string(polygon_bounds::kMaxElements) + " elements");
  }
  for (const Splinegon& splinegon : splinegons.boundaries) {
    Chain& chain = polygons.chains.emplace_back();
    chain.id = splinegon.id;
    chain.closed = splinegon.closed;
    chain.first_seen_ns = splinegon.first_seen_ns;
    chain.last_seen_ns = splinegon.last_seen_ns;
    chain.p_exists = kLoadedProbability;
    const std::vector<SplinegonPoint> points = sampled(splinegon, params_.polygons.spacing_m);
    std::for_each(points.rbegin(), points.rend(), [&](const SplinegonPoint& point) {
      chain.vertices.push_back({T_map_world * point.p_world_m, std::max(point.sigma_m, kLeastLoadedSigma_m)});
    });
  }
  PolygonMapSnapshot snapshot = snapshot_of_chains(polygons, params_.polygons.spacing_m);
  snapshot.next_id = std::max(snapshot.next_id, chains_.snapshot().next_id);
  chains_.restore(snapshot);
  polygons_ = chains_.polygons(std::move(polygons_));
  take_boundaries();
  for (ObstacleBoundary& boundary : boundaries_) boundary.moved = true;
  fit_boundaries(splinegons.stamp_ns);
}

}  // namespace situation_awareness
