// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/gps_ins.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "gps_ins_parts.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/covariance.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"

namespace situation_awareness {
namespace {

using namespace navigation_error;

constexpr std::size_t kMeasurements = 256;  ///< kept at most

/// What no sensor of a vehicle measures: 1,000 g, 160 turns a second, beyond the earth, a place or height that is not
/// known to 10 km, a yaw not to a turn. So bounded, no covariance overflows or drowns in rounding.
constexpr double kMaxForce_m_s2 = 1e4, kMaxRate_rad_s = 1e3;
constexpr double kMaxPlace_m = 1e7, kMaxPlaceSigma_m = 1e4;
constexpr double kMaxYaw_rad = 1e3, kMaxYawSigma_rad = 2.0 * kPi;
/// Of a correction by others, in the units of its rows.
constexpr double kMaxCorrection = 1e9;
/// A height or a yaw that says to be better is taken to be as good as this, which is better than any is.
constexpr double kMinAltitudeSigma_m = 1e-3, kMinYawSigma_rad = 1e-4;
/// Up to which the history is as long as max_delay_s and what alignment needs; with a margin for samples that jitter.
constexpr double kMaxImuRate_hz = 1.25 * 4000.0;

/// Where nothing shows the yaw for so long, the likelihoods of the yaws that are tried drift apart by chance.
constexpr double kAlignPatience_s = 20.0;
/// A yaw is lost, and looked for anew, beyond this; and known, first and again, below this share of what is too much.
/// While the noise of the fixes is learned, for so long, their drift may pass for a velocity: below half of it then.
constexpr double kLostYawSigma_rad = 0.35;
constexpr double kKnown = 0.7;
constexpr double kKnownAtOnce = 0.5;
constexpr double kLearn_s = 5.0;

constexpr double kHistoryMargin_s = 0.2;  ///< from a measurement back to the moment before

/// A gap of the IMU is one beyond this; the acceleration and the rate of turn that may have been in it.
constexpr double kUsualGap_s = 0.1;
constexpr double kGapAcceleration_m_s2 = 3.0;
constexpr double kGapRate_rad_s = 0.3;
/// After a longer gap the IMU may have been switched on anew, with other biases.
constexpr double kSameBiases_s = 10.0;

/// Fixes of some seconds whose mean innovation is this far from zero contradict the estimate: squared, of three degrees
/// of freedom, which happens once in a million times by chance.
constexpr double kContradiction = 30.7;

/// A height that differs from that of the fix before by this, and by so many standard deviations of both, has jumped:
/// those of the next seconds may be of another zero. A filter that drifts off heights which have not is wrong.
constexpr double kHeightJump_m = 10.0, kHeightJumpSigmas = 6.0, kHeightJump_s = 10.0;

/// s. Time for which that is said.
constexpr double kContradictedFor_s = 30.0;

/// Filters of less weight than this are not mixed in, and none is thought less likely than exp(-kLeastLog) times the
/// best, so that each can come back within some seconds.
constexpr double kLeastWeight = 1e-3;
constexpr double kLeastLog = 12.0;

/// How the error of fixes may be correlated in time.
constexpr std::array<FixNoise, 10> kFixNoises = {{{0.0, 1.0},
                                                  {0.5, 3.0},
                                                  {0.5, 30.0},
                                                  {0.9, 1.0},
                                                  {0.9, 4.0},
                                                  {0.95, 12.0},
                                                  {0.95, 40.0},
                                                  {0.95, 120.0},
                                                  {0.998, 30.0},
                                                  {0.998, 150.0}}};

const char* const kNoImu = "no sample of the IMU yet";
const char* const kYawLost = "yaw is not known any more, nothing showed it for too long: turn or change speed";
const char* const kNotFinite = "the estimate was not finite: it begins anew";

GpsInsModel model_of(const GpsInsParams& params, const GpsInsMounting& mounting) {
  GpsInsModel model;
  model.noise = params.imu;
  model.antenna_imu_m = mounting.antenna_base_m - mounting.T_base_imu.translation();
  model.imu_base_m = mounting.T_base_imu.translation();
  model.min_fix_sigma_m = params.min_fix_sigma_m;
  model.fix_stamp_sigma_s = params.fix_stamp_sigma_s;
  model.standing_turn_rad_s = params.standing_turn_rad_s;
  return model;
}

}  // namespace

void GpsInsParams::validate() const {
  imu.validate();
  check_bounds(*this, "gps_ins");
}

GpsIns::GpsIns(const GpsInsParams& params, const GpsInsMounting& mounting, std::optional<GeodeticPosition> origin)
    : params_(params),
      mounting_(mounting),
      origin_(origin),
      model_(model_of(params, mounting)),
      imu_((params.validate(), params.max_delay_s + kLevelWindow_s + kHistoryMargin_s), kMaxImuRate_hz,
           standing_change(params.standing_turn_rad_s, params.imu)),
      monitors_{NisMonitor(3), NisMonitor(1), NisMonitor(1), NisMonitor(1), NisMonitor(1)} {
  measurements_.reserve(kMeasurements);
  const auto moments = static_cast<std::size_t>(params.max_delay_s / GpsInsFilter::kMomentPeriod_s) + 3;
  const std::size_t filters = std::max<std::size_t>(kYaws, kFixNoises.size());
  fix_noises_.resize(filters);
  verdicts_.assign(filters, std::vector<GpsInsVerdict>(kMeasurements));
  for (std::size_t i = 0; i < filters; ++i) filters_.emplace_back(model_, fix_noises_[i], moments);
  counters_.reset();
  reset();
}

void GpsIns::reset() {
  imu_.clear();
  measurements_.clear();
  forgotten_ns_ = StampOrder::kNone;
  used_ = 0;
  phase_ = Phase::kLevelling;
  waiting_since_ns_ = StampOrder::kNone;
  is_yaw_known_ = false;
  reason_ = kNoImu;
  biases_.reset();
}

std::optional<GpsIns::Biases> GpsIns::known_biases() const {
  if (!is_ready()) return biases_;
  const Estimate<GpsInsState> estimate = mixed(stamp_ns());
  const NavigationState& x = estimate.x.motion;
  return Biases{stamp_ns(), x.accelerometer_bias_m_s2, x.gyroscope_bias_rad_s,
                estimate.P.block<6, 6>(kAccelerometerBias, kAccelerometerBias)};
}

void GpsIns::add_imu(const InertialSample& sample, std::int64_t received_ns) {
  if (!sample.specific_force_m_s2.allFinite() || !sample.angular_velocity_rad_s.allFinite()) {
    ++counters_["imu not finite"];
    return;
  }
  if (sample.specific_force_m_s2.norm() > kMaxForce_m_s2 || sample.angular_velocity_rad_s.norm() > kMaxRate_rad_s) {
    ++counters_["imu out of range"];
    return;
  }
  const std::int64_t before_ns = order_.latest_ns();
  switch (order_.judge(sample.stamp_ns, received_ns)) {
    case StampOrder::Verdict::kRefused:
      ++counters_[order_.doubted() > 0           ? "imu of another time"
                  : sample.stamp_ns == before_ns ? "imu stamped twice"
                                                 : "imu out of order"];
      return;
    case StampOrder::Verdict::kRestart:
      ++counters_["imu restarted"];
      reset();
      break;
    case StampOrder::Verdict::kNext:
      break;
  }
  double gap_s = 0.0;
  if (!imu_.empty()) {
    gap_s = seconds_between(imu_.latest().stamp_ns, sample.stamp_ns);
    if (gap_s > params_.max_imu_gap_s) {
      ++counters_["restarted after an imu gap"];
      const std::optional<Biases> biases = gap_s <= kSameBiases_s ? known_biases() : std::nullopt;
      reset();
      biases_ = biases;
      gap_s = 0.0;
    }
  }
  const Eigen::Matrix3d R_base_imu = mounting_.T_base_imu.linear();
  imu_.add({sample.stamp_ns, R_base_imu * sample.specific_force_m_s2, R_base_imu * sample.angular_velocity_rad_s});
  process();
  if (gap_s > kUsualGap_s) {
    ++counters_["imu gap"];
    for (std::size_t i = 0; i < used_; ++i) filters_[i].widen(kGapAcceleration_m_s2 * gap_s, kGapRate_rad_s * gap_s);
  }
}

void GpsIns::add_fix(const GeodeticFix& fix) {
  if (!fix.is_fix) {
    ++counters_["no fix"];
    return;
  }
  if (!is_valid(fix.position)) {
    ++counters_["fix not finite"];
    return;
  }
  if (!is_usable(fix.covariance_m2)) return;
  if (!origin_) origin_ = fix.position;
  const Eigen::Vector3d antenna_m = local_position(*origin_, fix.position);
  add_position(fix.stamp_ns, antenna_m, fix.covariance_m2, !fix.has_altitude);
  if (!fix.has_altitude) add_altitude(fix.stamp_ns, antenna_m.z(), std::sqrt(fix.covariance_m2(2, 2)));
}

bool GpsIns::is_usable(const Eigen::Matrix3d& covariance_m2) {
  const char* reason = "";
  if (!covariance_m2.allFinite() || covariance_m2.diagonal().minCoeff() <= 0.0) {
    reason = "fix without covariance";
  } else if (covariance_m2.cwiseAbs().maxCoeff() > kMaxPlaceSigma_m * kMaxPlaceSigma_m) {
    reason = "fix out of range";
  } else if (!is_positive_semidefinite(covariance_m2)) {
    reason = "fix covariance not positive semidefinite";
  } else {
    return true;
  }
  ++counters_[reason];
  return false;
}

/// Whether heights of fixes have jumped shortly before this one, or with it.
bool GpsIns::has_jumped(std::int64_t stamp_ns, double height_m, double variance_m2) {
  if (height_before_) {
    const double sigma_m = std::sqrt(variance_m2 + height_before_->second);
    const double least_m = std::max(kHeightJump_m, kHeightJumpSigmas * sigma_m);
    if (std::abs(height_m - height_before_->first) > least_m) height_jumped_ns_ = stamp_ns;
  }
  height_before_ = std::pair(height_m, variance_m2);
  return height_jumped_ns_ != StampOrder::kNone &&
         std::abs(seconds_between(height_jumped_ns_, stamp_ns)) < kHeightJump_s;
}

void GpsIns::add_position(std::int64_t stamp_ns, const Eigen::Vector3d& antenna_world_m,
                          const Eigen::Matrix3d& covariance_m2) {
  add_position(stamp_ns, antenna_world_m, covariance_m2, false);
}

void GpsIns::add_position(std::int64_t stamp_ns, const Eigen::Vector3d& antenna_world_m,
                          const Eigen::Matrix3d& covariance_m2, bool is_level) {
  if (!antenna_world_m.allFinite()) {
    ++counters_["fix not finite"];
    return;
  }
  if (antenna_world_m.norm() > kMaxPlace_m) {
    ++counters_["fix out of range"];
    return;
  }
  if (!is_usable(covariance_m2)) return;
  GpsInsMeasurement measurement;
  measurement.stamp_ns = stamp_ns;
  measurement.value = antenna_world_m;
  measurement.is_level = is_level;
  measurement.has_jumped = !is_level && has_jumped(stamp_ns, antenna_world_m.z(), covariance_m2(2, 2));
  measurement.covariance = 0.5 * (covariance_m2 + covariance_m2.transpose());
  if (params_.sideslip_sigma_m_s > 0.0) {
    GpsInsMeasurement sideslip;
    sideslip.sensor = GpsInsSensor::kSideslip;
    sideslip.stamp_ns = stamp_ns;
    sideslip.covariance(0, 0) = params_.sideslip_sigma_m_s * params_.sideslip_sigma_m_s;
    add(sideslip, "sideslip too late", "sideslip ahead of the imu");
  }
  add(measurement, "fix too late", "fix ahead of the imu");
}

void GpsIns::add_altitude(std::int64_t stamp_ns, double altitude_world_m, double sigma_m) {
  add_number(GpsInsSensor::kAltitude, stamp_ns, altitude_world_m, sigma_m,
             {"altitude not finite", "altitude out of range", "altitude too late", "altitude ahead of the imu",
              kMaxPlace_m, kMinAltitudeSigma_m, kMaxPlaceSigma_m});
}

void GpsIns::add_heading(std::int64_t stamp_ns, double yaw_rad, double sigma_rad) {
  add_number(GpsInsSensor::kHeading, stamp_ns, yaw_rad, sigma_rad,
             {"heading not finite", "heading out of range", "heading too late", "heading ahead of the imu", kMaxYaw_rad,
              kMinYawSigma_rad, kMaxYawSigma_rad});
}

void GpsIns::add_number(GpsInsSensor sensor, std::int64_t stamp_ns, double value, double sigma, const Number& number) {
  if (!std::isfinite(value) || !(sigma > 0.0) || !std::isfinite(sigma)) {
    ++counters_[number.not_finite];
    return;
  }
  if (std::abs(value) > number.most || sigma > number.most_sigma) {
    ++counters_[number.out_of_range];
    return;
  }
  GpsInsMeasurement measurement;
  measurement.sensor = sensor;
  measurement.stamp_ns = stamp_ns;
  measurement.value.x() = value;
  measurement.covariance(0, 0) = std::pow(std::max(sigma, number.least_sigma), 2);
  add(measurement, number.too_late, number.ahead);
}

void GpsIns::correct(const GpsInsCorrection& correction) {
  if (correction.rows < 1 || correction.rows > GpsInsCorrection::kMaxRows || !correction.residual.allFinite() ||
      !correction.H.allFinite() || !correction.R.allFinite() || !is_finite(correction.reference)) {
    ++counters_["correction not finite"];
    return;
  }
  const SmallCovariance R = correction.R.topLeftCorner(correction.rows, correction.rows);
  if (std::max({R.cwiseAbs().maxCoeff(), correction.H.cwiseAbs().maxCoeff(), correction.residual.norm()}) >
      kMaxCorrection) {
    ++counters_["correction out of range"];
    return;
  }
  if (!is_positive_semidefinite(R)) {
    ++counters_["correction covariance not positive semidefinite"];
    return;
  }
  GpsInsMeasurement measurement;
  measurement.sensor = GpsInsSensor::kOther;
  measurement.stamp_ns = correction.stamp_ns;
  measurement.correction = correction;
  // Rows that are not used agree with any state.
  const int unused = GpsInsCorrection::kMaxRows - correction.rows;
  measurement.correction.residual.tail(unused).setZero();
  measurement.correction.H.bottomRows(unused).setZero();
  measurement.correction.R.rightCols(unused).setZero();
  measurement.correction.R.bottomRows(unused).setZero();
  measurement.correction.R.diagonal().tail(unused).setOnes();
  add(measurement, "correction too late", "correction ahead of the imu");
}

void GpsIns::add(const GpsInsMeasurement& measurement, const char* too_late, const char* ahead) {
  if (imu_.empty()) {
    ++counters_[ahead];
    return;
  }
  const std::int64_t stamp_ns = measurement.stamp_ns;
  if (seconds_between(imu_.latest().stamp_ns, stamp_ns) > params_.max_delay_s) {
    ++counters_[ahead];
    return;
  }
  if (seconds_between(stamp_ns, imu_.latest().stamp_ns) > params_.max_delay_s ||
      (used_ > 0 && filters_[0].oldest_ns() >= stamp_ns) ||
      (used_ > 0 && filters_[0].stamp_ns() >= stamp_ns && filters_[0].oldest_sample() < imu_.begin())) {
    ++counters_[too_late];
    return;
  }
  if (measurements_.size() == kMeasurements) {
    // Half at once, so that moving the others is rare.
    forgotten_ns_ = measurements_[kMeasurements / 2 - 1].stamp_ns;
    measurements_.erase(measurements_.begin(), measurements_.begin() + kMeasurements / 2);
    if (stamp_ns <= forgotten_ns_) {
      ++counters_[too_late];
      return;
    }
  }
  const auto place =
      std::upper_bound(measurements_.begin(), measurements_.end(), stamp_ns,
                       [](std::int64_t stamp, const GpsInsMeasurement& m) { return stamp < m.stamp_ns; });
  measurements_.insert(place, measurement);
  for (std::size_t i = 0; i < used_; ++i) filters_[i].go_back_before(stamp_ns);
  process();
}

void GpsIns::process() {
  if (phase_ == Phase::kLevelling && !try_start()) return;
  const std::int64_t stamp_ns = imu_.latest().stamp_ns;
  bool is_sound = true;
  for (std::size_t i = 0; i < used_; ++i) {
    filters_[i].forget(imu_.begin(), forgotten_ns_);
    filters_[i].advance(stamp_ns, imu_, measurements_, verdicts_[i]);
    is_sound = is_sound && filters_[i].is_sound();
  }
  if (!is_sound) {
    ++counters_["restarted: estimate not finite"];
    reset();
    reason_ = kNotFinite;
    return;
  }
  const bool is_corrected = count_verdicts();
  const int contradictions = filters_[best()].contradictions();
  if (contradictions > contradictions_) contradicted_ns_ = stamp_ns;
  contradictions_ = contradictions;
  if (is_corrected && phase_ == Phase::kReady) widen_by_misfit();
  if (phase_ == Phase::kAligning) {
    align();
  } else if (is_corrected || std::abs(seconds_between(yaw_watched_ns_, stamp_ns)) >= GpsInsFilter::kMomentPeriod_s) {
    watch_yaw();
  }
}

void GpsIns::widen_by_misfit() {
  const double misfit = filters_[best()].contradiction();
  if (misfit < kContradiction) return;
  ++counters_["widened: fixes contradict the estimate"];
  contradicted_ns_ = filters_[0].stamp_ns();
  for (std::size_t i = 0; i < used_; ++i) filters_[i].widen_by(misfit / 3.0);
}

std::string GpsIns::contradiction() const {
  const std::int64_t now_ns = stamp_ns();
  if (contradicted_ns_ == StampOrder::kNone || now_ns == StampOrder::kNone) return "";
  if (std::abs(seconds_between(contradicted_ns_, now_ns)) > kContradictedFor_s) return "";
  return kContradicted;
}

void GpsIns::watch_yaw() {
  yaw_watched_ns_ = filters_[0].stamp_ns();
  const double sigma_rad = std::sqrt(yaw_variance(true));
  if (sigma_rad > std::max(kLostYawSigma_rad, 1.2 * params_.max_yaw_sigma_rad)) {
    ++counters_["restarted: yaw not known any more"];
    align_anew();
    return;
  }
  const bool is_learning = seconds_between(learning_since_ns_, yaw_watched_ns_) < kLearn_s;
  const double share = is_yaw_known_ ? 1.0 : is_learning ? kKnownAtOnce : kKnown;
  if (is_yaw_known_ == (sigma_rad > share * params_.max_yaw_sigma_rad)) {
    is_yaw_known_ = !is_yaw_known_;
    reason_ = is_yaw_known_ ? "" : kYawLost;
  }
}

void GpsIns::align_anew() {
  used_ = 0;
  phase_ = Phase::kLevelling;
  waiting_since_ns_ = StampOrder::kNone;
  is_yaw_known_ = false;
  reason_ = kNoYaw;
}

std::size_t GpsIns::best() const {
  std::size_t best = 0;
  for (std::size_t i = 1; i < used_; ++i) {
    if (filters_[i].log_likelihood() > filters_[best].log_likelihood()) best = i;
  }
  return best;
}

double GpsIns::yaw_variance(bool with_their_own) const {
  const std::size_t first = best();
  const double yaw = yaw_of(filters_[first].state().motion.q_world_imu);
  double weights = 0.0, variance = 0.0;
  for (std::size_t i = 0; i < used_; ++i) {
    const double weight = std::exp(filters_[i].log_likelihood() - filters_[first].log_likelihood());
    weights += weight;
    if (weight < 1e-9) continue;
    const double apart = wrap_to_pi(yaw_of(filters_[i].state().motion.q_world_imu) - yaw);
    variance += weight * (apart * apart + (with_their_own ? filters_[i].yaw_variance() : 0.0));
  }
  return variance / weights;
}

FixNoise GpsIns::fix_noise() const { return fix_noises_[best()]; }

Eigen::Vector2d GpsIns::imu_noise() const {
  if (imu_.empty()) return Eigen::Vector2d::Zero();
  return {imu_.latest().accelerometer_noise, imu_.latest().gyroscope_noise};
}

bool GpsIns::count_verdicts() {
  const std::int64_t now_ns = filters_[0].stamp_ns();
  const std::vector<GpsInsVerdict>& verdicts = verdicts_[best()];
  bool any = false;
  for (std::size_t i = measurements_.size(); i-- > 0;) {
    GpsInsMeasurement& measurement = measurements_[i];
    if (measurement.stamp_ns > now_ns || measurement.is_counted) continue;
    measurement.is_counted = any = true;
    const GpsInsVerdict& verdict = verdicts[i];
    if (!verdict.is_accepted) {
      constexpr std::array<const char*, kGpsInsSensors> kReasons = {
          "fix outside its gate", "altitude outside its gate", "heading outside its gate", "sideslip outside its gate",
          "correction outside its gate"};
      ++counters_[kReasons[static_cast<std::size_t>(measurement.sensor)]];
      continue;
    }
    if (verdict.is_height_refused) ++counters_["fix outside its gate in height: used in x and y"];
    // The monitor of other sensors is per degree of freedom.
    const bool is_other = measurement.sensor == GpsInsSensor::kOther;
    nis(measurement.sensor).add(is_other ? static_cast<std::uint64_t>(verdict.degrees_of_freedom) : 1, verdict.nis);
  }
  if (!any) return false;
  const double highest = filters_[best()].log_likelihood();
  for (std::size_t i = 0; i < used_; ++i) {
    filters_[i].set_log_likelihood(std::max(filters_[i].log_likelihood() - highest, -kLeastLog));
  }
  return true;
}

void GpsIns::align() {
  const std::size_t first = best();
  // Even the best was wrong, or likelihoods differ by chance alone.
  if (filters_[first].recoveries() > 0 ||
      seconds_between(filters_[first].yaw_shown_ns(), filters_[first].stamp_ns()) > kAlignPatience_s) {
    align_anew();
    return;
  }
  const double variance = yaw_variance(false);
  const double limit = params_.max_yaw_sigma_rad * params_.max_yaw_sigma_rad;
  if (variance > limit) return;
  const Eigen::RowVector3d J = yaw_jacobian(filters_[first].state().motion.q_world_imu);
  const ErrorMatrix<GpsInsState> P = filters_[first].estimate().P;
  if (variance + J * P.block<3, 3>(kAttitude, kAttitude) * J.transpose() > limit) return;

  const std::int64_t stamp_ns = filters_[first].stamp_ns();
  const Estimate<GpsInsState> estimate = mixed(stamp_ns);
  if (vertical_variance(estimate.x.motion.q_world_imu, estimate.P) > limit) return;
  used_ = kFixNoises.size();
  for (std::size_t i = 0; i < used_; ++i) {
    fix_noises_[i] = kFixNoises[i];
    filters_[i].set_fix_noise(fix_noises_[i]);
    filters_[i].start(stamp_ns, estimate, imu_, true);
  }
  phase_ = Phase::kReady;
  learning_since_ns_ = stamp_ns;
  watch_yaw();
}

Estimate<GpsInsState> GpsIns::mixed(std::int64_t stamp_ns) const {
  const std::size_t first = best();
  Estimate<GpsInsState> result = filters_[first].estimate_at(stamp_ns, imu_, measurements_);
  const GpsInsState reference = result.x;
  ErrorVector<GpsInsState> mean = ErrorVector<GpsInsState>::Zero();
  ErrorMatrix<GpsInsState> P = result.P;
  double weights = 1.0;
  for (std::size_t i = 0; i < used_; ++i) {
    if (i == first) continue;
    const double weight = std::exp(filters_[i].log_likelihood() - filters_[first].log_likelihood());
    if (weight < kLeastWeight) continue;
    const Estimate<GpsInsState> other = filters_[i].estimate_at(stamp_ns, imu_, measurements_);
    const ErrorVector<GpsInsState> apart = Manifold<GpsInsState>::local_coordinates(reference, other.x);
    weights += weight;
    mean += weight * apart;
    P += weight * (other.P + apart * apart.transpose());
  }
  if (weights == 1.0) return result;
  mean /= weights;
  result.P = P / weights - mean * mean.transpose();
  result.x = Manifold<GpsInsState>::retract(reference, mean);
  return result;
}

Eigen::Isometry3d GpsIns::pose_of(const GpsInsState& x) const {
  Eigen::Isometry3d T_world_base = Eigen::Isometry3d::Identity();
  T_world_base.linear() = x.motion.q_world_imu.toRotationMatrix();
  T_world_base.translation() = x.motion.position_world_m - T_world_base.linear() * mounting_.T_base_imu.translation();
  return T_world_base;
}

Eigen::Matrix<double, 6, 18> GpsIns::pose_jacobian(const GpsInsState& x) const {
  Eigen::Matrix<double, 6, 18> J = Eigen::Matrix<double, 6, 18>::Zero();
  J.block<3, 3>(0, kPosition).setIdentity();
  J.block<3, 3>(0, kAttitude) = x.motion.q_world_imu.toRotationMatrix() * hat(mounting_.T_base_imu.translation());
  J.block<3, 3>(3, kAttitude).setIdentity();
  return J;
}

bool GpsIns::state_at(std::int64_t stamp_ns, Estimate<GpsInsState>& estimate) const {
  if (!is_ready() || stamp_ns > filters_[0].stamp_ns() || stamp_ns < filters_[0].oldest_ns()) return false;
  estimate = mixed(stamp_ns);
  return true;
}

GpsInsPose GpsIns::pose() const { return pose_at(stamp_ns()); }

GpsInsPose GpsIns::pose_at(std::int64_t stamp_ns) const {
  GpsInsPose pose;
  pose.stamp_ns = stamp_ns;
  pose.reason = reason_;
  if (!is_ready()) return pose;
  Estimate<GpsInsState> estimate;
  if (!state_at(stamp_ns, estimate)) {
    pose.reason =
        stamp_ns > filters_[0].stamp_ns() ? "no sample of the IMU at this stamp yet" : "the stamp is too long ago";
    return pose;
  }
  pose.is_ready = true;
  pose.T_world_base = pose_of(estimate.x);
  pose.covariance = transformed(pose_jacobian(estimate.x), estimate.P);
  const std::uint64_t number = imu_.last_until(stamp_ns);
  const InertialHistory::Entry& sample = imu_[number];
  const Eigen::Matrix3d& R = pose.T_world_base.linear();
  const Eigen::Vector3d lever = mounting_.T_base_imu.translation();
  pose.angular_velocity_base_rad_s = sample.angular_velocity_rad_s - estimate.x.motion.gyroscope_bias_rad_s;
  pose.specific_force_base_m_s2 = sample.specific_force_m_s2 - estimate.x.motion.accelerometer_bias_m_s2;
  pose.velocity_world_m_s = estimate.x.motion.velocity_world_m_s - R * pose.angular_velocity_base_rad_s.cross(lever);
  Eigen::Matrix<double, 3, 18> J = Eigen::Matrix<double, 3, 18>::Zero();
  J.block<3, 3>(0, kVelocity).setIdentity();
  J.block<3, 3>(0, kAttitude) = R * hat(pose.angular_velocity_base_rad_s.cross(lever));
  J.block<3, 3>(0, kGyroscopeBias) = -R * hat(lever);
  pose.velocity_covariance = transformed(J, estimate.P);
  pose.velocity_base_m_s = R.transpose() * pose.velocity_world_m_s;
  Eigen::Matrix<double, 6, 18> J_twist = Eigen::Matrix<double, 6, 18>::Zero();
  J_twist.block<3, 3>(0, kVelocity) = R.transpose();
  J_twist.block<3, 3>(0, kAttitude) = hat(R.transpose() * estimate.x.motion.velocity_world_m_s);
  J_twist.block<3, 3>(0, kGyroscopeBias) = -hat(lever);
  J_twist.block<3, 3>(3, kGyroscopeBias) = -Eigen::Matrix3d::Identity();
  pose.twist_covariance = transformed(J_twist, estimate.P);
  if (number > imu_.begin()) {  // the white noise of one sample
    const double period_s = seconds_between(imu_[number - 1].stamp_ns, sample.stamp_ns);
    pose.twist_covariance.diagonal().tail<3>().array() += sample.gyroscope_noise * sample.gyroscope_noise / period_s;
  }
  pose.accelerometer_bias_m_s2 = estimate.x.motion.accelerometer_bias_m_s2;
  pose.gyroscope_bias_rad_s = estimate.x.motion.gyroscope_bias_rad_s;
  return pose;
}

}  // namespace situation_awareness
