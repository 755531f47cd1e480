// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/map/objects/object_map.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"

namespace situation_awareness {

/// The map's part of /diagnostics: numbers of elements.
void report_objects(const ObjectMap& map, StageDiagnostics::Status& status);

}  // namespace situation_awareness
