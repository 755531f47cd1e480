// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/ransac.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include <Eigen/LU>

#include "situation_awareness/geometry/ellipse.hpp"

#include "fit_each.hpp"

namespace situation_awareness {
namespace {

constexpr std::size_t kSample = 3;

/// Three different numbers below `count`, which is more than three.
std::array<std::size_t, kSample> draw_sample(std::size_t count, Random& random) {
  std::array<std::size_t, kSample> sample{};
  for (auto drawn = sample.begin(); drawn != sample.end();) {
    *drawn = static_cast<std::size_t>(random.uniform() * static_cast<double>(count));
    if (std::find(sample.begin(), drawn, *drawn) == drawn) ++drawn;
  }
  return sample;
}

/// Indices of the points within `distance_m` of the curve, to first order: |F| / |grad F| (Sampson, 1982) with
/// F = sqrt(d^T M d) - 1, which unlike d^T M d - 1 stays near the distance also far from the curve.
std::vector<std::size_t> inliers_of(const Ellipse& ellipse, const std::vector<Eigen::Vector2d>& points_m,
                                    double distance_m) {
  const Eigen::Matrix2d M = shape_matrix(ellipse).inverse();
  std::vector<std::size_t> inliers;
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    const Eigen::Vector2d d = points_m[i] - ellipse.center_m;
    const Eigen::Vector2d Md = M * d;
    const double a = d.dot(Md);
    if (std::abs(a - std::sqrt(a)) <= distance_m * Md.norm() && a > 0.0) inliers.push_back(i);
  }
  return inliers;
}

}  // namespace

void RansacParams::validate() const { check_bounds(*this, "ransac"); }

RansacFit fit_ransac(const std::vector<Eigen::Vector2d>& points_level_m, const RansacParams& params,
                     const DoglegParams& dogleg_params, Random& random) {
  RansacFit best;
  std::vector<Eigen::Vector2d> chosen_m;
  if (points_level_m.size() <= kSample) {
    best.refined = fit_dogleg(points_level_m, dogleg_params);
    best.inliers = inliers_of(best.refined.ellipse_level, points_level_m, params.inlier_distance_m);
    return best;
  }
  for (int i = 0; i < params.max_candidates && best.inliers.size() < points_level_m.size(); ++i) {
    chosen_m.clear();
    for (const std::size_t k : draw_sample(points_level_m.size(), random)) chosen_m.push_back(points_level_m[k]);
    const DoglegFit candidate = fit_dogleg(chosen_m, dogleg_params);
    std::vector<std::size_t> inliers = inliers_of(candidate.ellipse_level, points_level_m, params.inlier_distance_m);
    if (i > 0 && inliers.size() <= best.inliers.size()) continue;
    best.refined = candidate;
    best.inliers = std::move(inliers);
  }
  if (best.inliers.size() < kSample) return best;
  chosen_m.clear();
  for (const std::size_t k : best.inliers) chosen_m.push_back(points_level_m[k]);
  best.refined = fit_dogleg(chosen_m, dogleg_params);
  return best;
}

RansacDetector::RansacDetector(const RansacParams& params, const DoglegParams& dogleg_params,
                               const EllipseFitParams& fit_params)
    : params_(params), dogleg_params_(dogleg_params), fit_params_(fit_params) {
  params_.validate();
  dogleg_params_.validate();
  fit_params_.validate();
}

void RansacDetector::find(const Segments& segments, Detections& found) {
  const auto fit = [&](const std::vector<Eigen::Vector2d>& points_level_m) {
    Random random(static_cast<std::uint64_t>(params_.seed));
    return fit_ransac(points_level_m, params_, dogleg_params_, random).refined.ellipse_level;
  };
  fit_each(segments, fit_params_, fit, points_level_m_, found);
}

}  // namespace situation_awareness
