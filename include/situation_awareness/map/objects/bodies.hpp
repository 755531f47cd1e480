// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/map/objects/map_element.hpp"

namespace situation_awareness {

// Bodies of several elements, such as torso and arms (docs/math/objects.md, "Bodies").

/// Joins parts to bodies; it has no state but reusable memory.
class BodyJoiner {
 public:
  /// Elements that stay side by side while they travel are one body: the small one becomes part of the other, is still
  /// tracked, and is published again when they separate. An arm swings, so velocities are not conclusive; the criterion
  /// is the displacement since they met. `elements` are by ascending id, updated at `stamp_ns`.
  void join_parts(std::int64_t stamp_ns, std::vector<MapElement>& elements);

 private:
  /// An element that others may be part of.
  struct Body {
    Ellipse ellipse_world;
    std::size_t element;
  };

  void find_bodies(std::int64_t stamp_ns, const std::vector<MapElement>& elements);
  const Body* nearest_body(const MapElement& part, const Ellipse& ellipse_world, double max_gap_m,
                           const std::vector<MapElement>& elements) const;

  std::vector<Body> by_x_;
  double largest_radius_m_ = 0.0;
};

/// The largest part of a body that leaves the map takes over its id: where the body is deleted (`dropped`, of the
/// elements), or where it is off the map while the part is seen. The part replaces the body among the elements, and its
/// own element is dropped. Returns the number of bodies that were off the map.
std::size_t transfer_body_ids(std::int64_t stamp_ns, std::vector<MapElement>& elements, std::vector<char>& dropped);

}  // namespace situation_awareness
