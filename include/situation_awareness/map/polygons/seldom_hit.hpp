// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "situation_awareness/map/polygons/near_elements.hpp"
#include "situation_awareness/map/polygons/surfels.hpp"

namespace situation_awareness {

/// Which elements of a map were hit so seldom, for their age, that they are no surface: beams over an edge end there
/// now and then. No allocation after warm-up.
class SeldomHit {
 public:
  using Index = Surfels::Index;

  static constexpr double kReach_m = 0.12;  ///< within which elements are compared
  static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

  /// Part of its age for which an element was hit, LinkElement::seen_share.
  static double seen_share(double seen_s, double age_s);

  /// Compares an element of a list, by its place there, with those near it, and writes whether it is shown, whether age
  /// alone may end that, and whether it is crossed.
  static void judge(std::vector<LinkElement>& elements, std::size_t place, const NearElements& near);

  /// Whether one that has a chain of its own was there for long and hardly ever hit, at a stamp: beams over an edge far
  /// behind it.
  static bool is_lonely(const Surfel& surfel, std::int64_t stamp_ns);
  /// Whether it may get lonely.
  static bool may_get_lonely(const Surfel& surfel);

  /// The stamp from which on an element that is shown is not, if nothing beside it changes; kNever, if there is none.
  /// `is_alone`: it has a chain of its own.
  std::int64_t hidden_from_ns(const Surfels& surfels, Index index, bool is_alone);

 private:
  struct Beside {  ///< an element beside another one
    double seen_s;
    std::int64_t first_seen_ns;
  };

  std::vector<Beside> beside_;
};

}  // namespace situation_awareness
