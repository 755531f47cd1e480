// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

/// When each place of a disc about a vehicle was last seen to be free: cells on a lattice in the world, the nearest to
/// the vehicle. What it leaves is forgotten. No allocation after construction.
class SeenGround {
 public:
  /// Of a disc of `radius_m` > 0.
  explicit SeenGround(double radius_m);

  void clear();

  /// Notes for the cells within the radius of a place that they are free at `stamp_ns`, where `is_seen(p_world_m)`.
  template <class IsSeen>
  void see(const Eigen::Vector2d& center_world_m, std::int64_t stamp_ns, IsSeen&& is_seen) {
    visit(center_world_m, [&](const Eigen::Vector2d& p_world_m, Cell& cell, const Index& index) {
      if (is_seen(p_world_m)) cell = {index, stamp_ns, true};
      return true;
    });
  }

  /// Whether all cells within the radius are seen since `since_ns` and not after `until_ns`, those aside for which
  /// `needs_no_look(p_world_m)`.
  template <class NeedsNoLook>
  bool was_seen(const Eigen::Vector2d& center_world_m, std::int64_t since_ns, std::int64_t until_ns,
                NeedsNoLook&& needs_no_look) {
    return visit(center_world_m, [&](const Eigen::Vector2d& p_world_m, const Cell& cell, const Index& index) {
      const bool is_seen =
          cell.is_used && cell.index == index && cell.stamp_ns >= since_ns && cell.stamp_ns <= until_ns;
      return is_seen || needs_no_look(p_world_m);
    });
  }

  double cell_m() const { return cell_m_; }

 private:
  using Index = Eigen::Matrix<std::int64_t, 2, 1>;
  struct Cell {
    Index index = Index::Zero();
    std::int64_t stamp_ns = 0;
    bool is_used = false;
  };

  std::int64_t index_of(double p_m) const;

  /// Calls `use` for each cell until it returns false, which is the result then.
  template <class Use>
  bool visit(const Eigen::Vector2d& center_world_m, Use&& use) {
    const Index middle(index_of(center_world_m.x()), index_of(center_world_m.y()));
    const auto count = static_cast<std::int64_t>(side_);
    const std::int64_t reach = (count - 1) / 2;
    for (std::int64_t x = middle.x() - reach; x <= middle.x() + reach; ++x) {
      for (std::int64_t y = middle.y() - reach; y <= middle.y() + reach; ++y) {
        const Eigen::Vector2d p_world_m = cell_m_ * Eigen::Vector2d(static_cast<double>(x), static_cast<double>(y));
        if ((p_world_m - center_world_m).norm() > radius_m_) continue;
        const std::int64_t column = ((x % count) + count) % count, row = ((y % count) + count) % count;
        if (!use(p_world_m, cells_[static_cast<std::size_t>(column * count + row)], Index(x, y))) return false;
      }
    }
    return true;
  }

  double radius_m_, cell_m_;
  std::size_t side_;  ///< odd
  std::vector<Cell> cells_;
};

}  // namespace situation_awareness
