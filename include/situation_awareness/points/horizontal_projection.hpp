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

/// Largest turn of the lidar from the first beam to the last that `project_horizontally` accepts, as a fraction of the
/// angle between these two in the lidar's frame: well below the limit at which neighbouring beams swap order.
constexpr double kMaxTurnOfSweep = 0.1;

/// Reason why a scan taken between these poses cannot be projected, for counters: "pose" (one of them is not finite),
/// "tilt" (beyond kMaxTiltRad at one of them), "turn" (beyond kMaxTurnOfSweep); empty if it can.
const char* projection_defect(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                              const Eigen::Isometry3d& T_world_lidar_end);

/// Rotate every beam by the attitude and take its azimuth and range in the level frame.
///
/// This replaces eq. 5 of the circle paper (rho cos(theta) cos(phi) for every beam), which also shortens beams that
/// tilt does not shorten and does not change azimuths; docs/math/points.md compares both in numbers. Throws
/// std::invalid_argument if projection_defect says so.
Points project_horizontally(const Scan& scan, const Eigen::Isometry3d& T_world_lidar);

/// The same for a lidar that moves from `T_world_lidar`, its pose at the stamp and so at beam 0, to
/// `T_world_lidar_end`, its pose at the last beam: each beam is projected from the interpolated pose at its own time.
/// The result is in the level frame of the stamp, as seen from its origin (docs/math/points.md, "Motion").
/// `memory`: as for limit_range.
Points project_horizontally(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                            const Eigen::Isometry3d& T_world_lidar_end, Points memory = {});

}  // namespace situation_awareness
