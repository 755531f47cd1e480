// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/estimation/error_state_filter.hpp"
#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness {

// Localisation by reflectors (docs/math/reflectors.md; polygons paper, Sect. 5.1).
//
//   symbol  meaning                                                            space        size
//   T       T_world_base at the stamp                                          SE(2)
//   s       errors of the wheels: of scale, of distances and of turns, and     R^3          3
//           the turn (rad) that odometry misses on each m forward
//   e       error: of T in its own frame (forward, left, yaw), and of s        R^6          6
//   u       motion of the base by odometry between two stamps                  SE(2)
//   w, Q    error of odometry, of the pose after the motion, and its covariance  R^6         6, 6x6
//   z, R    range and azimuth of a reflector's centre in the level frame       R^2          2, 2x2
//   H       Jacobian of z by e                                                 J_z_e        2x6
//   l, H_l  place in the world of a reflector that was moved; Jacobian of z by it  R^2, J_z_l  2, 2x2

/// State of the localisation: a pose, and the constant errors of the wheels.
struct ReflectorState {
  Pose2 T_world_base;
  /// How much farther the robot drives and turns than its odometry says, relative.
  Eigen::Vector2d scale_error = Eigen::Vector2d::Zero();
  /// Turn that odometry misses, in rad by m forward: wheels of different radius.
  double yaw_drift_rad_m = 0.0;
};

template <>
struct Manifold<ReflectorState> {
  static constexpr int kDimension = 6;
  static constexpr bool kFlat = false;
  using Error = Eigen::Matrix<double, 6, 1>;

  static ReflectorState identity() { return {}; }
  static ReflectorState retract(const ReflectorState& x, const Error& e) {
    return {Manifold<Pose2>::retract(x.T_world_base, e.head<3>()), x.scale_error + e.segment<2>(3),
            x.yaw_drift_rad_m + e(5)};
  }
  static Error local_coordinates(const ReflectorState& x, const ReflectorState& y) {
    Error e;
    e << Manifold<Pose2>::local_coordinates(x.T_world_base, y.T_world_base), y.scale_error - x.scale_error,
        y.yaw_drift_rad_m - x.yaw_drift_rad_m;
    return e;
  }
  static Eigen::Matrix<double, 6, 6> reset_jacobian(const Error& e) {
    Eigen::Matrix<double, 6, 6> G = Eigen::Matrix<double, 6, 6>::Identity();
    G.topLeftCorner<3, 3>() = Manifold<Pose2>::reset_jacobian(e.head<3>());
    return G;
  }
};

/// Errors of wheel odometry.
struct WheelErrorParams {
  double distance_noise = 0.01;
  double lateral_noise = 0.001;
  double yaw_noise_of_distance = 0.01;
  double yaw_noise_of_yaw = 0.02;
  double distance_scale_sigma = 0.1;
  double yaw_scale_sigma = 0.1;
  double yaw_drift_sigma = 0.015;

  // Constants of the method, which are not read from YAML.
  /// Error of the motion that replaces a jump of odometry, in each direction.
  double jump_sigma_m = 0.1;
  /// Error of the turn that replaces a jump of odometry.
  double jump_sigma_rad = 0.1;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("distance_noise", self.distance_noise, Bounds{0.0, 1.0}, "m/sqrt(m)",
          "random error of the distance, by distance");
    visit("lateral_noise", self.lateral_noise, Bounds{0.0, 1.0}, "m/sqrt(m)", "random error sideways, by distance");
    visit("yaw_noise_of_distance", self.yaw_noise_of_distance, Bounds{0.0, 1.0}, "rad/sqrt(m)",
          "random error of the yaw, by distance");
    visit("yaw_noise_of_yaw", self.yaw_noise_of_yaw, Bounds{0.0, 1.0}, "rad/sqrt(rad)",
          "random error of the yaw, by turning");
    visit("distance_scale_sigma", self.distance_scale_sigma, Bounds{0.0, 0.5}, "",
          "standard deviation of the constant relative error of distances; it is estimated");
    visit("yaw_scale_sigma", self.yaw_scale_sigma, Bounds{0.0, 0.5}, "",
          "standard deviation of the constant relative error of turns; it is estimated");
    visit("yaw_drift_sigma", self.yaw_drift_sigma, Bounds{0.0, 0.5}, "rad/m",
          "standard deviation of the constant turn by distance that odometry misses; it is estimated");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// Covariance of x, y in the world and yaw, to first order.
Eigen::Matrix3d world_covariance(const Estimate<Pose2>& T_world_base);

/// Range (m) and azimuth (rad) of a reflector's centre in the frame of the lidar, and its Jacobian by the error of
/// T_world_base.
Eigen::Vector2d observed_reflector(const Pose2& T_world_base, const Pose2& T_base_lidar,
                                   const Eigen::Vector2d& center_world_m);
Eigen::Matrix<double, 2, 3> observed_reflector_jacobian(const Pose2& T_world_base, const Pose2& T_base_lidar,
                                                        const Eigen::Vector2d& center_world_m);

/// The Jacobian of the same by the place of the reflector in the world, from that by the error of T_world_base.
Eigen::Matrix2d observed_reflector_place_jacobian(const Eigen::Matrix<double, 2, 3>& J_z_e, const Pose2& T_world_base);

/// The state after the motion u by odometry, and its Jacobian by the error of the state before. `turn_rad`: the turn
/// that the error of scale is of. With that of u itself the error of u's turn would count as one of scale, and on a
/// straight way, where it is the whole turn, the scale would go to -1.
ReflectorState moved_by_odometry(const ReflectorState& x, const Pose2& u, double turn_rad);
Eigen::Matrix<double, 6, 6> moved_by_odometry_jacobian(const ReflectorState& x, const Pose2& u, double turn_rad);
/// Noise of that motion, an error of the state after it. `wheel_error`: how large the constant errors of the wheels, of
/// ReflectorState, are taken to be; they change in proportion to it.
Eigen::Matrix<double, 6, 6> odometry_noise(const Pose2& u, const WheelErrorParams& params,
                                           const Eigen::Vector3d& wheel_error = Eigen::Vector3d::Zero());

}  // namespace situation_awareness
