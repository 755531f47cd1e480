// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "situation_awareness/ros/params/param_reader.hpp"

namespace situation_awareness {

/// Removes keys that a stage of any kind has: one file serves all of them (cfg/polygons.yaml those of the map of
/// objects, too), and each reads its own.
void forget_keys_of_other_stages(const ParamReader& reader, std::vector<UnknownKey>& unknown);

}  // namespace situation_awareness
