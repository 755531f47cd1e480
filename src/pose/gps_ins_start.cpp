// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <utility>

#include "gps_ins_parts.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/lie_groups.hpp"
#include "situation_awareness/pose/gps_ins.hpp"

// The start of the filters by the first fixes and by gravity.
namespace situation_awareness {
namespace {

using namespace navigation_error;

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// rad. Angle at the start between gravity and the base's z, beyond which the IMU must be mounted otherwise than said.
constexpr double kMaxTilt_rad = 0.5;
/// s. Roll and pitch are taken from gravity without standing or flying level after this time.
constexpr double kLevelWait_s = 5.0;
/// The part of the variance of a fix that is of errors which are correlated in time, until it is learnt; the rest is
/// white.
constexpr double kFixCorrelatedShare = 0.5;
/// s. Time after which 1/e of those errors is left, until it is learnt.
constexpr double kFixCorrelation_s = 20.0;

/// rad. Standard deviation of each yaw that is tried: a third more than that of its part of the turn.
constexpr double kYawSigma_rad = 0.075;

/// Standing or moving steadily: largest rate of turn, and difference of the mean force of two halves of the window.
constexpr double kMaxLevelRate_rad_s = 0.05;
constexpr double kMaxLevelChange_m_s2 = 0.5;
/// Roll and pitch by the mean force are off by a steady acceleration of 0.3 m/s^2, or by what a turn can hide.
constexpr double kLevelSigma_rad = 0.03;
constexpr double kTurningSigma_rad = 0.3;
constexpr double kInitialSpeed_m_s = 10.0;
constexpr double kInitialClimb_m_s = 2.0;
/// Forces are those of another unit, or without gravity, within what these many standard deviations of the biases and
/// a steady acceleration explain.
constexpr double kForceSigmas = 3.0;
constexpr double kSteadyAcceleration_m_s2 = 0.3;
/// The first fix and the one before agree within what so many standard deviations of both and of the speed explain.
constexpr double kSameFixSigmas = 3.0;

const char* const kTooFast = "the IMU is sampled faster than 4,000 Hz";
const char* const kNoFix = "no usable fix yet";
const char* const kLoneFix = "one fix alone, or far from the one before: may be an outlier";
const char* const kNotGravity =
    "the force that the IMU measures is not that of gravity: m/s^2, and +9.8 upwards at rest";
const char* const kInG =
    "the force that the IMU measures is not that of gravity: it is 1 at rest, as in g: m/s^2 are expected, and +9.8 "
    "upwards at rest";
const char* const kInMilliG =
    "the force that the IMU measures is not that of gravity: it is about 1000 at rest, as in 0.001 g or cm/s^2: m/s^2 "
    "are expected, and +9.8 upwards at rest";
const char* const kWithoutGravity =
    "the force that the IMU measures is not that of gravity: it is 0 at rest, as where gravity was taken off: m/s^2 "
    "are expected, and +9.8 upwards at rest";
const char* const kAskew = "gravity is not along the base's z: is the IMU mounted as T_base_imu says";
const char* const kUpsideDown =
    "gravity is not along the base's z: the force at rest is -9.8 m/s^2 on z, as in axes x ahead, y to the right, z "
    "down (NED), or of an IMU upside down: +9.8 upwards at rest is expected in the axes that T_base_imu turns";
const char* const kTurning = "turning or accelerating: roll and pitch are not known from gravity";

/// Two fixes of one vehicle, as far as can be told without knowing its velocity.
bool agree(const GpsInsMeasurement& a, const GpsInsMeasurement& b) {
  const double way_m = kInitialSpeed_m_s * seconds_between(a.stamp_ns, b.stamp_ns);
  const double variance_m2 = a.covariance.diagonal().maxCoeff() + b.covariance.diagonal().maxCoeff() + way_m * way_m;
  return (b.value - a.value).squaredNorm() <= kSameFixSigmas * kSameFixSigmas * variance_m2;
}

/// Why a mean force is not that of gravity. `sigma_m_s2`: of its error, each axis.
const char* why_not_gravity(const Eigen::Vector3d& force, double sigma_m_s2) {
  const double most_m_s2 = kForceSigmas * sigma_m_s2;
  if (force.norm() < most_m_s2 && std::abs(force.norm() - 1.0) > most_m_s2 / kStandardGravity_m_s2) {
    return kWithoutGravity;
  }
  for (const auto& [unit_m_s2, why] : {std::pair(kStandardGravity_m_s2, kInG), {0.01, kInMilliG}}) {
    const bool is_along_z = std::abs(force.z()) > std::cos(kMaxTilt_rad) * force.norm();
    if (is_along_z && std::abs(unit_m_s2 * force.norm() - kStandardGravity_m_s2) < most_m_s2) return why;
  }
  return force.norm() < most_m_s2 ? kWithoutGravity : kNotGravity;
}

/// Whether it is a reason that was seen at rest, and stays where the vehicle moves.
bool names_unit(const char* reason) { return reason == kInG || reason == kInMilliG || reason == kWithoutGravity; }

}  // namespace

/// The latest fix up to now, if it was not looked at before and agrees with the one before; else null.
GpsInsMeasurement* GpsIns::first_fix() {
  const std::int64_t latest_ns = imu_.latest().stamp_ns;
  std::size_t last = measurements_.size();
  while (last > 0 &&
         (measurements_[last - 1].stamp_ns > latest_ns || measurements_[last - 1].sensor != GpsInsSensor::kFix)) {
    --last;
  }
  if (last == 0) {
    reason_ = kNoFix;
    return nullptr;
  }
  GpsInsMeasurement& fix = measurements_[last - 1];
  if (fix.is_counted) return nullptr;  // looked at before
  const auto before = std::find_if(measurements_.rend() - static_cast<std::ptrdiff_t>(last - 1), measurements_.rend(),
                                   [](const GpsInsMeasurement& m) { return m.sensor == GpsInsSensor::kFix; });
  if (before == measurements_.rend() || !agree(*before, fix)) {
    reason_ = kLoneFix;
    return nullptr;
  }
  return &fix;
}

/// Where up is at a fix, by the mean force of the samples before it; none, if they do not tell.
std::optional<GpsIns::Level> GpsIns::level_at(GpsInsMeasurement& fix) {
  const std::uint64_t to = imu_.last_until(fix.stamp_ns);
  if (imu_[to].stamp_ns > fix.stamp_ns) return std::nullopt;  // older than the samples
  const std::uint64_t from = imu_.last_until(fix.stamp_ns - nanoseconds(kLevelWindow_s));
  if (seconds_between(imu_[from].stamp_ns, fix.stamp_ns) < 0.9 * kLevelWindow_s) {
    if (imu_.is_short()) reason_ = kTooFast;
    return std::nullopt;
  }

  Eigen::Vector3d halves[2] = {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  Eigen::Vector3d rate = Eigen::Vector3d::Zero(), recent = Eigen::Vector3d::Zero();
  const std::uint64_t count = to - from + 1, half = (count + 1) / 2, tail = (count + 4) / 5;
  for (std::uint64_t i = from; i <= to; ++i) {
    halves[i - from < half ? 0 : 1] += imu_[i].specific_force_m_s2;
    if (to - i < tail) recent += imu_[i].specific_force_m_s2;
    rate += imu_[i].angular_velocity_rad_s;
  }
  if (count < 4) return std::nullopt;
  const Eigen::Vector3d sum = halves[0] + halves[1];
  halves[0] /= static_cast<double>(half);
  halves[1] /= static_cast<double>(count - half);
  rate /= static_cast<double>(count);
  const bool is_steady = rate.norm() < kMaxLevelRate_rad_s && (halves[1] - halves[0]).norm() < kMaxLevelChange_m_s2;
  fix.is_counted = true;
  if (!is_steady) {
    if (waiting_since_ns_ == StampOrder::kNone) waiting_since_ns_ = fix.stamp_ns;
    if (seconds_between(waiting_since_ns_, fix.stamp_ns) < kLevelWait_s) {
      if (!names_unit(reason_)) reason_ = kTurning;
      return std::nullopt;
    }
  }
  Eigen::Vector3d up = is_steady ? Eigen::Vector3d(sum / static_cast<double>(count))
                                 : Eigen::Vector3d(recent / static_cast<double>(tail));
  if (biases_) up -= biases_->accelerometer_m_s2;
  if (up.norm() < 0.8 * kStandardGravity_m_s2 || up.norm() > 1.5 * kStandardGravity_m_s2) {
    const char* const why =
        why_not_gravity(up, std::hypot(params_.imu.accelerometer_bias_sigma_m_s2, kSteadyAcceleration_m_s2));
    if (why != kNotGravity || !names_unit(reason_)) reason_ = why;
    return std::nullopt;
  }
  if (up.z() < -std::cos(kMaxTilt_rad) * up.norm()) {
    reason_ = kUpsideDown;
    return std::nullopt;
  }
  if (std::acos(std::clamp(up.z() / up.norm(), -1.0, 1.0)) > kMaxTilt_rad) {
    reason_ = kAskew;
    return std::nullopt;
  }
  return Level{up, is_steady};
}

/// But for the yaw, and the place and attitude by it.
Estimate<GpsInsState> GpsIns::start_at(const GpsInsMeasurement& fix, bool is_steady) const {
  Estimate<GpsInsState> start;
  const double variance_m2 = 100.0 * (fix.covariance.diagonal().maxCoeff() + 1.0);
  const double tilt = is_steady ? kLevelSigma_rad : kTurningSigma_rad;
  const double b_a = params_.imu.accelerometer_bias_sigma_m_s2, b_g = params_.imu.gyroscope_bias_sigma_rad_s;
  start.P.diagonal() << Eigen::Vector3d::Constant(variance_m2), kInitialSpeed_m_s * kInitialSpeed_m_s,
      kInitialSpeed_m_s * kInitialSpeed_m_s, kInitialClimb_m_s * kInitialClimb_m_s, tilt * tilt, tilt * tilt,
      kYawSigma_rad * kYawSigma_rad, Eigen::Vector3d::Constant(b_a * b_a), Eigen::Vector3d::Constant(b_g * b_g),
      Eigen::Vector3d::Ones();
  if (biases_) {
    start.x.motion.accelerometer_bias_m_s2 = biases_->accelerometer_m_s2;
    start.x.motion.gyroscope_bias_rad_s = biases_->gyroscope_rad_s;
    const double since_s = seconds_between(biases_->stamp_ns, fix.stamp_ns);
    const double walk_a = params_.imu.accelerometer_bias_walk, walk_g = params_.imu.gyroscope_bias_walk;
    auto P = start.P.block<6, 6>(kAccelerometerBias, kAccelerometerBias);
    P = biases_->covariance;
    P.diagonal().head<3>().array() += walk_a * walk_a * since_s;
    P.diagonal().tail<3>().array() += walk_g * walk_g * since_s;
  }
  return start;
}

bool GpsIns::try_start() {
  GpsInsMeasurement* const fix = first_fix();
  if (fix == nullptr) return false;
  const std::optional<Level> found = level_at(*fix);
  if (!found) return false;
  const Eigen::Vector3d& up = found->up_imu;
  Estimate<GpsInsState> start = start_at(*fix, found->is_steady);
  const Eigen::Vector3d axis = up.cross(Eigen::Vector3d::UnitZ());
  const double sine = axis.norm();
  const Eigen::Quaterniond level =
      exp_so3(sine > 0.0 ? Eigen::Vector3d(std::atan2(sine, up.z()) / sine * axis) : Eigen::Vector3d::Zero());
  const double yaw_now = yaw_of(level);
  used_ = kYaws;
  for (int i = 0; i < kYaws; ++i) {
    const double yaw = 2.0 * kPi * i / kYaws - yaw_now;
    start.x.motion.q_world_imu = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * level;
    start.x.motion.position_world_m = fix->value - start.x.motion.q_world_imu * model_.antenna_imu_m;
    const auto place = static_cast<std::size_t>(i);
    fix_noises_[place] = {kFixCorrelatedShare, kFixCorrelation_s};
    filters_[place].set_fix_noise(fix_noises_[place]);
    // The fix itself is the first measurement; all before it are left out.
    filters_[place].start(fix->stamp_ns - 1, start, imu_);
  }
  for (GpsInsMeasurement* before = measurements_.data(); before <= fix; ++before) before->is_counted = true;
  phase_ = Phase::kAligning;
  reason_ = kNoYaw;
  return true;
}

}  // namespace situation_awareness
