// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness {

/// What the scanner's poses in the map say of each other, and the least motions of them, and of what was drawn from
/// them, with which a closed loop agrees (docs/math/splinegons.md).
///
///   symbol   meaning                                                                                size
///   x_k      motion of pose k, and of what was drawn at its time: of x, y (m), and yaw (rad)        3
///   A, b     of a tie of two poses: cost d' A d / 2 - b' d of the difference d = x_k - x_j of       3x3, 3
///            their motions, both about the map's origin
///
/// A pose is tied to the one before by inertial navigation, and to those of the times at which what it sees was drawn.
/// What is older is told by fewer poses, a twelfth of its age apart at most: those between are marginalized, so that
/// what they said of the others stays exact. What is older than 25 minutes stays where it is. So the cost is bounded:
/// at most kMostPoses, about 150 in hours of one pose a second.
class PoseGraph {
 public:
  /// s. Time between two poses.
  static constexpr double kPeriod_s = 1.0;
  static constexpr std::size_t kMostPoses = 200;

  PoseGraph();

  /// Whether the pose before is so old that one is to be added.
  bool is_due(std::int64_t stamp_ns) const;

  /// Adds a pose later than those before, the scanner's. What follows needs one at least.
  void add(std::int64_t stamp_ns, const Eigen::Vector2d& p_map_m);

  /// Of the pose added last: a place that it sees was drawn at this time, and it is now `residual_m` away from that
  /// along a unit vector. Weight in 1 / m^2.
  void tie(std::int64_t drawn_ns, const Eigen::Vector2d& p_map_m, const Eigen::Vector2d& normal_map, double residual_m,
           double weight);
  /// Of the pose added last: A and b of the difference of its motion, about a place, to that of this time.
  void tie(std::int64_t drawn_ns, const Eigen::Vector2d& center_m, const Eigen::Matrix3d& A, const Eigen::Vector3d& b);

  /// Finds the motions.
  void solve();
  /// That of what was drawn at a time.
  Pose2 motion_of(std::int64_t drawn_ns) const;
  /// All were moved so.
  void move();
  /// Number of poses.
  std::size_t size() const { return nodes_.size(); }

 private:
  struct Node {
    std::int64_t stamp_ns = 0;
    Eigen::Vector2d p_map_m = Eigen::Vector2d::Zero();
    Eigen::Vector3d x = Eigen::Vector3d::Zero();
  };

  Eigen::Index unknowns() const { return static_cast<Eigen::Index>(3 * nodes_.size()); }
  void thin_out();
  void marginalize(std::size_t node);
  void remove(std::size_t node);
  std::vector<Node>::const_iterator first_since(std::int64_t stamp_ns) const;
  std::size_t nearest(std::int64_t drawn_ns) const;
  void relate(std::size_t node, std::size_t other, const Eigen::Matrix3d& A, const Eigen::Vector3d& b);

  std::vector<Node> nodes_;
  // Normal equations of all motions, of which the first unknowns() rows and columns count.
  Eigen::MatrixXd H_, factor_;
  Eigen::VectorXd b_, x_;
};

}  // namespace situation_awareness
