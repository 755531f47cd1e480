// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/registration/map_place.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/vectors.hpp"
#include "situation_awareness/pose/fix_noise.hpp"

namespace situation_awareness {
namespace {

constexpr int kPlaceYaw = 2;
constexpr double kGateProbability = 0.9999;
/// m/sqrt(s) and rad/sqrt(s). By how much a map of boundaries bends, of which 0.2 m and 1 degree per lap were seen.
constexpr double kBend_m_sqrt_s = 0.03, kBend_rad_sqrt_s = 0.002;
/// How the error of fixes may be correlated in time: of the slow part shares of the variance, and time constants (s).
/// Finer than the bank of GpsIns: where none of it fits, the one that does best may take the mean for much better than
/// it is.
constexpr std::array<double, 6> kShares = {0.3, 0.6, 0.8, 0.9, 0.97, 0.998};
constexpr std::array<double, 5> kCorrelations_s = {1.0, 4.0, 12.0, 40.0, 120.0};

std::vector<FixNoise> noises() {
  std::vector<FixNoise> all = {{0.0, 1.0}};
  for (const double share : kShares) {
    for (const double correlation_s : kCorrelations_s) all.push_back({share, correlation_s});
  }
  return all;
}

const std::vector<FixNoise>& bank() {
  static const std::vector<FixNoise> all = noises();
  return all;
}

/// No filter is thought less likely than exp(-this) times the best, so that each can come back.
constexpr double kLeastLog = 12.0;

}  // namespace

void MapPlace::begin(const Eigen::Vector2d& c_map_m, const Pose2& T_world_map, double variance_m2,
                     double yaw_variance_rad2) {
  has_begun_ = true;
  stamp_ns_ = 0;
  c_map_m_ = c_map_m;
  filters_.resize(bank().size());
  compared_.resize(bank().size());
  for (Filter& filter : filters_) {
    filter.x << T_world_map * c_map_m, T_world_map.yaw_rad, 0.0, 0.0;
    filter.P = Matrix5::Zero();
    filter.P.diagonal() << variance_m2, variance_m2, yaw_variance_rad2, 1.0, 1.0;
    filter.log_likelihood = 0.0;
  }
  mix();
}

bool MapPlace::add(const PlacedFix& fix, double way_variance_m2) {
  static const double gate = chi_square_quantile(kGateProbability, 2.0);
  const double dt_s = stamp_ns_ == 0 ? 0.0 : std::max(seconds_between(stamp_ns_, fix.stamp_ns), 0.0);
  stamp_ns_ = fix.stamp_ns;
  const Eigen::Vector2d arm_map_m = fix.antenna_m - c_map_m_;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < filters_.size(); ++i) {
    Filter& filter = filters_[i];
    const FixNoise& noise = bank()[i];
    const double kept = std::exp(-dt_s / noise.correlation_s);
    filter.x.tail<2>() *= kept;
    filter.P.rightCols<2>() *= kept;
    filter.P.bottomRows<2>() *= kept;
    filter.P.diagonal().tail<2>().array() += 1.0 - kept * kept;
    filter.P.diagonal().head<2>().array() += kBend_m_sqrt_s * kBend_m_sqrt_s * dt_s;
    filter.P(kPlaceYaw, kPlaceYaw) += kBend_rad_sqrt_s * kBend_rad_sqrt_s * dt_s;
    const Eigen::Vector2d arm_m = Pose2{Eigen::Vector2d::Zero(), filter.x(kPlaceYaw)}.rotation() * arm_map_m;
    const Eigen::Vector2d scale_m = (noise.correlated_share * fix.variance_m2).cwiseSqrt();
    Compared& own = compared_[i];
    own.nu = fix.fix_world_m - filter.x.head<2>() - arm_m - scale_m.cwiseProduct(filter.x.tail<2>());
    own.H << Eigen::Matrix2d::Identity(), left_of(arm_m), Eigen::Matrix2d(scale_m.asDiagonal());
    own.S = own.H * filter.P * own.H.transpose();
    own.S.diagonal() += (1.0 - noise.correlated_share) * fix.variance_m2;
    own.S.diagonal().array() += way_variance_m2;
    own.mahalanobis2 = own.nu.dot(own.S.llt().solve(own.nu));
    least = std::min(least, own.mahalanobis2);
  }
  if (!(least < gate)) {  // for all noises
    mix();
    return false;
  }
  double highest = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < filters_.size(); ++i) {
    Filter& filter = filters_[i];
    const Compared& own = compared_[i];
    const Eigen::Matrix<double, 5, 2> K = filter.P * own.H.transpose() * own.S.inverse();
    filter.x += K * own.nu;
    filter.P -= K * own.S * K.transpose();
    filter.P = (0.5 * (filter.P + filter.P.transpose())).eval();
    filter.log_likelihood -= 0.5 * (own.mahalanobis2 + std::log(own.S.determinant()));
    highest = std::max(highest, filter.log_likelihood);
  }
  for (Filter& filter : filters_) filter.log_likelihood = std::max(filter.log_likelihood - highest, -kLeastLog);
  mix();
  return true;
}

void MapPlace::mix() {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double weights = 0.0;
  for (const Filter& filter : filters_) {
    const double weight = std::exp(filter.log_likelihood);
    weights += weight;
    mean += weight * filter.x.head<3>();
  }
  mean /= weights;
  P_.setZero();
  for (const Filter& filter : filters_) {
    const Eigen::Vector3d apart = filter.x.head<3>() - mean;
    P_ += std::exp(filter.log_likelihood) / weights * (filter.P.topLeftCorner<3, 3>() + apart * apart.transpose());
  }
  T_world_map_.yaw_rad = mean(kPlaceYaw);
  T_world_map_.translation_m = mean.head<2>() - T_world_map_.rotation() * c_map_m_;
}

Eigen::Matrix3d MapPlace::covariance_at(const Eigen::Vector2d& p_map_m) const {
  Eigen::Matrix3d J = Eigen::Matrix3d::Identity();
  J.block<2, 1>(0, kPlaceYaw) = left_of(T_world_map_.rotation() * (p_map_m - c_map_m_));
  return J * P_ * J.transpose();
}

}  // namespace situation_awareness
