// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>

#include <Eigen/Core>

namespace situation_awareness {

/// Where a body is on its path at one time, and how that changes; everything in the world's frame. Acceleration and
/// jerk are NaN for a body that moves with another: they are for the robot, which may not.
struct PathState {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d acceleration_m_s2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d jerk_m_s3 = Eigen::Vector3d::Zero();
  double yaw_rad = 0.0;
  double yaw_rate_rad_s = 0.0;
};

/// A scripted path: a function of time in seconds, at least three times continuously differentiable.
using Path = std::function<PathState(double time_s)>;

/// The path of the body of that name; empty where it has none, or none that another may move with.
using PathOfBody = std::function<Path(const std::string& body)>;

/// The path that a world file describes in one line of text; models/worlds/README.md is its manual:
///
///     stand                                             at the body's own place
///     circle center X Y radius R rate W [phase A]
///     line from X Y to X Y period T [phase A]           back and forth, sinusoidal
///     straight from X Y velocity VX VY                  for ever, from there at time 0
///     loop speed V points X Y; X Y; X Y ...             closed and smooth, at this mean speed
///     loop speed V points X Y Z YAW; ...                the same with height and yaw
///
///     with BODY at X Y [swing A period T [phase P]]     carried by another body, in whose axes (X, Y) is
///
/// and for all but the loop with yaw how it turns: `spin W` (default 0), or `tangent` for a body that keeps its angle
/// to the direction of motion. `position_m` and `yaw_rad`, the body's pose in the file, give what the text does not;
/// `path_of_body` finds the path of BODY, and where it is left out the body may not move with another.
/// Throws std::invalid_argument saying what is wrong with the text.
Path parse_path(const std::string& text, const Eigen::Vector3d& position_m, double yaw_rad,
                const PathOfBody& path_of_body = {});

}  // namespace situation_awareness
