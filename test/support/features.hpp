// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/map/map.hpp"

namespace situation_awareness {

/// A boundary of the map of large obstacles as it is on the one map.
inline Feature feature_of(const Splinegon& boundary) {
  Feature feature;
  feature.id = boundary.id;
  feature.shape = ArcShape{boundary.vertices, boundary.closed};
  return feature;
}

/// A chain of the map of polygons as it is on the one map.
inline Feature feature_of(const Chain& chain) {
  Feature feature;
  feature.id = chain.id;
  feature.shape = PolylineShape{chain.vertices, chain.closed};
  return feature;
}

}  // namespace situation_awareness
