// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

/// Position of an element of a map, in the frame of the map.
struct MapPosition {
  std::uint64_t id;
  Eigen::Vector2d position_m;
};

struct PathPoint {
  std::int64_t stamp_ns;
  Eigen::Vector2d position_m;
};

/// The recent path of each element of the map. It is deleted with its element, and all are deleted when time goes back.
class MapHistory {
 public:
  /// Adds the elements of a map, and deletes points older than `length_s` before it.
  void add(std::int64_t stamp_ns, const std::vector<MapPosition>& elements, double length_s);

  /// From the oldest point to the current position; empty for an element that is not on the map.
  const std::deque<PathPoint>& path(std::uint64_t id) const;

  void clear() { paths_.clear(); }

 private:
  struct Path {
    std::deque<PathPoint> points;
    std::uint64_t last_map = 0;
  };

  std::unordered_map<std::uint64_t, Path> paths_;
  std::uint64_t maps_ = 0;
  std::int64_t stamp_ns_ = 0;
};

}  // namespace situation_awareness
