// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/map/grid/grid.hpp"

namespace situation_awareness {

/// Writes a grid as a GeoTIFF of two float bands, north up in the world's metres: the probability, NaN where nothing
/// was observed, and the number of images with evidence; atomically. A grid without cells is one cell, not observed.
/// Throws std::runtime_error naming the path.
void save_geotiff(const std::string& path, const SemanticGrid& grid);

/// What save_geotiff wrote; heights of the ground and the stamp are not in it. Throws std::runtime_error naming the
/// path and what is wrong.
SemanticGrid load_geotiff(const std::string& path);

}  // namespace situation_awareness
