// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>

#include <Eigen/Core>

// Common to the sources of ReflectorLocalization.
namespace situation_awareness {

/// m. Standard deviation of a reflector's place about that of its sighting, apart from the scanner's errors. Its source
/// is not recorded, nor its sensitivity.
constexpr double kModelSigma_m = 0.001;

/// A correction is linearised anew where it exceeds this, in m and rad.
constexpr double kRelinearise = 0.02;
constexpr int kMaxIterations = 6;
/// Assignments that are kept to tell whether a match is ambiguous.
constexpr std::size_t kMaxLeaves = 32;
/// s. Reflectors are judged only by a pose that two of them have confirmed in this time, when one alone is in sight.
constexpr double kConfirmed_s = 5.0;
/// What is seen within this distance of where it was seen before stands.
constexpr double kStands_m = 0.1;
/// Most things that shine and are no reflectors that are remembered.
constexpr std::size_t kMaxStrangers = 64;

inline double larger_eigenvalue(const Eigen::Matrix2d& P) {
  const double mean = 0.5 * (P(0, 0) + P(1, 1));
  return mean + std::hypot(0.5 * (P(0, 0) - P(1, 1)), P(0, 1));
}

}  // namespace situation_awareness
