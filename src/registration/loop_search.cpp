// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/registration/loop_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

/// What is younger than this part of the mean age of what is met is of another loop.
constexpr double kSameAge = 0.5;
/// Hits that meet what is old, at least, and over this distance (m). It is looked for in steps of this reach (m), the
/// first one without a motion.
constexpr std::size_t kFewestOfLoop = 6;
constexpr double kLeastOfLoop_m = 0.5;
constexpr std::array<double, 6> kLoopReaches_m = {1.5, 1.5, 1.0, 0.6, 0.4, 0.3};
/// What poses may have drifted meanwhile, and standard deviations of that within which a motion is a loop's.
constexpr double kDrift_m_s = 0.015, kDrift_rad_s = 0.0015;
constexpr double kMostDriftSigmas = 10.0;
/// m, root mean square. Hits are so far from what is old, at least, without the motion, and at most with it.
constexpr double kApartBefore_m = 0.05, kApartAfter_m = 0.1;
/// A loop is closed by so many scans over so long (s), once the scanner's place is known so well (m), or after such a
/// pause (s). What they say is forgotten with this time (s), as the map goes on.
constexpr int kFewestLoopScans = 3;
constexpr double kLoopFor_s = 0.25, kLoopSigma_m = 0.1, kLoopPause_s = 0.5, kLoopMemory_s = 3.0;

double squared(double value) { return value * value; }

}  // namespace

struct LoopSearch::Sight {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double apart_m2 = 0.0, age_s = 0.0, drawn_age_s = 0.0;  ///< means
};

/// Normal equations of the hits' distances from what was seen last before that time; none if they are too few.
std::optional<LoopSearch::Sight> LoopSearch::meet(const PolygonMap& map, const Polylines& polylines,
                                                  const Pose2& T_map_level, const Eigen::Vector2d& center_m,
                                                  double reach_m, std::int64_t before_ns) const {
  constexpr std::int64_t kBegin_ns = std::numeric_limits<std::int64_t>::min();
  const Eigen::Matrix2d R = T_map_level.rotation();
  Sight sight;
  std::size_t count = 0;
  Eigen::Vector2d low_m = Eigen::Vector2d::Constant(1e9), high_m = -low_m;
  for (const PolylineHit& hit : polylines.hits) {
    if (!hit.has_normal) continue;
    const Eigen::Vector2d p_map_m = R * hit.p_level_m + T_map_level.translation_m;
    const auto met = map.find_facing(p_map_m, R * hit.normal_level, reach_m, kBegin_ns, before_ns);
    if (!met) continue;
    const BoundaryElement& element = met->element;
    const Eigen::Vector2d normal_map(-element.along_world.y(), element.along_world.x());
    const double residual_m = normal_map.dot(element.p_world_m - p_map_m);
    const double weight = kIndependentPart / (squared(hit.sigma_m) + element.variance_m2 + squared(hit_sigma_m_));
    Eigen::Vector3d J;
    J << normal_map, normal_map.dot(left_of(p_map_m - center_m));
    sight.information += weight * J * J.transpose();
    sight.gradient += weight * residual_m * J;
    sight.apart_m2 += squared(residual_m);
    sight.age_s += seconds_between(met->seen_ns, polylines.stamp_ns);
    sight.drawn_age_s += seconds_between(met->drawn_ns, polylines.stamp_ns);
    low_m = low_m.cwiseMin(p_map_m);
    high_m = high_m.cwiseMax(p_map_m);
    ++count;
  }
  if (count < kFewestOfLoop || (high_m - low_m).norm() < kLeastOfLoop_m) return std::nullopt;
  sight.apart_m2 /= static_cast<double>(count);
  sight.age_s /= static_cast<double>(count);
  sight.drawn_age_s /= static_cast<double>(count);
  return sight;
}

/// Takes what the scan says, if it meets what is old, and is elsewhere.
void LoopSearch::find(const PolygonMap& map, const Polylines& polylines, const Pose2& T_map_level,
                      const Eigen::Matrix3d& covariance) {
  const std::int64_t recent_ns = stamp_ns_ - nanoseconds(kRecent_s);
  Loop loop = loop_;
  if (loop.scans == 0) {
    loop.begin_ns = stamp_ns_;
    loop.center_m = T_map_level.translation_m;
  } else {
    loop.information *= std::exp(-seconds_between(loop.found_ns, stamp_ns_) / kLoopMemory_s);
  }
  std::optional<Sight> sight = meet(map, polylines, T_map_level, loop.center_m, kLoopReaches_m[0], recent_ns);
  if (!sight) return;
  if (sight->apart_m2 < squared(kApartBefore_m)) return;
  Eigen::Matrix3d drift = covariance;
  drift.diagonal() += Eigen::Vector3d(kDrift_m_s, kDrift_m_s, kDrift_rad_s).cwiseAbs2() * squared(sight->age_s);
  loop.drift_information = drift.inverse();
  const Eigen::Matrix3d before = loop.information;
  const Eigen::Vector3d motion_before = loop.motion;
  for (std::size_t k = 1; k < kLoopReaches_m.size(); ++k) {
    sight = meet(map, polylines, motion_about(loop.center_m, loop.motion) * T_map_level, loop.center_m,
                 kLoopReaches_m[k], std::min(recent_ns, stamp_ns_ - nanoseconds(kSameAge * sight->age_s)));
    if (!sight) return;
    loop.information = before + sight->information;
    loop.motion +=
        (loop.information + loop.drift_information)
            .ldlt()
            .solve(sight->gradient + before * (motion_before - loop.motion) - loop.drift_information * loop.motion);
  }
  if (sight->apart_m2 > squared(kApartAfter_m) ||
      loop.motion.dot(loop.drift_information * loop.motion) > squared(kMostDriftSigmas)) {
    return;
  }
  loop.since_ns = stamp_ns_ - nanoseconds(sight->age_s);
  loop.drawn_ns = stamp_ns_ - nanoseconds(sight->drawn_age_s);
  loop.found_ns = stamp_ns_;
  ++loop.scans;
  loop_ = loop;
}

/// Of a place that the motion moves, in the worse direction.
double LoopSearch::variance_m2(const Eigen::Vector2d& p_map_m) const {
  Eigen::Matrix<double, 2, 3> J;
  J << Eigen::Matrix2d::Identity(), left_of(p_map_m - loop_.center_m);
  const Eigen::Matrix2d P = J * (loop_.information + loop_.drift_information).inverse() * J.transpose();
  return P.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff();
}

std::optional<FoundLoop> LoopSearch::see(const PolygonMap& map, const Polylines& polylines, const Pose2& T_map_level,
                                         const Eigen::Matrix3d& covariance) {
  stamp_ns_ = polylines.stamp_ns;
  find(map, polylines, T_map_level, covariance);
  if (loop_.scans == 0) return std::nullopt;
  const bool ends = seconds_between(loop_.found_ns, stamp_ns_) > kLoopPause_s;
  std::optional<FoundLoop> found;
  if (loop_.scans >= kFewestLoopScans && seconds_between(loop_.begin_ns, loop_.found_ns) >= kLoopFor_s &&
      (ends || variance_m2(T_map_level.translation_m) < squared(kLoopSigma_m))) {
    found = {loop_.drawn_ns, loop_.center_m, loop_.information,
             (loop_.information + loop_.drift_information) * loop_.motion};
  }
  if (ends || found) loop_ = {};
  return found;
}

Pose2 LoopSearch::motion_of(std::int64_t drawn_ns) const {
  if (loop_.scans == 0) return {};
  const double part = seconds_between(loop_.since_ns, drawn_ns) / seconds_between(loop_.since_ns, stamp_ns_);
  return motion_about(loop_.center_m, std::clamp(part, 0.0, 1.0) * loop_.motion);
}

}  // namespace situation_awareness
