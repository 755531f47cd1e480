// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

/// A GNSS receiver; the defaults are those of a single-frequency one under open sky.
struct SimulatedGnssParams {
  double rate_hz = 5.0;
  double correlated_sigma_m = 1.5;
  double correlation_s = 60.0;
  double white_sigma_m = 0.3;
  double vertical_ratio = 2.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("rate_hz", self.rate_hz, Bounds{0.01, 100.0}, "Hz", "fixes per second");
    visit("correlated_sigma_m", self.correlated_sigma_m, Bounds{0.0, 100.0}, "m",
          "standard deviation of the slow error, east and north each");
    visit("correlation_s", self.correlation_s, Bounds{0.001, 1e6}, "s", "time after which 1/e of it is left");
    visit("white_sigma_m", self.white_sigma_m, Bounds{0.0, 100.0}, "m",
          "standard deviation of the white noise, east and north each");
    visit("vertical_ratio", self.vertical_ratio, Bounds{0.0, 10.0}, "", "vertical errors in terms of the horizontal");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "gnss"); }
};

/// The measured position of the antenna, in m in the world, and the covariance reported by the receiver.
struct GnssFix {
  std::int64_t stamp_ns = 0;
  Eigen::Vector3d position_world_m = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance_m2 = Eigen::Matrix3d::Zero();
};

/// A GNSS receiver whose antenna is on the robot of a world. Its error is a first-order Gauss-Markov process,
/// stationary from the first fix on, and white noise; the covariance is that of both.
class SimulatedGnss {
 public:
  /// `world` must outlive the receiver. Throws std::invalid_argument for params.
  SimulatedGnss(const World& world, const Eigen::Isometry3d& T_robot_antenna, const SimulatedGnssParams& params,
                std::uint64_t seed);

  const SimulatedGnssParams& params() const { return params_; }

  /// When the next fix is due; the first is at time 0.
  double next_time_s() const { return static_cast<double>(fixes_) / params_.rate_hz; }

  GnssFix next();

 private:
  const World& world_;
  Eigen::Isometry3d T_robot_antenna_;
  SimulatedGnssParams params_;
  Random random_;
  Eigen::Vector3d correlated_error_m_;
  std::uint64_t fixes_ = 0;
};

}  // namespace situation_awareness
