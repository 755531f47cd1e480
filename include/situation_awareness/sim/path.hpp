// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

/// State of a body on its path at one time, in the world frame. Acceleration and jerk are NaN for a body that moves
/// with another: they are needed only for the robot, which may not.
struct PathState {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d acceleration_m_s2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d jerk_m_s3 = Eigen::Vector3d::Zero();
  double yaw_rad = 0.0;
  double yaw_rate_rad_s = 0.0;
};

/// A scripted path: a function of time in seconds, at least three times continuously differentiable; that of a foot
/// twice.
using ScriptedPath = std::function<PathState(double time_s)>;

/// The path of the body of that name; empty where it has none, or none that another may move with.
using PathOfBody = std::function<ScriptedPath(const std::string& body)>;

/// The path that a world file describes in one line of text; models/worlds/README.md is its manual:
///
///     stand                                             at the body's position in the file
///     circle center X Y radius R rate W [phase A]
///     line from X Y to X Y period T [phase A]           back and forth, sinusoidal
///     straight from X Y velocity VX VY                  constant velocity, `from` at time 0
///     loop speed V points X Y; X Y; X Y ...             closed and smooth, at this mean speed
///     loop speed V points X Y Z YAW; ...                the same with height and yaw
///
///     stops places X Y YAW T; X Y YAW T; ...            at rest at each place at its time, the straight way between
///
///     with BODY at X Y [swing A period T [phase P]]     carried by another body, (X, Y) in its axes
///     with BODY at X Y steps T [phase P]                a foot of another body, two steps of which take T
///
/// and for all but the loop with yaw, and stops, the rotation: `spin W` (default 0), or `tangent` for a body that keeps
/// its angle to the direction of motion; and the time of presence: `appears T`, `goes T`, `transits N N ...`
/// (facts_of_path). `position_m` and `yaw_rad`, the body's pose in the file, are the defaults; `path_of_body` finds the
/// path of BODY, and without it the body may not move with another. Throws std::invalid_argument with the error in the
/// text.
ScriptedPath parse_path(const std::string& text, const Eigen::Vector3d& position_m, double yaw_rad,
                        const PathOfBody& path_of_body = {});

/// Presence of a body: in some transits, from `appears_s` on, until just before `goes_s`, which are times of a transit.
/// Where nobody drives through a world, all is in transit 1, which begins at time 0.
struct Presence {
  double appears_s = -std::numeric_limits<double>::infinity();
  double goes_s = std::numeric_limits<double>::infinity();
  std::optional<std::vector<int>> transits = std::nullopt;  ///< from 1, sorted; nothing: all

  bool in(int transit) const { return !transits || std::binary_search(transits->begin(), transits->end(), transit); }
  bool at(double time_s, int transit = 1) const { return time_s >= appears_s && time_s < goes_s && in(transit); }
  bool always() const { return std::isinf(appears_s) && std::isinf(goes_s) && !transits; }
};

/// Attributes in the text of a path other than its geometry.
struct PathFacts {
  Presence presence;    ///< by `appears T` and `goes T`, in s, and `transits N ...`, all optional
  std::string carrier;  ///< the body that it moves with; empty where it moves by itself
  bool stands = false;  ///< of the kind `stand`, without rotation
};

/// Throws std::invalid_argument with the error in the text.
PathFacts facts_of_path(const std::string& text);

}  // namespace situation_awareness
