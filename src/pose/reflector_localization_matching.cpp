// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "reflector_localization_parts.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"
#include "situation_awareness/pose/reflector_localization.hpp"

// Which reflector each sighting is of.
namespace situation_awareness {
namespace {

/// A match is ambiguous if other matches contradict it whose cost, the sum of squared Mahalanobis distances and of the
/// gate for each sighting left unmatched, is not higher by this. Its source is not recorded, nor its sensitivity.
constexpr double kMatchAdvantage = 6.0;
/// Matches of a scan that are tried before it is given up as ambiguous; without false sightings a few per reflector.
constexpr int kMaxNodes = 3000;

}  // namespace

// Whether a sighting may be of a reflector with this centre, P_l being the covariance of the place. `fit`: for its
// radius, and that of the call before.
bool ReflectorLocalization::is_possible(const ReflectorSightings& sightings, const Seen& seen,
                                        const Eigen::Vector2d& center_m, double radius_m, const Eigen::Matrix2d& P_l,
                                        SightingFit& fit, Possible& possible) const {
  const ReflectorSighting& sighting = sightings.sightings[seen.sighting];
  const Eigen::Vector2d predicted = observed_reflector(estimate_.x.T_world_base, seen.T_base_lidar, center_m);
  if (predicted(0) < radius_m + 0.01) return false;  // inside it
  Matrix26 H = Matrix26::Zero();
  H.leftCols<3>() = observed_reflector_jacobian(estimate_.x.T_world_base, seen.T_base_lidar, center_m);
  // An error of a moved reflector's place acts as an independent one of the sighting. In truth it has much in common
  // with that of the pose by which it was found, and the gate is wider than need be.
  const Eigen::Matrix2d HPH_l =
      transformed(observed_reflector_place_jacobian(H.leftCols<3>(), estimate_.x.T_world_base), P_l);
  const Eigen::Matrix2d HPH = transformed(H, estimate_.P) + HPH_l;
  // Most are far away: only near ones are fitted.
  const double off_m = predicted(0) - sighting.surface_range_m - radius_m;
  if (off_m * off_m > 4.0 * gate_ * (HPH(0, 0) + 0.01)) return false;
  const double off_rad = wrap_to_pi(predicted(1) - sighting.azimuth_rad);
  if (off_rad * off_rad > 4.0 * gate_ * (HPH(1, 1) + 1e-3)) return false;
  if (radius_m != fit.radius_m) fit = {radius_m, fit_reflector(sightings, sighting, radius_m)};
  possible.z << fit.fit.range_m, fit.fit.azimuth_rad;
  possible.R = fit.fit.covariance;
  possible.white = fit.fit.white;
  const double model_m2 = kModelSigma_m * kModelSigma_m;
  possible.R(0, 0) += model_m2;
  possible.R(1, 1) += model_m2 / (fit.fit.range_m * fit.fit.range_m);
  // To first order errors of odometry since the stamp act as one of the pose at the stamp, turned by the motion.
  possible.R_gate = possible.R + transformed(H, seen.Q) + HPH_l;
  Eigen::Vector2d nu = possible.z - predicted;
  nu(1) = wrap_to_pi(nu(1));
  return inside_gate(innovation(estimate_, nu, H, possible.R_gate), gate_);
}

// Which reflectors each sighting may be of, each by itself.
void ReflectorLocalization::list_possible(const ReflectorSightings& sightings) {
  possible_.clear();
  for (Seen& seen : seen_) {
    seen.first = possible_.size();
    SightingFit fit;
    for (std::size_t k = 0; k < map_.reflectors.size(); ++k) {
      const Reflector& reflector = map_.reflectors[k];
      Watched& watched = watched_[k];
      Possible possible{};
      possible.reflector = static_cast<int>(k);
      if (watched.used >= 0 && is_possible(sightings, seen, moved_.at(watched.used), reflector.radius_m,
                                           moved_.covariance_at(watched.used), fit, possible)) {
        possible_.push_back(possible);
        continue;
      }
      if (!is_possible(sightings, seen, reflector.center_world_m, reflector.radius_m, Eigen::Matrix2d::Zero(), fit,
                       possible)) {
        continue;
      }
      if (watched.is_moved) {
        ++watched.back;
      } else {
        possible_.push_back(possible);
      }
    }
    seen.count = possible_.size() - seen.first;
  }
  // Those with the least choice first, which makes the tree of assignments small.
  std::sort(seen_.begin(), seen_.end(), [](const Seen& a, const Seen& b) {
    const bool is_clear_a = a.count == 1, is_clear_b = b.count == 1;
    return is_clear_a != is_clear_b ? is_clear_a : a.sighting < b.sighting;
  });
}

// The assignment with the least sum of squared Mahalanobis distances, of all sightings jointly, and of the gate for
// each left out (joint compatibility: Neira and Tardos, 2001).
void ReflectorLocalization::associate() {
  leaves_.clear();
  best_cost_ = std::numeric_limits<double>::infinity();
  nodes_ = 0;
  std::fill(taken_.begin(), taken_.end(), 0);
  trial_.fill(-1);
  reflector_of_.fill(-1);
  try_sighting(0, estimate_, 0.0);
  if (nodes_ > kMaxNodes) {
    ++counters_["association given up"];
    for (const Seen& seen : seen_) {
      if (seen.count > 0) update_.ambiguous.push_back(seen.sighting);
    }
    return;
  }
  if (leaves_.empty()) return;
  const Leaf& best =
      *std::min_element(leaves_.begin(), leaves_.end(), [](const Leaf& a, const Leaf& b) { return a.cost < b.cost; });
  for (std::size_t k = 0; k < seen_.size(); ++k) {
    const int reflector = best.reflector_of[k];
    if (reflector < 0) continue;
    const bool is_contested = std::any_of(leaves_.begin(), leaves_.end(), [&](const Leaf& leaf) {
      if (leaf.cost > best.cost + kMatchAdvantage) return false;
      if (leaf.reflector_of[k] >= 0 && leaf.reflector_of[k] != reflector) return true;
      for (std::size_t m = 0; m < seen_.size(); ++m) {
        if (m != k && leaf.reflector_of[m] == reflector) return true;
      }
      return false;
    });
    if (is_contested) {
      update_.ambiguous.push_back(seen_[k].sighting);
    } else {
      reflector_of_[k] = reflector;
    }
  }
}

void ReflectorLocalization::try_sighting(std::size_t k, const Estimate<ReflectorState>& estimate, double cost) {
  if (++nodes_ > kMaxNodes) return;
  if (k == seen_.size()) {
    best_cost_ = std::min(best_cost_, cost);
    if (leaves_.size() == kMaxLeaves) {  // the worst makes room
      const auto worst = std::max_element(leaves_.begin(), leaves_.end(),
                                          [](const Leaf& a, const Leaf& b) { return a.cost < b.cost; });
      if (worst->cost > cost) *worst = {trial_, cost};
    } else {
      leaves_.push_back({trial_, cost});
    }
    return;
  }
  // Each sighting to come may at best be matched without any distance.
  const auto is_hopeless = [&](double so_far) { return so_far > best_cost_ + kMatchAdvantage; };
  if (is_hopeless(cost)) return;
  const Seen& seen = seen_[k];
  for (std::size_t i = seen.first; i < seen.first + seen.count; ++i) {
    const Possible& possible = possible_[i];
    const auto reflector = static_cast<std::size_t>(possible.reflector);
    if (taken_[reflector] != 0) continue;
    const Eigen::Vector2d center_m = center_of(reflector);
    // Linearised at the estimate that the matches so far lead to, and again where the correction by this one is large.
    Matrix26 H = Matrix26::Zero();
    Innovation<2> compared;
    Vector6 e = Vector6::Zero();
    double nis = 0.0;
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
      const ReflectorState x = Manifold<ReflectorState>::retract(estimate.x, e);
      H.leftCols<3>() =
          observed_reflector_jacobian(x.T_world_base, seen.T_base_lidar, center_m) * right_jacobian_se2(e.head<3>());
      Eigen::Vector2d nu = possible.z - observed_reflector(x.T_world_base, seen.T_base_lidar, center_m);
      nu(1) = wrap_to_pi(nu(1));
      compared = innovation(estimate, Eigen::Vector2d(nu + H * e), H, possible.R_gate);
      nis = compared.mahalanobis2;
      if (!(nis < 4.0 * gate_)) break;  // also NaN
      const Vector6 next = estimate.P * H.transpose() * solve_cholesky(factor_of(compared.S), compared.nu);
      const double change = (next - e).norm();
      e = next;
      if (change < kRelinearise) break;
    }
    if (!(nis <= gate_)) continue;
    const double next_cost = cost + nis;
    if (is_hopeless(next_cost)) continue;
    Estimate<ReflectorState> next = estimate;
    situation_awareness::update(next, compared, H, possible.R_gate);
    taken_[reflector] = 1;
    trial_[k] = possible.reflector;
    try_sighting(k + 1, next, next_cost);
    trial_[k] = -1;
    taken_[reflector] = 0;
  }
  try_sighting(k + 1, estimate, cost + (seen.count > 0 ? gate_ : 0.0));
}

// Returns the candidate that `seen_[k]` is matched as.
ReflectorLocalization::Possible& ReflectorLocalization::possible_of(std::size_t k) {
  return *std::find_if(possible_.begin() + static_cast<std::ptrdiff_t>(seen_[k].first), possible_.end(),
                       [&](const Possible& possible) { return possible.reflector == reflector_of_[k]; });
}

// Where a reflector is taken to stand.
Eigen::Vector2d ReflectorLocalization::center_of(std::size_t reflector) const {
  const int moved = watched_[reflector].used;
  return moved >= 0 ? moved_.at(moved) : map_.reflectors[reflector].center_world_m;
}

// What each match says that is new.
void ReflectorLocalization::weigh(double resolution_rad) {
  for (std::size_t k = 0; k < seen_.size(); ++k) {
    const std::size_t sighting = seen_[k].sighting;
    const bool is_ambiguous =
        std::find(update_.ambiguous.begin(), update_.ambiguous.end(), sighting) != update_.ambiguous.end();
    if (reflector_of_[k] < 0) {
      if (!is_ambiguous) update_.unmatched.push_back(sighting);
      continue;
    }
    Possible& possible = possible_of(k);
    const Eigen::Vector2d center_m = center_of(static_cast<std::size_t>(reflector_of_[k]));
    const Eigen::Vector2d predicted = observed_reflector(estimate_.x.T_world_base, seen_[k].T_base_lidar, center_m);
    Matrix26 H = Matrix26::Zero();
    H.leftCols<3>() = observed_reflector_jacobian(estimate_.x.T_world_base, seen_[k].T_base_lidar, center_m);
    Eigen::Vector2d nu = possible.z - predicted;
    nu(1) = wrap_to_pi(nu(1));
    const double nis = innovation(estimate_, nu, H, possible.R_gate).mahalanobis2;
    update_.matches.push_back({sighting, reflector_of_[k], nis});
    update_.nis += nis;

    RepeatedBeams& beams = watched_[static_cast<std::size_t>(reflector_of_[k])].beams;
    possible.R = beams.new_covariance(possible.R, possible.white, predicted(1), resolution_rad);
  }
  if (update_.matches.empty()) return;
  nis_monitor_.add(update_.matches.size(), update_.nis);
}

}  // namespace situation_awareness
