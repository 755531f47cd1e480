// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/pose/reflector_survey.hpp"

namespace situation_awareness {

/// All poses and reflectors of a survey, as they are adjusted at once.
struct ReflectorSurvey::Solution {
  std::vector<Pose2> T_world_base;
  Eigen::Vector2d scale_error;
  std::vector<Eigen::Vector2d> centers_m;  ///< of found_
  std::vector<std::size_t> same_as;        ///< index in found_ that it is the same as, itself if of none before
  std::vector<const char*> refused;        ///< reason, or null while it is used
  std::vector<int> sightings;
  std::vector<double> nis;
  std::vector<double> bright_part;
  double odometry_nis = 0.0;      ///< mean, per degree of freedom
  std::vector<std::size_t> used;  ///< indices of those used
  Eigen::MatrixXd covariance;     ///< of the centres of those used
};

/// The residual of a sighting, against the place where it should be.
Eigen::Vector2d residual_of(const Eigen::Vector2d& z, const Pose2& T_world_base, const Pose2& T_base_lidar,
                            const Eigen::Vector2d& center_world_m);
/// Jacobian of that place by the centre of the reflector.
Eigen::Matrix2d place_by_center_jacobian(const Pose2& T_world_base, const Pose2& T_base_lidar,
                                         const Eigen::Vector2d& center_world_m);

}  // namespace situation_awareness
