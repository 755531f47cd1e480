// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/standing_place.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

/// A view counts whose lidar is farther than this from that of the view before, as for the keys of a survey.
constexpr double kViewStep_m = 0.1;
/// Between two views that are farther apart in time it has not been in view.
constexpr double kViewGap_s = 0.5;
constexpr int kLeastViews = 10;
/// The radius must be known to this standard deviation, and be right within three, or within three times the least.
constexpr double kRadiusSigma_m = 0.02;
constexpr double kLeastRadiusSigma_m = 0.005;
/// Mean of the squared errors, normalised by their covariance: one of a reflector that stands, as in the survey.
constexpr double kMaxMeanSquare = 4.0;

}  // namespace

void StandingPlace::add(std::int64_t stamp_ns, const Eigen::Vector2d& center_world_m, const Eigen::Matrix2d& covariance,
                        const Eigen::Vector2d& lidar_world_m) {
  if (has_view_) {
    const double since_s = seconds_between(stamp_ns_, stamp_ns);
    if (since_s > 0.0 && since_s < kViewGap_s) seen_s_ += since_s;
  } else {
    first_world_m_ = center_world_m;
  }
  stamp_ns_ = stamp_ns;
  if (has_view_ && (lidar_world_m - lidar_world_m_).norm() < kViewStep_m) return;
  has_view_ = true;
  lidar_world_m_ = lidar_world_m;
  const Eigen::Matrix2d W = covariance.inverse();
  const Eigen::Vector2d y = center_world_m - first_world_m_;
  Eigen::Matrix<double, 2, 3> J;
  J << Eigen::Matrix2d::Identity(), (lidar_world_m - center_world_m).normalized();
  if (!W.allFinite() || !J.allFinite()) return;
  ++views_;
  A_ += J.transpose() * W * J;
  b_ += J.transpose() * W * y;
  square_ += y.dot(W * y);
}

bool StandingPlace::is_reflector() const {
  if (views_ < kLeastViews) return false;
  const Eigen::LLT<Eigen::Matrix3d> llt(A_);
  if (llt.info() != Eigen::Success) return false;
  const Eigen::Vector3d x = llt.solve(b_);
  const double sigma_m = std::sqrt(llt.solve(Eigen::Vector3d::UnitZ()).z());
  const double mean_square = (square_ - b_.dot(x)) / (2 * views_ - 3);
  return sigma_m < kRadiusSigma_m && std::abs(x.z()) < 3.0 * std::max(sigma_m, kLeastRadiusSigma_m) &&
         mean_square < kMaxMeanSquare;
}

Eigen::Vector2d StandingPlace::center_world_m() const {
  const Eigen::Matrix2d A = A_.topLeftCorner<2, 2>();  // of a reflector: its radius is right
  const Eigen::LLT<Eigen::Matrix2d> llt(A);
  if (views_ == 0 || llt.info() != Eigen::Success) return first_world_m_;
  return first_world_m_ + llt.solve(b_.head<2>());
}

}  // namespace situation_awareness
