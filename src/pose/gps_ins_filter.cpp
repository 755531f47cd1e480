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

using namespace navigation_error;
constexpr int kFixError = Manifold<GpsInsState>::kFixError;

/// Over which the noise of the IMU is measured.
constexpr double kNoiseWindow_s = 5.0;
constexpr std::array<int, 3> kNoiseBlocks = {1, 4, 16};

/// Fewest fixes in a row that are all refused before the filter is doubted instead.
constexpr int kMinRefusedFixes = 5;
/// What a filter that is doubted may be wrong by, besides the distance to the fix.
constexpr double kDoubtVelocity_m_s = 5.0;
constexpr double kDoubtAttitude_rad = 0.2;

/// The same as update() of the kernel, in a quarter of its time (gps_ins_benchmark): with W = L^-1 H P and S = L L^T,
/// Joseph's form is P - W^T W at the optimal gain, and the reset changes no more than the attitude's rows and columns.
template <int Size>
void update_sparsely(Estimate<GpsInsState>& estimate, const Innovation<Size>& innovation,
                     const Eigen::Matrix<double, Size, 18>& H) {
  const Eigen::LLT<Eigen::Matrix<double, Size, Size>> llt(innovation.S);
  const Eigen::Matrix<double, Size, 18> HP = H.lazyProduct(estimate.P);
  const Eigen::Matrix<double, Size, 18> W = llt.matrixL().solve(HP);
  const Eigen::Matrix<double, Size, 1> whitened = llt.matrixL().solve(innovation.nu);
  const ErrorVector<GpsInsState> e = W.transpose() * whitened;
  estimate.P -= W.transpose().lazyProduct(W);
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

InertialHistory::InertialHistory(std::size_t capacity) : samples_(capacity) { clear(); }

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
  Entry& entry = samples_[static_cast<std::size_t>(end_++ % samples_.size())];
  static_cast<InertialSample&>(entry) = sample;
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

void InertialHistory::clear() {
  begin_ = end_;
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

void fix_innovation(const GpsInsState& x, const GpsInsMeasurement& fix, const GpsInsModel& model, const FixNoise& noise,
                    Eigen::Vector3d& nu, Eigen::Matrix<double, 3, 18>& H, Eigen::Matrix3d& R) {
  // The slow error is along the axes of the world; where those of the covariance are not, the rest stays white.
  const Eigen::Vector3d sigma = fix.covariance.diagonal().cwiseSqrt();
  const Eigen::Vector3d scale = std::sqrt(noise.correlated_share) * sigma;
  const Eigen::Matrix3d R_world_base = x.motion.q_world_imu.toRotationMatrix();
  nu = fix.value - x.motion.position_world_m - R_world_base * model.antenna_imu_m - scale.cwiseProduct(x.fix_error);
  H.setZero();
  H.block<3, 3>(0, kPosition).setIdentity();
  H.block<3, 3>(0, kAttitude) = -R_world_base * hat(model.antenna_imu_m);
  H.block<3, 3>(0, kFixError) = scale.asDiagonal();
  const Eigen::Vector3d shift_m = model.fix_stamp_sigma_s * x.motion.velocity_world_m_s;
  R = (1.0 - noise.correlated_share) * fix.covariance + shift_m * shift_m.transpose();
  R.diagonal().array() += model.min_fix_sigma_m * model.min_fix_sigma_m;
}

double sideslip(const NavigationState& x) { return x.velocity_world_m_s.dot(x.q_world_imu * Eigen::Vector3d::UnitY()); }

Eigen::Matrix<double, 1, 18> sideslip_jacobian(const NavigationState& x) {
  const Eigen::Matrix3d R = x.q_world_imu.toRotationMatrix();
  Eigen::Matrix<double, 1, 18> H = Eigen::Matrix<double, 1, 18>::Zero();
  H.segment<3>(kVelocity) = R.col(1).transpose();
  H.segment<3>(kAttitude) = hat(R.transpose() * x.velocity_world_m_s).row(1);
  return H;
}

GpsInsFilter::GpsInsFilter(const GpsInsModel& model, const FixNoise& fix_noise, std::size_t moments)
    : model_(model), fix_noise_(fix_noise), moments_(moments) {
  gates_.push_back(0.0);
  for (int rows = 1; rows <= GpsInsCorrection::kMaxRows; ++rows) {
    gates_.push_back(chi_square_quantile(model.gate_probability, rows));
  }
}

void GpsInsFilter::start(std::int64_t stamp_ns, const Estimate<GpsInsState>& estimate, const InertialHistory& imu) {
  now_ = Moment();
  now_.stamp_ns = stamp_ns;
  now_.sample = imu.last_until(stamp_ns);
  now_.estimate = estimate;
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

void GpsInsFilter::set_log_likelihood(double log_likelihood) {
  const double change = log_likelihood - now_.log_likelihood;
  now_.log_likelihood = log_likelihood;
  for (std::size_t i = 0; i < kept_; ++i) moments_[(first_ + i) % moments_.size()].log_likelihood += change;
}

void GpsInsFilter::widen(double velocity_sigma_m_s, double attitude_sigma_rad) {
  predict_covariance(now_);
  now_.estimate.P.diagonal().segment<3>(kVelocity).array() += velocity_sigma_m_s * velocity_sigma_m_s;
  now_.estimate.P.diagonal().segment<3>(kAttitude).array() += attitude_sigma_rad * attitude_sigma_rad;
  first_ = kept_ = 0;  // to go back and on again would lose it
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
  if (!is_last && b.stamp_ns <= stamp_ns) ++moment.sample;
}

ErrorMatrix<GpsInsState> GpsInsFilter::predicted_covariance(const Moment& moment) const {
  InertialNoiseParams noise = model_.noise;
  noise.accelerometer_noise = std::max(noise.accelerometer_noise, moment.accelerometer_noise);
  noise.gyroscope_noise = std::max(noise.gyroscope_noise, moment.gyroscope_noise);
  return moved_covariance(moment.estimate.P, moment.motion, noise, fix_noise_.correlation_s);
}

void GpsInsFilter::predict_covariance(Moment& moment) const {
  moment.estimate.P = predicted_covariance(moment);
  moment.motion = MotionJacobian();
}

template <int Size>
GpsInsVerdict GpsInsFilter::correct(Moment& moment, const Eigen::Matrix<double, Size, 1>& nu,
                                    const Eigen::Matrix<double, Size, 18>& H,
                                    const Eigen::Matrix<double, Size, Size>& R, int rows, bool is_fix) const {
  GpsInsVerdict verdict;
  const double gate = gates_[static_cast<std::size_t>(rows)];
  Innovation<Size> compared = innovation(moment.estimate, nu, H, R);
  verdict.degrees_of_freedom = rows;
  verdict.nis = compared.mahalanobis2;
  verdict.is_accepted = inside_gate(compared, gate);
  if (!std::isfinite(compared.mahalanobis2)) return verdict;
  // An outlier says no more about a filter than that it is outside the gate.
  moment.log_likelihood += compared.log_likelihood + 0.5 * std::max(compared.mahalanobis2 - gate, 0.0);
  if (is_fix) {
    if (verdict.is_accepted) {
      moment.rejected = 0;
    } else {
      if (moment.rejected++ == 0) moment.rejected_since_ns = moment.stamp_ns;
      if (moment.rejected > kMinRefusedFixes &&
          seconds_between(moment.rejected_since_ns, moment.stamp_ns) > model_.recover_after_s) {
        ErrorMatrix<GpsInsState>& P = moment.estimate.P;
        P.diagonal().template segment<3>(kPosition) += nu.template head<3>().cwiseAbs2();
        P.diagonal().template segment<3>(kVelocity).array() += kDoubtVelocity_m_s * kDoubtVelocity_m_s;
        P.diagonal().template segment<3>(kAttitude).array() += kDoubtAttitude_rad * kDoubtAttitude_rad;
        moment.rejected = 0;
        ++moment.recoveries;
        compared = innovation(moment.estimate, nu, H, R);
        update_sparsely(moment.estimate, compared, H);
        return verdict;
      }
    }
  }
  if (verdict.is_accepted) update_sparsely(moment.estimate, compared, H);
  return verdict;
}

GpsInsVerdict GpsInsFilter::apply(Moment& moment, const GpsInsMeasurement& measurement) const {
  const GpsInsState& x = moment.estimate.x;
  using Scalar = Eigen::Matrix<double, 1, 1>;
  switch (measurement.sensor) {
    case GpsInsSensor::kFix: {
      Eigen::Vector3d nu;
      Eigen::Matrix<double, 3, 18> H;
      Eigen::Matrix3d R;
      fix_innovation(x, measurement, model_, fix_noise_, nu, H, R);
      return correct<3>(moment, nu, H, R, 3, true);
    }
    case GpsInsSensor::kAltitude: {
      Eigen::Matrix<double, 1, 18> H = Eigen::Matrix<double, 1, 18>::Zero();
      H(kPosition + 2) = 1.0;
      return correct<1>(moment, Scalar(measurement.value.x() - x.motion.position_world_m.z()), H,
                        Scalar(measurement.covariance(0, 0)), 1, false);
    }
    case GpsInsSensor::kHeading: {
      Eigen::Matrix<double, 1, 18> H = Eigen::Matrix<double, 1, 18>::Zero();
      H.segment<3>(kAttitude) = yaw_jacobian(x.motion.q_world_imu);
      return correct<1>(moment, Scalar(wrap_to_pi(measurement.value.x() - yaw_of(x.motion.q_world_imu))), H,
                        Scalar(measurement.covariance(0, 0)), 1, false);
    }
    case GpsInsSensor::kSideslip:
      return correct<1>(moment, Scalar(-sideslip(x.motion)), sideslip_jacobian(x.motion),
                        Scalar(measurement.covariance(0, 0)), 1, false);
    case GpsInsSensor::kOther:
      break;
  }
  const GpsInsCorrection& by = measurement.correction;
  return correct<GpsInsCorrection::kMaxRows>(
      moment, by.residual - by.H * Manifold<GpsInsState>::local_coordinates(by.reference, x), by.H, by.R, by.rows,
      false);
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
    move_to(moment, to_ns, imu);
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

Estimate<GpsInsState> GpsInsFilter::estimate() const { return {now_.estimate.x, predicted_covariance(now_)}; }

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
