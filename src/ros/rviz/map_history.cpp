// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/map_history.hpp"

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

constexpr double kStep_m = 0.02;  ///< closer points are merged, so that standing elements gather none
constexpr std::size_t kMaxPoints = 2000;

}  // namespace

void MapHistory::add(std::int64_t stamp_ns, const std::vector<MapPosition>& elements, double length_s) {
  if (stamp_ns < stamp_ns_) clear();
  stamp_ns_ = stamp_ns;
  ++maps_;
  for (const MapPosition& element : elements) {
    Path& path = paths_[element.id];
    path.last_map = maps_;
    std::deque<PathPoint>& points = path.points;
    const PathPoint now{stamp_ns, element.position_m};
    const auto count = points.size();
    // The latest point is the current position; it is kept only when it is a step away from the previous one.
    if (count >= 2 && (points[count - 1].position_m - points[count - 2].position_m).norm() < kStep_m) {
      points.back() = now;
    } else {
      points.push_back(now);
    }
    while (points.size() > kMaxPoints || seconds_between(points.front().stamp_ns, stamp_ns) > length_s) {
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
