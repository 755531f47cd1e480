// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "gps_ins_flight.hpp"

namespace situation_awareness {

/// A drive on level ground of a vehicle that goes where it heads: legs with a speed and a rate of turn each, which go
/// over into each other smoothly. The motion is that of the IMU, at `lever_m` from the base in its axes.
struct SimulatedDrive {
  struct Leg {
    double duration_s;
    double speed_m_s, rate_rad_s;
  };

  std::vector<Leg> legs;
  double initial_yaw_rad = 0.7;
  double change_s = 2.0;
  Eigen::Vector3d lever_m = Eigen::Vector3d::Zero();

  struct Now {
    double speed_m_s, acceleration_m_s2, yaw_rad, rate_rad_s, rate_change_rad_s2;
  };

  /// The last leg lasts for ever.
  Now at(double time_s) const {
    double begin_s = 0.0, yaw = initial_yaw_rad;
    Leg before{0.0, 0.0, 0.0};
    for (std::size_t i = 0;; ++i) {
      const Leg& leg = legs[i];
      const bool is_last = i + 1 == legs.size();
      const double in_leg_s = is_last ? time_s - begin_s : std::min(time_s - begin_s, leg.duration_s);
      const double s = std::clamp(in_leg_s / change_s, 0.0, 1.0);
      const double part = s * s * (3.0 - 2.0 * s), slope = s < 1.0 ? 6.0 * s * (1.0 - s) / change_s : 0.0;
      const double rate = leg.rate_rad_s - before.rate_rad_s, speed = leg.speed_m_s - before.speed_m_s;
      yaw += before.rate_rad_s * in_leg_s +
             rate * (change_s * s * s * s * (1.0 - 0.5 * s) + std::max(in_leg_s - change_s, 0.0));
      if (is_last || time_s - begin_s <= leg.duration_s) {
        return {before.speed_m_s + part * speed, slope * speed, yaw, before.rate_rad_s + part * rate, slope * rate};
      }
      begin_s += leg.duration_s;
      before = leg;
    }
  }

  Eigen::Vector3d velocity(double time_s) const {
    const Now now = at(time_s);
    return rotation(now) *
           (now.speed_m_s * Eigen::Vector3d::UnitX() + now.rate_rad_s * Eigen::Vector3d::UnitZ().cross(lever_m));
  }
  Eigen::Quaterniond attitude(double time_s) const { return rotation(at(time_s)); }
  Eigen::Vector3d angular_velocity_body(double time_s) const { return {0.0, 0.0, at(time_s).rate_rad_s}; }
  Eigen::Vector3d specific_force_body(double time_s) const {
    const Now now = at(time_s);
    const Eigen::Vector3d up = Eigen::Vector3d::UnitZ(), turned = up.cross(lever_m);
    return now.acceleration_m_s2 * Eigen::Vector3d::UnitX() +
           now.speed_m_s * now.rate_rad_s * Eigen::Vector3d::UnitY() + now.rate_change_rad_s2 * turned +
           now.rate_rad_s * now.rate_rad_s * up.cross(turned) + kStandardGravity_m_s2 * up;
  }

 private:
  static Eigen::Quaterniond rotation(const Now& now) {
    return Eigen::Quaterniond(Eigen::AngleAxisd(now.yaw_rad, Eigen::Vector3d::UnitZ()));
  }
};

using DriveRun = MotionRun<SimulatedDrive>;

}  // namespace situation_awareness
