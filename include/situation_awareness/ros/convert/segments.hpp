// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <sensor_msgs/PointCloud2.h>
#include <situation_awareness/SegmentArray.h>

#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

SegmentArray segments_to_msg(const Segments& segments, const std::string& world_frame);

/// Throws std::invalid_argument if a segment has point indices out of range, a number is not finite, or as
/// free_space_from_msg does.
Segments segments_from_msg(const SegmentArray& msg);

/// The hits in the world with fields x, y, z, rgb and segment (index in Segments::segments): one colour per object,
/// grey for structures.
sensor_msgs::PointCloud2 segments_to_cloud(const Segments& segments, const std::string& world_frame);

}  // namespace situation_awareness
