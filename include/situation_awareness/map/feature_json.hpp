// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "situation_awareness/common/json.hpp"
#include "situation_awareness/map/map.hpp"

namespace situation_awareness {

/// Adds a feature to the end of a list as the object FEATURE of docs/offline.md ("map_bag"): its kind, class,
/// probabilities, times (s), outline (m, in the world), and what its kind has beside. Throws std::runtime_error if a
/// number is not finite.
void add_feature(Json& list, const Feature& feature);

/// The feature that such an object describes: numbers are read back exactly, but times within 1 us, a box within
/// rounding, and of arcs not which of their vertices are corners. A feature that is drawn by hand has a kind, and an
/// outline or a place and a size; what else is missing is that of a fixed thing of an unknown class that surely exists,
/// without an id (0), known within 2 cm, and seen at `stamp_ns`. Throws std::invalid_argument, beginning with `place`,
/// naming the member and what is wrong with it.
Feature feature_from_json(const Json& object, std::int64_t stamp_ns, const std::string& place);

}  // namespace situation_awareness
