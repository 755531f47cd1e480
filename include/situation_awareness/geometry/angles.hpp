// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

namespace situation_awareness {

constexpr double kPi = 3.14159265358979323846;

constexpr double radians(double degrees) { return degrees * (kPi / 180.0); }
constexpr double degrees(double radians) { return radians * (180.0 / kPi); }

/// The same angle in [-pi, pi].
inline double wrap_to_pi(double angle_rad) {
  return std::abs(angle_rad) <= kPi ? angle_rad : std::remainder(angle_rad, 2.0 * kPi);
}

/// The same undirected axis in [-pi/2, pi/2].
inline double wrap_to_half_pi(double angle_rad) {
  return std::abs(angle_rad) <= 0.5 * kPi ? angle_rad : std::remainder(angle_rad, kPi);
}

/// Returns that of the four directions psi + k pi / 2 which is nearest to the axis `major_rad`, as an axis.
inline double nearest_axis(double psi_rad, double major_rad) {
  const double turns = std::round((major_rad - psi_rad) / (0.5 * kPi));
  return wrap_to_half_pi(psi_rad + turns * 0.5 * kPi);
}

}  // namespace situation_awareness
