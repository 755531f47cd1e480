// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/map_alignment.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

using Matrix5 = Eigen::Matrix<double, 5, 5>;
using Vector5 = Eigen::Matrix<double, 5, 1>;

constexpr int kIterations = 4;
/// Standard deviations of the scan's place within which boundaries are looked for, and the reach (m) beyond that.
constexpr double kReachSigmas = 3.0;
constexpr double kLeastSearch_m = 0.2, kMostSearch_m = 1.5;
/// Pairs, at least.
constexpr std::size_t kFewestPairs = 12;
/// Standard deviations beyond which a pair counts linearly (Huber).
constexpr double kHuber = 2.0;
/// A step (m, rad) that ends the iterations.
constexpr double kSmallStep = 1e-4;
/// m^2 and rad^2. Keeps P invertible.
constexpr double kLeastVariance = 1e-10;

}  // namespace

void MapAlignment::pair_up(const PolygonMap& map, const Polylines& polylines, const Pose2& T_map_level,
                           double reach_m) {
  pairs_.clear();
  pairs_.reserve(polylines.hits.size());
  const Eigen::Matrix2d R = T_map_level.rotation();
  BoundaryElement element;
  for (const PolylineHit& hit : polylines.hits) {
    if (!hit.has_normal) continue;
    const Eigen::Vector2d p_map_m = R * hit.p_level_m + T_map_level.translation_m;
    if (!map.find_facing(p_map_m, R * hit.normal_level, reach_m, element)) continue;
    const Eigen::Vector2d normal_map(-element.along_world.y(), element.along_world.x());
    pairs_.push_back({hit.p_level_m, element.p_world_m, normal_map,
                      hit.sigma_m * hit.sigma_m + element.variance_m2 + params_.hit_sigma_m * params_.hit_sigma_m});
  }
}

Eigen::Matrix3d MapAlignment::align(const PolygonMap& map, const InertialPlacement& placement, Polylines& polylines) {
  const Pose2 T_odom_level = polylines.T_world_level;
  Pose2 T_map_level = T_map_odom_ * T_odom_level;
  if (has_begun_) {
    const double dt_s = std::max(seconds_between(stamp_ns_, polylines.stamp_ns), 0.0);
    const Eigen::Matrix2d R = T_map_level.rotation();
    T_map_level.translation_m += dt_s * (R * v_level_m_s_);
    const Eigen::Vector2d moved_m = T_map_level.translation_m - at_map_m_;
    Matrix5 F = Matrix5::Identity();
    F.block<2, 1>(0, 2) << -moved_m.y(), moved_m.x();
    F.block<2, 2>(0, 3) = dt_s * R;
    P_ = F * P_ * F.transpose();
    P_(2, 2) += params_.yaw_drift_rad_sqrt_s * params_.yaw_drift_rad_sqrt_s * dt_s;
    P_.diagonal().tail<2>().array() += params_.velocity_drift_m_s_sqrt_s * params_.velocity_drift_m_s_sqrt_s * dt_s;
    P_.diagonal().array() += kLeastVariance;

    const double sigma_m = std::sqrt(std::max(P_(0, 0), P_(1, 1)));
    const double reach_m = std::clamp(kLeastSearch_m + kReachSigmas * sigma_m, kLeastSearch_m, kMostSearch_m);
    const Matrix5 information = P_.llt().solve(Matrix5::Identity());
    Vector5 total = Vector5::Zero();
    Matrix5 A = information;
    const Pose2 begin = T_map_level;
    for (int k = 0; k < kIterations; ++k) {
      pair_up(map, polylines, T_map_level, reach_m);
      A = information;
      if (pairs_.size() < kFewestPairs) break;
      Vector5 b = -information * total;
      const Eigen::Matrix2d R_map_level = T_map_level.rotation();
      for (const Pair& pair : pairs_) {
        const Eigen::Vector2d offset_m = R_map_level * pair.p_level_m;
        const double residual_m = pair.normal_map.dot(pair.q_map_m - offset_m - T_map_level.translation_m);
        const double sigmas = std::abs(residual_m) / std::sqrt(pair.variance_m2);
        const double weight = params_.independent_part / pair.variance_m2 * (sigmas > kHuber ? kHuber / sigmas : 1.0);
        Eigen::Vector3d J;
        J << pair.normal_map, pair.normal_map.dot(Eigen::Vector2d(-offset_m.y(), offset_m.x()));
        A.topLeftCorner<3, 3>() += weight * J * J.transpose();
        b.head<3>() += weight * residual_m * J;
      }
      const Vector5 step = A.llt().solve(b);
      total += step;
      T_map_level = {begin.translation_m + total.head<2>(), begin.yaw_rad + total(2)};
      if (step.cwiseAbs().maxCoeff() < kSmallStep) break;
    }
    v_level_m_s_ += total.tail<2>();
    P_ = A.llt().solve(Matrix5::Identity());
  } else {
    P_.diagonal().tail<2>().setConstant(placement.velocity_sigma_m_s * placement.velocity_sigma_m_s);
  }
  if (!has_begun_ && polylines.hits.empty()) return P_.topLeftCorner<3, 3>();
  has_begun_ = true;
  stamp_ns_ = polylines.stamp_ns;
  at_map_m_ = T_map_level.translation_m;
  T_map_odom_ = T_map_level * inverse(T_odom_level);
  average(polylines, T_map_level, placement);
  polylines.T_world_level = T_map_level;
  return P_.topLeftCorner<3, 3>();
}

/// Each pose says where the map is, with the weight of what it knows. Errors of poses last: the mean is taken for no
/// better than the best of them.
void MapAlignment::average(const Polylines& polylines, const Pose2& T_map_level, const InertialPlacement& placement) {
  const Eigen::Matrix3d& pose_covariance = placement.pose_covariance;
  if (polylines.hits.empty()) return;
  Eigen::Vector2d seen_map_m = Eigen::Vector2d::Zero();
  for (const PolylineHit& hit : polylines.hits) seen_map_m += T_map_level * hit.p_level_m;
  seen_map_m /= static_cast<double>(polylines.hits.size());
  const double variance_m2 = std::max(pose_covariance(0, 0), pose_covariance(1, 1));
  const double position_weight = 1.0 / variance_m2, yaw_weight = 1.0 / pose_covariance(2, 2);
  const bool first = position_weight_ == 0.0;
  position_variance_m2_ = first ? variance_m2 : std::min(position_variance_m2_, variance_m2);
  yaw_variance_rad2_ = first ? pose_covariance(2, 2) : std::min(yaw_variance_rad2_, pose_covariance(2, 2));

  const Pose2 T_world_map_now = placement.T_world_odom * inverse(T_map_odom_);
  position_weight_ += position_weight;
  yaw_weight_ += yaw_weight;
  const double part = position_weight / position_weight_;
  middle_map_m_ += part * (seen_map_m - middle_map_m_);
  middle_world_m_ += part * (T_world_map_now * seen_map_m - middle_world_m_);
  yaw_rad_ += yaw_weight / yaw_weight_ * wrap_to_pi(T_world_map_now.yaw_rad - yaw_rad_);
  T_world_map_ = {Eigen::Vector2d::Zero(), yaw_rad_};
  T_world_map_.translation_m = middle_world_m_ - T_world_map_.rotation() * middle_map_m_;
}

double MapAlignment::variance_m2(double from_middle_m) const {
  return position_variance_m2_ + yaw_variance_rad2_ * from_middle_m * from_middle_m;
}

}  // namespace situation_awareness
