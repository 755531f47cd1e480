// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "boundary_elements.hpp"

namespace situation_awareness {

/// A boundary of biarcs between main vertices, its nodes, and the elements that are at each of its arcs. Places are
/// relative to the origin of the elements.
class BiarcChain {
 public:
  using Vector6d = Eigen::Matrix<double, 6, 1>;

  /// m. An element's arc is looked for beside that of the element before, and everywhere if it is farther from these:
  /// as far as elements are from each other, and off the chain.
  static constexpr double kNear_m = 0.3;
  /// m. Least length of an arc.
  static constexpr double kShortestArc_m = 1e-6;

  /// A main vertex. At a corner two tangents.
  struct Node {
    Eigen::Vector2d p_m;
    double yaw_in_rad, yaw_out_rad;
    bool corner;
    Eigen::Vector2d found_m;  ///< of a corner: where it was found
  };
  /// Half of a biarc, by the node that it is at.
  struct Arc {
    Eigen::Vector2d p_m, along;  ///< of the node, and its tangent there
    double curvature_1pm;
    Vector6d curvature_slope;  ///< by x, y, yaw of the node before, and of the one after
    Eigen::Vector2d begin_m;
    Eigen::Vector2d begin_along;  ///< of the boundary there, at a corner in the middle of both tangents
    double begin_yaw_rad, length_m;
  };
  struct Residual {
    double distance_m;
    Vector6d slope;  ///< by x, y, yaw of the node before, and of the one after
  };

  std::size_t biarcs() const { return closed ? nodes.size() : nodes.size() - 1; }
  std::size_t next_node(std::size_t k) const { return k + 1 < nodes.size() ? k + 1 : 0; }
  /// Whether the arc's begin has one tangent and an arc before it.
  bool is_smooth(std::size_t arc) const;

  /// The arcs between the nodes.
  void compute_arcs();

  /// Assigns the elements for the first time: each to the arc with the nearest chord that has the element's free side,
  /// of those near that of the element before if that is near enough. False if hardly any is.
  bool assign_nearest(const BoundaryElements& elements);
  /// Moves each element from its arc to a neighbour of that, if it lies beyond the normal at the arc's end.
  void assign_stepwise(const BoundaryElements& elements);

  /// Signed distance to the arc's circle, positive to the left.
  Residual residual_of(const Eigen::Vector2d& p_m, std::size_t index) const;
  /// The residuals of all elements are set to those of the present arcs, each element at the arc that it is assigned
  /// to.
  void compute_residuals(const BoundaryElements& elements);

  /// Along an arc from its begin to the point of its circle that is nearest to a place.
  double way_to_foot_m(const Eigen::Vector2d& p_m, std::size_t index) const;

  bool closed = false;
  std::vector<Node> nodes;
  std::vector<Arc> arcs;              ///< two of each biarc
  std::vector<std::size_t> arc_of;    ///< of each element
  std::vector<Residual> of_elements;  ///< as the arcs are
};

/// The point of an arc so far after its begin.
Eigen::Vector2d point_on(const BiarcChain::Arc& arc, double s_m);

}  // namespace situation_awareness
