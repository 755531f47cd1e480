// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/map_history.hpp"

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

constexpr double kStep_m = 0.02;  ///< closer points are one: what stands gathers none
constexpr std::size_t kMaxPoints = 2000;

}  // namespace

void MapHistory::add(const Objects& map, double length_s) {
  if (map.stamp_ns < stamp_ns_) clear();
  stamp_ns_ = map.stamp_ns;
  ++maps_;
  for (const Object& object : map.objects) {
    Path& path = paths_[object.id];
    path.last_map = maps_;
    std::deque<PathPoint>& points = path.points;
    const PathPoint now{map.stamp_ns, object.ellipse_world.center_m};
    const auto count = points.size();
    // The latest point is where the element is, and stays only once it is a step away from the one before.
    if (count >= 2 && (points[count - 1].position_world_m - points[count - 2].position_world_m).norm() < kStep_m) {
      points.back() = now;
    } else {
      points.push_back(now);
    }
    while (points.size() > kMaxPoints || seconds_between(points.front().stamp_ns, map.stamp_ns) > length_s) {
      points.pop_front();
    }
  }
  for (auto path = paths_.begin(); path != paths_.end();) {
    path = path->second.last_map == maps_ ? std::next(path) : paths_.erase(path);
  }
}

const std::deque<PathPoint>& MapHistory::path(std::uint64_t id) const {
  static const std::deque<PathPoint> kNone;
  const auto found = paths_.find(id);
  return found == paths_.end() ? kNone : found->second.points;
}

}  // namespace situation_awareness
