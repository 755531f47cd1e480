// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/map_pipeline.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// Of the standard deviation of the map's place in the world, and m, at least: when it has moved by more all features
/// have changed.
constexpr double kMovedSigmas = 0.25, kLeastMoved_m = 0.005;
/// The same when the standard deviation of its place is so many times as large or as small.
constexpr double kOtherSigma = 1.25;

std::optional<ObjectPipelineParams> objects_of(const ObjectPipelineParams& objects, const MapKinds& kinds) {
  if (!kinds.objects) return std::nullopt;
  return objects;
}

StandingThings standing_of(const MapKinds& kinds) {
  if (kinds.boundaries) return StandingThings::kBoundaries;
  return kinds.polygons ? StandingThings::kChains : StandingThings::kNone;
}

}  // namespace

MapPipeline::MapPipeline(const MapPipelineParams& params, const ObjectPipelineParams& objects, const MapKinds& kinds,
                         std::uint64_t robot)
    : ids_(robot),
      kinds_(kinds),
      layers_(params.layers, objects_of(objects, kinds), params.movers, standing_of(kinds)),
      map_(params.hand_over, ids_, kinds.polygons) {}

const MapUpdate& MapPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                      const Eigen::Isometry3d& T_world_lidar_end,
                                      const Eigen::Matrix3d& pose_covariance) {
  layers_.process(scan, T_world_lidar, T_world_lidar_end, pose_covariance);
  return tell(scan, T_world_lidar.translation().z());
}

const MapUpdate& MapPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_odom_lidar,
                                      const Eigen::Isometry3d& T_odom_lidar_end, const InertialPlacement& placement) {
  layers_.process(scan, T_odom_lidar, T_odom_lidar_end, placement);
  update_ = tell(scan, T_odom_lidar.translation().z());
  for (const Feature& feature : update_.changed) {
    const Eigen::AlignedBox2d box = box_around(feature.shape);
    reach_m_ = std::max({reach_m_, box.min().norm(), box.max().norm()});
  }
  if (is_elsewhere()) {
    T_world_map_ = layers_.T_world_map();
    variance_m2_ = layers_.common_variance_m2();
    all_ = map_.map(std::move(all_));
    update_.changed = all_.features;
  }
  for (Feature& feature : update_.changed) move(feature, *T_world_map_, variance_m2_);
  return update_;
}

/// Whether the map is known to be elsewhere in the world than all features were told to be.
bool MapPipeline::is_elsewhere() const {
  if (!T_world_map_) return true;
  const Pose2& T = layers_.T_world_map();
  const double moved_m = (T.translation_m - T_world_map_->translation_m).norm() +
                         std::abs(wrap_to_pi(T.yaw_rad - T_world_map_->yaw_rad)) * reach_m_;
  const double sigma_m = std::sqrt(layers_.common_variance_m2()), told_m = std::sqrt(variance_m2_);
  return moved_m > std::max(kLeastMoved_m, kMovedSigmas * sigma_m) || sigma_m > kOtherSigma * told_m ||
         told_m > kOtherSigma * sigma_m;
}

/// Tells the map what the layers have after a scan, and returns what has changed, in the frame of the layers.
const MapUpdate& MapPipeline::tell(const Scan& scan, double height_world_m) {
  LayerUpdates layers;
  layers.stamp_ns = scan.stamp_ns;
  layers.height_world_m = height_world_m;
  if (layers_.objects() != nullptr) layers.objects = &layers_.objects()->objects;
  const ChainChanges& changes = layers_.chain_changes();
  const BoundaryChanges boundaries{&layers_.boundaries().map().splinegons(), &layers_.boundaries().chains()};
  if (kinds_.polygons || kinds_.boundaries) {
    chains_.changed.clear();
    for (const std::uint64_t id : changes.changed) chains_.changed.push_back(layers_.chain(id));
    chains_.gone = changes.gone;
    layers.polygons = &chains_;
    if (kinds_.boundaries && !(changes.changed.empty() && changes.gone.empty())) layers.boundaries = &boundaries;
  }
  return map_.update(layers);
}

const MapUpdate& MapPipeline::take(const GridTargets& targets) {
  LayerUpdates layers;
  layers.stamp_ns = targets.stamp_ns;
  layers.targets = &targets;
  return map_.update(layers);
}

void MapPipeline::begin_anew() {
  layers_.reset();
  map_.begin_anew();
  T_world_map_.reset();
  variance_m2_ = reach_m_ = 0.0;
}

Map MapPipeline::map(Map memory) const {
  Map result = map_.map(std::move(memory));
  if (!T_world_map_) return result;
  for (Feature& feature : result.features) move(feature, *T_world_map_, variance_m2_);
  return result;
}

const Points& MapPipeline::points() const {
  return layers_.objects() != nullptr ? layers_.objects()->points : layers_.points();
}

}  // namespace situation_awareness
