// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/json.hpp"

namespace situation_awareness {

/// One line: {"stamp":S, and the members of `rest`, an object that is not empty. The stamp is in seconds with all
/// digits of its nanoseconds, which a double cannot represent.
std::string json_line(std::int64_t stamp_ns, const Json& rest);

/// {"x", "y", "z", "roll", "pitch", "yaw", "covariance"} in m and rad, R = Rz(yaw) Ry(pitch) Rx(roll); the covariance
/// is that of the position and of the attitude's error in the base, row by row.
Json json_of_pose(const Eigen::Isometry3d& T_world_base, const Eigen::Matrix<double, 6, 6>& covariance);

}  // namespace situation_awareness
