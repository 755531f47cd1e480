// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/ellipse.hpp"

namespace situation_awareness {

/// The outline of a thing that moves, in the world, with a margin for what is not known of it.
class MoverOutline {
 public:
  MoverOutline() = default;
  MoverOutline(const Ellipse& world, double margin_m);
  MoverOutline(const Box& world, double margin_m);

  const Eigen::Vector2d& center_world_m() const { return center_world_m_; }
  /// Of all that it covers, from the centre.
  double reach_m() const { return reach_m_; }

  /// Whether a point is inside, or beside it by the margin at most.
  bool covers(const Eigen::Vector2d& p_world_m) const;

  /// Where a ray is inside, without the margin.
  struct Crossing {
    double entry_m = 0.0, exit_m = 0.0;  ///< along the ray from its origin
  };
  /// None if the ray does not cross it, or begins inside. `direction_world`: unit.
  std::optional<Crossing> crossing(const Eigen::Vector2d& origin_world_m, const Eigen::Vector2d& direction_world) const;

  void move(const Eigen::Vector2d& by_world_m) { center_world_m_ += by_world_m; }

 private:
  Eigen::Vector2d center_world_m_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d along_world_ = Eigen::Vector2d::UnitX();  ///< unit, its own x axis
  Eigen::Vector2d half_m_ = Eigen::Vector2d::Zero();        ///< along its own axes
  bool is_box_ = false;
  double margin_m_ = 0.0, reach_m_ = 0.0;
};

/// Where a thing that moves has been.
struct MoverTrace {
  MoverOutline outline;
  /// Elements first seen before this are not of it.
  std::int64_t since_ns = std::numeric_limits<std::int64_t>::min();
};

/// What is kept off a map of what stands, at the time of a scan.
struct Movers {
  std::vector<MoverOutline> outlines;  ///< hits on these are not mapped
  std::vector<MoverTrace> traces;      ///< the boundary of these is given up where the scan does not hit it

  bool cover(const Eigen::Vector2d& p_world_m) const {
    for (const MoverOutline& outline : outlines) {
      if (outline.covers(p_world_m)) return true;
    }
    return false;
  }
};

}  // namespace situation_awareness
