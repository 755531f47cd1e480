// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "situation_awareness/map/polygons/joints.hpp"
#include "situation_awareness/map/polygons/near_elements.hpp"
#include "situation_awareness/map/polygons/surfels.hpp"

namespace situation_awareness {

/// Makes chains of elements of a map: which one follows which along a boundary. It keeps its memory: no
/// allocation after warm-up. Linear in the elements. Indices are those of the list that link() is given.
class ChainLinks {
 public:
  /// The scan after which chains are made.
  struct View {
    Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();  ///< of the sensor
    double resolution_rad = 0.0;                          ///< azimuth between its beams
    double step_s = 0.0;                                  ///< since the one before; 0: it was seen already
  };

  /// A run of ordered().
  struct Run {
    std::size_t first = 0, end = 0;
    bool closed = false;
    double size_m = 0.0;  ///< diagonal of the box, along the axes of the world, around its elements
    /// Chains are listed in ascending order of it: whether the elements make a loop, and the index of the first one.
    /// The order does not depend on which other elements are linked.
    std::pair<bool, Surfels::Index> rank;
  };

  /// Each element goes on with the nearest one ahead of it on its line, of those that agree; then, where neither goes
  /// on, with one up to `max_gap_m` ahead; then around a corner whose sides both come near it (docs/math/polygons.md,
  /// "Chains"). What is small has one chain, however its elements are turned. Whether known chains meet so is decided
  /// by `joints`, which see what the scan hit. `near`: the neighbours of the elements, within reach_m(). Those that are
  /// not shown are left out.
  void link(const std::vector<LinkElement>& elements, const NearElements& near, double spacing_m, double max_gap_m,
            const View& view, Joints& joints);

  /// Within which link() has to know the neighbours of the elements.
  static double reach_m(double spacing_m);

  /// Each of the elements that are shown once, chain by chain, from right to left: its index in the map.
  const std::vector<Surfels::Index>& ordered() const { return ordered_; }
  const std::vector<Run>& chains() const { return chains_; }
  /// Whether a chain goes on around a corner or a gap beyond this place of ordered().
  bool is_before_joint(std::size_t place) const { return before_joint_[place]; }
  /// The next one of each element of the list along its line, without joints; none at an end.
  const std::vector<NearElements::Index>& line_right() const { return line_right_; }
  const std::vector<NearElements::Index>& line_left() const { return line_left_; }

 private:
  using Index = NearElements::Index;
  using Elements = std::vector<LinkElement>;

  template <class Search, class Cost>
  void link_best(const Search& search, bool at_joints, const Cost& cost);
  template <class Search, class Cost>
  void see_joints(const Elements& elements, const Search& search, const View& view, Joints& joints, const Cost& cost);
  void keep_lines(const Elements& elements);
  void find_directions(const Elements& elements);
  void leave_out_crossed(const Elements& elements, const NearElements& near, double spacing_m);
  void walk(const Elements& elements, const NearElements& near);
  void walk_from(const Elements& elements, Index first, bool closed);
  void join_small(const Elements& elements, const NearElements& near);
  std::size_t group_of(std::size_t chain) const;
  bool order_around(const Elements& elements, std::size_t first, double size_m);

  std::vector<Index> right_, left_;  ///< the next element of each
  std::vector<Index> best_right_, best_left_;
  std::vector<Index> line_right_, line_left_;
  std::vector<Eigen::Vector2d> along_;  ///< of the boundary, at each end of a chain
  std::vector<int> run_;                ///< elements on a line with it, up to those of a wall
  std::vector<std::uint64_t> name_;     ///< of most of these: LinkElement::chain
  std::vector<double> cost_right_, cost_left_;
  NearElements near_ends_;  ///< of open_ once the lines are linked
  std::vector<Index> open_, crossed_;
  std::vector<unsigned char> links_, walked_, joint_;  ///< of each element: yes or no
  std::vector<Index> walked_in_order_;
  std::vector<Surfels::Index> ordered_;
  std::vector<bool> before_joint_;
  std::vector<Run> chains_;
  // Of join_small().
  std::vector<std::size_t> chain_of_;  ///< small ones that elements are of
  std::vector<std::size_t> group_;     ///< of chains: the first chain of the thing that they are of
  std::vector<std::pair<std::size_t, std::size_t>> members_;  ///< groups and their chains
  std::vector<Index> reordered_;
  std::vector<Run> rejoined_;
  std::vector<std::pair<double, Index>> around_;
};

}  // namespace situation_awareness
