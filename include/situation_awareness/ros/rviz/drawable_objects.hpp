// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <situation_awareness/MappedObjectArray.h>

#include "situation_awareness/map/objects/objects.hpp"

namespace situation_awareness {

/// A map that is safe for a renderer: its float numbers are finite and its extents bounded.
struct DrawableObjects {
  Objects objects;
  std::vector<std::string>
      names;  ///< of the objects, in their order: id and, where there are, label and class; printable ASCII
};

/// Throws std::invalid_argument naming the element and its error: a number that is not finite, an orientation that is
/// not a rotation about z, a probability outside [0, 1], an id that appears twice, an unknown shape or class, a radius
/// or half a side of a box outside (0, 1] km, a position beyond 100 km, a speed beyond 1 km/s or a covariance beyond
/// 1e12.
DrawableObjects drawable_objects(const MappedObjectArray& msg);

}  // namespace situation_awareness
