// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "gps_ins_parts.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/covariance.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/pose/gps_ins.hpp"

// What is taken for a measurement.
namespace situation_awareness {
namespace {

/// What no sensor of a vehicle measures: beyond the earth, a place or height that is not known to 10 km, a yaw not to a
/// turn. So bounded, no covariance overflows or drowns in rounding.
constexpr double kMaxPlace_m = 1e7, kMaxPlaceSigma_m = 1e4;
constexpr double kMaxVelocity_m_s = 1e4;  ///< and the most of its standard deviation
constexpr double kMaxYaw_rad = 1e3, kMaxYawSigma_rad = 2.0 * kPi;
/// Of a correction by others, in the units of its rows.
constexpr double kMaxCorrection = 1e9;
/// A height or a yaw that says to be better is taken to be as good as this, which is better than any is.
constexpr double kMinAltitudeSigma_m = 1e-3, kMinYawSigma_rad = 1e-4;

/// Added to the standard deviation of a velocity, each axis (m/s): receivers tell that of the noise alone.
constexpr double kVelocitySigma_m_s = 0.03;

/// A height that differs from that of the fix before by this, and by so many standard deviations of both, has jumped:
/// those of the next seconds may be of another zero. A filter that drifts off heights which have not is wrong.
constexpr double kHeightJump_m = 10.0, kHeightJumpSigmas = 6.0, kHeightJump_s = 10.0;

}  // namespace

void GpsIns::add_fix(const GeodeticFix& fix) {
  if (!fix.is_fix) {
    ++counters_["no fix"];
    return;
  }
  if (!is_valid(fix.position)) {
    ++counters_["fix not finite"];
    return;
  }
  if (!is_usable(fix.covariance_m2, kMaxPlaceSigma_m, "fix")) return;
  if (!origin_) origin_ = fix.position;
  const Eigen::Vector3d antenna_m = local_position(*origin_, fix.position);
  add_position(fix.stamp_ns, antenna_m, fix.covariance_m2, !fix.has_altitude);
  if (!fix.has_altitude) add_altitude(fix.stamp_ns, antenna_m.z(), std::sqrt(fix.covariance_m2(2, 2)));
}

bool GpsIns::is_usable(const Eigen::Matrix3d& covariance, double most_sigma, const std::string& noun) {
  const char* reason = "";
  if (!covariance.allFinite() || covariance.diagonal().minCoeff() <= 0.0) {
    reason = " without covariance";
  } else if (covariance.cwiseAbs().maxCoeff() > most_sigma * most_sigma) {
    reason = " out of range";
  } else if (!is_positive_semidefinite(covariance)) {
    reason = " covariance not positive semidefinite";
  } else {
    return true;
  }
  ++counters_[noun + reason];
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
  if (!is_usable(covariance_m2, kMaxPlaceSigma_m, "fix")) return;
  GpsInsMeasurement measurement;
  measurement.stamp_ns = stamp_ns;
  measurement.value = antenna_world_m;
  measurement.is_level = is_level;
  measurement.has_jumped = !is_level && has_jumped(stamp_ns, antenna_world_m.z(), covariance_m2(2, 2));
  measurement.covariance = 0.5 * (covariance_m2 + covariance_m2.transpose());
  add(measurement, "fix too late", "fix ahead of the imu");
}

void GpsIns::add_velocity(const AntennaVelocity& velocity) {
  if (!velocity.world_m_s.allFinite()) {
    ++counters_["velocity not finite"];
    return;
  }
  if (velocity.world_m_s.norm() > kMaxVelocity_m_s) {
    ++counters_["velocity out of range"];
    return;
  }
  if (!is_usable(velocity.covariance_m2_s2, kMaxVelocity_m_s, "velocity")) return;
  GpsInsMeasurement measurement;
  measurement.stamp_ns = velocity.stamp_ns;
  measurement.value = velocity.world_m_s;
  measurement.covariance = 0.5 * (velocity.covariance_m2_s2 + velocity.covariance_m2_s2.transpose());
  measurement.covariance.diagonal().array() += kVelocitySigma_m_s * kVelocitySigma_m_s;
  measurement.sensor = GpsInsSensor::kVelocity;
  if (!keep(measurement, "velocity too late", "velocity ahead of the imu")) return;
  velocity_ns_ = velocity.stamp_ns;
  measurement.sensor = GpsInsSensor::kClimb;
  add(measurement, "velocity too late", "velocity ahead of the imu");
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
  if (keep(measurement, too_late, ahead)) process();
}

/// False, and counted, if it is of no use any more, or not yet.
bool GpsIns::keep(const GpsInsMeasurement& measurement, const char* too_late, const char* ahead) {
  if (imu_.empty()) {
    ++counters_[ahead];
    return false;
  }
  const std::int64_t stamp_ns = measurement.stamp_ns;
  if (seconds_between(imu_.latest().stamp_ns, stamp_ns) > params_.max_delay_s) {
    ++counters_[ahead];
    return false;
  }
  if (seconds_between(stamp_ns, imu_.latest().stamp_ns) > params_.max_delay_s ||
      (used_ > 0 && filters_[0].oldest_ns() >= stamp_ns) ||
      (used_ > 0 && filters_[0].stamp_ns() >= stamp_ns && filters_[0].oldest_sample() < imu_.begin())) {
    ++counters_[too_late];
    return false;
  }
  if (measurements_.size() == kGpsInsMeasurements) {
    // Half at once, so that moving the others is rare.
    forgotten_ns_ = measurements_[kGpsInsMeasurements / 2 - 1].stamp_ns;
    measurements_.erase(measurements_.begin(), measurements_.begin() + kGpsInsMeasurements / 2);
    if (stamp_ns <= forgotten_ns_) {
      ++counters_[too_late];
      return false;
    }
  }
  const auto place =
      std::upper_bound(measurements_.begin(), measurements_.end(), stamp_ns,
                       [](std::int64_t stamp, const GpsInsMeasurement& m) { return stamp < m.stamp_ns; });
  measurements_.insert(place, measurement);
  for (std::size_t i = 0; i < used_; ++i) filters_[i].go_back_before(stamp_ns);
  return true;
}

}  // namespace situation_awareness
