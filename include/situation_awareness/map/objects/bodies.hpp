// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/map/objects/map_element.hpp"
#include "situation_awareness/map/objects/object_map_params.hpp"

namespace situation_awareness {

// Bodies of several elements, such as torso and arms (docs/math/objects.md, "Bodies").

/// Joins parts to bodies; what it keeps between calls is memory alone.
class BodyJoiner {
 public:
  /// Elements that stay side by side while they travel are one body: the small one becomes part of the other, goes on
  /// being followed, and comes back as itself when they part. An arm swings, so velocities say little: the way
  /// travelled since they met does. `elements` are by growing id, updated at `stamp_ns`.
  void join_parts(std::int64_t stamp_ns, const ObjectMapParams& params, std::vector<MapElement>& elements);

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

/// The identity of a body that leaves the map goes on in its largest part: where the body is deleted (`dropped`, of the
/// elements), or where it is off the map and the part is seen, which would go with it. The part takes the body's place
/// among the elements, and is dropped in its stead. Returns how many bodies were off the map.
std::size_t pass_on_identities(std::int64_t stamp_ns, std::vector<MapElement>& elements, std::vector<char>& dropped);

}  // namespace situation_awareness
