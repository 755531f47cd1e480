// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/objects/object_filter.hpp"

namespace situation_awareness {

/// Parameters of the two motion models and of the transitions between them.
struct MotionParams {
  ProcessNoise standing;                      ///< of standing objects
  ProcessNoise moving;                        ///< of moving objects
  Course course = Course::kStraight;          ///< of moving objects
  double start_rate_1_s = 0.0;                ///< rate of transitions from standing to moving
  double stop_rate_1_s = 0.0;                 ///< rate of transitions from moving to standing
  double start_velocity_sigma = 0.0;          ///< m/s, per axis, of objects that begin to move
  double start_angular_velocity_sigma = 0.0;  ///< rad/s
};

/// The estimate of one element under two motions, standing (v = 0, w = 0) and moving (ellipse paper, eqs. 8 to 12),
/// each with its own EKF, and the probability of either: interacting multiple models (Blom and Bar-Shalom, 1988). A
/// standing object's velocity goes to zero and its position and shape converge; a manoeuvring one is followed.
struct MotionEstimate {
  ObjectEstimate standing;
  ObjectEstimate moving;
  double p_moving = 0.5;
};

/// A new element, under both motions.
MotionEstimate start(const ObjectEstimate& mapped, const MotionParams& params);

/// Mix the estimates by the transition probabilities and predict both, over an hour at most for any step.
void predict(MotionEstimate& estimate, double dt_s, const MotionParams& params);

/// A measurement compared with both motions.
struct MotionMatch {
  Match standing;
  Match moving;
  double log_likelihood = 0.0;  ///< of the measurement under the mixture
};
MotionMatch match(const MotionEstimate& estimate, const Pose2& T_world_level, const Measurement& measurement,
                  const Eigen::Matrix3d& U);
MotionMatch match(const MotionEstimate& estimate, const MeasuringFrame& level, const Measurement& measurement,
                  const Eigen::Matrix3d& U);

/// Correct both motions and their probabilities.
void update(MotionEstimate& estimate, const Pose2& T_world_level, const Measurement& measurement,
            const MotionMatch& match, const Eigen::Matrix3d& U);
void update(MotionEstimate& estimate, const MeasuringFrame& level, const Measurement& measurement,
            const MotionMatch& match, const Eigen::Matrix3d& U);

/// Mean and covariance of the mixture.
ObjectEstimate combine(const MotionEstimate& estimate);
/// Its covariance of the position alone.
Eigen::Matrix2d combined_position_covariance(const MotionEstimate& estimate);
/// Its mean alone.
Vector8d combined_state(const MotionEstimate& estimate);

}  // namespace situation_awareness
