// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/Core>
#include <Eigen/LU>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

/// Of one reflector, how often the same beams have seen it: what they say of its place is the same again while nothing
/// moves, apart from the noise of the ranges (docs/math/reflectors.md, "What repeats").
class RepeatedBeams {
 public:
  /// The covariance R of a sighting (of range and azimuth), as large as makes its information that which is new with
  /// it: with n scans of the same beams the covariance of their mean is W / n + C, W the white part of R and C = R - W.
  /// Not finite where nothing is new. `azimuth_rad`: of the reflector; `resolution_rad`: between beams.
  Eigen::Matrix2d new_covariance(const Eigen::Matrix2d& R, const Eigen::Matrix2d& white, double azimuth_rad,
                                 double resolution_rad) {
    double fresh = 1.0;
    if (has_azimuth_) {
      const double change_rad = std::abs(wrap_to_pi(azimuth_rad - azimuth_rad_));
      fresh = std::min(1.0, change_rad / (kFreshAzimuth * resolution_rad));
    }
    used(azimuth_rad);
    const double before = std::min(kMostScans, (1.0 - fresh) * scans_);
    scans_ = before + 1.0;
    if (before < kLeastScans) return R;
    const Eigen::Matrix2d constant = R - white;
    const auto information = [&](double scans) -> Eigen::Matrix2d { return (white / scans + constant).inverse(); };
    const Eigen::Matrix2d gain = information(before + 1.0) - information(before);
    const Eigen::Matrix2d inverse = gain.inverse();
    return 0.5 * (inverse + inverse.transpose());
  }

  /// A sighting at this azimuth has been used otherwise.
  void used(double azimuth_rad) {
    has_azimuth_ = true;
    azimuth_rad_ = azimuth_rad;
  }

 private:
  /// While the azimuth changes by less than this part of the beams' spacing, the same beams see it, with the same
  /// error. The error of a rounded number is uncorrelated after 0.21 steps.
  static constexpr double kFreshAzimuth = 0.25;
  /// Scans of the same beams whose mean is taken at most.
  static constexpr double kMostScans = 1000.0;
  /// Fewer count as none.
  static constexpr double kLeastScans = 1e-3;

  bool has_azimuth_ = false;
  double azimuth_rad_ = 0.0;
  double scans_ = 0.0;  ///< that have used the same beams
};

}  // namespace situation_awareness
