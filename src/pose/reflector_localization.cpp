// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/reflector_localization.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// Probability that a sighting is inside the gate of the reflector that it is of.
constexpr double kSightingGateProbability = 0.999;
/// A match is ambiguous if other matches contradict it whose cost, the sum of squared Mahalanobis distances and of the
/// gate for each sighting left unmatched, is not higher by this.
constexpr double kMatchAdvantage = 6.0;
/// m. Standard deviation of a reflector's place about that of its sighting, apart from the scanner's errors.
constexpr double kModelSigma_m = 0.001;
/// m. A reflector is missing only where it should be seen nearer than this.
constexpr double kMaxView_m = 8.0;
/// A reflector is missing after so many scans with beams through its place, less those that saw it.
constexpr int kMissingScans = 25;
/// A reflector is moved after so many scans in a row that saw one standing near its place instead.
constexpr int kMovedScans = 25;
/// m. A reflector that moved farther is a missing one.
constexpr double kMaxMove_m = 1.0;
/// The pose is searched for anew after so many scans in a row that contradict it.
constexpr int kLostScans = 12;
/// m. Error added to the position, in each direction, by a scan that contradicts it.
constexpr double kLostSigma_m = 0.03;
/// rad. Error added to the yaw by a scan that contradicts it.
constexpr double kLostSigma_rad = 0.02;
/// A search uses what has been seen standing in so many scans of the last seconds.
constexpr int kSearchScans = 3;
/// 1/sqrt(m). Random change of the constant errors, by distance, of that of turns by turning in rad.
constexpr double kScaleDrift = 0.001;
/// 1/sqrt(m). The same in proportion to the errors: wheels that are wrong by more change by more.
constexpr double kRelativeDrift = 0.2;

/// Matches of a scan that are tried before it is given up as ambiguous; without false sightings a few per reflector.
constexpr int kMaxNodes = 3000;
/// Assignments that are kept to tell whether a match is ambiguous.
constexpr std::size_t kMaxLeaves = 32;
/// Factor of the variance of the wheels' errors of scale when a pose replaces the one by which they were learned.
constexpr double kLearnedScale = 4.0;
/// s. The turn by odometry in a window that ends so long before a motion stands for that of the motion where the error
/// of scale is applied: what was wrong in it has been corrected by reflectors since. The correction lags as much.
constexpr double kTurnDelay_s = 0.1;
/// s. Its length: with 0.06 s the noise of turns weighs more, with 0.3 s the correction lags more.
constexpr double kTurnWindow_s = 0.15;
/// m. After this distance errors of the wheels count less, by a factor e, for how much they may change.
constexpr double kErrorsLast_m = 100.0;
/// A correction is linearised anew where it exceeds this, in m and rad.
constexpr double kRelinearise = 0.02;
constexpr int kMaxIterations = 6;
/// Reflectors are judged only by a pose that is known better than this.
constexpr double kCertain_m = 0.05;
constexpr double kCertain_rad = 0.03;
/// And by one that two of them have confirmed in this time, when one alone is in sight.
constexpr double kConfirmed_s = 5.0;
/// Beams that pass through the place of a reflector end farther behind it than this.
constexpr double kBehindReflector_m = 0.1;
/// What is seen nearer than this to a reflector's place and not in it hides that place, or is the reflector itself.
constexpr double kBesidePlace_m = 0.15;
/// What is seen within this distance of where it was seen before stands.
constexpr double kStands_m = 0.1;
/// What was seen longer ago, or farther away, is not searched with.
constexpr double kMaxAge_s = 3.0;
constexpr double kMaxSearchTravel_m = 1.5;
/// m. A robot that moves less between scans stands, and places are averaged.
constexpr double kStandsStill_m = 0.005;
constexpr std::size_t kMaxStood = 64;
/// Error of a place by odometry in between, relative to the way, at least.
constexpr double kTravelError = 0.03;
/// m. A pose that was less certain may have been given to the wrong reflector, until so many are matched.
constexpr double kUnsure_m = 0.1;
constexpr std::size_t kSureMatches = 3;
/// Probability that the pose that a search finds differs by less from the same one.
constexpr double kSamePose = 0.9999;
/// m. A sighting of none of the reflectors is of the same thing as an earlier one within this distance.
constexpr double kSameStranger_m = 0.25;
/// Scans with a match that saw it, after which it is known.
constexpr int kStrangerScans = 5;
constexpr std::size_t kMaxStrangers = 64;
/// m. The place of a moved reflector is known to this standard deviation, in each direction, when it begins to be used:
/// so much more than the errors by which it was found that these, which come again, count for nothing.
constexpr double kMovedSigma_m = 0.05;

double larger_eigenvalue(const Eigen::Matrix2d& P) {
  const double mean = 0.5 * (P(0, 0) + P(1, 1));
  return mean + std::hypot(0.5 * (P(0, 0) - P(1, 1)), P(0, 1));
}

}  // namespace

void WheelErrorParams::validate() const { check_bounds(*this, "localization.wheels"); }

void ReflectorLocalizationParams::validate() const {
  check_bounds(*this, "localization");
  wheels.validate();
  odometry.validate();
}

// --- models ----------------------------------------------------------------------------------------------------------

Eigen::Matrix3d world_covariance(const Estimate<Pose2>& T_world_base) {
  Eigen::Matrix3d B = Eigen::Matrix3d::Identity();
  B.topLeftCorner<2, 2>() = T_world_base.x.rotation();
  return transformed(B, T_world_base.P);
}

Eigen::Vector2d observed_reflector(const Pose2& T_world_base, const Pose2& T_base_lidar,
                                   const Eigen::Vector2d& center_world_m) {
  const Eigen::Vector2d p_lidar = place_of(T_base_lidar, place_of(T_world_base, center_world_m));
  return {p_lidar.norm(), std::atan2(p_lidar.y(), p_lidar.x())};
}

Eigen::Matrix<double, 2, 3> observed_reflector_jacobian(const Pose2& T_world_base, const Pose2& T_base_lidar,
                                                        const Eigen::Vector2d& center_world_m) {
  const Eigen::Vector2d p_base = place_of(T_world_base, center_world_m);
  const Eigen::Vector2d p_lidar = place_of(T_base_lidar, p_base);
  const double range2_m2 = p_lidar.squaredNorm();
  Eigen::Matrix2d J_z_p;
  J_z_p << p_lidar.transpose() / std::sqrt(range2_m2), -p_lidar.y() / range2_m2, p_lidar.x() / range2_m2;
  return J_z_p * T_base_lidar.rotation().transpose() * place_jacobian(p_base);
}

Eigen::Matrix2d observed_reflector_place_jacobian(const Eigen::Matrix<double, 2, 3>& J_z_e, const Pose2& T_world_base) {
  return -J_z_e.leftCols<2>() * T_world_base.rotation().transpose();
}

namespace {

// The motion of the robot by that of its odometry.
Eigen::Vector3d corrected(const ReflectorState& x, const Eigen::Vector3d& tau, double turn_rad) {
  Eigen::Vector3d result = tau;
  result.head<2>() *= 1.0 + x.scale_error(0);
  result(2) += x.scale_error(1) * turn_rad + x.yaw_drift_rad_m * tau(0);
  return result;
}

}  // namespace

ReflectorState moved_by_odometry(const ReflectorState& x, const Pose2& u, double turn_rad) {
  return {x.T_world_base * exp_se2(corrected(x, log_se2(u), turn_rad)), x.scale_error, x.yaw_drift_rad_m};
}

Eigen::Matrix<double, 6, 6> moved_by_odometry_jacobian(const ReflectorState& x, const Pose2& u, double turn_rad) {
  const Eigen::Vector3d tau = log_se2(u);
  const Eigen::Vector3d scaled = corrected(x, tau, turn_rad);
  Eigen::Matrix3d J_tau_s;
  J_tau_s << tau(0), 0.0, 0.0, tau(1), 0.0, 0.0, 0.0, turn_rad, tau(0);
  Eigen::Matrix<double, 6, 6> F = Eigen::Matrix<double, 6, 6>::Identity();
  F.topLeftCorner<3, 3>() = adjoint_se2(inverse(exp_se2(scaled)));
  F.topRightCorner<3, 3>() = right_jacobian_se2(scaled) * J_tau_s;
  return F;
}

Eigen::Matrix<double, 6, 6> odometry_noise(const Pose2& u, const WheelErrorParams& params,
                                           const Eigen::Vector3d& wheel_error) {
  const double distance_m = u.translation_m.norm();
  const double turn_rad = std::abs(wrap_to_pi(u.yaw_rad));
  const auto variance = [](double noise, double way) { return noise * noise * way; };
  const auto drift = [&](double error, double way) {
    return variance(kScaleDrift, way) + variance(kRelativeDrift * error, way);
  };
  Eigen::Matrix<double, 6, 1> diagonal;
  diagonal << variance(params.distance_noise, distance_m), variance(params.lateral_noise, distance_m),
      variance(params.yaw_noise_of_distance, distance_m) + variance(params.yaw_noise_of_yaw, turn_rad),
      drift(wheel_error(0), distance_m), drift(wheel_error(1), turn_rad), drift(wheel_error(2), distance_m);
  return diagonal.asDiagonal();
}

// --- poses -----------------------------------------------------------------------------------------------------------

ReflectorLocalization::ReflectorLocalization(const ReflectorMap& map, const ReflectorLocalizationParams& params)
    : map_(map), params_(params), gate_(0.0), track_(params.odometry), search_(map) {
  params_.validate();
  gate_ = chi_square_quantile(kSightingGateProbability, 2);
  const std::size_t n = map_.reflectors.size();
  for (const Reflector& reflector : map_.reflectors) mean_radius_m_ += reflector.radius_m / static_cast<double>(n);
  for (const Reflector& reflector : map_.reflectors) {
    radius_spread_m_ = std::max(radius_spread_m_, std::abs(reflector.radius_m - mean_radius_m_));
  }
  watched_.resize(n);
  seen_.reserve(kMaxSightings);
  possible_.reserve(kMaxSightings * n);
  leaves_.reserve(kMaxLeaves);
  taken_.resize(n);
  stood_.reserve(kMaxStood);
  strangers_.reserve(kMaxStrangers);
  order_.reserve(1024);
  in_time_.reserve(kMaxSightings);
  places_.reserve(kMaxStood);
  excluded_.resize(n);
  update_.matches.reserve(kMaxSightings);
  update_.ambiguous.reserve(kMaxSightings);
  update_.unmatched.reserve(kMaxSightings);
  update_.missing.reserve(n);
  update_.moved.reserve(n);
  counters_.reset();
}

void ReflectorLocalization::forget(const char* reason) {
  is_known_ = false;
  reason_ = reason;
  // What was seen of reflectors by a pose that was contradicted may be wrong.
  if (contradicted_ > 0) forget_reflectors();
  contradicted_ = doubtful_ = 0;
  was_unsure_ = false;
  strangers_.clear();
}

void ReflectorLocalization::forget_reflectors() {
  for (Watched& watched : watched_) watched = {};
  moved_ = {};
}

void ReflectorLocalization::relocate() {
  forget("no pose yet");
  forget_reflectors();
  stood_.clear();
  search_.begin_anew();
  has_initial_ = false;
}

void ReflectorLocalization::initial_pose(std::int64_t stamp_ns, const Pose2& T_world_base, double sigma_m,
                                         double sigma_rad) {
  relocate();
  has_initial_ = true;
  initial_.stamp_ns = stamp_ns;
  initial_.T_world_base.x = T_world_base;
  initial_.T_world_base.P = Eigen::Vector3d(sigma_m, sigma_m, sigma_rad).cwiseAbs2().asDiagonal();
}

void ReflectorLocalization::set_pose(const OdometryTrack::Entry& at, const Estimate<Pose2>& T_world_base) {
  if (contradicted_ > 0) forget_reflectors();
  for (Watched& watched : watched_) watched.beams = {};
  moved_.P_state.setZero();  // the new pose was found without them
  is_known_ = true;
  reason_ = "";
  contradicted_ = doubtful_ = 0;
  was_unsure_ = false;
  at_ = at;
  // The wheels are the same. What was learned of them counts less: a pose that was wrong may have taught it.
  const Eigen::Vector3d prior_variance = Eigen::Vector3d(params_.wheels.distance_scale_sigma,
                                                         params_.wheels.yaw_scale_sigma, params_.wheels.yaw_drift_sigma)
                                             .cwiseAbs2();
  Eigen::Vector3d variance = prior_variance;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double learned = kLearnedScale * estimate_.P(3 + i, 3 + i);
    if (has_scales_ && learned < prior_variance(i)) {
      variance(i) = learned;
    } else if (i < 2) {
      estimate_.x.scale_error(i) = 0.0;
    } else {
      estimate_.x.yaw_drift_rad_m = 0.0;
    }
  }
  has_scales_ = true;
  estimate_.x.T_world_base = T_world_base.x;
  estimate_.P.setZero();
  estimate_.P.topLeftCorner<3, 3>() = T_world_base.P;
  estimate_.P.bottomRightCorner<3, 3>() = variance.asDiagonal();
  at_stamp_ = T_world_base;
  stamp_ns_ = at.stamp_ns;
  confirmed_ns_ = stamp_ns_ - nanoseconds(kConfirmed_s);
}

LocalizedPose ReflectorLocalization::pose() const {
  LocalizedPose result;
  result.stamp_ns = stamp_ns_;
  result.T_world_base = at_stamp_;
  result.T_world_base.x.yaw_rad = wrap_to_pi(result.T_world_base.x.yaw_rad);
  result.covariance_world = world_covariance(result.T_world_base);
  return result;
}

Counters ReflectorLocalization::counters() const {
  Counters all = counters_;
  for (const Counters::Entry& entry : track_.counters()) all[entry.first] += entry.second;
  return all;
}

OdometryTrack::Verdict ReflectorLocalization::add_odometry(std::int64_t stamp_ns, const Pose2& T_odom_base,
                                                           std::int64_t received_ns) {
  // Without scans the estimate is taken along before its place in the track is overwritten.
  if (is_known_ && track_.size() == OdometryTrack::kCapacity && track_[1].stamp_ns > at_.stamp_ns) {
    predict_to(track_[1]);
  }
  const OdometryTrack::Verdict verdict = track_.add(stamp_ns, T_odom_base, received_ns);
  if (verdict == OdometryTrack::Verdict::kRestarted) relocate();
  return verdict;
}

void ReflectorLocalization::predict_to(const OdometryTrack::Entry& target) {
  const auto step = [&](const OdometryTrack::Entry& to) {
    const Pose2 u = inverse(at_.T_track_base) * to.T_track_base;
    Matrix6 Q = noise_of(u);
    if (to.jumps > at_.jumps) {
      const Eigen::Vector3d sigma(params_.wheels.jump_sigma_m, params_.wheels.jump_sigma_m,
                                  params_.wheels.jump_sigma_rad);
      Q.diagonal().head<3>() += (to.jumps - at_.jumps) * sigma.cwiseAbs2();
    }
    const double turn_rad = turn_before(at_, to);
    const Matrix6 F = moved_by_odometry_jacobian(estimate_.x, u, turn_rad);
    predict(estimate_, moved_by_odometry(estimate_.x, u, turn_rad), F, Q);
    if (moved_.any()) moved_.P_state = F * moved_.P_state;
    at_ = to;
    wheel_error_ *= std::exp(-u.translation_m.norm() / kErrorsLast_m);
  };
  for (std::size_t i = track_.after(at_.stamp_ns); i < track_.size() && track_[i].stamp_ns < target.stamp_ns; ++i) {
    step(track_[i]);
  }
  step(target);
}

// By wheels whose errors were as large as they were at some time lately, also while they are small in between.
ReflectorLocalization::Matrix6 ReflectorLocalization::noise_of(const Pose2& u) const {
  const Eigen::Vector3d error(estimate_.x.scale_error(0), estimate_.x.scale_error(1), estimate_.x.yaw_drift_rad_m);
  return odometry_noise(u, params_.wheels, error.cwiseAbs().cwiseMax(wheel_error_));
}

void ReflectorLocalization::remember_errors() {
  const Eigen::Vector3d error(estimate_.x.scale_error(0), estimate_.x.scale_error(1), estimate_.x.yaw_drift_rad_m);
  const Eigen::Vector3d sigma = estimate_.P.diagonal().tail<3>().cwiseSqrt();
  wheel_error_ = wheel_error_.cwiseMax(error.cwiseAbs() - 2.0 * sigma);
}

// How far the robot would turn from one time to the other at the rate of some time before, whose errors are others.
double ReflectorLocalization::turn_before(const OdometryTrack::Entry& from, const OdometryTrack::Entry& to) const {
  const std::int64_t end_ns = from.stamp_ns - nanoseconds(kTurnDelay_s);
  OdometryTrack::Entry begin, end;
  if (!track_.at(end_ns - nanoseconds(kTurnWindow_s), begin) || !track_.at(end_ns, end)) return 0.0;
  const double turn_rad = wrap_to_pi(end.T_track_base.yaw_rad - begin.T_track_base.yaw_rad);
  return turn_rad * seconds_between(from.stamp_ns, to.stamp_ns) / kTurnWindow_s;
}

// --- a scan ----------------------------------------------------------------------------------------------------------

// Where the lidar was when each sighting was seen.
void ReflectorLocalization::look(const ReflectorSightings& sightings, const Pose2& T_base_lidar,
                                 const OdometryTrack::Entry& now) {
  seen_.clear();
  const std::size_t n = sightings.sightings.size();
  order_.clear();
  for (std::size_t i = 0; i < n; ++i) order_.push_back(i);
  if (n > kMaxSightings) {
    std::sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
      const std::size_t hits_a = sightings.sightings[a].count, hits_b = sightings.sightings[b].count;
      return hits_a != hits_b ? hits_a > hits_b : a < b;
    });
    order_.resize(kMaxSightings);
    ++counters_["too many sightings"];
  }
  for (const std::size_t i : order_) {
    OdometryTrack::Entry then = now;
    const std::int64_t stamp_ns = sightings.stamp_ns + nanoseconds(sightings.sightings[i].time_offset_s);
    if (!track_.at(stamp_ns, then)) continue;
    ReflectorState x = estimate_.x;  // only the errors of the wheels count
    x.T_world_base = {};
    const Pose2 u = inverse(now.T_track_base) * then.T_track_base;
    seen_.push_back(
        {i, then, moved_by_odometry(x, u, turn_before(now, then)).T_world_base * T_base_lidar, noise_of(u), 0, 0});
  }
}

const ReflectorUpdate& ReflectorLocalization::update(const ReflectorSightings& sightings, const Pose2& T_base_lidar) {
  update_.stamp_ns = sightings.stamp_ns;
  update_.is_known = false;  // a scan that is not used leaves the pose at an earlier stamp
  update_.reason = "";
  update_.is_found = false;
  update_.is_contradicted = false;
  update_.matches.clear();
  update_.ambiguous.clear();
  update_.unmatched.clear();
  update_.missing.clear();
  update_.moved.clear();
  update_.nis = 0.0;

  const StampOrder::Verdict verdict = scans_.judge(sightings.stamp_ns);
  if (verdict == StampOrder::Verdict::kRefused) {
    update_.reason = scans_.doubted() > 0 ? "scan of another time" : "scan out of order";
    ++counters_[update_.reason];
    return update_;
  }
  // Odometry may have restarted before the scans did, and the pose have been given since.
  if (verdict == StampOrder::Verdict::kRestart && is_known_ && at_.stamp_ns > sightings.stamp_ns) relocate();

  OdometryTrack::Entry now;
  if (!track_.at(sightings.stamp_ns, now)) {
    update_.reason = "no odometry";
    ++counters_[update_.reason];
    return update_;
  }
  if (has_initial_) {
    OdometryTrack::Entry then = now;
    track_.at(initial_.stamp_ns, then);  // else the robot is taken to have stood since
    if (then.stamp_ns > now.stamp_ns) then = now;
    set_pose(then, initial_.T_world_base);
    has_initial_ = false;
  }

  if (is_known_) {
    predict_to(now);
    at_stamp_ = {estimate_.x.T_world_base, estimate_.P.topLeftCorner<3, 3>()};
    stamp_ns_ = now.stamp_ns;
    was_unsure_ |= std::max(estimate_.P(0, 0), estimate_.P(1, 1)) > kUnsure_m * kUnsure_m;
    look(sightings, T_base_lidar, now);
    list_possible(sightings);
    associate();
    weigh(sightings.resolution_rad);
    correct(T_base_lidar);
    remember_errors();
    judge_reflectors(sightings, T_base_lidar);
  } else {
    look(sightings, T_base_lidar, now);
  }
  if (is_known_ && contradicted_ == 0 && doubtful_ == 0) {
    stood_.clear();
    search_.begin_anew();
  } else {
    collect(sightings, now);
    const bool is_due = contradicted_ >= kLostScans || doubtful_ >= kLostScans;
    if (!is_known_ || is_due) search(now);
  }
  if (is_known_) {
    const bool is_lost = std::sqrt(larger_eigenvalue(estimate_.P.topLeftCorner<2, 2>())) > params_.max_sigma_m ||
                         std::sqrt(estimate_.P(2, 2)) > params_.max_sigma_rad;
    if (is_lost) {
      forget("lost");
      ++counters_["pose lost"];
    }
  }
  update_.is_known = is_known_;
  if (!is_known_) update_.reason = reason_;
  cover(sightings.stamp_ns);
  return update_;
}

void ReflectorLocalization::cover(std::int64_t stamp_ns) {
  const double since_s = covered_ns_ ? std::max(0.0, seconds_between(*covered_ns_, stamp_ns)) : 0.0;
  covered_ns_ = stamp_ns;
  coverage_.all_s += since_s;
  if (is_known_ && (update_.is_found || update_.matches.size() >= ReflectorCoverage::kNeeded)) {
    coverage_.too_few_now_s = 0.0;
  } else {
    coverage_.too_few_s += since_s;
    coverage_.too_few_now_s += since_s;
    coverage_.longest_s = std::max(coverage_.longest_s, coverage_.too_few_now_s);
  }
  if (!is_known_) return;
  coverage_.largest_sigma_m =
      std::max(coverage_.largest_sigma_m, std::sqrt(larger_eigenvalue(at_stamp_.P.topLeftCorner<2, 2>())));
  coverage_.largest_sigma_rad = std::max(coverage_.largest_sigma_rad, std::sqrt(at_stamp_.P(2, 2)));
}

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

// That which `seen_[k]` is matched as.
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

void ReflectorLocalization::correct(const Pose2& T_base_lidar) {
  if (update_.matches.empty()) return;
  in_time_.clear();
  for (std::size_t k = 0; k < seen_.size(); ++k) {
    if (reflector_of_[k] >= 0 && possible_of(k).R.allFinite()) in_time_.push_back(k);
  }
  std::sort(in_time_.begin(), in_time_.end(), [&](std::size_t a, std::size_t b) {
    return seen_[a].at.stamp_ns != seen_[b].at.stamp_ns ? seen_[a].at.stamp_ns < seen_[b].at.stamp_ns : a < b;
  });
  if (moved_.any()) {
    correct_with<kMovedSize>(T_base_lidar);
  } else {
    correct_with<0>(T_base_lidar);
  }
}

// All matches at once, each at its own time: a linear filter for the error about the predicted trajectory, of the pose
// at the stamp as well and of the places of moved reflectors, and linearised again about its result while that is
// large.
template <int Moved>
void ReflectorLocalization::correct_with(const Pose2& T_base_lidar) {
  // Of the state at the time of a sighting, of the pose at the stamp, and of the places of moved reflectors.
  constexpr int kSize = 9 + Moved;
  using Vector = Eigen::Matrix<double, kSize, 1>;
  using Matrix = Eigen::Matrix<double, kSize, kSize>;
  const Estimate<ReflectorState> before = estimate_;
  const MovedPlaces moved = moved_;
  const OdometryTrack::Entry stamp = at_;
  ReflectorState about = before.x;  // at the stamp
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const Vector6 off = Manifold<ReflectorState>::local_coordinates(before.x, about);
    const Matrix6 reset = Manifold<ReflectorState>::reset_jacobian(off);
    const Matrix6 P = transformed(reset, before.P);
    Estimate<Vector> error;
    error.x.template head<6>() = Manifold<ReflectorState>::local_coordinates(about, before.x);
    error.x.template segment<3>(6) = error.x.template head<3>();
    error.P.template topLeftCorner<6, 6>() = P;
    error.P.template block<6, 3>(0, 6) = P.leftCols<3>();
    error.P.template block<3, 6>(6, 0) = P.topRows<3>();
    error.P.template block<3, 3>(6, 6) = P.topLeftCorner<3, 3>();
    if constexpr (Moved > 0) {
      const Eigen::Matrix<double, 6, Moved> P_state = reset * moved.P_state;
      error.P.template topRightCorner<6, Moved>() = P_state;
      error.P.template bottomLeftCorner<Moved, 6>() = P_state.transpose();
      error.P.template block<3, Moved>(6, 9) = P_state.template topRows<3>();
      error.P.template block<Moved, 3>(9, 6) = P_state.template topRows<3>().transpose();
      error.P.template bottomRightCorner<Moved, Moved>() = moved.P;
    }
    ReflectorState x = about;
    at_ = stamp;
    for (const std::size_t k : in_time_) {
      const Pose2 u = inverse(at_.T_track_base) * seen_[k].at.T_track_base;
      const double turn_rad = turn_before(at_, seen_[k].at);
      at_ = seen_[k].at;
      Matrix F = Matrix::Identity();
      Matrix Q = Matrix::Zero();
      F.template topLeftCorner<6, 6>() = moved_by_odometry_jacobian(x, u, turn_rad);
      Q.template topLeftCorner<6, 6>() = noise_of(u);
      x = moved_by_odometry(x, u, turn_rad);
      predict(error, Vector(F * error.x), F, Q);

      const Possible& possible = possible_of(k);
      const auto reflector = static_cast<std::size_t>(reflector_of_[k]);
      const Eigen::Vector2d center_m = center_of(reflector);
      Eigen::Matrix<double, 2, kSize> H = Eigen::Matrix<double, 2, kSize>::Zero();
      const Eigen::Matrix<double, 2, 3> J = observed_reflector_jacobian(x.T_world_base, T_base_lidar, center_m);
      H.template leftCols<3>() = J;
      if constexpr (Moved > 0) {
        const int i = watched_[reflector].used;
        if (i >= 0) H.template middleCols<2>(9 + 2 * i) = observed_reflector_place_jacobian(J, x.T_world_base);
      }
      Eigen::Vector2d nu = possible.z - observed_reflector(x.T_world_base, T_base_lidar, center_m);
      nu(1) = wrap_to_pi(nu(1));
      nu -= H * error.x;
      situation_awareness::update(error, innovation(error, nu, H, possible.R), H, possible.R);
    }
    const Vector6 e = error.x.template head<6>();
    const Eigen::Vector3d e_stamp = error.x.template segment<3>(6);
    const Matrix6 G = Manifold<ReflectorState>::reset_jacobian(e);
    estimate_.x = Manifold<ReflectorState>::retract(x, e);
    estimate_.P = transformed(G, Matrix6(error.P.template topLeftCorner<6, 6>()));
    at_stamp_.x = Manifold<Pose2>::retract(about.T_world_base, e_stamp);
    at_stamp_.P =
        transformed(Manifold<Pose2>::reset_jacobian(e_stamp), Eigen::Matrix3d(error.P.template block<3, 3>(6, 6)));
    const bool is_done = e_stamp.norm() < kRelinearise || iteration + 1 == kMaxIterations;
    if constexpr (Moved > 0) {
      if (is_done) {  // until then they are linearised about where they were
        moved_.l = moved.l + error.x.template tail<Moved>();
        moved_.P = error.P.template bottomRightCorner<Moved, Moved>();
        moved_.P_state = G * error.P.template topRightCorner<6, Moved>();
      }
    }
    if (is_done) break;
    about = {at_stamp_.x, estimate_.x.scale_error, estimate_.x.yaw_drift_rad_m};
  }
}

// --- the reflectors themselves ---------------------------------------------------------------------------------------

bool ReflectorLocalization::MovedPlaces::any() const {
  return std::any_of(is_used.begin(), is_used.end(), [](bool used) { return used; });
}

// A moved reflector is used from now on where it has been seen standing, if there is room.
void ReflectorLocalization::use_moved(Watched& watched) {
  const auto room = std::find(moved_.is_used.begin(), moved_.is_used.end(), false);
  if (room == moved_.is_used.end()) return;
  *room = true;
  const int i = static_cast<int>(room - moved_.is_used.begin());
  watched.used = i;
  watched.beams = {};
  moved_.l.segment<2>(2 * i) = watched.stands.center_world_m();
  moved_.P.block<2, 2>(2 * i, 2 * i) = kMovedSigma_m * kMovedSigma_m * Eigen::Matrix2d::Identity();
  ++counters_["moved reflector used"];
}

void ReflectorLocalization::leave_moved(Watched& watched) {
  const int i = watched.used;
  if (i < 0) return;
  watched.used = -1;
  watched.beams = {};
  moved_.is_used[static_cast<std::size_t>(i)] = false;
  moved_.l.segment<2>(2 * i).setZero();
  moved_.P.middleRows<2>(2 * i).setZero();
  moved_.P.middleCols<2>(2 * i).setZero();
  moved_.P_state.middleCols<2>(2 * i).setZero();
}

// All beams that would meet the reflector, wherever it is by the errors of the pose, end far behind it.
bool ReflectorLocalization::is_seen_through(const ReflectorSightings& sightings, const Pose2& T_base_lidar,
                                            const Reflector& known) const {
  const std::vector<float>& azimuths = sightings.free.azimuth_rad;
  if (azimuths.size() < 2) return false;
  double time_s = 0.5 * (sightings.free_begin_s + sightings.free_end_s);
  Eigen::Vector2d z;
  Eigen::Matrix<double, 2, 3> H;
  double azimuth_rad = 0.0;
  OdometryTrack::Entry now;
  if (!track_.at(sightings.stamp_ns, now)) return false;
  for (int iteration = 0; iteration < 2; ++iteration) {  // the time depends on the azimuth
    OdometryTrack::Entry then;
    if (!track_.at(sightings.stamp_ns + nanoseconds(time_s), then)) return false;
    const Pose2 T_base_then_lidar = inverse(now.T_track_base) * then.T_track_base * T_base_lidar;
    z = observed_reflector(at_stamp_.x, T_base_then_lidar, known.center_world_m);
    H = observed_reflector_jacobian(at_stamp_.x, T_base_then_lidar, known.center_world_m);
    azimuth_rad = z(1);
    while (azimuth_rad < azimuths.front()) azimuth_rad += 2.0 * kPi;
    while (azimuth_rad - 2.0 * kPi >= azimuths.front()) azimuth_rad -= 2.0 * kPi;
    const double part = (azimuth_rad - azimuths.front()) / static_cast<double>(azimuths.back() - azimuths.front());
    time_s = sightings.free_begin_s + std::min(1.0, part) * (sightings.free_end_s - sightings.free_begin_s);
  }
  if (z(0) > kMaxView_m || z(0) < known.radius_m + 0.1) return false;
  const Eigen::Matrix2d HPH = transformed(H, at_stamp_.P);
  const double half_rad = std::asin(std::min(1.0, known.radius_m / z(0))) + 2.0 * std::sqrt(HPH(1, 1));
  const double behind_m = z(0) + known.radius_m + kBehindReflector_m + 2.0 * std::sqrt(HPH(0, 0));
  const auto begin = std::lower_bound(azimuths.begin(), azimuths.end(), static_cast<float>(azimuth_rad - half_rad));
  const auto end = std::upper_bound(begin, azimuths.end(), static_cast<float>(azimuth_rad + half_rad));
  if (begin == azimuths.begin() || begin == end || end == azimuths.end()) return false;
  return std::all_of(sightings.free.range_m.begin() + (begin - azimuths.begin()),
                     sightings.free.range_m.begin() + (end - azimuths.begin()),
                     [&](float range_m) { return range_m > behind_m; });
}

// Unmatched sightings of what was not seen before while others were matched. Those of a scan with matches are
// remembered.
std::size_t ReflectorLocalization::count_strange(const ReflectorSightings& sightings) {
  std::size_t strange = 0;
  for (const Seen& seen : seen_) {
    const bool is_unmatched =
        std::find(update_.unmatched.begin(), update_.unmatched.end(), seen.sighting) != update_.unmatched.end();
    if (!is_unmatched) continue;
    const ReflectorSighting& sighting = sightings.sightings[seen.sighting];
    const Eigen::Vector2d p_lidar =
        sighting.surface_range_m * Eigen::Vector2d(std::cos(sighting.azimuth_rad), std::sin(sighting.azimuth_rad));
    const Eigen::Vector2d p_world = at_stamp_.x * (seen.T_base_lidar * p_lidar);
    const auto known = std::find_if(strangers_.begin(), strangers_.end(), [&](const Stranger& stranger) {
      return (stranger.p_world_m - p_world).norm() < kSameStranger_m;
    });
    if (known == strangers_.end() || known->scans < kStrangerScans) ++strange;
    if (update_.matches.empty() || contradicted_ > 0) continue;
    if (known != strangers_.end()) {
      ++known->scans;
    } else {
      if (strangers_.size() == kMaxStrangers) strangers_.erase(strangers_.begin());  // the oldest
      strangers_.push_back({p_world, 1});
    }
  }
  return strange;
}

// Whether something stands near the place of a reflector, `is_gone` from it, that is nobody else's.
void ReflectorLocalization::judge_elsewhere(const ReflectorSightings& sightings, const Pose2& T_base_lidar,
                                            std::size_t reflector, bool is_gone) {
  Watched& watched = watched_[reflector];
  const Reflector& known = map_.reflectors[reflector];
  double nearest_m = kMaxMove_m;
  Eigen::Vector2d nearest_world_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d lidar_world_m = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  bool is_plausible = false;
  for (const Seen& seen : seen_) {
    if (std::find(update_.unmatched.begin(), update_.unmatched.end(), seen.sighting) == update_.unmatched.end()) {
      continue;
    }
    const ReflectorFit fit = fit_reflector(sightings, sightings.sightings[seen.sighting], known.radius_m);
    const Pose2 T_world_lidar = at_stamp_.x * seen.T_base_lidar;
    const Eigen::Vector2d along(std::cos(fit.azimuth_rad), std::sin(fit.azimuth_rad));
    const Eigen::Vector2d p_world = T_world_lidar * (fit.range_m * along);
    const double distance_m = (p_world - known.center_world_m).norm();
    // Where the place itself is hidden, something bright at some distance is another thing.
    if (distance_m >= nearest_m || (distance_m > kBesidePlace_m && !is_gone && !watched.is_missing)) continue;
    nearest_m = distance_m;
    nearest_world_m = p_world;
    lidar_world_m = T_world_lidar.translation_m;
    is_plausible = fit.is_width_plausible;
    const Eigen::Vector2d along_world = T_world_lidar.rotation() * along;
    Eigen::Matrix2d J;  // d(x, y) / d(range, azimuth)
    J << along_world.x(), -fit.range_m * along_world.y(), along_world.y(), fit.range_m * along_world.x();
    const double yaw_m2 = fit.range_m * fit.range_m * at_stamp_.P(2, 2);
    covariance = transformed(J, fit.covariance) +
                 (larger_eigenvalue(at_stamp_.P.topLeftCorner<2, 2>()) + yaw_m2) * Eigen::Matrix2d::Identity();
  }
  const bool is_seen = nearest_m < kMaxMove_m;
  if (!is_seen && watched.elsewhere > 0 &&
      is_seen_through(sightings, T_base_lidar, {watched.elsewhere_world_m, known.radius_m})) {
    // Not there any more: someone who stood there, or a reflector that was moved again.
    if (++watched.left >= kMissingScans) {
      watched.elsewhere = watched.left = 0;
      watched.is_moved = false;
    }
    watched.stands = {};
  }
  if (!is_seen) return;
  if (watched.elsewhere > 0 && (nearest_world_m - watched.elsewhere_world_m).norm() > kStands_m) {
    watched.elsewhere = 0;
    watched.stands = {};
  }
  watched.left = 0;
  ++watched.elsewhere;
  watched.elsewhere_world_m += (nearest_world_m - watched.elsewhere_world_m) / watched.elsewhere;
  if (is_plausible) watched.stands.add(sightings.stamp_ns, nearest_world_m, covariance, lidar_world_m);
  if (watched.elsewhere < kMovedScans) return;
  if (!watched.is_moved) ++counters_["reflector moved"];
  watched.is_moved = true;
  if (watched.stands.seen_s() >= params_.moved_use_s && watched.stands.is_reflector()) use_moved(watched);
}

void ReflectorLocalization::judge_reflectors(const ReflectorSightings& sightings, const Pose2& T_base_lidar) {
  if (update_.matches.size() >= 2) confirmed_ns_ = stamp_ns_;
  const bool is_certain = !update_.matches.empty() && seconds_between(confirmed_ns_, stamp_ns_) < kConfirmed_s &&
                          larger_eigenvalue(at_stamp_.P.topLeftCorner<2, 2>()) < kCertain_m * kCertain_m &&
                          at_stamp_.P(2, 2) < kCertain_rad * kCertain_rad;
  std::size_t seen_through = 0;
  for (std::size_t k = 0; k < watched_.size(); ++k) {
    Watched& watched = watched_[k];
    const bool is_matched = std::any_of(update_.matches.begin(), update_.matches.end(),
                                        [&](const ReflectorMatch& m) { return m.reflector == static_cast<int>(k); });
    if (is_matched && watched.used >= 0) {
      watched.left = std::max(0, watched.left - 2);
      watched.back = 0;
      watched.elsewhere_world_m = moved_.at(watched.used);
      continue;
    }
    if (is_matched) {
      watched.missing = std::max(0, watched.missing - 2);
      watched.elsewhere = 0;
      watched.stands = {};
      if (watched.missing == 0) watched.is_missing = false;
      continue;
    }
    const bool is_gone = is_seen_through(sightings, T_base_lidar, map_.reflectors[k]);
    if (is_gone && !watched.is_missing && !watched.is_moved) ++seen_through;
    if (!is_certain) continue;
    if (is_gone) {
      watched.missing = std::min(watched.missing + 1, kMissingScans);
      watched.back = 0;
      if (watched.missing == kMissingScans && !watched.is_missing) {
        watched.is_missing = true;
        ++counters_["reflector missing"];
      }
    }
    // Back in its place.
    if (watched.is_moved && watched.back >= kMovedScans) {
      leave_moved(watched);
      watched = {};
      ++counters_["reflector back"];
      continue;
    }
    if (watched.used < 0) {
      judge_elsewhere(sightings, T_base_lidar, k, is_gone);
    } else if (is_seen_through(sightings, T_base_lidar, {center_of(k), map_.reflectors[k].radius_m}) &&
               ++watched.left >= kMovedScans) {
      leave_moved(watched);  // moved again, or it was none
      watched.elsewhere = watched.left = 0;
      watched.is_moved = false;
      watched.stands = {};
      ++counters_["moved reflector gone"];
    }
  }
  for (std::size_t k = 0; k < watched_.size(); ++k) {
    if (watched_[k].is_moved) {
      MovedReflector moved;
      moved.reflector = static_cast<int>(k);
      moved.center_world_m = watched_[k].elsewhere_world_m;
      moved.is_used = watched_[k].used >= 0;
      if (moved.is_used) moved.covariance_m2 = moved_.covariance_at(watched_[k].used);
      update_.moved.push_back(moved);
    } else if (watched_[k].is_missing) {
      update_.missing.push_back(static_cast<int>(k));
    }
  }

  const std::size_t matches = update_.matches.size();
  // After a long way with few reflectors one may be matched by chance, and those that it hides are soon known as things
  // that shine: a search tells. A pose that was known all the time needs none: things that shine, and reflectors that
  // were moved, may be more than those that are matched.
  if (matches >= kSureMatches && doubtful_ == 0) was_unsure_ = false;
  const std::size_t unmatched = update_.unmatched.size();
  if (unmatched >= 2 && unmatched > matches && was_unsure_) {
    ++doubtful_;
  } else if (matches > 0) {
    doubtful_ = std::max(0, doubtful_ - 1);
  }
  // What was there before, while the pose was known, is no sign of another pose: a reflector that was moved, a thing
  // that shines.
  const std::size_t strange = count_strange(sightings);
  update_.is_contradicted =
      (seen_through >= 2 && seen_through > matches && strange >= 2) || (matches == 0 && strange >= 3);
  if (!update_.is_contradicted) {
    if (matches >= 1) contradicted_ = 0;
    return;
  }
  ++contradicted_;
  const Eigen::Vector3d sigma(kLostSigma_m, kLostSigma_m, kLostSigma_rad);
  estimate_.P.diagonal().head<3>() += sigma.cwiseAbs2();
  at_stamp_.P.diagonal() += sigma.cwiseAbs2();
}

// --- search ----------------------------------------------------------------------------------------------------------

void ReflectorLocalization::collect(const ReflectorSightings& sightings, const OdometryTrack::Entry& now) {
  const auto is_old = [&](const Stood& stood) {
    return seconds_between(stood.stamp_ns, now.stamp_ns) > kMaxAge_s ||
           (stood.base_track_m - now.T_track_base.translation_m).norm() > kMaxSearchTravel_m;
  };
  stood_.erase(std::remove_if(stood_.begin(), stood_.end(), is_old), stood_.end());
  for (const Seen& seen : seen_) {
    const ReflectorFit fit = fit_reflector(sightings, sightings.sightings[seen.sighting], mean_radius_m_);
    if (!fit.is_width_plausible) continue;
    const Pose2 T_track_lidar = now.T_track_base * seen.T_base_lidar;
    const Eigen::Vector2d along =
        T_track_lidar.rotation() * Eigen::Vector2d(std::cos(fit.azimuth_rad), std::sin(fit.azimuth_rad));
    const Eigen::Vector2d center_m = T_track_lidar.translation_m + fit.range_m * along;
    Eigen::Matrix2d J;
    J << along.x(), -fit.range_m * along.y(), along.y(), fit.range_m * along.x();
    const double spread_m2 = radius_spread_m_ * radius_spread_m_ + kModelSigma_m * kModelSigma_m;
    const Eigen::Matrix2d covariance = transformed(J, fit.covariance) + spread_m2 * Eigen::Matrix2d::Identity();
    const auto same = std::find_if(stood_.begin(), stood_.end(), [&](const Stood& stood) {
      return stood.stamp_ns != now.stamp_ns && (stood.center_track_m - center_m).norm() < kStands_m;
    });
    if (same == stood_.end()) {
      if (stood_.size() < kMaxStood) {
        stood_.push_back({center_m, covariance, 1, now.stamp_ns, now.T_track_base.translation_m});
      }
      continue;
    }
    // While the robot stands a mean of the last few; its errors are those of one, since most of them are the same in
    // each. The errors of odometry in between would make it lag.
    ++same->scans;
    const bool stands = (same->base_track_m - now.T_track_base.translation_m).norm() < kStandsStill_m;
    same->center_track_m += (stands ? std::max(0.2, 1.0 / same->scans) : 1.0) * (center_m - same->center_track_m);
    same->covariance = covariance;
    same->stamp_ns = now.stamp_ns;
    same->base_track_m = now.T_track_base.translation_m;
  }
}

void ReflectorLocalization::search(const OdometryTrack::Entry& now) {
  order_.clear();
  for (std::size_t i = 0; i < stood_.size(); ++i) {
    if (stood_[i].scans >= kSearchScans) order_.push_back(i);
  }
  if (order_.empty()) return;
  std::sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
    return stood_[a].scans != stood_[b].scans ? stood_[a].scans > stood_[b].scans : a < b;
  });
  if (order_.size() > ReflectorSearch::kMaxPlaces) order_.resize(ReflectorSearch::kMaxPlaces);
  places_.clear();
  const double scale_sigma = has_scales_ ? std::sqrt(estimate_.P(3, 3)) : params_.wheels.distance_scale_sigma;
  for (const std::size_t i : order_) {
    const double way_m = (stood_[i].base_track_m - now.T_track_base.translation_m).norm();
    const double travel_m = std::max(kTravelError, scale_sigma) * way_m;
    places_.push_back(
        {stood_[i].center_track_m, stood_[i].covariance + travel_m * travel_m * Eigen::Matrix2d::Identity()});
  }
  const ReflectorPose& found = search_.find(places_);
  const auto matches = std::count_if(found.reflectors.begin(), found.reflectors.end(), [](int r) { return r >= 0; });
  if (!found.is_known) {
    if (!is_known_) reason_ = found.reason;
    ++counters_[found.reason];
    return;
  }
  if (is_known_ && static_cast<std::size_t>(matches) <= update_.matches.size()) return;
  Estimate<Pose2> T_world_base;
  T_world_base.x = found.T_world_frame * now.T_track_base;
  T_world_base.P = transformed(adjoint_se2(inverse(now.T_track_base)), found.P);
  if (is_known_ && contradicted_ < kLostScans) {
    // Only doubted: another pose replaces it, the same one is none.
    const Eigen::Vector3d off = Manifold<Pose2>::local_coordinates(T_world_base.x, at_stamp_.x);
    const Eigen::Matrix3d P = T_world_base.P + at_stamp_.P;
    if (innovation(off, P).mahalanobis2 < chi_square_quantile(kSamePose, 3)) return;
    contradicted_ = 1;
  }
  ++counters_[is_known_ ? "pose replaced" : "pose found"];
  set_pose(now, T_world_base);
  // This scan has been used.
  for (const int reflector : found.reflectors) {
    if (reflector < 0) continue;
    Watched& watched = watched_[static_cast<std::size_t>(reflector)];
    for (const Seen& seen : seen_) {
      const Eigen::Vector2d z = observed_reflector(estimate_.x.T_world_base, seen.T_base_lidar,
                                                   map_.reflectors[static_cast<std::size_t>(reflector)].center_world_m);
      watched.beams.used(z(1));
    }
  }
  update_.is_found = true;
  update_.matches.clear();
  update_.ambiguous.clear();
  update_.unmatched.clear();
  stood_.clear();
}

}  // namespace situation_awareness
