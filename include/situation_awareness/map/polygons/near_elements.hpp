// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/map/polygons/surfels.hpp"

namespace situation_awareness {

/// What making chains reads of an element, apart from the rest: most of its time is for memory.
struct LinkElement {
  Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal_world = Eigen::Vector2d::UnitX();
  double sigma_m = 0.0;
  double low_m = 0.0, high_m = 0.0;
  double seen_s = 0.0, age_s = 0.0;
  double seen_share = 0.0;  ///< of its age, or of a least one
  std::uint64_t chain = 0;
  Surfels::Index index = Surfels::kNone;  ///< of the element itself
  bool is_hit = false;                    ///< by the latest scan
  bool is_shown = false;
  bool is_crossed = false;  ///< one near it faces quite another way
  bool is_ageing = false;   ///< shown, and age alone may end that
  /// Its links along its line are as they were, whatever is near it: indices in the list, or none.
  bool is_kept = false;
  bool is_linked = false;   ///< of one that is kept: it is of a chain
  bool is_context = false;  ///< of one that is kept: those that are linked anew may be near it
  std::int32_t right = Surfels::kNone, left = Surfels::kNone;

  /// Cosine between the normals of elements of one surface, at least.
  static constexpr double kSameSurface = 0.7;

  Eigen::Vector2d along_world() const { return {normal_world.y(), -normal_world.x()}; }
  /// Neither as the other one nor back to back.
  bool faces_another_way(const LinkElement& other) const {
    return std::abs(normal_world.dot(other.normal_world)) <= kSameSurface;
  }
};

/// Which elements of a list are near each other, found once for all that ask for it. Linear in the elements. It keeps
/// its memory: no allocation after warm-up.
class NearElements {
 public:
  using Index = std::int32_t;  ///< of an element in its list

  /// Of each of these elements of the list, those of the others within `radius_m`.
  void find(const std::vector<LinkElement>& list, const std::vector<Index>& elements, double radius_m);

  /// act(index) for those of an element that find() was given; their order depends on their places alone.
  template <class Act>
  void for_each(Index index, const Act& act) const {
    const Range& range = of_element_[static_cast<std::size_t>(index)];
    for (std::size_t k = range.first; k < range.end; ++k) act(near_[k]);
  }

 private:
  struct Range {
    std::size_t first = 0, end = 0;
  };
  struct Entry {
    std::uint64_t cell;  ///< row by row
    double x_m, y_m;
    Index index;
  };

  void sort_by(unsigned lowest_bit);

  std::vector<Entry> entries_, sorted_;  ///< by their cells
  std::vector<std::size_t> places_;      ///< of the entries of each digit, while they are sorted
  std::vector<Range> of_element_;        ///< of near_
  std::vector<Index> near_;
};

}  // namespace situation_awareness
