// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

/// Distance of a point from the segment between two others, ends included.
inline double distance_from_segment_m(const Eigen::Vector2d& p_m, const Eigen::Vector2d& from_m,
                                      const Eigen::Vector2d& to_m) {
  const Eigen::Vector2d way_m = to_m - from_m;
  const Eigen::Vector2d d_m = p_m - from_m;
  const double part = std::clamp(d_m.dot(way_m) / std::max(way_m.squaredNorm(), 1e-18), 0.0, 1.0);
  return (d_m - part * way_m).norm();
}

/// Simplification of chains of points (Douglas and Peucker, 1973). It keeps its memory: no allocation after warm-up.
class Simplification {
 public:
  /// The points to be kept between `first` and `last`, both included, as increasing indices, appended to `kept` but for
  /// the first. A point is kept if it is farther from the chord than `max_offset_m` and its own `allowance_m(i)`.
  /// `at(i)`: the points.
  template <class At, class Allowance>
  void add(std::size_t first, std::size_t last, double max_offset_m, const At& at, const Allowance& allowance_m,
           std::vector<std::size_t>& kept) {
    open_.clear();
    open_.emplace_back(first, last);
    while (!open_.empty()) {
      const auto [from, to] = open_.back();
      open_.pop_back();
      double most_m = max_offset_m;
      std::size_t farthest = from;
      for (std::size_t i = from + 1; i < to; ++i) {
        const double off_m = distance_from_segment_m(at(i), at(from), at(to)) - allowance_m(i);
        if (off_m <= most_m) continue;
        most_m = off_m;
        farthest = i;
      }
      if (farthest == from) {
        kept.push_back(to);
      } else {  // the first part is done first
        open_.emplace_back(farthest, to);
        open_.emplace_back(from, farthest);
      }
    }
  }

 private:
  std::vector<std::pair<std::size_t, std::size_t>> open_;
};

}  // namespace situation_awareness
