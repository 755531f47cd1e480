// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/gnss.hpp"

#include <cmath>

#include "seeds.hpp"
#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

SimulatedGnss::SimulatedGnss(const World& world, const Eigen::Isometry3d& T_robot_antenna,
                             const SimulatedGnssParams& params, std::uint64_t seed)
    : world_(world), T_robot_antenna_(T_robot_antenna), params_(params), random_(seed_of_scan(seed, 0)) {
  params.validate();
  correlated_error_m_ = params.correlated_sigma_m * normal3(random_);
}

GnssFix SimulatedGnss::next() {
  const double time_s = next_time_s();
  if (fixes_++ > 0) {
    const double kept = std::exp(-1.0 / (params_.rate_hz * params_.correlation_s));
    correlated_error_m_ =
        kept * correlated_error_m_ + std::sqrt(1.0 - kept * kept) * params_.correlated_sigma_m * normal3(random_);
  }
  const Eigen::Vector3d scale(1.0, 1.0, params_.vertical_ratio);
  const Eigen::Vector3d error_m = correlated_error_m_ + params_.white_sigma_m * normal3(random_);
  const double variance_m2 =
      params_.correlated_sigma_m * params_.correlated_sigma_m + params_.white_sigma_m * params_.white_sigma_m;
  GnssFix fix;
  fix.stamp_ns = nanoseconds(time_s);
  fix.position_world_m =
      (world_.robot_at(time_s).T_world_robot * T_robot_antenna_).translation() + scale.cwiseProduct(error_m);
  fix.covariance_m2 = (variance_m2 * scale.cwiseAbs2()).asDiagonal();
  return fix;
}

}  // namespace situation_awareness
