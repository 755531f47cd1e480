// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/gps_ins_filter.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// Standard deviation of the accelerometer's scale and of the angles between its axes; it makes the height uncertain
/// where force changes in direction or size.
constexpr double kAccelerometerScaleSigma = 0.003;
/// Probability that a true measurement is used.
constexpr double kMeasurementGateProbability = 0.9999;
/// s. The pose is doubted instead of the fixes if none was used for this time.
constexpr double kRecoverAfter_s = 10.0;

using namespace navigation_error;
constexpr int kFixError = Manifold<GpsInsState>::kFixError;
using Scalar = Eigen::Matrix<double, 1, 1>;

/// What the force is on average, and for how long it differs from that in one way: an error of the scale goes into the
/// bias with the first, and lets the bias wander within the second.
constexpr double kMeanForce_s = 20.0, kForceChange_s = 5.0;
/// Over which the noise of the IMU is measured.
constexpr double kNoiseWindow_s = 5.0;
constexpr std::array<int, 3> kNoiseBlocks = {1, 4, 16};
/// Rate of the IMU for which there is room from the begin on.
constexpr double kUsualRate_hz = 250.0;
/// A longer gap of the samples ends a block.
constexpr double kStandingGap_s = 0.5;

/// Fewest fixes in a row that are all refused before the filter is doubted instead.
constexpr int kMinRefusedFixes = 5;
/// After an outage that is longer than this, fixes that agree with each other are believed at once.
constexpr double kOutage_s = 3.0;
/// What a filter that is doubted may be wrong by at most, besides the distance to the fix.
constexpr double kDoubtVelocity_m_s = 5.0;
constexpr double kDoubtAttitude_rad = 0.2;
/// What stands: means of blocks of the force that differ by less, as a start by 0.25 m/s would make them, and a rate
/// that a bias can be.
constexpr double kStandingForceChange_m_s2 = 0.03, kMostBias_rad_s = 0.05;
/// Least jump of the height of fixes that is taken for another zero of heights, and not for an outlier or an error (m).
constexpr double kHeightJump_m = 10.0;
/// Innovations of fixes are averaged over so long (s).
constexpr double kContradiction_s = 5.0;
/// What goes straight on does not turn, either: the velocity tells it from what flies a wide circle. One that is known
/// worse does not.
constexpr double kKnownVelocity_m_s = 0.5, kStandingVelocity_m_s = 1.0;
/// A bias that is known worse does not tell a turn from it; a yaw that is known worse may have been shown by chance,
/// and is better lost than kept.
constexpr double kKnownBias_rad_s = 0.0015, kKnownYaw_rad = 0.07;
/// An acceleration or a speed shows the yaw if this share of it is more than noise.
constexpr double kShown = 0.5;

/// Where less than this share of a variance is left, Joseph's form is taken: the difference has lost half of its
/// digits.
constexpr double kCancelled = 1e-7;

/// The same as update() of the kernel, in a quarter of its time (gps_ins_benchmark): with W = L^-1 H P and S = L L^T,
/// Joseph's form is P - W^T W at the optimal gain, and the reset changes no more than the attitude's rows and columns.
template <int Size>
void update_sparsely(Estimate<GpsInsState>& estimate, const Innovation<Size>& innovation,
                     const Eigen::Matrix<double, Size, 18>& H, const Eigen::Matrix<double, Size, Size>& R) {
  const Eigen::Matrix<double, Size, Size> L = factor_of(innovation.S);
  const Eigen::Matrix<double, Size, 18> HP = H.lazyProduct(estimate.P);
  const Eigen::Matrix<double, Size, 18> W = solve_lower(L, HP);
  const Eigen::Matrix<double, Size, 1> whitened = solve_lower(L, innovation.nu);
  const ErrorVector<GpsInsState> e = W.transpose() * whitened;
  const ErrorVector<GpsInsState> before = estimate.P.diagonal();
  const ErrorMatrix<GpsInsState> lower = estimate.P - W.transpose().lazyProduct(W);
  if ((lower.diagonal().array() < kCancelled * before.array()).any()) {
    const Eigen::Matrix<double, 18, Size> K = solve_cholesky(L, HP).transpose();
    const ErrorMatrix<GpsInsState> I_KH = ErrorMatrix<GpsInsState>::Identity() - K * H;
    estimate.P = transformed(I_KH, estimate.P) + transformed(K, R);
  } else {
    estimate.P = lower;
  }
  const Eigen::Matrix3d J = right_jacobian_so3(e.segment<3>(kAttitude));
  const Eigen::Matrix<double, 3, 18> rows = J.lazyProduct(estimate.P.middleRows<3>(kAttitude));
  estimate.P.middleRows<3>(kAttitude) = rows;
  const Eigen::Matrix<double, 18, 3> columns = estimate.P.middleCols<3>(kAttitude).lazyProduct(J.transpose());
  estimate.P.middleCols<3>(kAttitude) = columns;
  estimate.P = (0.5 * (estimate.P + estimate.P.transpose())).eval();
  estimate.x = Manifold<GpsInsState>::retract(estimate.x, e);
}

Eigen::Vector3d mix(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double part) { return a + part * (b - a); }

}  // namespace

InertialHistory::InertialHistory(double duration_s, double most_hz, double standing_change_rad_s)
    : duration_s_(duration_s),
      standing_change_rad_s_(standing_change_rad_s),
      most_(static_cast<std::size_t>(std::ceil(duration_s * most_hz)) + 2),
      samples_(std::min(most_, static_cast<std::size_t>(std::ceil(duration_s * kUsualRate_hz)) + 2)) {
  clear();
}

bool InertialHistory::is_short() const {
  return is_full() && seconds_between((*this)[begin()].stamp_ns, latest().stamp_ns) < duration_s_;
}

void InertialHistory::grow() {
  const std::uint64_t first = begin();
  std::vector<Entry> more(std::min(2 * samples_.size(), most_));
  for (std::uint64_t i = first; i < end_; ++i) more[static_cast<std::size_t>(i % more.size())] = (*this)[i];
  samples_.swap(more);
  begin_ = first;
}

void InertialHistory::Blocks::add(const InertialSample& sample, double period_s) {
  sum.head<3>() += sample.specific_force_m_s2;
  sum.tail<3>() += sample.angular_velocity_rad_s;
  if (++count < length) return;
  const Eigen::Matrix<double, 6, 1> mean = sum / count;
  if (whole == 2) {
    // Of white noise the difference has 1.5 times the variance of a mean, in each of three axes.
    const Eigen::Matrix<double, 6, 1> apart = last - 0.5 * (last_but_one + mean);
    const double block_s = length * period_s;
    duration_s = std::min(duration_s + block_s, kNoiseWindow_s);
    const Eigen::Vector2d of_block(apart.head<3>().squaredNorm(), apart.tail<3>().squaredNorm());
    densities += block_s / duration_s * (of_block * block_s / 4.5 - densities);
  } else {
    ++whole;
  }
  last_but_one = last;
  last = mean;
  sum.setZero();
  count = 0;
}

void InertialHistory::add(const InertialSample& sample) {
  const double period_s = empty() ? 0.0 : seconds_between(latest().stamp_ns, sample.stamp_ns);
  if (is_short() && samples_.size() < most_) grow();
  Entry& entry = samples_[static_cast<std::size_t>(end_++ % samples_.size())];
  static_cast<InertialSample&>(entry) = sample;
  add_to_block(entry, period_s);
  if (end_ - begin_ == 1) mean_force_m_s2_ = sample.specific_force_m_s2;
  const Eigen::Vector3d change_m_s2 = sample.specific_force_m_s2 - mean_force_m_s2_;
  mean_force_m_s2_ += std::min(period_s / kMeanForce_s, 1.0) * change_m_s2;
  force_variance_ += std::min(period_s / kForceChange_s, 1.0) * (change_m_s2.squaredNorm() - force_variance_);
  entry.force_change_m_s2 = std::sqrt(force_variance_);
  if (period_s <= 0.0) return;
  Eigen::Vector2d least = Eigen::Vector2d::Zero();
  for (Blocks& blocks : blocks_) {
    blocks.add(sample, period_s);
    if (blocks.duration_s < 1.0 && blocks.length > 1) continue;
    least = blocks.length == 1 ? blocks.densities : least.cwiseMin(blocks.densities).eval();
  }
  entry.accelerometer_noise = std::sqrt(least.x());
  entry.gyroscope_noise = std::sqrt(least.y());
}

void InertialHistory::add_to_block(Entry& entry, double period_s) {
  entry.ends_block = false;
  if (period_s > kStandingGap_s) standing_ = Standing();
  if (standing_.count++ == 0) standing_.begin_ns = entry.stamp_ns;
  standing_.sum.head<3>() += entry.specific_force_m_s2;
  standing_.sum.tail<3>() += entry.angular_velocity_rad_s;
  const double block_s = seconds_between(standing_.begin_ns, entry.stamp_ns);
  if (block_s < kBlock_s) return;
  const Eigen::Matrix<double, 6, 1> mean = standing_.sum / standing_.count, change = mean - standing_.last;
  entry.ends_block = true;
  entry.block_s = block_s;
  entry.mean_rate_rad_s = mean.tail<3>();
  entry.rate_change_rad_s = change.tail<3>();
  entry.may_stand = standing_.has_last && change.head<3>().norm() < kStandingForceChange_m_s2 &&
                    change.tail<3>().cwiseAbs().maxCoeff() < standing_change_rad_s_ &&
                    mean.tail<3>().norm() < kMostBias_rad_s;
  standing_.last = mean;
  standing_.has_last = true;
  standing_.sum.setZero();
  standing_.count = 1;  // the last of one is the first of the next
  standing_.begin_ns = entry.stamp_ns;
  standing_.sum << entry.specific_force_m_s2, entry.angular_velocity_rad_s;
}

void InertialHistory::clear() {
  begin_ = end_;
  standing_ = Standing();
  force_variance_ = 0.0;
  blocks_ = {};
  for (std::size_t i = 0; i < blocks_.size(); ++i) blocks_[i].length = kNoiseBlocks[i];
}

std::uint64_t InertialHistory::last_until(std::int64_t stamp_ns) const {
  std::uint64_t low = begin(), high = end_;
  while (high - low > 1) {
    const std::uint64_t middle = low + (high - low) / 2;
    ((*this)[middle].stamp_ns <= stamp_ns ? low : high) = middle;
  }
  return low;
}

GpsInsFilter::GpsInsFilter(const GpsInsModel& model, const FixNoise& fix_noise, std::size_t moments)
    : model_(model), fix_noise_(fix_noise), moments_(moments) {
  gates_.push_back(0.0);
  for (int rows = 1; rows <= GpsInsCorrection::kMaxRows; ++rows) {
    gates_.push_back(chi_square_quantile(kMeasurementGateProbability, rows));
  }
}

void GpsInsFilter::start(std::int64_t stamp_ns, const Estimate<GpsInsState>& estimate, const InertialHistory& imu,
                         bool is_yaw_known) {
  now_ = Moment();
  now_.stamp_ns = stamp_ns;
  now_.sample = imu.last_until(stamp_ns);
  now_.estimate = estimate;
  now_.is_yaw_known = is_yaw_known;
  now_.yaw_shown_ns = now_.last_fix_ns = stamp_ns;
  first_ = kept_ = 0;
  keep(now_);
}

void GpsInsFilter::keep(const Moment& moment) {
  if (kept_ == moments_.size()) {
    first_ = (first_ + 1) % moments_.size();
    --kept_;
  }
  moments_[(first_ + kept_++) % moments_.size()] = moment;
}

std::int64_t GpsInsFilter::oldest_ns() const { return moments_[first_].stamp_ns; }

bool GpsInsFilter::go_back_before(std::int64_t stamp_ns) {
  if (now_.stamp_ns < stamp_ns) return true;
  std::size_t left = kept_;
  while (left > 0 && moments_[(first_ + left - 1) % moments_.size()].stamp_ns >= stamp_ns) --left;
  if (left == 0) return false;
  kept_ = left;
  now_ = moments_[(first_ + left - 1) % moments_.size()];
  return true;
}

void GpsInsFilter::forget(std::uint64_t before_sample, std::int64_t before_ns) {
  while (kept_ > 1 && (moments_[first_].sample < before_sample || moments_[first_].stamp_ns < before_ns)) {
    first_ = (first_ + 1) % moments_.size();
    --kept_;
  }
}

void GpsInsFilter::set_log_likelihood(double log_likelihood) {
  const double change = log_likelihood - now_.log_likelihood;
  now_.log_likelihood = log_likelihood;
  for (std::size_t i = 0; i < kept_; ++i) moments_[(first_ + i) % moments_.size()].log_likelihood += change;
}

void GpsInsFilter::widen(double velocity_sigma_m_s, double attitude_sigma_rad) {
  predict_covariance(now_);
  now_.estimate.P.diagonal().segment<3>(kVelocity).array() += velocity_sigma_m_s * velocity_sigma_m_s;
  now_.estimate.P.diagonal().segment<3>(kAttitude).array() += attitude_sigma_rad * attitude_sigma_rad;
  forget_moments();
}

void GpsInsFilter::widen_by(double factor) {
  predict_covariance(now_);
  now_.estimate.P.topRows<kFixError>() *= std::sqrt(factor);
  now_.estimate.P.leftCols<kFixError>() *= std::sqrt(factor);
  now_.innovation_sum.setZero();
  now_.innovation_variance = 0.0;
  forget_moments();
}

// To go back and on again would lose what was changed.
void GpsInsFilter::forget_moments() {
  first_ = kept_ = 0;
  keep(now_);
}

void GpsInsFilter::move_to(Moment& moment, std::int64_t stamp_ns, const InertialHistory& imu) const {
  const InertialHistory::Entry& a = imu[moment.sample];
  const bool is_last = moment.sample + 1 == imu.end();
  const InertialHistory::Entry& b = is_last ? a : imu[moment.sample + 1];
  const double dt_s = seconds_between(moment.stamp_ns, stamp_ns);
  const double period_s = seconds_between(a.stamp_ns, b.stamp_ns);
  const double middle_s = seconds_between(a.stamp_ns, moment.stamp_ns) + 0.5 * dt_s;
  const double part = period_s > 0.0 ? std::clamp(middle_s / period_s, 0.0, 1.0) : 0.0;
  const Eigen::Vector3d force = mix(a.specific_force_m_s2, b.specific_force_m_s2, part);
  const Eigen::Vector3d rate = mix(a.angular_velocity_rad_s, b.angular_velocity_rad_s, part);
  moment.estimate.x.motion = moment.motion.append(moment.estimate.x.motion, force, rate, dt_s);
  moment.estimate.x.fix_error *= kept_of_fix_error(dt_s, fix_noise_.correlation_s);
  moment.stamp_ns = stamp_ns;
  moment.accelerometer_noise = b.accelerometer_noise;
  moment.gyroscope_noise = b.gyroscope_noise;
  moment.force_change_m_s2 = b.force_change_m_s2;
  const double end_s = seconds_between(a.stamp_ns, stamp_ns);
  moment.rate_rad_s = mix(a.angular_velocity_rad_s, b.angular_velocity_rad_s,
                          period_s > 0.0 ? std::clamp(end_s / period_s, 0.0, 1.0) : 0.0);
  if (period_s > 0.0) moment.rate_variance = b.gyroscope_noise * b.gyroscope_noise / period_s;
  if (moment.stands) moment.stood_s += dt_s;
  if (!is_last && b.stamp_ns <= stamp_ns) ++moment.sample;
}

ErrorMatrix<GpsInsState> GpsInsFilter::predicted_covariance(const Moment& moment, double& shown_share) const {
  InertialNoiseParams noise = model_.noise;
  noise.accelerometer_noise = std::max(noise.accelerometer_noise, moment.accelerometer_noise);
  noise.gyroscope_noise = std::max(noise.gyroscope_noise, moment.gyroscope_noise);
  const ErrorMatrix<GpsInsState>& P = moment.estimate.P;
  MotionJacobian motion = moment.motion;
  const Eigen::Quaterniond q_before =
      moment.estimate.x.motion.q_world_imu * Eigen::Quaterniond(motion.attitude_by_attitude);
  const YawEffect effect = leave_out_insignificant(motion, q_before, P, noise);
  shown_share = effect.share_left;
  ErrorMatrix<GpsInsState> result = moved_covariance(P, motion, noise, fix_noise_.correlation_s);
  const double scale_m_s2 = kAccelerometerScaleSigma * moment.force_change_m_s2;
  const Eigen::Vector3d up_body = moment.estimate.x.motion.q_world_imu.conjugate() * Eigen::Vector3d::UnitZ();
  result.block<3, 3>(kAccelerometerBias, kAccelerometerBias) +=
      2.0 / kForceChange_s * scale_m_s2 * scale_m_s2 * motion.duration_s * up_body * up_body.transpose();
  result.topLeftCorner<6, 6>() += vertical_variance(q_before, P) * effect.left_out * effect.left_out.transpose();
  // At rest the walk about the vertical is measured.
  result.block<3, 3>(kGyroscopeBias, kGyroscopeBias) -=
      noise.gyroscope_bias_walk * noise.gyroscope_bias_walk * moment.stood_s * up_body * up_body.transpose();
  return result;
}

void GpsInsFilter::predict_covariance(Moment& moment) const {
  double shown_share = 0.0;
  moment.estimate.P = predicted_covariance(moment, shown_share);
  moment.motion = MotionJacobian();
  moment.stood_s = 0.0;
  if (shown_share > kShown) moment.yaw_shown_ns = moment.stamp_ns;
}

bool GpsInsFilter::may_stand(const Moment& moment) const {
  const Eigen::Vector3d& v_m_s = moment.estimate.x.motion.velocity_world_m_s;
  const auto P = moment.estimate.P.block<3, 3>(kVelocity, kVelocity);
  return P.diagonal().maxCoeff() < kKnownVelocity_m_s * kKnownVelocity_m_s && v_m_s.norm() < kStandingVelocity_m_s;
}

void GpsInsFilter::watch_standing(Moment& moment, const InertialHistory::Entry& block) const {
  const bool stood = moment.stands;
  moment.stands = block.may_stand && (stood || may_stand(moment));
  if (!moment.stands) return;
  NavigationState& x = moment.estimate.x.motion;
  const Eigen::Vector3d up_body = x.q_world_imu.conjugate() * Eigen::Vector3d::UnitZ();
  if (stood) {
    // The mean rate changes as the bias does, which the turn in this block was less of.
    const double change_rad_s = up_body.dot(block.rate_change_rad_s);
    x.gyroscope_bias_rad_s += change_rad_s * up_body;
    x.q_world_imu = (x.q_world_imu * exp_so3(-change_rad_s * block.block_s * up_body)).normalized();
    return;
  }
  // The bias is the rate but for a turn that passes for standing, and which stays as long as it stands: it never gets
  // known better than that, however often.
  const Eigen::Matrix3d P = moment.estimate.P.block<3, 3>(kGyroscopeBias, kGyroscopeBias);
  const double variance = up_body.dot(P * up_body);
  const double least = model_.standing_turn_rad_s * model_.standing_turn_rad_s / 3.0 +
                       model_.noise.gyroscope_noise * model_.noise.gyroscope_noise / block.block_s;
  moment.stands = variance < kKnownBias_rad_s * kKnownBias_rad_s &&
                  vertical_variance(x.q_world_imu, moment.estimate.P) < kKnownYaw_rad * kKnownYaw_rad;
  if (!moment.stands) return;
  const Scalar nu(up_body.dot(block.mean_rate_rad_s - x.gyroscope_bias_rad_s));
  // A turn that is more than what is known of the bias is one; a bias that wandered off is known worse after a while.
  moment.stands = nu.value() * nu.value() < kStandingSigmas * kStandingSigmas * (variance + least);
  if (!moment.stands || variance <= 1.01 * least) return;
  Eigen::Matrix<double, 1, 18> H = Eigen::Matrix<double, 1, 18>::Zero();
  H.segment<3>(kGyroscopeBias) = up_body;
  moment.stands = correct<1>(moment, nu, H, Scalar(least * variance / (variance - least)), 1).is_accepted;
}

bool GpsInsFilter::is_doubted(Moment& moment, const Eigen::Vector3d& nu, const Eigen::Matrix3d& R) const {
  const std::int64_t before_ns = moment.rejected_ns;
  const Eigen::Vector3d apart_m = nu - moment.rejected_m;
  moment.rejected_ns = moment.stamp_ns;
  moment.rejected_m = nu;
  if (moment.rejected++ == 0) {
    moment.rejected_since_ns = moment.stamp_ns;
    return false;
  }
  if (moment.rejected > kMinRefusedFixes &&
      seconds_between(moment.rejected_since_ns, moment.stamp_ns) > kRecoverAfter_s) {
    return true;
  }
  if (moment.outage_s == 0.0) return false;
  // What the filter is off by grew with the time of the outage, and goes on so.
  const Eigen::Vector3d drift_m = 2.0 * seconds_between(before_ns, moment.stamp_ns) / moment.outage_s * nu;
  const Eigen::Matrix3d S = 2.0 * R + Eigen::Matrix3d(drift_m.cwiseAbs2().asDiagonal());
  return innovation(apart_m, S).mahalanobis2 <= gates_[3];
}

void GpsInsFilter::doubt(Moment& moment, const Eigen::Vector3d& nu) const {
  ErrorMatrix<GpsInsState>& P = moment.estimate.P;
  P.diagonal().segment<3>(kPosition) += nu.cwiseAbs2();
  if (moment.outage_s > 0.0) {
    // A velocity or an acceleration that was wrong from the begin of the outage on.
    const Eigen::Vector3d velocity_m_s = 2.0 / moment.outage_s * nu, acceleration_m_s2 = velocity_m_s / moment.outage_s;
    const double tilt_rad = acceleration_m_s2.head<2>().norm() / kStandardGravity_m_s2;
    P.diagonal().segment<3>(kVelocity) += velocity_m_s.cwiseAbs2();
    P.diagonal().segment<3>(kAttitude).array() += std::pow(std::min(tilt_rad, kDoubtAttitude_rad), 2);
    // Of the vertical one the bias along the body's axis that is up.
    const Eigen::Vector3d up_body = moment.estimate.x.motion.q_world_imu.conjugate() * Eigen::Vector3d::UnitZ();
    P.block<3, 3>(kAccelerometerBias, kAccelerometerBias) +=
        acceleration_m_s2.z() * acceleration_m_s2.z() * up_body * up_body.transpose();
  } else {
    P.diagonal().segment<3>(kVelocity).array() += kDoubtVelocity_m_s * kDoubtVelocity_m_s;
    P.diagonal().segment<3>(kAttitude).array() += kDoubtAttitude_rad * kDoubtAttitude_rad;
    ++moment.contradictions;
  }
  moment.rejected = 0;
  moment.outage_s = 0.0;
  ++moment.recoveries;
}

bool GpsInsFilter::is_off_in_height(Moment& moment, const Eigen::Vector3d& nu, const Eigen::Matrix3d& S,
                                    double variance_m2) const {
  const Innovation<2> level = innovation(Eigen::Vector2d(nu.head<2>()), Eigen::Matrix2d(S.topLeftCorner<2, 2>()));
  if (std::abs(nu.z()) < kHeightJump_m || inside_gate(innovation(nu, S), gates_[3]) || !inside_gate(level, gates_[2])) {
    moment.heights_refused = 0;
    return false;
  }
  const double apart_m = nu.z() - moment.height_refused_m;
  moment.heights_refused = apart_m * apart_m <= 2.0 * gates_[1] * variance_m2 ? moment.heights_refused + 1 : 1;
  moment.height_refused_m = nu.z();
  if (moment.heights_refused <= kMinRefusedFixes) return true;
  // Another zero of heights: the jump tells nothing of the motion.
  ErrorMatrix<GpsInsState>& P = moment.estimate.P;
  const double variance = P(kPosition + 2, kPosition + 2) + nu.z() * nu.z();
  P.row(kPosition + 2).setZero();
  P.col(kPosition + 2).setZero();
  P(kPosition + 2, kPosition + 2) = variance;
  moment.heights_refused = 0;
  return false;
}

template <int Size>
GpsInsVerdict GpsInsFilter::correct(Moment& moment, const Eigen::Matrix<double, Size, 1>& nu,
                                    const Eigen::Matrix<double, Size, 18>& H,
                                    const Eigen::Matrix<double, Size, Size>& R, int rows) const {
  GpsInsVerdict verdict;
  const double gate = gates_[static_cast<std::size_t>(rows)];
  Innovation<Size> compared = innovation(moment.estimate, nu, H, R);
  verdict.degrees_of_freedom = rows;
  verdict.nis = compared.mahalanobis2;
  verdict.is_accepted = inside_gate(compared, gate);
  if (!std::isfinite(compared.mahalanobis2) || !std::isfinite(compared.log_likelihood)) {
    verdict.is_accepted = false;
    return verdict;
  }
  // An outlier says no more about a filter than that it is outside the gate.
  moment.log_likelihood += compared.log_likelihood + 0.5 * std::max(compared.mahalanobis2 - gate, 0.0);
  bool is_used = verdict.is_accepted;
  if constexpr (Size == 3) {  // a fix
    const double since_s = seconds_between(moment.last_fix_ns, moment.stamp_ns);
    moment.last_fix_ns = moment.stamp_ns;
    if (since_s > kOutage_s) moment.outage_s = since_s;
    if (verdict.is_accepted) {
      const double kept = std::exp(-since_s / kContradiction_s);
      moment.innovation_sum = kept * moment.innovation_sum + solve_lower(factor_of(compared.S), nu);
      moment.innovation_variance = kept * kept * moment.innovation_variance + 1.0;
      moment.rejected = 0;
      moment.outage_s = 0.0;
    } else if (is_doubted(moment, nu, R)) {
      doubt(moment, nu);
      compared = innovation(moment.estimate, nu, H, R);
      is_used = true;
    }
  }
  if (is_used) {
    update_sparsely(moment.estimate, compared, H, R);
    moment.is_sound =
        is_finite(moment.estimate.x) && moment.estimate.P.allFinite() && moment.estimate.P.diagonal().minCoeff() >= 0.0;
  }
  return verdict;
}

GpsInsVerdict GpsInsFilter::apply(Moment& moment, const GpsInsMeasurement& measurement) const {
  const GpsInsState& x = moment.estimate.x;
  switch (measurement.sensor) {
    case GpsInsSensor::kFix: {
      Eigen::Vector3d nu;
      Eigen::Matrix<double, 3, 18> H;
      Eigen::Matrix3d R;
      fix_innovation(x, measurement, model_, fix_noise_, nu, H, R);
      const Eigen::Matrix3d S = transformed(H, moment.estimate.P) + R;
      const bool is_off = measurement.has_jumped && !measurement.is_level &&
                          is_off_in_height(moment, nu, S, measurement.covariance(2, 2));
      if (!is_off && !measurement.is_level) return correct<3>(moment, nu, H, R, 3);
      // The height says nothing of the state, nor of how the error of fixes is correlated.
      nu.z() = 0.0;
      H.row(2).setZero();
      R.row(2) = R.col(2).transpose() = Eigen::RowVector3d(0.0, 0.0, measurement.covariance(2, 2));
      GpsInsVerdict verdict = correct<3>(moment, nu, H, R, 3);
      if (is_off && !moment.is_yaw_known)
        moment.log_likelihood -= 0.5 * gates_[1];  // a wrong yaw is off in height, too
      verdict.is_height_refused = is_off && verdict.is_accepted;
      verdict.nis *= 1.5;  // of two degrees of freedom
      return verdict;
    }
    case GpsInsSensor::kAltitude: {
      Eigen::Matrix<double, 1, 18> H = Eigen::Matrix<double, 1, 18>::Zero();
      H(kPosition + 2) = 1.0;
      return correct<1>(moment, Scalar(measurement.value.x() - x.motion.position_world_m.z()), H,
                        Scalar(measurement.covariance(0, 0)), 1);
    }
    case GpsInsSensor::kHeading: {
      Eigen::Matrix<double, 1, 18> H = Eigen::Matrix<double, 1, 18>::Zero();
      H.segment<3>(kAttitude) = yaw_jacobian(x.motion.q_world_imu);
      moment.yaw_shown_ns = moment.stamp_ns;
      // One heading alone may be an outlier inside the gate: it halves the variance of the yaw at most.
      const Eigen::Vector3d by_attitude = H.segment<3>(kAttitude);
      const double known = by_attitude.dot(moment.estimate.P.block<3, 3>(kAttitude, kAttitude) * by_attitude);
      return correct<1>(moment, Scalar(wrap_to_pi(measurement.value.x() - yaw_of(x.motion.q_world_imu))), H,
                        Scalar(std::max(measurement.covariance(0, 0), known)), 1);
    }
    case GpsInsSensor::kSideslip: {
      Eigen::Matrix<double, 1, 18> H = sideslip_jacobian(x.motion, model_.imu_base_m);
      double variance =
          measurement.covariance(0, 0) + H.segment<3>(kGyroscopeBias).squaredNorm() * moment.rate_variance;
      // The speed ahead, by which a yaw shows itself, as far as it is more than its own error.
      const ErrorMatrix<GpsInsState>& P = moment.estimate.P;
      const Eigen::Vector3d up_body = x.motion.q_world_imu.conjugate() * Eigen::Vector3d::UnitZ();
      const Eigen::Vector3d ahead = x.motion.q_world_imu * Eigen::Vector3d::UnitX();
      const double by_yaw = H.segment<3>(kAttitude).dot(up_body);
      const double share = significant_share(by_yaw * by_yaw / ahead.dot(P.block<3, 3>(kVelocity, kVelocity) * ahead));
      H.segment<3>(kAttitude) -= (1.0 - share) * by_yaw * up_body.transpose();
      variance += std::pow((1.0 - share) * by_yaw, 2) * vertical_variance(x.motion.q_world_imu, P);
      if (share > kShown) moment.yaw_shown_ns = moment.stamp_ns;
      return correct<1>(moment, Scalar(-sideslip(x.motion, moment.rate_rad_s, model_.imu_base_m)), H, Scalar(variance),
                        1);
    }
    case GpsInsSensor::kOther:
      break;
  }
  const GpsInsCorrection& by = measurement.correction;
  return correct<GpsInsCorrection::kMaxRows>(
      moment, by.residual - by.H * Manifold<GpsInsState>::local_coordinates(by.reference, x), by.H, by.R, by.rows);
}

template <class OnMoment, class OnVerdict>
void GpsInsFilter::advance(Moment& moment, std::int64_t stamp_ns, const InertialHistory& imu,
                           const std::vector<GpsInsMeasurement>& measurements, const OnMoment& on_moment,
                           const OnVerdict& on_verdict) const {
  auto next = std::upper_bound(measurements.begin(), measurements.end(), moment.stamp_ns,
                               [](std::int64_t stamp, const GpsInsMeasurement& m) { return stamp < m.stamp_ns; });
  while (moment.stamp_ns < stamp_ns) {
    std::int64_t to_ns = stamp_ns;
    if (moment.sample + 1 < imu.end()) to_ns = std::min(to_ns, imu[moment.sample + 1].stamp_ns);
    const bool is_due = next != measurements.end() && next->stamp_ns <= to_ns;
    if (is_due) to_ns = next->stamp_ns;
    const std::uint64_t before = moment.sample;
    move_to(moment, to_ns, imu);
    if (moment.is_yaw_known && moment.sample != before && imu[moment.sample].ends_block) {
      predict_covariance(moment);
      watch_standing(moment, imu[moment.sample]);
    }
    if (is_due) {
      predict_covariance(moment);
      for (; next != measurements.end() && next->stamp_ns == moment.stamp_ns; ++next) {
        on_verdict(static_cast<std::size_t>(next - measurements.begin()), apply(moment, *next));
      }
    } else if (moment.motion.duration_s >= kMomentPeriod_s) {
      predict_covariance(moment);
    }
    if (moment.motion.duration_s == 0.0) on_moment(moment);
  }
}

void GpsInsFilter::advance(std::int64_t stamp_ns, const InertialHistory& imu,
                           const std::vector<GpsInsMeasurement>& measurements, std::vector<GpsInsVerdict>& verdicts) {
  advance(
      now_, stamp_ns, imu, measurements,
      [&](const Moment& moment) {
        const std::int64_t latest_ns = moments_[(first_ + kept_ - 1) % moments_.size()].stamp_ns;
        if (seconds_between(latest_ns, moment.stamp_ns) >= kMomentPeriod_s) keep(moment);
      },
      [&](std::size_t i, const GpsInsVerdict& verdict) { verdicts[i] = verdict; });
}

Estimate<GpsInsState> GpsInsFilter::estimate() const {
  double shown_share = 0.0;
  return {now_.estimate.x, predicted_covariance(now_, shown_share)};
}

Estimate<GpsInsState> GpsInsFilter::estimate_at(std::int64_t stamp_ns, const InertialHistory& imu,
                                                const std::vector<GpsInsMeasurement>& measurements) const {
  if (stamp_ns >= now_.stamp_ns) return estimate();
  std::size_t left = kept_;
  while (left > 1 && moments_[(first_ + left - 1) % moments_.size()].stamp_ns > stamp_ns) --left;
  Moment moment = moments_[(first_ + left - 1) % moments_.size()];
  advance(
      moment, stamp_ns, imu, measurements, [](const Moment&) {}, [](std::size_t, const GpsInsVerdict&) {});
  predict_covariance(moment);
  return moment.estimate;
}

}  // namespace situation_awareness
