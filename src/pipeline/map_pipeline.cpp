// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/map_pipeline.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
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

MapKinds map_kinds_of(const std::string& names) {
  MapKinds kinds{false, false, false, false};
  std::istringstream stream(names);
  for (std::string name; std::getline(stream, name, ',');) {
    if (name == "objects") {
      kinds.objects = true;
    } else if (name == "polygons") {
      kinds.polygons = true;
    } else if (name == "splinegons") {
      kinds.boundaries = true;
    } else if (name == "grid") {
      kinds.targets = true;
    } else {
      throw std::invalid_argument("'" + name + "' is not objects, polygons, splinegons or grid");
    }
  }
  if (!kinds.are_of_scans() && !kinds.targets) throw std::invalid_argument("nothing is to be mapped");
  return kinds;
}

MapPipeline::MapPipeline(const MapPipelineParams& params, const ObjectPipelineParams& objects, const MapKinds& kinds,
                         std::uint64_t robot)
    : MapPipeline(params, objects_of(objects, kinds), kinds, robot) {}

MapPipeline::MapPipeline(const MapPipelineParams& params, const MapKinds& kinds, std::uint64_t robot)
    : MapPipeline(params, std::optional<ObjectPipelineParams>(), kinds, robot) {}

MapPipeline::MapPipeline(const MapPipelineParams& params, const std::optional<ObjectPipelineParams>& objects,
                         const MapKinds& kinds, std::uint64_t robot)
    : ids_(robot),
      kinds_(kinds),
      layers_(params.layers, objects, params.movers, standing_of(kinds)),
      map_(params.hand_over, ids_, kinds.polygons) {}

const MapDelta& MapPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                                     const Eigen::Isometry3d& T_world_lidar_end,
                                     const Eigen::Matrix3d& pose_covariance) {
  layers_.process(scan, T_world_lidar, T_world_lidar_end, pose_covariance);
  return tell(scan.stamp_ns, T_world_lidar.translation().z(), own_objects(), own_sight());
}

const MapDelta& MapPipeline::process(const Segments& segments, const Objects* objects,
                                     const Eigen::Matrix3d& pose_covariance) {
  layers_.process(segments, objects, pose_covariance);
  return tell(segments.stamp_ns, segments.height_world_m, kinds_.objects ? objects : nullptr,
              SightOfScan{segments.T_world_level, &segments.free_space});
}

const MapDelta& MapPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_odom_lidar,
                                     const Eigen::Isometry3d& T_odom_lidar_end, const InertialPlacement& placement) {
  layers_.process(scan, T_odom_lidar, T_odom_lidar_end, placement);
  const std::optional<SightOfScan> sight =
      layers_.alignment().has_begun() ? std::optional(own_sight()) : std::nullopt;  // else it is in the frame of odom
  delta_ = tell(scan.stamp_ns, T_odom_lidar.translation().z(), own_objects(), sight);
  for (const Feature& feature : delta_.changed) {
    const Eigen::AlignedBox2d box = box_around(feature.shape);
    reach_m_ = std::max({reach_m_, box.min().norm(), box.max().norm()});
  }
  if (is_elsewhere()) {
    T_world_map_ = layers_.T_world_map();
    variance_m2_ = layers_.common_variance_m2();
    all_ = map_.map(std::move(all_));
    delta_.changed = all_.features;
  }
  for (Feature& feature : delta_.changed) move(feature, *T_world_map_, variance_m2_);
  return delta_;
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
const MapDelta& MapPipeline::tell(std::int64_t stamp_ns, double height_world_m, const Objects* objects,
                                  const std::optional<SightOfScan>& sight) {
  LayerUpdates layers;
  layers.sight = sight;
  layers.stamp_ns = stamp_ns;
  layers.height_world_m = height_world_m;
  layers.objects = objects;
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

/// Of the scan that the layers took last, in their frame.
SightOfScan MapPipeline::own_sight() const {
  if (layers_.objects() != nullptr) {
    const Segments& segments = layers_.objects()->segments;
    return {segments.T_world_level, &segments.free_space};
  }
  return {layers_.polylines().T_world_level, &layers_.polylines().free_space};
}

const Objects* MapPipeline::own_objects() const {
  return layers_.objects() != nullptr ? &layers_.objects()->objects : nullptr;
}

const MapDelta& MapPipeline::take(const GridTargets& targets) {
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

MapDelta MapPipeline::whole() const {
  MapDelta result;
  Map all = map();
  result.stamp_ns = all.stamp_ns;
  result.objects_stamp_ns = all.objects_stamp_ns;
  result.map = map_.number();
  result.version = map_.version();
  result.full = true;
  result.height_world_m = all.height_world_m;
  result.changed = std::move(all.features);
  return result;
}

const Points& MapPipeline::points() const {
  return layers_.objects() != nullptr ? layers_.objects()->points : layers_.points();
}

}  // namespace situation_awareness
