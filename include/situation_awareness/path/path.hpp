// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

/// A point that a path leads through.
struct WayPoint {
  Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
  std::optional<double> speed_m_s;  ///< the greatest speed from here on; none: that of the way point before
};

/// A path as a list of points, two at least, of a closed one three: it goes on from the last to the first. The part
/// between two successive points is a segment of the path, and has the index of the first.
struct Path {
  bool closed = false;
  std::vector<WayPoint> way_points;
};

/// Least distance of successive way points.
constexpr double kLeastWay_m = 0.01;

/// Throws std::invalid_argument naming `source`, the index, the field and its bound, unless there are at least two way
/// points, of a closed path three, coordinates are in [-1e6, 1e6] m, speeds in (0, 100] m/s, and successive way points
/// at least kLeastWay_m apart, those of a closed path's ends too; at most 10,000 way points, 1,000 m apart.
void check_path(const Path& path, const std::string& source);

/// A path from YAML text:
///
///     path:
///       - {x: 1.5, y: -0.25}                  # in m, in the world
///       - {x: 4.0, y: 0.5, speed_m_s: 0.3}    # the greatest speed from here on
///     closed: false                           # may be left out
///
/// Throws std::invalid_argument naming `source` for what is no such text, for unknown, missing and repeated keys, and
/// as check_path does.
Path read_path(const std::string& yaml, const std::string& source);

/// The same from a file, which is the source. Throws std::invalid_argument also if it cannot be read.
Path load_path(const std::string& file);

/// The path as YAML text that read_path reads back exactly.
std::string yaml_text(const Path& path);

/// The way back: the same points and speeds from the last to the first. A part has the same speed in both directions.
Path reversed(const Path& path);

}  // namespace situation_awareness
