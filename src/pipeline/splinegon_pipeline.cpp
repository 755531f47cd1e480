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
#include "situation_awareness/map/map.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"

namespace situation_awareness {
namespace {

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

/// Where the scanner is at the last beam, by the velocity as the map knows it: an error of odom's lasts.
Eigen::Isometry3d swept(const MapAlignment& alignment, const Scan& scan, const Eigen::Isometry3d& T_odom_lidar_end,
                        const InertialPlacement& placement) {
  const double sweep_s = scan.time_increment_s * static_cast<double>(std::max<std::size_t>(scan.beams.size(), 1) - 1);
  Eigen::Isometry3d T = T_odom_lidar_end;
  T.translation().head<2>() += sweep_s * alignment.velocity_correction_m_s(placement);
  return T;
}

/// Of the map's variance at its boundaries.
constexpr double kFromMiddle_m = 10.0;

/// Of elements on boundaries that were loaded, at least: a file may say 0.
constexpr double kLeastLoadedSigma_m = 1e-3;

}  // namespace

SplinegonPipeline::SplinegonPipeline(const SplinegonPipelineParams& params,
                                     const std::optional<ObjectPipelineParams>& objects, const MoverParams& movers,
                                     StandingThings standing)
    : params_(params),
      chains_(params.polygons),
      objects_(objects ? std::make_unique<ObjectPipeline>(*objects) : nullptr),
      movers_(movers),
      standing_(standing),
      alignment_(params.alignment),
      boundaries_(params.boundaries, params.splinegons, params.polygons.spacing_m, params.polygons.max_gap_m) {
  params_.scan.validate();
  params_.segments.validate();
  params_.polylines.validate();
  if (objects_) objects_->map().trust_stamps();
}

const Splinegons& SplinegonPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                             const Eigen::Isometry3d& T_world_lidar_end,
                                             const Eigen::Matrix3d& pose_covariance) {
  if (objects_) {
    follow_objects(scan, T_world_lidar, T_world_lidar_end);
    if (standing_ == StandingThings::kNone) return splinegons_;
    polylines_ = extract_polylines(latest_->segments, params_.polylines, std::move(polylines_));
  } else {
    take_polylines(scan, T_world_lidar, T_world_lidar_end);
  }
  return map_polylines(pose_covariance, std::max(pose_covariance(0, 0), pose_covariance(1, 1)));
}

const Splinegons& SplinegonPipeline::process(const Segments& segments, const Objects* objects,
                                             const Eigen::Matrix3d& pose_covariance) {
  if (standing_ == StandingThings::kNone) return splinegons_;
  polylines_ = extract_polylines(segments, params_.polylines, std::move(polylines_));
  if (!can_be_mapped(polylines_, pose_covariance)) {
    throw std::invalid_argument("numbers that are no place near the world's origin");
  }
  if (objects != nullptr) movers_.add(*objects, segments.free_space, segments.T_world_level);
  return map_polylines(pose_covariance, std::max(pose_covariance(0, 0), pose_covariance(1, 1)));
}

const Splinegons& SplinegonPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_odom_lidar,
                                             const Eigen::Isometry3d& T_odom_lidar_end,
                                             const InertialPlacement& placement) {
  if (!alignment_.has_begun()) {
    take_polylines(scan, T_odom_lidar, T_odom_lidar_end);
    if (!begin({scan, T_odom_lidar, T_odom_lidar_end, placement})) {
      changes_ = {};
      return fit_boundaries(scan.stamp_ns);  // loaded ones, if any
    }
  }
  const Eigen::Isometry3d T_odom_swept = swept(alignment_, scan, T_odom_lidar_end, placement);
  take_polylines(scan, T_odom_lidar, T_odom_swept);
  const Pose2 T_level_odom = inverse(polylines_.T_world_level);
  const Eigen::Matrix3d covariance = alignment_.align(chains_, placement, polylines_);
  if (objects_) {
    const Eigen::Isometry3d T_map_odom = isometry_in_plane(polylines_.T_world_level * T_level_odom);
    follow_objects(scan, T_map_odom * T_odom_lidar, T_map_odom * T_odom_swept);
  }
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

void SplinegonPipeline::follow_objects(const Scan& scan, const Eigen::Isometry3d& T_map_lidar,
                                       const Eigen::Isometry3d& T_map_lidar_end) {
  latest_ = &objects_->process(scan, T_map_lidar, T_map_lidar_end);
  movers_.add(latest_->objects, latest_->segments.free_space, latest_->segments.T_world_level);
}

const Splinegons& SplinegonPipeline::map_polylines(const Eigen::Matrix3d& covariance, double common_variance_m2) {
  update_ = chains_.update(polylines_, covariance, movers_.at(polylines_.stamp_ns), std::move(update_));
  common_variance_m2_ = common_variance_m2;
  const ChainChanges& changes = chains_.update_due_chains();
  if (are_taken_ && changes.changed.empty() && changes.gone.empty()) {
    changes_ = changes;
    polygons_.stamp_ns = polylines_.stamp_ns;
    return place_boundaries(polylines_.stamp_ns);
  }
  polygons_ = chains_.latest_polygons(std::move(polygons_));
  if (are_taken_) {
    changes_ = changes;
  } else {
    tell_all_chains();
  }
  are_taken_ = true;
  if (standing_ != StandingThings::kBoundaries) return splinegons_;
  take_boundaries();
  return fit_boundaries(polylines_.stamp_ns);
}

/// Tells of all chains that they changed, where those that did before were not told.
void SplinegonPipeline::tell_all_chains() {
  changes_ = {};
  for (const Chain& chain : polygons_.chains) changes_.changed.push_back(chain.id);
  std::sort(changes_.changed.begin(), changes_.changed.end());
}

/// Takes the chains as they are in the map.
void SplinegonPipeline::take_boundaries() {
  boundaries_.take(chains_, polygons_, alignment_.loop_closed_ns() == polygons_.stamp_ns,
                   [this](std::int64_t first_seen_ns) { return alignment_.motion_of(first_seen_ns); });
}

/// Fits the boundaries in the map, and places them in the world.
const Splinegons& SplinegonPipeline::fit_boundaries(std::int64_t stamp_ns) {
  boundaries_.fit(stamp_ns);
  return place_boundaries(stamp_ns);
}

/// Places all boundaries where the map is in the world now, whatever the scan hit.
const Splinegons& SplinegonPipeline::place_boundaries(std::int64_t stamp_ns) {
  splinegons_ = map().splinegons();
  splinegons_.stamp_ns = stamp_ns;
  for (Splinegon& splinegon : splinegons_.boundaries) {
    move_vertices(splinegon.vertices, alignment_.T_world_map(), common_variance_m2_);
  }
  return splinegons_;
}

void SplinegonPipeline::reset() {
  chains_.reset();
  movers_.reset();
  if (objects_) objects_->map().reset();
  latest_ = nullptr;
  alignment_ = MapAlignment(params_.alignment);
  first_scans_.clear();
  begins_ = passes_ = 0;
  polygons_.chains.clear();
  update_.reasons.reset();
  boundaries_.clear();
  fit_boundaries(0);
}

std::uint64_t SplinegonPipeline::resume(const Polygons& chains) {
  const Pose2 T_map_world = inverse(alignment_.T_world_map());
  const std::uint64_t first_id = chains_.next_id();
  Polygons placed = chains;
  std::uint64_t next_id = first_id;
  for (Chain& chain : placed.chains) {
    chain.id = next_id++;
    move_vertices(chain.vertices, T_map_world, 0.0);
    for (ChainVertex& vertex : chain.vertices) vertex.sigma_m = std::max(vertex.sigma_m, kLeastLoadedSigma_m);
  }
  chains_.restore(placed);
  movers_.reset();
  if (objects_) objects_->map().reset();
  latest_ = nullptr;
  chains_.update_chains();
  polygons_ = chains_.latest_polygons(std::move(polygons_));
  tell_all_chains();
  are_taken_ = true;
  if (standing_ != StandingThings::kBoundaries) return first_id;
  take_boundaries();
  boundaries_.move();
  fit_boundaries(chains.stamp_ns);
  return first_id;
}

}  // namespace situation_awareness
