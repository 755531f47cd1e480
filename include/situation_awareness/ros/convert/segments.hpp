// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <situation_awareness/SegmentArray.h>

#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

SegmentArray segments_to_msg(const Segments& segments, const std::string& world_frame);

/// Throws std::invalid_argument if a segment or a refused run has point indices out of range, a number is not finite,
/// or as free_space_from_msg does.
Segments segments_from_msg(const SegmentArray& msg);

}  // namespace situation_awareness
