// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/timed_polygon_map.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/covariance.hpp"

namespace situation_awareness {
namespace {

/// m. Places farther from the world's origin than this have no place in the grid of the map, either.
constexpr double kFarthest_m = 1e6;
/// rad. A yaw of so many turns is no yaw of a sensor.
constexpr double kMostYaw_rad = 1e6;
/// The length of a unit vector may be off by so much.
constexpr double kLengthError = 1e-6;

}  // namespace

bool can_be_mapped(const Polylines& polylines, const Eigen::Matrix3d& pose_covariance) {
  const Pose2& T = polylines.T_world_level;
  const auto is_size = [](double value) { return value >= 0.0 && value < kFarthest_m; };
  const auto is_near = [](const Eigen::Vector2d& p_m) {
    return p_m.allFinite() && p_m.cwiseAbs().maxCoeff() < kFarthest_m;
  };
  if (!is_near(T.translation_m) || !(std::abs(T.yaw_rad) < kMostYaw_rad) ||
      !is_size(std::abs(polylines.height_world_m)) || !is_size(polylines.resolution_rad) ||
      !is_size(polylines.range_sigma_m) || !is_positive_semidefinite(pose_covariance) ||
      !is_free_space(polylines.free_space.azimuth_rad, polylines.free_space.range_m)) {
    return false;
  }
  const Eigen::Matrix2d R_world_level = T.rotation();
  return std::all_of(polylines.hits.begin(), polylines.hits.end(), [&](const PolylineHit& hit) {
    return is_near(hit.p_level_m) && is_near(R_world_level * hit.p_level_m + T.translation_m) &&
           std::abs(hit.normal_level.norm() - 1.0) < kLengthError && hit.sigma_m > 0.0 && is_size(hit.sigma_m);
  });
}

TimedPolygonMap::TimedPolygonMap(const PolygonMapParams& params, const ChainStateParams& states,
                                 double reset_time_jump_s)
    : params_(params), states_(states), order_(reset_time_jump_s), map_(params) {
  states_.validate();
}

PolygonMapUpdate TimedPolygonMap::update(const Polylines& polylines, const Eigen::Matrix3d& pose_covariance,
                                         const Movers& movers, PolygonMapUpdate memory) {
  PolygonMapUpdate report = std::move(memory);
  report.fused = report.created = report.removed = report.on_movers = 0;
  report.reasons.reset();
  if (!can_be_mapped(polylines, pose_covariance)) {
    ++report.reasons[kCannotBeUsed];
    return report;
  }
  if (resumed_) {
    // The clock may have begun anew since the map was saved; no such scan is refused.
    if (map_stamp_ns_ != kNoStamp && polylines.stamp_ns <= map_stamp_ns_) shift_to(polylines.stamp_ns - 1);
    order_.reset();
    transit_ns_ = kNoStamp;
    resumed_ = false;
  }
  const std::int64_t previous_ns = order_.latest_ns();
  bool restarted = false;
  switch (order_.judge(polylines.stamp_ns)) {
    case StampOrder::Verdict::kNext:
      break;
    case StampOrder::Verdict::kRefused:
      ++report.reasons[order_.doubted() > 0 ? kAnotherTime : polylines.stamp_ns == previous_ns ? kRepeats : kGoesBack];
      return report;
    case StampOrder::Verdict::kRestart:
      begin_anew();
      restarted = true;
      break;
  }
  if (transit_ns_ == kNoStamp ||
      (previous_ns != kNoStamp && seconds_between(previous_ns, polylines.stamp_ns) > params_.absence_s)) {
    transit_ns_ = polylines.stamp_ns;
  }
  report = map_.update(polylines, pose_covariance, movers, std::move(report));
  if (restarted) ++report.reasons["time jumped back: new map"];
  map_stamp_ns_ = polylines.stamp_ns;
  polygons_.height_world_m = polylines.height_world_m;
  make_polygons(polylines.stamp_ns, map_.update_due_chains());
  return report;
}

/// Only chains that changed, and those that are new, can have another state within a transit.
void TimedPolygonMap::make_polygons(std::int64_t stamp_ns, const ChainChanges& changes) {
  polygons_.stamp_ns = stamp_ns;
  std::vector<Chain>& chains = polygons_.chains;
  const auto is_below = [](const Chain& chain, std::uint64_t id) { return chain.id < id; };
  if (!changes.gone.empty()) {
    // New ids are the greatest, and what goes is mostly new.
    const auto first = std::lower_bound(chains.begin(), chains.end(), changes.gone.front(), is_below);
    auto left = static_cast<std::size_t>(first - chains.begin());
    for (std::size_t k = left; k < chains.size(); ++k) {
      const bool is_gone = std::binary_search(changes.gone.begin(), changes.gone.end(), chains[k].id);
      if (!is_gone) std::swap(chains[left++], chains[k]);
    }
    for (; chains.size() > left; chains.pop_back()) spare_.push_back(std::move(chains.back()));
  }
  for (const std::uint64_t id : changes.changed) {
    auto place = std::lower_bound(chains.begin(), chains.end(), id, is_below);
    if (place == chains.end() || place->id != id) {
      if (spare_.empty()) spare_.emplace_back();
      place = chains.insert(place, std::move(spare_.back()));
      spare_.pop_back();
    }
    copy_with_room(*map_.chain(id), *place);
    place->state = state_of(*place, stamp_ns, transit_ns_, states_);
    if (place->state == ChainState::kNew) new_.push_back(id);
  }
  if (judged_transit_ns_ != transit_ns_) {
    new_.clear();
    for (const Chain& chain : chains) new_.push_back(chain.id);
    judged_transit_ns_ = transit_ns_;
  }
  std::sort(new_.begin(), new_.end());
  new_.erase(std::unique(new_.begin(), new_.end()), new_.end());
  const auto is_not_new = [&](std::uint64_t id) {
    const auto place = std::lower_bound(chains.begin(), chains.end(), id, is_below);
    if (place == chains.end() || place->id != id) return true;
    place->state = state_of(*place, stamp_ns, transit_ns_, states_);
    return place->state != ChainState::kNew;
  };
  new_.erase(std::remove_if(new_.begin(), new_.end(), is_not_new), new_.end());
}

Polygons TimedPolygonMap::at(std::int64_t stamp_ns) const {
  Polygons then = polygons_;
  then.stamp_ns = stamp_ns;
  return then;
}

void TimedPolygonMap::begin_anew() {
  map_.restore({});
  map_.update_chains();
  polygons_.chains.clear();
  map_stamp_ns_ = transit_ns_ = kNoStamp;
  resumed_ = false;
}

void TimedPolygonMap::reset() {
  begin_anew();
  order_.reset();
}

PolygonMapSnapshot TimedPolygonMap::snapshot() {
  if (map_stamp_ns_ != kNoStamp) make_polygons(polygons_.stamp_ns, map_.update_chains());
  PolygonMapSnapshot result = map_.snapshot();
  result.height_world_m = polygons_.height_world_m;
  result.polygons = polygons_;
  return result;
}

void TimedPolygonMap::resume(const PolygonMapSnapshot& snapshot) {
  PolygonMapSnapshot moved = snapshot;
  const std::int64_t latest_ns = stamp_ns();
  if (latest_ns != kNoStamp && moved.stamp_ns > latest_ns) moved.shift_time(latest_ns - moved.stamp_ns);
  map_.restore(moved);
  map_stamp_ns_ = moved.stamp_ns == PolygonMapSnapshot::kNoStamp ? kNoStamp : moved.stamp_ns;
  resumed_ = true;
  if (latest_ns == kNoStamp && map_stamp_ns_ != kNoStamp) order_.judge(map_stamp_ns_);
  polygons_.height_world_m = moved.height_world_m;
  // All of it is from before the next transit.
  transit_ns_ = std::numeric_limits<std::int64_t>::max();
  make_polygons(stamp_ns() == kNoStamp ? 0 : stamp_ns(), map_.update_chains());
}

void TimedPolygonMap::shift_to(std::int64_t stamp_ns) {
  PolygonMapSnapshot moved = map_.snapshot();
  moved.shift_time(stamp_ns - moved.stamp_ns);
  // What was seen by another clock does not say what is free now.
  moved.watches.assign(moved.watches.size(), {});
  moved.next_watch = 0;
  map_.restore(moved);
}

}  // namespace situation_awareness
