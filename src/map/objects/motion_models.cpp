// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/motion_models.hpp"

#include <algorithm>
#include <cmath>

namespace situation_awareness {

using namespace object_state;

namespace {

/// Longest prediction: an element unseen for longer may be anywhere.
constexpr double kLongestPrediction_s = 3600.0;

/// The moving estimate as one of a standing object: without velocities.
ObjectEstimate stopped(const ObjectEstimate& moving) {
  ObjectEstimate result = moving;
  constexpr int kRates = 3;  // velocity and angular velocity, side by side
  result.x.segment<kRates>(kVelocity).setZero();
  result.P.middleRows<kRates>(kVelocity).setZero();
  result.P.middleCols<kRates>(kVelocity).setZero();
  return result;
}

/// The standing estimate as one of an object that begins to move: with unknown velocity.
ObjectEstimate started(const ObjectEstimate& standing, const MotionParams& params) {
  ObjectEstimate result = standing;
  result.P.diagonal().segment<2>(kVelocity).array() += params.start_velocity_sigma * params.start_velocity_sigma;
  result.P(kAngularVelocity, kAngularVelocity) +=
      params.start_angular_velocity_sigma * params.start_angular_velocity_sigma;
  return result;
}

/// Mean and covariance of a mixture of two, the second with weight `p`.
ObjectEstimate mixed(const ObjectEstimate& a, const ObjectEstimate& b, double p) {
  const Vector8d d = b.x - a.x;
  return {a.x + p * d, (1.0 - p) * a.P + p * b.P + p * (1.0 - p) * d * d.transpose()};
}

}  // namespace

MotionEstimate start(const ObjectEstimate& mapped, const MotionParams& params) {
  return {stopped(mapped), started(mapped, params), 0.5};
}

void predict(MotionEstimate& estimate, double dt_s, const MotionParams& params) {
  dt_s = std::min(dt_s, kLongestPrediction_s);
  const double p = estimate.p_moving;
  // The two-state Markov chain over the whole step: however often it starts and stops within.
  const double rate_1_s = params.start_rate_1_s + params.stop_rate_1_s;
  const double switched_s = rate_1_s > 0.0 ? -std::expm1(-rate_1_s * dt_s) / rate_1_s : 0.0;
  const double starts = (1.0 - p) * params.start_rate_1_s * switched_s;
  const double stops = p * params.stop_rate_1_s * switched_s;
  const double goes_on = p * std::max(0.0, 1.0 - params.stop_rate_1_s * switched_s);  // rounding may step below
  const double stays = (1.0 - p) * std::max(0.0, 1.0 - params.start_rate_1_s * switched_s);
  const double moves = goes_on + starts;
  const double stands = stays + stops;
  if (starts > 0.0 || stops > 0.0) {  // else nothing is mixed
    const ObjectEstimate moving =
        moves > 0.0 ? mixed(estimate.moving, started(estimate.standing, params), starts / moves) : estimate.moving;
    if (stands > 0.0) estimate.standing = mixed(estimate.standing, stopped(estimate.moving), stops / stands);
    estimate.moving = moving;
  }
  estimate.p_moving = std::min(moves, 1.0);
  predict(estimate.standing, dt_s, params.standing);
  predict(estimate.moving, dt_s, params.moving, params.course);
}

MotionMatch match(const MotionEstimate& estimate, const Pose2& T_world_level, const Measurement& measurement,
                  const Eigen::Matrix3d& U) {
  return match(estimate, MeasuringFrame(T_world_level), measurement, U);
}

MotionMatch match(const MotionEstimate& estimate, const MeasuringFrame& level, const Measurement& measurement,
                  const Eigen::Matrix3d& U) {
  MotionMatch result{match(estimate.standing, level, measurement, U), match(estimate.moving, level, measurement, U),
                     0.0};
  const double standing = std::log1p(-estimate.p_moving) + result.standing.log_likelihood;
  const double moving = std::log(estimate.p_moving) + result.moving.log_likelihood;
  const double more = std::max(standing, moving);
  result.log_likelihood = more + std::log(std::exp(standing - more) + std::exp(moving - more));
  return result;
}

void update(MotionEstimate& estimate, const Pose2& T_world_level, const Measurement& measurement,
            const MotionMatch& match, const Eigen::Matrix3d& U) {
  update(estimate, MeasuringFrame(T_world_level), measurement, match, U);
}

void update(MotionEstimate& estimate, const MeasuringFrame& level, const Measurement& measurement,
            const MotionMatch& match, const Eigen::Matrix3d& U) {
  update(estimate.standing, level, measurement, match.standing, U);
  update(estimate.moving, level, measurement, match.moving, U);
  estimate.p_moving = std::exp(std::log(estimate.p_moving) + match.moving.log_likelihood - match.log_likelihood);
  // Neither motion is ever impossible: rounding must not make it so.
  estimate.p_moving = std::clamp(estimate.p_moving, 1e-9, 1.0 - 1e-9);
}

ObjectEstimate combine(const MotionEstimate& estimate) {
  return mixed(estimate.standing, estimate.moving, estimate.p_moving);
}

Eigen::Matrix2d combined_position_covariance(const MotionEstimate& estimate) {
  const double p = estimate.p_moving;
  const Eigen::Vector2d d = estimate.moving.x.segment<2>(kPosition) - estimate.standing.x.segment<2>(kPosition);
  return (1.0 - p) * estimate.standing.P.block<2, 2>(kPosition, kPosition) +
         p * estimate.moving.P.block<2, 2>(kPosition, kPosition) + p * (1.0 - p) * d * d.transpose();
}

Vector8d combined_state(const MotionEstimate& estimate) {
  return estimate.standing.x + estimate.p_moving * (estimate.moving.x - estimate.standing.x);
}

}  // namespace situation_awareness
