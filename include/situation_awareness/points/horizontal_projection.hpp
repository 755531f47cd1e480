// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>

#include "situation_awareness/points/points.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// Largest tilt of the scan plane that `project_horizontally` accepts: beyond it neighbouring beams can swap order.
constexpr double kMaxTiltRad = 1.2;

/// Angle between the scan plane and the horizontal plane, in [0, pi/2]; the same for a scanner mounted upside down.
double tilt_rad(const Eigen::Isometry3d& T_world_lidar);

/// Rotate every beam by the attitude and take its azimuth and range in the level frame.
///
/// This replaces eq. 5 of the circle paper (rho cos(theta) cos(phi) for every beam), which shortens beams that tilt
/// does not shorten and leaves azimuths alone; docs/math/points.md compares both in numbers.
/// Throws std::invalid_argument if tilt_rad exceeds kMaxTiltRad.
Points project_horizontally(const Scan& scan, const Eigen::Isometry3d& T_world_lidar);

}  // namespace situation_awareness
