// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/reflector_search.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "situation_awareness/estimation/error_state_filter.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"

namespace situation_awareness {
namespace {

/// Most Gauss-Newton steps; three or four are taken.
constexpr int kMaxSteps = 20;
constexpr double kConverged = 1e-13;
/// Beyond this number the search gives up as ambiguous.
constexpr std::size_t kMaxHypotheses = 512;
/// Poses nearer to each other than this, in m and rad, are the same found by other pairs.
constexpr double kSamePose_m = 0.3;
constexpr double kSameYaw_rad = 0.1;

bool is_same(const Pose2& a, const Pose2& b) {
  const Pose2 between = inverse(a) * b;
  return between.translation_m.norm() < kSamePose_m && std::abs(wrap_to_pi(between.yaw_rad)) < kSameYaw_rad;
}

/// Variance of the distance of two places.
double distance_variance(const ReflectorPlace& a, const ReflectorPlace& b) {
  const Eigen::Vector2d along = (a.center_m - b.center_m).normalized();
  return along.dot((a.covariance + b.covariance) * along);
}

}  // namespace

void ReflectorSearchParams::validate() const { check_bounds(*this, "search"); }

Eigen::Vector2d place_of(const Pose2& T_world_frame, const Eigen::Vector2d& center_world_m) {
  return T_world_frame.rotation().transpose() * (center_world_m - T_world_frame.translation_m);
}

Eigen::Matrix<double, 2, 3> place_jacobian(const Eigen::Vector2d& center_frame_m) {
  Eigen::Matrix<double, 2, 3> J;
  J << -1.0, 0.0, center_frame_m.y(), 0.0, -1.0, -center_frame_m.x();
  return J;
}

double fit_pose(const std::vector<ReflectorPlace>& places, const std::vector<int>& reflectors, const ReflectorMap& map,
                Pose2& T_world_frame, Eigen::Matrix3d& P) {
  double cost = 0.0;
  for (int step = 0; step < kMaxSteps; ++step) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    cost = 0.0;
    int matched = 0;
    for (std::size_t i = 0; i < places.size() && i < reflectors.size(); ++i) {
      if (reflectors[i] < 0) continue;
      const Eigen::Vector2d p =
          place_of(T_world_frame, map.reflectors[static_cast<std::size_t>(reflectors[i])].center_world_m);
      const Eigen::Vector2d nu = places[i].center_m - p;
      const Eigen::Matrix<double, 2, 3> H = place_jacobian(p);
      const Eigen::Matrix2d W = places[i].covariance.inverse();
      A += H.transpose() * W * H;
      b += H.transpose() * W * nu;
      cost += nu.dot(W * nu);
      ++matched;
    }
    if (matched < 2) return -1.0;
    const Eigen::LLT<Eigen::Matrix3d> llt(A);
    if (llt.info() != Eigen::Success) return -1.0;
    const Eigen::Vector3d e = llt.solve(b);
    if (!e.allFinite()) return -1.0;
    T_world_frame = T_world_frame * exp_se2(e);
    P = llt.solve(Eigen::Matrix3d::Identity());
    if (e.norm() < kConverged) break;
  }
  T_world_frame.yaw_rad = wrap_to_pi(T_world_frame.yaw_rad);
  P = 0.5 * (P + P.transpose()).eval();
  return cost;
}

ReflectorSearch::ReflectorSearch(const ReflectorMap& map, const ReflectorSearchParams& params)
    : map_(map), params_(params), gate_(0.0) {
  check_reflectors(map_, "reflector map");
  params_.validate();
  gate_ = chi_square_quantile(params_.gate_probability, 2);
  taken_.resize(map_.reflectors.size());
  hypotheses_.resize(kMaxHypotheses);
  for (Hypothesis& hypothesis : hypotheses_) hypothesis.reflectors.reserve(kMaxPlaces);
  next_.reflectors.reserve(kMaxPlaces);
  result_.reflectors.reserve(kMaxPlaces);
}

// The first two places are matched: each other place to the reflector that is nearest, as the pose becomes known
// better.
bool ReflectorSearch::complete(const std::vector<ReflectorPlace>& places, const std::vector<char>& excluded,
                               Hypothesis& hypothesis) {
  hypothesis.fit_cost = fit_pose(places, hypothesis.reflectors, map_, hypothesis.T_world_frame, hypothesis.P);
  if (hypothesis.fit_cost < 0.0 || hypothesis.fit_cost > 2.0 * gate_) return false;
  for (std::size_t k = 0; k < taken_.size(); ++k) taken_[k] = k < excluded.size() && excluded[k] != 0 ? 1 : 0;
  for (const int reflector : hypothesis.reflectors) {
    if (reflector >= 0) taken_[static_cast<std::size_t>(reflector)] = 1;
  }
  Estimate<Pose2> estimate{hypothesis.T_world_frame, hypothesis.P};
  for (std::size_t i = 0; i < hypothesis.reflectors.size(); ++i) {
    if (hypothesis.reflectors[i] >= 0) continue;
    int best = -1;
    Innovation<2> best_innovation;
    Eigen::Matrix<double, 2, 3> best_H;
    for (std::size_t k = 0; k < map_.reflectors.size(); ++k) {
      if (taken_[k] != 0) continue;
      const Eigen::Vector2d p = place_of(estimate.x, map_.reflectors[k].center_world_m);
      const Eigen::Matrix<double, 2, 3> H = place_jacobian(p);
      const Innovation<2> compared =
          innovation(estimate, Eigen::Vector2d(places[i].center_m - p), H, places[i].covariance);
      if (!inside_gate(compared, gate_) || (best >= 0 && compared.mahalanobis2 >= best_innovation.mahalanobis2))
        continue;
      best = static_cast<int>(k);
      best_innovation = compared;
      best_H = H;
    }
    if (best < 0) continue;
    hypothesis.reflectors[i] = best;
    taken_[static_cast<std::size_t>(best)] = 1;
    update(estimate, best_innovation, best_H, places[i].covariance);
  }
  hypothesis.T_world_frame = estimate.x;
  return true;
}

bool ReflectorSearch::refine(const std::vector<ReflectorPlace>& places, Hypothesis& hypothesis) const {
  hypothesis.fit_cost = fit_pose(places, hypothesis.reflectors, map_, hypothesis.T_world_frame, hypothesis.P);
  const auto unmatched = std::count(hypothesis.reflectors.begin(), hypothesis.reflectors.end(), -1);
  hypothesis.cost = hypothesis.fit_cost + gate_ * static_cast<double>(unmatched);
  return hypothesis.fit_cost >= 0.0;
}

const ReflectorPose& ReflectorSearch::find(const std::vector<ReflectorPlace>& places,
                                           const std::vector<char>& excluded) {
  result_.is_known = false;
  result_.reason = "too few places";
  result_.reflectors.clear();
  used_ = 0;
  const std::size_t n = std::min<std::size_t>(places.size(), kMaxPlaces);
  if (n < static_cast<std::size_t>(params_.min_matches)) return result_;

  bool is_complete = true;
  const std::size_t m = map_.reflectors.size();
  const auto is_out = [&](std::size_t k) { return k < excluded.size() && excluded[k] != 0; };
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 1; j < n; ++j) {
      const Eigen::Vector2d seen_m = places[j].center_m - places[i].center_m;
      const double distance_m = seen_m.norm();
      if (distance_m < params_.min_distance_m) continue;
      const double allowed_m2 = gate_ * distance_variance(places[i], places[j]) + 1e-12;
      for (std::size_t a = 0; a < m; ++a) {
        if (is_out(a)) continue;
        for (std::size_t b = 0; b < m; ++b) {
          if (a == b || is_out(b)) continue;
          const Eigen::Vector2d mapped_m = map_.reflectors[b].center_world_m - map_.reflectors[a].center_world_m;
          const double difference_m = mapped_m.norm() - distance_m;
          if (difference_m * difference_m > allowed_m2) continue;
          next_.reflectors.assign(n, -1);
          next_.reflectors[i] = static_cast<int>(a);
          next_.reflectors[j] = static_cast<int>(b);
          next_.T_world_frame.yaw_rad = std::atan2(mapped_m.y(), mapped_m.x()) - std::atan2(seen_m.y(), seen_m.x());
          next_.T_world_frame.translation_m =
              map_.reflectors[a].center_world_m - next_.T_world_frame.rotation() * places[i].center_m;
          if (!complete(places, excluded, next_)) continue;
          const auto end = hypotheses_.begin() + static_cast<std::ptrdiff_t>(used_);
          const bool is_old = std::any_of(hypotheses_.begin(), end, [&](const Hypothesis& hypothesis) {
            return hypothesis.reflectors == next_.reflectors;
          });
          if (is_old) continue;
          if (used_ == kMaxHypotheses) {
            is_complete = false;
            continue;
          }
          Hypothesis& hypothesis = hypotheses_[used_];
          hypothesis = next_;
          if (refine(places, hypothesis)) ++used_;
        }
      }
    }
  }

  const auto end = hypotheses_.begin() + static_cast<std::ptrdiff_t>(used_);
  const auto best = std::min_element(hypotheses_.begin(), end,
                                     [](const Hypothesis& x, const Hypothesis& y) { return x.cost < y.cost; });
  result_.reason = "no match";
  if (best == end) return result_;
  const auto matches = std::count_if(best->reflectors.begin(), best->reflectors.end(), [](int r) { return r >= 0; });
  if (matches < params_.min_matches) return result_;
  result_.T_world_frame = best->T_world_frame;
  result_.P = best->P;
  result_.reflectors = best->reflectors;
  result_.cost = best->fit_cost;
  const bool is_ambiguous = std::any_of(hypotheses_.begin(), end, [&](const Hypothesis& other) {
    return other.cost < best->cost + params_.min_advantage && !is_same(other.T_world_frame, best->T_world_frame);
  });
  result_.reason = is_ambiguous || !is_complete ? "ambiguous" : "";
  result_.is_known = !is_ambiguous && is_complete;
  return result_;
}

}  // namespace situation_awareness
