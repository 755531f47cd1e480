// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/splinegon_pipeline.hpp"

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <utility>

#include "situation_awareness/map/polygons/map_snapshot.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"

namespace situation_awareness {
namespace {

/// Elements of a boundary, at least: fewer are no large obstacle.
constexpr std::size_t kFewestElements = 6;

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
  take_polylines(scan, T_odom_lidar, T_odom_lidar_end);
  const Eigen::Matrix3d covariance = alignment_.align(chains_, placement, polylines_);
  return map_polylines(covariance, alignment_.variance_m2(kFromMiddle_m));
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
  polygons_ = chains_.polygons(std::move(polygons_));
  take_boundaries();
  return map_.update(polylines_.stamp_ns, boundaries_, common_variance_m2);
}

/// Chains run clockwise around what they are the boundary of.
void SplinegonPipeline::take_boundaries() {
  const Pose2& T_world_map = alignment_.T_world_map();
  const Eigen::Matrix2d R_world_map = T_world_map.rotation();
  std::size_t count = 0;
  for (std::size_t c = 0; c < polygons_.chains.size(); ++c) {
    const Chain& chain = polygons_.chains[c];
    chains_.elements_of(c, elements_);
    if (elements_.size() < kFewestElements) continue;
    if (boundaries_.size() == count) boundaries_.emplace_back();
    ObstacleBoundary& boundary = boundaries_[count++];
    boundary.id = chain.id;
    boundary.closed = chain.closed;
    boundary.first_seen_ns = chain.first_seen_ns;
    boundary.last_seen_ns = chain.last_seen_ns;
    boundary.elements.clear();
    std::for_each(elements_.rbegin(), elements_.rend(), [&](const BoundaryElement& element) {
      boundary.elements.push_back({T_world_map * element.p_world_m,
                                   R_world_map * Eigen::Vector2d(-element.along_world.y(), element.along_world.x()),
                                   element.variance_m2});
    });
  }
  boundaries_.resize(count);
}

void SplinegonPipeline::reset() {
  const PolygonMapSnapshot before = chains_.snapshot();
  PolygonMapSnapshot nothing;
  nothing.next_id = before.next_id;
  nothing.watches.resize(before.watches.size());
  chains_.restore(nothing);
  alignment_ = MapAlignment(params_.alignment);
  polygons_.chains.clear();
  boundaries_.clear();
  map_.update(0, boundaries_, 0.0);
}

void SplinegonPipeline::resume(const Splinegons& splinegons) {
  const Pose2 T_map_world = inverse(alignment_.T_world_map());
  Polygons polygons;
  polygons.stamp_ns = splinegons.stamp_ns;
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
  map_.update(splinegons.stamp_ns, boundaries_, 0.0);
}

}  // namespace situation_awareness
