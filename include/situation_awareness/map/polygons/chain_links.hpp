// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "situation_awareness/map/polygons/near_elements.hpp"
#include "situation_awareness/map/polygons/surfels.hpp"

namespace situation_awareness {

/// Makes chains of elements of a map: which one follows which along a boundary. It keeps its memory: no
/// allocation after warm-up. Linear in the elements.
class ChainLinks {
 public:
  /// A run of ordered().
  struct Run {
    std::size_t first = 0, end = 0;
    bool closed = false;
  };

  /// Each element goes on with the nearest one ahead of it on its line, of those that agree; then, where neither goes
  /// on, with one up to `max_gap_m` ahead; then around a corner whose sides both come near it (docs/math/polygons.md,
  /// "Chains").
  void link(const Surfels& surfels, const std::vector<Surfels::Index>& elements, const NearElements& near,
            double spacing_m, double max_gap_m);

  /// Within which link() has to know the neighbours of the elements.
  static double reach_m(double spacing_m);

  /// Each of the elements once, chain by chain, from right to left.
  const std::vector<Surfels::Index>& ordered() const { return ordered_; }
  const std::vector<Run>& chains() const { return chains_; }

 private:
  template <class Search, class Cost>
  void link_best(const Search& search, const Cost& cost);
  void find_directions(const Surfels& surfels);
  void leave_out_crossed(const Surfels& surfels, const NearElements& near, double spacing_m);
  void walk(const Surfels& surfels, const std::vector<Surfels::Index>& elements);
  void walk_from(const Surfels& surfels, Surfels::Index first, bool closed);

  std::vector<Surfels::Index> right_, left_;  ///< the next element of each
  std::vector<Surfels::Index> best_right_, best_left_;
  std::vector<Eigen::Vector2d> along_;  ///< of the boundary, at each end of a chain
  std::vector<int> run_;                ///< elements on a line with it, up to those of a wall
  std::vector<double> cost_right_, cost_left_;
  NearElements near_ends_;  ///< of open_ once the lines are linked
  std::vector<Surfels::Index> open_, crossed_;
  std::vector<bool> links_, walked_;
  std::vector<Surfels::Index> ordered_;
  std::vector<Run> chains_;
};

}  // namespace situation_awareness
