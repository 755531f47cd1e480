// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "situation_awareness/map/objects/map_element.hpp"

namespace situation_awareness {

// Lost elements that are detected again elsewhere get their id back (docs/math/objects.md, "Re-identification").

/// (rx + ry) / 2 and |(p, q)| of an element, in m.
using ElementShape = std::pair<double, double>;
ElementShape element_shape(const MapElement& element);

/// m. An element with a common shape and a position less certain than this matches nothing. No source is recorded. From
/// 1.0 to 1.4 by re_identification_test; in flights 0.6 and 2.4 change no figure beyond chance.
constexpr double kMaxSigmaOfCommonShape_m = 1.2;

/// Finds the confirmed elements whose shape several others have, so that it does not identify them. It has no state but
/// reusable memory.
class CommonShapes {
 public:
  /// Of each element, not zero if its shape is a common one. `others`: sorted shapes of more confirmed elements. Where
  /// `least_sigma_m` is given, that is told only of elements whose positions are less certain than this.
  const std::vector<char>& find(const std::vector<MapElement>& elements, const std::vector<ElementShape>& others = {},
                                double least_sigma_m = -1.0);

 private:
  std::vector<std::size_t> asked_;  ///< elements
  std::vector<ElementShape> shapes_;
  std::vector<char> common_;
};

/// Compares each of the elements `newly_confirmed` (by ascending index) with the lost ones, by shape and reachable
/// position. The most probable one that explains it better than a new object is re-identified: it continues with the
/// new element's estimate, and the new element's state is kDeleted. `common_shape`: of the elements, or of the first of
/// them; `gate`: of the squared Mahalanobis distance.
void re_identify(const std::vector<std::size_t>& newly_confirmed, const std::vector<char>& common_shape, double gate,
                 std::int64_t stamp_ns, std::vector<MapElement>& elements);

}  // namespace situation_awareness
