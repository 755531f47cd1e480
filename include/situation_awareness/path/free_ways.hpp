// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/path/avoidance.hpp"
#include "situation_awareness/path/obstacles.hpp"

namespace situation_awareness {

/// Shortest ways, of straight lines, that keep their distance from obstacles, for a vehicle that can turn on the spot.
/// They are found on the nodes of a lattice over a rectangle, and drawn straight where that is free. All in the world.
class FreeWays {
 public:
  /// Throws std::invalid_argument unless the rectangle has an area, the step is above 0 and there are at most 1e6
  /// nodes.
  FreeWays(const Eigen::Vector2d& low_world_m, const Eigen::Vector2d& high_world_m, double step_m);

  /// From now on ways keep margin_m(piece, 0, params) from each piece.
  void set(const Obstacles& obstacles, const AvoidanceParams& params);

  bool is_free(const Eigen::Vector2d& p_world_m) const;

  /// Whether the straight line is. Where its begin is too near to something, it comes no nearer to that.
  bool is_free(const Eigen::Vector2d& from_world_m, const Eigen::Vector2d& to_world_m) const;

  /// Length of a way, the straight line where it is free, else along the lattice; infinite if there is none. Remembers
  /// what it computed for `to_world_m`.
  double length_m(const Eigen::Vector2d& from_world_m, const Eigen::Vector2d& to_world_m);

  /// The corners of a way, without its begin, with its end; empty if there is none.
  std::vector<Eigen::Vector2d> way(const Eigen::Vector2d& from_world_m, const Eigen::Vector2d& to_world_m);

 private:
  struct Field {
    std::vector<double> length_m;   ///< to the goal, by node
    std::vector<std::size_t> next;  ///< node towards it; kNone: the goal itself
  };
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);

  Eigen::Vector2d node_m(std::size_t node) const;
  std::vector<std::size_t> nodes_near(const Eigen::Vector2d& p_m) const;
  const Field& field_to(const Eigen::Vector2d& goal_m);
  std::size_t entry(const Eigen::Vector2d& from_m, const Field& field, double& length_m) const;

  Eigen::Vector2d low_m_;
  double step_m_;
  std::size_t columns_, rows_;
  Obstacles obstacles_;
  AvoidanceParams params_;
  std::vector<std::uint8_t> free_;                     ///< by node
  std::vector<std::uint8_t> edges_;                    ///< bits: free lines to the east, north-east, north, north-west
  std::map<std::pair<double, double>, Field> fields_;  ///< by goal
};

}  // namespace situation_awareness
