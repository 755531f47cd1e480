// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/map_pipeline.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>

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

/// Moves all times by the same, if the map is not of before a time.
void shift_before(std::int64_t stamp_ns, Map& map) {
  if (map.stamp_ns < stamp_ns) return;
  const std::int64_t earlier_ns = map.stamp_ns - (stamp_ns - 1);
  map.stamp_ns -= earlier_ns;
  for (Feature& feature : map.features) {
    feature.first_seen_ns -= earlier_ns;
    feature.last_seen_ns -= earlier_ns;
    if (feature.last_absent_ns) *feature.last_absent_ns -= earlier_ns;
    if (feature.first_absent_ns) *feature.first_absent_ns -= earlier_ns;
  }
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
  resume_before(scan.stamp_ns);
  layers_.process(scan, T_world_lidar, T_world_lidar_end, pose_covariance);
  return tell(scan.stamp_ns, T_world_lidar.translation().z(), own_objects(), own_sight());
}

const MapDelta& MapPipeline::process(const Segments& segments, const Objects* objects,
                                     const Eigen::Matrix3d& pose_covariance) {
  resume_before(segments.stamp_ns);
  layers_.process(segments, objects, pose_covariance);
  return tell(segments.stamp_ns, segments.height_world_m, kinds_.objects ? objects : nullptr,
              SightOfScan{segments.T_world_level, &segments.free_space});
}

const MapDelta& MapPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_odom_lidar,
                                     const Eigen::Isometry3d& T_odom_lidar_end, const InertialPlacement& placement) {
  resume_before(scan.stamp_ns);
  layers_.process(scan, T_odom_lidar, T_odom_lidar_end, placement);
  const std::optional<SightOfScan> sight =
      layers_.alignment().has_begun() ? std::optional(own_sight()) : std::nullopt;  // else it is in the frame of odom
  delta_ = tell(scan.stamp_ns, T_odom_lidar.translation().z(), own_objects(), sight);
  place_in_world();
  return delta_;
}

/// Moves the features of delta_ from the frame of the layers to the world: all of the map's, where it has moved there.
void MapPipeline::place_in_world() {
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
  resume_before(targets.stamp_ns);
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
  resumed_.reset();
}

SavedMap MapPipeline::saved() const { return {"", ids_.upcoming(), map()}; }

const MapDelta& MapPipeline::resume(const SavedMap& saved) {
  Map standing = saved.map;
  standing.features.erase(std::remove_if(standing.features.begin(), standing.features.end(),
                                         [](const Feature& feature) { return feature.motion == Motion::kMoving; }),
                          standing.features.end());
  if (has_map()) shift_before(map_.stamp_ns() + 1, standing);
  ids_.resume(saved.next_id);
  const MapDelta& result = restore(standing, has_map() ? map_.stamp_ns() : standing.stamp_ns);
  resumed_ = std::move(standing);
  return result;
}

/// Moves the times of a saved map that was just resumed to before the first scan after it: it may be of another clock.
void MapPipeline::resume_before(std::int64_t stamp_ns) {
  if (!resumed_) return;
  Map saved = std::move(*resumed_);
  resumed_.reset();
  if (saved.stamp_ns < stamp_ns) return;
  shift_before(stamp_ns, saved);
  restore(saved, saved.stamp_ns);
}

/// Makes a map the one of now, at a time, and tells all of it.
const MapDelta& MapPipeline::restore(const Map& saved, std::int64_t stamp_ns) {
  // Chains are what polylines and boundaries go on as, where they are mapped.
  Polygons chains;
  chains.stamp_ns = saved.stamp_ns;
  chains.height_world_m = saved.height_world_m;
  std::vector<FeatureOfChain> features_of_chains;
  double elements = 0.0;
  const double spacing_m = layers_.chain_spacing_m();
  for (const Feature& feature : saved.features) {
    const auto* const lines = kinds_.polygons ? std::get_if<PolylineShape>(&feature.shape) : nullptr;
    const auto* const arcs = kinds_.polygons || kinds_.boundaries ? std::get_if<ArcShape>(&feature.shape) : nullptr;
    if (lines == nullptr && arcs == nullptr) continue;
    Chain& chain = chains.chains.emplace_back();
    chain.first_seen_ns = feature.first_seen_ns;
    chain.last_seen_ns = feature.last_seen_ns;
    chain.p_exists = feature.p_exists;
    chain.closed = lines != nullptr ? lines->closed : arcs->closed;
    if (lines != nullptr) {
      chain.vertices = lines->vertices;
    } else {
      elements += length_m(splinegon_of(*arcs)) / spacing_m;
      if (!(elements <= static_cast<double>(PolygonMap::kMaxElements))) {
        throw std::invalid_argument("its boundaries are too long: they would be more than " +
                                    std::to_string(PolygonMap::kMaxElements) + " elements");
      }
      chain.vertices = lines_along(splinegon_of(*arcs), spacing_m);
      std::reverse(chain.vertices.begin(), chain.vertices.end());
    }
    features_of_chains.push_back({feature.id, 0, arcs != nullptr});
  }
  std::uint64_t chain = layers_.resume(chains);
  for (FeatureOfChain& of : features_of_chains) of.chain = chain++;
  Map in_map = saved;
  for (Feature& feature : in_map.features) move(feature, inverse(layers_.T_world_map()), 0.0);
  map_.resume(in_map, features_of_chains);
  const MapDelta& told = tell(stamp_ns, saved.height_world_m, nullptr, std::nullopt);
  if (!T_world_map_) return told;
  delta_ = told;
  place_in_world();
  return delta_;
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
