// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <nav_msgs/OccupancyGrid.h>
#include <sensor_msgs/PointCloud2.h>

#include "situation_awareness/TargetArray.h"
#include "situation_awareness/map/grid/grid.hpp"

namespace situation_awareness {

TargetArray grid_targets_to_msg(const GridTargets& targets, const std::string& world_frame);

/// Throws std::invalid_argument if a number is not finite, an id is 0 or a variance negative.
GridTargets grid_targets_from_msg(const TargetArray& msg);

/// The probability in percent; -1 where nothing was observed.
nav_msgs::OccupancyGrid grid_to_msg(const SemanticGrid& grid, const std::string& world_frame);

/// Of the probability alone, in hundredths. Throws std::invalid_argument if its size, its origin or a cell is not as
/// grid_to_msg makes them.
SemanticGrid grid_from_msg(const nav_msgs::OccupancyGrid& msg);

/// The middles of the observed cells on the ground, for display: x, y, z, rgb (grey: not of the class, red: of it).
sensor_msgs::PointCloud2 grid_to_cloud(const SemanticGrid& grid, const std::string& world_frame);

}  // namespace situation_awareness
