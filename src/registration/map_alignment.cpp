// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/registration/map_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/vectors.hpp"
#include "situation_awareness/pose/inertial_motion.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// rad/sqrt(s). Random walk of the yaw by inertial navigation between two scans.
constexpr double kYawDrift_rad_sqrt_s = 0.002;
/// rad/s. Standard deviation of the error of the rate of turn at the start.
constexpr double kYawRateSigma_rad_s = 0.003;
/// rad/s/sqrt(s). Random walk of the error of the rate of turn.
constexpr double kYawRateDrift_rad_s_sqrt_s = 0.0005;
/// m/s/sqrt(s). Random walk of the velocity by inertial navigation between two scans.
constexpr double kVelocityDrift_m_s_sqrt_s = 0.03;
/// rad. Standard deviation of the error of the tilt by inertial navigation at the start, each axis.
constexpr double kTiltSigma_rad = 0.02;
/// rad/sqrt(s). Random walk of the error of the tilt.
constexpr double kTiltDrift_rad_sqrt_s = 0.0003;
/// rad/s. Standard deviation of the error of the rate of roll and pitch.
constexpr double kTiltRateSigma_rad_s = 0.003;
/// m/s^2. Standard deviation of the bias of the acceleration, in the scanner's level axes, at the start.
constexpr double kAccelerationSigma_m_s2 = 0.05;
/// m/s^2/sqrt(s). Random walk of the bias of the acceleration.
constexpr double kAccelerationDrift_m_s2_sqrt_s = 0.003;
/// s. Time for which the error of the velocity by GPS and INS lasts.
constexpr double kVelocityMemory_s = 10.0;

using Matrix12 = Eigen::Matrix<double, 12, 12>;
using Vector12 = Eigen::Matrix<double, 12, 1>;
/// Indices in P.
constexpr int kYaw = 2, kVelocity = 3, kTilt = 5, kAcceleration = 7, kYawRate = 9, kTiltRate = 10;

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

/// Where a face ends: hits of it at least, and the least sine of the angle at which the beam meets it there. A surface
/// that bends away ends where beams graze it, which is another place for each pose.
constexpr std::size_t kFewestOfFace = 6;
constexpr double kLeastSine = 0.35;
/// Its standard deviation (m), at least. It is used once it stayed, within so many standard deviations, while the angle
/// between beam and face changed by this (rad): on a radius of 2 m a beam that grazes it moves by 0.2 m.
constexpr double kLeastEndSigma_m = 0.02;
constexpr double kSameEndSigmas = 3.0, kLeastBearings_rad = 0.1;
/// It is the same one within this distance (m) across the face, and with this cosine of both directions.
constexpr double kSameEnd_m = 0.4, kSameEndCosine = 0.95;
/// s. It is forgotten when it was not seen for so long: one that was seen from about one direction only, as those of
/// things that move, and any. Of two laps of a minute the second one still meets the ends of the first.
constexpr double kPassingEnd_s = LoopSearch::kRecent_s, kEnd_s = 120.0;

/// m. The reach to what was hit before the present lap.
constexpr double kReachOfOld_m = 0.15;
/// After a loop was closed, what is so near to each other across the boundary (m) is one.
constexpr double kSameBoundary_m = 0.3;
/// For so long what is behind the hits by these (m) is given up.
constexpr double kClearedAfter_s = 5.0, kLeastBehind_m = 0.1, kMostBehind_m = 0.8;

/// Standard deviations of the pose at the begin within which the map is taken to be, as the fixes that the pose is made
/// of are not independent of the next ones; and the time for which it is kept where odom was in the map.
constexpr double kBeginSigmas = 3.0, kBeginYawSigmas = 2.0;
constexpr double kOdomFor_s = 2.0;
/// s. The shape of what was hit is that of so long.
constexpr double kShapeFor_s = 60.0;
/// Least information of a hit on each step and turn, of 1: around an ellipse of 10 m x 6 m a turn has 0.11, around a
/// box of 12 m x 7 m 0.3, around a tower of twelve sides 0.02.
constexpr double kLeastTold = 0.05;

double square(double value) { return value * value; }

/// By GPS and INS, in the axes of odom.
Eigen::Vector2d begin_velocity_m_s(const InertialPlacement& placement) {
  return placement.T_world_odom.rotation().transpose() * placement.v_world_m_s;
}

}  // namespace

/// Ends that are the object's own: half way to the next beam, which passed it.
void MapAlignment::find_face_ends(const Polylines& polylines) {
  seen_ends_.clear();
  for (const Polyline& polyline : polylines.polylines) {
    if (polyline.hits < kFewestOfFace) continue;
    for (const bool left : {false, true}) {
      if (!is_sure_silhouette(left ? polyline.left_end : polyline.right_end)) continue;
      const PolylineHit& hit = polylines.hits[polyline.first_hit + (left ? polyline.hits - 1 : 0)];
      if (!hit.has_normal) continue;
      const Eigen::Vector2d to_left(hit.normal_level.y(), -hit.normal_level.x());
      const Eigen::Vector2d outward = left ? to_left : Eigen::Vector2d(-to_left);
      const Eigen::Vector2d beam = hit.p_level_m.normalized();
      const double sine = std::abs(hit.normal_level.dot(beam));
      if (sine < kLeastSine) continue;
      const double bearing_rad = std::atan2(outward.dot(beam), sine);
      const double half_m = 0.5 * hit.range_m * polylines.resolution_rad / sine;
      seen_ends_.push_back({hit.p_level_m + half_m * outward, outward,
                            half_m * half_m / 3.0 + params_.hit_sigma_m * params_.hit_sigma_m, bearing_rad, bearing_rad,
                            polylines.stamp_ns, polylines.stamp_ns});
    }
  }
}

MapAlignment::FaceEnd* MapAlignment::known_end(const FaceEnd& end, const Pose2& T_map_level, double reach_m) {
  const Eigen::Vector2d p_map_m = T_map_level * end.p_m, outward = T_map_level.rotation() * end.outward;
  FaceEnd* best = nullptr;
  double least_m = reach_m;
  for (FaceEnd& known : ends_) {
    if (known.outward.dot(outward) < kSameEndCosine) continue;
    const Eigen::Vector2d d_m = p_map_m - known.p_m;
    const double along_m = std::abs(known.outward.dot(d_m));
    if (along_m >= least_m || std::abs(known.outward.x() * d_m.y() - known.outward.y() * d_m.x()) > kSameEnd_m)
      continue;
    least_m = along_m;
    best = &known;
  }
  return best;
}

/// Mean of what was seen of each end, in the order of the scans, without those that left. One that is seen elsewhere
/// begins anew: where a surface bends away it ends elsewhere for each pose.
void MapAlignment::map_face_ends(const Pose2& T_map_level) {
  for (const FaceEnd& end : seen_ends_) {
    FaceEnd in_map = end;
    in_map.p_m = T_map_level * end.p_m;
    in_map.outward = T_map_level.rotation() * end.outward;
    const double pose_variance_m2 = in_map.outward.dot(P_.topLeftCorner<2, 2>() * in_map.outward);
    FaceEnd* const known = known_end(end, T_map_level, kMostSearch_m);
    if (known == nullptr) {
      in_map.variance_m2 += pose_variance_m2;
      ends_.push_back(in_map);
      continue;
    }
    const double moved_m = known->outward.dot(in_map.p_m - known->p_m);
    if (square(moved_m) > square(kSameEndSigmas) * (end.variance_m2 + pose_variance_m2 + known->variance_m2)) {
      in_map.variance_m2 += pose_variance_m2;
      *known = in_map;
      continue;
    }
    const double variance_m2 = end.variance_m2 / kIndependentPart + pose_variance_m2;
    const double part = known->variance_m2 / (known->variance_m2 + variance_m2);
    known->p_m += part * (in_map.p_m - known->p_m);
    known->outward = (known->outward + part * (in_map.outward - known->outward)).normalized();
    known->variance_m2 = std::max((1.0 - part) * known->variance_m2, kLeastEndSigma_m * kLeastEndSigma_m);
    known->least_bearing_rad = std::min(known->least_bearing_rad, end.least_bearing_rad);
    known->most_bearing_rad = std::max(known->most_bearing_rad, end.most_bearing_rad);
    known->last_seen_ns = end.last_seen_ns;
  }
  if (seen_ends_.empty()) return;
  const std::int64_t now_ns = seen_ends_.front().last_seen_ns;
  const auto is_gone = [&](const FaceEnd& end) {
    const bool is_told = end.most_bearing_rad - end.least_bearing_rad >= kLeastBearings_rad;
    return end.last_seen_ns < now_ns - nanoseconds(is_told ? kEnd_s : kPassingEnd_s);
  };
  ends_.erase(std::remove_if(ends_.begin(), ends_.end(), is_gone), ends_.end());
}

void MapAlignment::pair_up(const PolygonMap& map, const Polylines& polylines, const Pose2& T_map_level,
                           double reach_m) {
  pairs_.clear();
  pairs_.reserve(polylines.hits.size());
  const Eigen::Matrix2d R = T_map_level.rotation();
  const std::int64_t recent_ns = polylines.stamp_ns - nanoseconds(LoopSearch::kRecent_s);
  for (const PolylineHit& hit : polylines.hits) {
    if (!hit.has_normal) continue;
    const Eigen::Vector2d p_map_m = R * hit.p_level_m + T_map_level.translation_m;
    const Eigen::Vector2d normal = R * hit.normal_level;
    auto met = map.find_facing(p_map_m, normal, reach_m, recent_ns, polylines.stamp_ns);
    if (!met) met = map.find_facing(p_map_m, normal, std::min(reach_m, kReachOfOld_m));
    if (!met) continue;
    const BoundaryElement& element = met->element;
    const Eigen::Vector2d normal_map(-element.along_world.y(), element.along_world.x());
    pairs_.push_back({hit.p_level_m, element.p_world_m, normal_map,
                      hit.sigma_m * hit.sigma_m + element.variance_m2 + params_.hit_sigma_m * params_.hit_sigma_m,
                      met->drawn_ns});
  }
  for (const FaceEnd& end : seen_ends_) {
    const FaceEnd* const known = known_end(end, T_map_level, reach_m);
    if (known == nullptr || known->most_bearing_rad - known->least_bearing_rad < kLeastBearings_rad ||
        known->last_seen_ns < recent_ns)
      continue;
    pairs_.push_back({end.p_m, known->p_m, known->outward, end.variance_m2 + known->variance_m2, known->drawn_ns()});
  }
}

/// Inertial navigation in the map: only changes of the velocity are taken from odom.
void MapAlignment::go_on(const Pose2& T_odom_level, const Eigen::Vector2d& v_odom_m_s, double dt_s) {
  const Eigen::Matrix2d R_map_odom = (T_map_level_ * inverse(T_odom_level_)).rotation();
  const Eigen::Matrix2d R = T_map_level_.rotation();
  const Eigen::Vector2d a_m_s2 = a_map_m_s2_ + R * a_level_m_s2_;
  const Eigen::Vector2d change_m_s = R_map_odom * (v_odom_m_s - v_odom_m_s_) + dt_s * a_m_s2;
  const Eigen::Vector2d bend_m =
      R_map_odom * (T_odom_level.translation_m - T_odom_level_.translation_m - dt_s * v_odom_m_s_) +
      0.5 * dt_s * dt_s * a_m_s2;
  T_map_level_.translation_m += dt_s * v_map_m_s_ + bend_m;
  T_map_level_.yaw_rad += wrap_to_pi(T_odom_level.yaw_rad - T_odom_level_.yaw_rad) + dt_s * w_rad_s_;
  v_map_m_s_ += change_m_s;
  v_changes_m_s_ += change_m_s;
  a_map_m_s2_ += dt_s * (R * j_level_m_s3_);

  Matrix12 F = Matrix12::Identity();
  F.block<2, 1>(0, kYaw) = left_of(bend_m);
  F.block<2, 2>(0, kVelocity) = dt_s * Eigen::Matrix2d::Identity();
  F.block<2, 2>(0, kTilt) = 0.5 * dt_s * dt_s * Eigen::Matrix2d::Identity();
  F.block<2, 2>(0, kAcceleration) = 0.5 * dt_s * dt_s * R;
  F(kYaw, kYawRate) = dt_s;
  F.block<2, 1>(kVelocity, kYaw) = left_of(change_m_s);
  F.block<2, 2>(kVelocity, kTilt) = dt_s * Eigen::Matrix2d::Identity();
  F.block<2, 2>(kVelocity, kAcceleration) = dt_s * R;
  F.block<2, 2>(kTilt, kTiltRate) = dt_s * R;
  P_ = F * P_ * F.transpose();
  const auto walk = [&](int first, int size, double drift) {
    P_.diagonal().segment(first, size).array() += drift * drift * dt_s;
  };
  walk(kYaw, 1, kYawDrift_rad_sqrt_s);
  walk(kVelocity, 2, kVelocityDrift_m_s_sqrt_s);
  walk(kTilt, 2, kStandardGravity_m_s2 * kTiltDrift_rad_sqrt_s);
  walk(kAcceleration, 2, kAccelerationDrift_m_s2_sqrt_s);
  walk(kYawRate, 1, kYawRateDrift_rad_s_sqrt_s);
  P_.diagonal().array() += kLeastVariance;
}

void MapAlignment::correct(const PolygonMap& map, const Polylines& polylines, const InertialPlacement& placement,
                           double dt_s) {
  const double sigma_m = std::sqrt(std::max(P_(0, 0), P_(1, 1)));
  const double reach_m = std::clamp(kLeastSearch_m + kReachSigmas * sigma_m, kLeastSearch_m, kMostSearch_m);
  Matrix12 information = P_.llt().solve(Matrix12::Identity());
  // The velocity by GPS and INS: one measurement of it in velocity_memory_s.
  const Eigen::Matrix2d R_map_world =
      (T_map_level_ * inverse(T_odom_level_) * inverse(placement.T_world_odom)).rotation();
  const double v_weight =
      std::min(dt_s / kVelocityMemory_s, 1.0) / std::max(square(placement.velocity_sigma_m_s), kLeastVariance);
  const Eigen::Vector2d v_residual_m_s = R_map_world * placement.v_world_m_s - v_map_m_s_;
  Vector12 from_velocity = Vector12::Zero();
  from_velocity.segment<2>(kVelocity) = v_weight * v_residual_m_s;
  information.diagonal().segment<2>(kVelocity).array() += v_weight;

  const Pose2 begin = T_map_level_;
  Vector12 total = Vector12::Zero();
  Matrix12 A = information;
  for (int k = 0; k < kIterations; ++k) {
    pair_up(map, polylines, T_map_level_, reach_m);
    A = information;
    Vector12 b = from_velocity - information * total;
    if (pairs_.size() >= kFewestPairs) {
      const Eigen::Matrix2d R = T_map_level_.rotation();
      for (const Pair& pair : pairs_) {
        const Eigen::Vector2d offset_m = R * pair.p_level_m;
        const double residual_m = pair.normal_map.dot(pair.q_map_m - offset_m - T_map_level_.translation_m);
        const double weight = weight_of(pair, residual_m);
        Eigen::Vector3d J;
        J << pair.normal_map, pair.normal_map.dot(left_of(offset_m));
        A.topLeftCorner<3, 3>() += weight * J * J.transpose();
        b.head<3>() += weight * residual_m * J;
      }
    }
    const Vector12 step = A.llt().solve(b);
    total += step;
    T_map_level_ = {begin.translation_m + total.head<2>(), begin.yaw_rad + total(kYaw)};
    if (step.cwiseAbs().maxCoeff() < kSmallStep) break;
  }
  v_map_m_s_ += total.segment<2>(kVelocity);
  a_map_m_s2_ += total.segment<2>(kTilt);
  a_level_m_s2_ += total.segment<2>(kAcceleration);
  j_level_m_s3_ += total.segment<2>(kTiltRate);
  w_rad_s_ += total(kYawRate);
  P_ = A.llt().solve(Matrix12::Identity());
}

double MapAlignment::weight_of(const Pair& pair, double residual_m) const {
  const double sigmas = std::abs(residual_m) / std::sqrt(pair.variance_m2);
  return kIndependentPart / pair.variance_m2 * (sigmas > kHuber ? kHuber / sigmas : 1.0);
}

/// To when what the scan sees was drawn.
void MapAlignment::tie_poses(const PolygonMap& map, const Polylines& polylines) {
  graph_.add(polylines.stamp_ns, T_map_level_.translation_m);
  pair_up(map, polylines, T_map_level_, kReachOfOld_m);
  for (const Pair& pair : pairs_) {
    const Eigen::Vector2d p_map_m = T_map_level_ * pair.p_level_m;
    const double residual_m = pair.normal_map.dot(pair.q_map_m - p_map_m);
    graph_.tie(pair.drawn_ns, p_map_m, pair.normal_map, residual_m, weight_of(pair, residual_m));
  }
}

void MapAlignment::close_loop(PolygonMap& map, const Polylines& polylines) {
  const auto loop = loops_.see(map, polylines, T_map_level_, P_.topLeftCorner<3, 3>());
  if (loop || graph_.is_due(polylines.stamp_ns)) tie_poses(map, polylines);
  if (!loop) return;
  graph_.tie(loop->drawn_ns, loop->center_m, loop->A, loop->b);
  graph_.solve();
  map.deform([this](std::int64_t drawn_ns) { return graph_.motion_of(drawn_ns); });
  for (FaceEnd& end : ends_) {
    const Pose2 moved = graph_.motion_of(end.drawn_ns());
    end.p_m = moved * end.p_m;
    end.outward = moved.rotation() * end.outward;
  }
  const Pose2 correction = graph_.motion_of(polylines.stamp_ns);
  T_map_level_ = correction * T_map_level_;
  v_map_m_s_ = correction.rotation() * v_map_m_s_;
  a_map_m_s2_ = correction.rotation() * a_map_m_s2_;
  v_changes_m_s_ = correction.rotation() * v_changes_m_s_;
  graph_.move();
  loop_closed_ns_ = polylines.stamp_ns;
}

/// What was drawn twice where a loop was closed is one, and what is hidden of it now, which no beam would ever pass, is
/// given up.
void MapAlignment::join_doubles(PolygonMap& map, const Polylines& polylines) const {
  if (loop_closed_ns_ == StampOrder::kNone || seconds_between(loop_closed_ns_, polylines.stamp_ns) > kClearedAfter_s) {
    return;
  }
  map.merge_doubles(kSameBoundary_m);
  const Eigen::Matrix2d R = T_map_level_.rotation();
  for (const PolylineHit& hit : polylines.hits) {
    if (!hit.has_normal) continue;
    map.give_up_behind(T_map_level_ * hit.p_level_m, R * hit.normal_level, kLeastBehind_m, kMostBehind_m,
                       polylines.stamp_ns - nanoseconds(LoopSearch::kRecent_s));
  }
}

void MapAlignment::begin_with(const Eigen::Vector2d& v_map_m_s, double sigma_m_s) {
  v_map_m_s_ = v_map_m_s;
  first_velocity_sigma_m_s_ = sigma_m_s;
}

double MapAlignment::velocity_sigma_m_s() const { return std::sqrt(P_.diagonal().segment<2>(kVelocity).maxCoeff()); }

Eigen::Vector2d MapAlignment::velocity_correction_m_s(const InertialPlacement& placement) const {
  if (has_begun_) return (T_odom_level_ * inverse(T_map_level_)).rotation() * v_map_m_s_ - v_odom_m_s_;
  // The map's axes are odom's then.
  const bool is_given = first_velocity_sigma_m_s_ > 0.0;
  return (is_given ? v_map_m_s_ : begin_velocity_m_s(placement)) - placement.v_odom_m_s;
}

Eigen::Matrix3d MapAlignment::align(PolygonMap& map, const InertialPlacement& placement, Polylines& polylines) {
  const Pose2 T_odom_level = polylines.T_world_level;
  find_face_ends(polylines);
  if (has_begun_) {
    const double dt_s = std::max(seconds_between(stamp_ns_, polylines.stamp_ns), 0.0);
    go_on(T_odom_level, placement.v_odom_m_s, dt_s);
    T_odom_level_ = T_odom_level;
    correct(map, polylines, placement, dt_s);
    close_loop(map, polylines);
    join_doubles(map, polylines);
  } else {
    if (polylines.hits.empty()) return P_.topLeftCorner<3, 3>();
    has_begun_ = true;
    T_odom_level_ = T_map_level_ = T_odom_level;
    const bool is_given = first_velocity_sigma_m_s_ > 0.0;
    if (!is_given) v_map_m_s_ = begin_velocity_m_s(placement);
    P_.diagonal().segment<2>(kVelocity).setConstant(
        square(is_given ? first_velocity_sigma_m_s_ : placement.velocity_sigma_m_s));
    P_.diagonal().segment<2>(kTilt).setConstant(square(kStandardGravity_m_s2 * kTiltSigma_rad));
    P_.diagonal().segment<2>(kAcceleration).setConstant(square(kAccelerationSigma_m_s2));
    P_.diagonal().segment<2>(kTiltRate).setConstant(square(kStandardGravity_m_s2 * kTiltRateSigma_rad_s));
    P_(kYawRate, kYawRate) = square(kYawRateSigma_rad_s);
  }
  watch_shape(polylines);
  stamp_ns_ = polylines.stamp_ns;
  v_odom_m_s_ = placement.v_odom_m_s;
  map_face_ends(T_map_level_);
  average(polylines, T_map_level_, placement);
  place(polylines, placement);
  polylines.T_world_level = T_map_level_;
  return P_.topLeftCorner<3, 3>();
}

void MapAlignment::watch_shape(const Polylines& polylines) {
  const double kept = std::exp(-std::max(seconds_between(stamp_ns_, polylines.stamp_ns), 0.0) / kShapeFor_s);
  shape_.information *= kept;
  shape_.sum_map_m *= kept;
  shape_.squares_m2 *= kept;
  shape_.hits *= kept;
  const Eigen::Matrix2d R = T_map_level_.rotation();
  for (const PolylineHit& hit : polylines.hits) {
    if (!hit.has_normal) continue;
    const Eigen::Vector2d p_map_m = T_map_level_ * hit.p_level_m, n = R * hit.normal_level;
    const Eigen::Vector3d h(n.x(), n.y(), left_of(p_map_m).dot(n));
    shape_.information += h * h.transpose();
    shape_.sum_map_m += p_map_m;
    shape_.squares_m2 += p_map_m.squaredNorm();
    shape_.hits += 1.0;
  }
}

/// The mean information of a hit on the step, or turn, that hits tell least about. A turn is one about their middle,
/// times their distance from it.
double MapAlignment::least_told() const {
  if (!(shape_.hits >= 1.0)) return 0.0;
  const Eigen::Vector2d middle_m = shape_.sum_map_m / shape_.hits;
  const double radius_m = std::sqrt(std::max(shape_.squares_m2 / shape_.hits - middle_m.squaredNorm(), 0.0));
  if (!(radius_m > 0.0)) return 0.0;
  Eigen::Matrix3d J = Eigen::Matrix3d::Identity();
  J.row(2) << -left_of(middle_m).transpose() / radius_m, 1.0 / radius_m;
  const Eigen::Matrix3d information = J * shape_.information * J.transpose() / shape_.hits;
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(information, Eigen::EigenvaluesOnly).eigenvalues()(0);
}

/// Each pose says where the map is, with the weight of what it knows. Errors of poses last: the mean is taken for no
/// better than poses are in the mean (harmonic, as they are weighted).
void MapAlignment::average(const Polylines& polylines, const Pose2& T_map_level, const InertialPlacement& placement) {
  const Eigen::Matrix3d& pose_covariance = placement.pose_covariance;
  if (polylines.hits.empty()) return;
  Eigen::Vector2d seen_map_m = Eigen::Vector2d::Zero();
  for (const PolylineHit& hit : polylines.hits) seen_map_m += T_map_level * hit.p_level_m;
  seen_map_m /= static_cast<double>(polylines.hits.size());
  const double variance_m2 = std::max(pose_covariance(0, 0), pose_covariance(1, 1));
  const double position_weight = 1.0 / variance_m2, yaw_weight = 1.0 / pose_covariance(2, 2);
  const Pose2 T_world_map_now = placement.T_world_odom * T_odom_level_ * inverse(T_map_level);
  position_weight_ += position_weight;
  yaw_weight_ += yaw_weight;
  ++poses_;
  position_variance_m2_ = poses_ / position_weight_;
  yaw_variance_rad2_ = poses_ / yaw_weight_;
  const double part = position_weight / position_weight_;
  middle_map_m_ += part * (seen_map_m - middle_map_m_);
  middle_world_m_ += part * (T_world_map_now * seen_map_m - middle_world_m_);
  yaw_rad_ += yaw_weight / yaw_weight_ * wrap_to_pi(T_world_map_now.yaw_rad - yaw_rad_);
  T_world_map_ = {Eigen::Vector2d::Zero(), yaw_rad_};
  T_world_map_.translation_m = middle_world_m_ - T_world_map_.rotation() * middle_map_m_;
}

/// By fixes.
void MapAlignment::place(const Polylines& polylines, const InertialPlacement& placement) {
  odom_.push_back({polylines.stamp_ns, T_map_level_ * inverse(T_odom_level_)});
  while (seconds_between(odom_.front().stamp_ns, polylines.stamp_ns) > kOdomFor_s) odom_.pop_front();
  if (!place_.has_begun()) {
    // The fixes that it is made of are counted again.
    const Eigen::Matrix3d& P = placement.pose_covariance;
    place_.begin(T_map_level_.translation_m, placement.T_world_odom * inverse(odom_.back().T_map_odom),
                 square(kBeginSigmas) * std::max(P(0, 0), P(1, 1)), square(kBeginYawSigmas) * P(2, 2));
  }
  for (const PlacedFix& fix : placement.fixes) {
    has_fixes_ = true;
    auto then = odom_.rbegin();
    while (then + 1 != odom_.rend() && then->stamp_ns > fix.stamp_ns) ++then;
    PlacedFix in_map = fix;
    in_map.antenna_m = then->T_map_odom * fix.antenna_m;
    place_.add(in_map, std::max(P_(0, 0), P_(1, 1)));
  }
  if (has_fixes_) T_world_map_ = place_.T_world_map();
}

std::optional<MapAlignment::PlaceByMap> MapAlignment::better_place(const Eigen::Matrix3d& pose_covariance) const {
  if (!has_begun_ || least_told() < kLeastTold) return {};
  const PlaceByMap place{T_world_map_ * T_map_level_ * inverse(T_odom_level_), covariance_world()};
  const auto trace_m2 = [](const Eigen::Matrix3d& P) { return P.topLeftCorner<2, 2>().trace(); };
  if (!(trace_m2(place.covariance) <= trace_m2(pose_covariance))) return {};
  return place;
}

Eigen::Matrix3d MapAlignment::covariance_world() const {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  R.topLeftCorner<2, 2>() = T_world_map_.rotation();
  const Eigen::Matrix3d in_map = R * P_.topLeftCorner<3, 3>() * R.transpose();
  if (has_fixes_) return in_map + place_.covariance_at(T_map_level_.translation_m);
  const Eigen::Vector2d arm_m = T_world_map_.rotation() * (T_map_level_.translation_m - middle_map_m_);
  Eigen::Vector3d by_yaw;
  by_yaw << left_of(arm_m), 1.0;
  Eigen::Matrix3d covariance = in_map + yaw_variance_rad2_ * by_yaw * by_yaw.transpose();
  covariance.diagonal().head<2>().array() += position_variance_m2_;
  return covariance;
}

double MapAlignment::variance_m2(double from_middle_m) const {
  if (!has_fixes_) return position_variance_m2_ + yaw_variance_rad2_ * from_middle_m * from_middle_m;
  const Eigen::Matrix3d P = place_.covariance_at(middle_map_m_);
  return std::max(P(0, 0), P(1, 1)) + P(2, 2) * from_middle_m * from_middle_m;
}

}  // namespace situation_awareness
