// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <situation_awareness/MappedObjectArray.h>

#include "situation_awareness/map/objects/objects.hpp"

namespace situation_awareness {

/// `labels` names the objects in their order, or is empty.
MappedObjectArray objects_to_msg(const Objects& objects, const std::string& world_frame,
                                 const std::vector<std::string>& labels = {});

/// Throws std::invalid_argument if a number is not finite, a radius or a side of a box is not positive, or a shape or
/// class is unknown. The height of an empty map is 0,
/// since the message has it per element.
Objects objects_from_msg(const MappedObjectArray& msg);

}  // namespace situation_awareness
