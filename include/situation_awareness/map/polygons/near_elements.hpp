// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "situation_awareness/map/polygons/surfels.hpp"

namespace situation_awareness {

/// Which elements of a map are near each other, found once for all that ask for it. Linear in the elements but for
/// their sorting. It keeps its memory: no allocation after warm-up.
class NearElements {
 public:
  /// Of each of the elements, those of the others within `radius_m`.
  void find(const Surfels& surfels, const std::vector<Surfels::Index>& elements, double radius_m);

  /// act(index) for those of an element that find() was given; their order depends on their places alone.
  template <class Act>
  void for_each(Surfels::Index index, const Act& act) const {
    const Range& range = of_element_[static_cast<std::size_t>(index)];
    for (std::size_t k = range.first; k < range.end; ++k) act(list_[k]);
  }

 private:
  struct Range {
    std::size_t first = 0, end = 0;
  };
  struct Entry {
    std::uint64_t cell;  ///< row by row
    Surfels::Index index;
    double x_m, y_m;
  };

  std::vector<Entry> entries_;     ///< by their cells
  std::vector<Range> of_element_;  ///< of list_
  std::vector<Surfels::Index> list_;
};

}  // namespace situation_awareness
