// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/reflector_localization.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "reflector_localization_parts.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// Probability that a sighting is inside the gate of the reflector that it is of.
constexpr double kSightingGateProbability = 0.999;
/// The pose is searched for anew after so many scans in a row that contradict it.
constexpr int kLostScans = 12;
/// A search uses what has been seen standing in so many scans of the last seconds.
constexpr int kSearchScans = 3;

/// Factor of the variance of the wheels' errors of scale when a pose replaces the one by which they were learned.
constexpr double kLearnedScale = 4.0;
/// s. The turn by odometry in a window that ends so long before a motion stands for that of the motion where the error
/// of scale is applied: what was wrong in it has been corrected by reflectors since. The correction lags as much.
constexpr double kTurnDelay_s = 0.1;
/// s. Its length: with 0.06 s the noise of turns weighs more, with 0.3 s the correction lags more.
constexpr double kTurnWindow_s = 0.15;
/// m. After this distance errors of the wheels count less, by a factor e, for how much they may change.
constexpr double kErrorsLast_m = 100.0;
/// What was seen longer ago, or farther away, is not searched with.
constexpr double kMaxAge_s = 3.0;
constexpr double kMaxSearchTravel_m = 1.5;
/// m. A robot that moves less between scans stands, and places are averaged.
constexpr double kStandsStill_m = 0.005;
constexpr std::size_t kMaxStood = 64;
/// Error of a place by odometry in between, relative to the way, at least.
constexpr double kTravelError = 0.03;
/// m. A pose that was less certain may have been given to the wrong reflector, until enough are matched.
constexpr double kUnsure_m = 0.1;
/// Probability that the pose that a search finds differs by less from the same one.
constexpr double kSamePose = 0.9999;

}  // namespace

void ReflectorLocalizationParams::validate() const {
  check_bounds(*this, "localization");
  wheels.validate();
  odometry.validate();
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
