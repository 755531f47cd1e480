// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include <Eigen/Core>

namespace situation_awareness {

inline Eigen::Vector2d unit(double yaw_rad) { return {std::cos(yaw_rad), std::sin(yaw_rad)}; }

inline double yaw_of(const Eigen::Vector2d& v) { return std::atan2(v.y(), v.x()); }

}  // namespace situation_awareness
