// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "situation_awareness/map/objects/map_element.hpp"

namespace situation_awareness {

// Lost elements that are detected again elsewhere get their id back (docs/math/objects.md, "Re-identification").

/// Finds the confirmed elements whose shape several others have, so that it does not identify them. It has no state but
/// reusable memory.
class CommonShapes {
 public:
  /// Of each element, not zero if its shape is a common one.
  const std::vector<char>& find(const std::vector<MapElement>& elements);

 private:
  std::vector<std::pair<double, std::size_t>> by_mean_radius_m_;
  std::vector<char> common_;
};

/// Compares each of the elements `newly_confirmed` (by ascending index) with the lost ones, by shape and reachable
/// position. The most probable one that explains it better than a new object is re-identified: it continues with the
/// new element's estimate, and the new element's state is kDeleted. `common_shape`: of the elements, or of the first of
/// them; `gate`: of the squared Mahalanobis distance.
void re_identify(const std::vector<std::size_t>& newly_confirmed, const std::vector<char>& common_shape, double gate,
                 std::int64_t stamp_ns, std::vector<MapElement>& elements);

}  // namespace situation_awareness
