// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <sensor_msgs/PointCloud2.h>

#include "situation_awareness/pipeline/hit_labels.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// The labelled hits of a scan in the world. Fields: x, y, z in m; rgb (of an object that of its id); object (lower 32
/// bits of its id, 0: none); segment (index in Segments::segments, 2^32 - 1: none); fate (HitFate); reason (index in
/// hit_reasons()). Throws std::invalid_argument unless there is one label per point.
sensor_msgs::PointCloud2 hit_labels_to_cloud(const Segments& segments, const std::vector<HitLabel>& labels,
                                             const std::string& world_frame);

}  // namespace situation_awareness
