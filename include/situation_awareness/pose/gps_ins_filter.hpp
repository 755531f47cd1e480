// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/estimation/error_state_filter.hpp"
#include "situation_awareness/pose/fix_noise.hpp"
#include "situation_awareness/pose/inertial_history.hpp"
#include "situation_awareness/pose/inertial_motion.hpp"

namespace situation_awareness {

// One filter of the GPS/INS, which applies measurements at their stamps (docs/math/gps_ins.md). Its history is the
// inertial samples and measurements of the last seconds, which all filters of a bank share, and its own state at some
// moments: a late measurement takes it back to the moment before, from where it goes on.

/// In standard deviations of what noise and walk make of the difference of two means.
constexpr double kStandingSigmas = 3.0;
/// The least that the means of two blocks of the rate of something that stands may differ by (rad/s): what turns
/// slowest, or what noise and the walk of the bias make of it.
double standing_change(double standing_turn_rad_s, const InertialNoiseParams& noise);

/// The sensors whose innovations are watched.
enum class GpsInsSensor { kFix, kAltitude, kHeading, kVelocity, kClimb, kOther };
constexpr std::size_t kGpsInsSensors = 6;

/// A correction by others, linear in the error of the state about `reference`: `residual` = z - h(reference) has the
/// covariance R and the Jacobian H = d(h(reference [+] e)) / d(e). Rows from `rows` on are not used.
struct GpsInsCorrection {
  static constexpr int kMaxRows = 6;

  std::int64_t stamp_ns = 0;
  int rows = 0;  ///< 1 to kMaxRows
  GpsInsState reference;
  Eigen::Matrix<double, kMaxRows, 1> residual = Eigen::Matrix<double, kMaxRows, 1>::Zero();
  Eigen::Matrix<double, kMaxRows, Manifold<GpsInsState>::kDimension> H =
      Eigen::Matrix<double, kMaxRows, Manifold<GpsInsState>::kDimension>::Zero();
  Eigen::Matrix<double, kMaxRows, kMaxRows> R = Eigen::Matrix<double, kMaxRows, kMaxRows>::Identity();
};

/// A measurement in the history.
struct GpsInsMeasurement {
  GpsInsSensor sensor = GpsInsSensor::kFix;
  std::int64_t stamp_ns = 0;
  /// A position (m), a velocity (m/s) of which one sensor is the part in the plane, another that upwards; an altitude
  /// (m) or a yaw (rad) first.
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of the value; a variance first
  bool is_level = false;                                 ///< of a fix: its height was not measured
  bool has_jumped = false;                               ///< of a fix: heights have jumped shortly before
  GpsInsCorrection correction;                           ///< of GpsInsSensor::kOther
  bool is_counted = false;                               ///< by the monitors, which count once
};

/// What became of a measurement.
struct GpsInsVerdict {
  bool is_accepted = false;
  int degrees_of_freedom = 0;
  double nis = 0.0;                ///< normalised innovation squared; NaN where the covariance was none
  bool is_height_refused = false;  ///< of a fix that was accepted: in x and y alone
};

/// Settings that all filters of a bank share.
struct GpsInsModel {
  InertialNoiseParams noise;
  Eigen::Vector3d antenna_imu_m = Eigen::Vector3d::Zero();  ///< from the IMU to the antenna, axes of the base
  Eigen::Vector3d imu_base_m = Eigen::Vector3d::Zero();     ///< of the IMU on the base
  double min_fix_sigma_m = 0.02;
  double fix_stamp_sigma_s = 0.01;
  double standing_turn_rad_s = 0.0003;
};

/// z - h(x) of a fix, with its Jacobian, and the noise that is white. `value` is the antenna's place in the world.
void fix_innovation(const GpsInsState& x, const GpsInsMeasurement& fix, const GpsInsModel& model, const FixNoise& noise,
                    Eigen::Vector3d& nu, Eigen::Matrix<double, 3, 18>& H, Eigen::Matrix3d& R);

/// z - h(x) of a velocity of the antenna in the world, and the Jacobian of h; `rate_rad_s` as measured.
Eigen::Vector3d velocity_innovation(const NavigationState& x, const Eigen::Vector3d& velocity_m_s,
                                    const Eigen::Vector3d& rate_rad_s, const Eigen::Vector3d& antenna_m,
                                    Eigen::Matrix<double, 3, 18>& H);

/// Velocity of the base to its left (m/s), and its Jacobian. The state is that of the IMU, which is at `lever_m` from
/// the base in its axes and goes sideways when that turns; `rate_rad_s` is the angular rate as measured.
double sideslip(const NavigationState& x, const Eigen::Vector3d& rate_rad_s, const Eigen::Vector3d& lever_m);
Eigen::Matrix<double, 1, 18> sideslip_jacobian(const NavigationState& x, const Eigen::Vector3d& lever_m);

/// One filter.
class GpsInsFilter {
 public:
  /// Time between moments that are kept, over which the covariance is predicted at once.
  static constexpr double kMomentPeriod_s = 0.05;

  GpsInsFilter(const GpsInsModel& model, const FixNoise& fix_noise, std::size_t moments);

  /// Starts anew at a stamp, from when on there are samples; measurements up to then have been used. A yaw that is only
  /// tried is none that could stay known at rest.
  void start(std::int64_t stamp_ns, const Estimate<GpsInsState>& estimate, const InertialHistory& imu,
             bool is_yaw_known = false);
  /// Before a start. What goes where it heads does so to `sideslip_sigma_m_s`; 0: it need not.
  void suppose(const FixNoise& fix_noise, double sideslip_sigma_m_s) {
    fix_noise_ = fix_noise;
    sideslip_sigma_m_s_ = sideslip_sigma_m_s;
  }

  /// Goes on to the stamp, which is not beyond the latest sample, applying the measurements until then. `verdicts`, as
  /// long as `measurements`, gets what became of those that were applied.
  void advance(std::int64_t stamp_ns, const InertialHistory& imu, const std::vector<GpsInsMeasurement>& measurements,
               std::vector<GpsInsVerdict>& verdicts);

  /// Goes back to a moment before the stamp; false, and nothing done, if none is left.
  bool go_back_before(std::int64_t stamp_ns);
  /// Forgets the moments from which it cannot go on as it did: those with an earlier sample, or before the stamp.
  void forget(std::uint64_t before_sample, std::int64_t before_ns);

  /// Adds to the covariance what is unknown of the motion in a gap of the samples.
  void widen(double velocity_sigma_m_s, double attitude_sigma_rad);

  /// Multiplies the covariance of the motion and of the biases by a factor.
  void widen_by(double factor);

  std::int64_t stamp_ns() const { return now_.stamp_ns; }
  /// The estimate at stamp_ns(), and at a stamp at most a moment's period earlier than the last, from the history.
  Estimate<GpsInsState> estimate() const;
  Estimate<GpsInsState> estimate_at(std::int64_t stamp_ns, const InertialHistory& imu,
                                    const std::vector<GpsInsMeasurement>& measurements) const;
  /// The oldest stamp that estimate_at knows, and the sample from which it goes on.
  std::int64_t oldest_ns() const;
  std::uint64_t oldest_sample() const { return moments_[first_].sample; }
  const GpsInsState& state() const { return now_.estimate.x; }

  double log_likelihood() const { return now_.log_likelihood; }
  void set_log_likelihood(double log_likelihood);
  /// How often all fixes contradicted it for so long that it was doubted instead, with those after an outage that agree
  /// with each other, and without them.
  int recoveries() const { return now_.recoveries; }
  int contradictions() const { return now_.contradictions; }
  /// When last something showed the yaw: an acceleration or a speed ahead that is more than noise, or a heading.
  std::int64_t yaw_shown_ns() const { return now_.yaw_shown_ns; }
  /// About the vertical, at most a moment's period ago.
  double yaw_variance() const { return vertical_variance(now_.estimate.x.motion.q_world_imu, now_.estimate.P); }
  /// How far the innovations of the fixes of the last seconds are from zero on average: squared, in units of what it is
  /// if the filter is right, three degrees of freedom.
  double contradiction() const { return now_.innovation_sum.squaredNorm() / std::max(now_.innovation_variance, 1.0); }
  /// Whether all numbers are finite, and no variance is negative.
  bool is_sound() const { return now_.is_sound; }

 private:
  /// Everything that goes back with the time.
  struct Moment {
    std::int64_t stamp_ns = 0;
    std::uint64_t sample = 0;        ///< number of the last one that is not later
    Estimate<GpsInsState> estimate;  ///< the covariance is that before `motion`
    MotionJacobian motion;
    Eigen::Vector3d accelerometer_noise = Eigen::Vector3d::Zero();  ///< as measured
    Eigen::Vector3d gyroscope_noise = Eigen::Vector3d::Zero();      ///< as measured
    Eigen::Vector3d rate_rad_s = Eigen::Vector3d::Zero();           ///< as measured
    Eigen::Vector3d acceleration_m_s2 = Eigen::Vector3d::Zero();    ///< of the antenna, smoothed
    std::int64_t velocity_ns = 0, climb_ns = 0;                     ///< when last one was measured
    double force_change_m_s2 = 0.0;                                 ///< as measured
    Eigen::Vector3d rate_variance = Eigen::Vector3d::Zero();        ///< of its white noise, each axis
    bool is_yaw_known = false, stands = false;
    double stood_s = 0.0;  ///< of `motion`
    double log_likelihood = 0.0;
    std::int64_t yaw_shown_ns = 0;
    std::int64_t slip_ns = 0;  ///< when last it was supposed not to slip
    std::int64_t rejected_since_ns = 0, rejected_ns = 0;
    int rejected = 0;  ///< fixes in a row
    std::int64_t last_fix_ns = 0;
    double outage_s = 0.0;                                 ///< before those that are rejected
    Eigen::Vector3d rejected_m = Eigen::Vector3d::Zero();  ///< the innovation of the last one
    int recoveries = 0, contradictions = 0;
    int heights_refused = 0;                                   ///< fixes in a row that agree with each other
    double height_refused_m = 0.0;                             ///< the innovation of the last one
    Eigen::Vector3d innovation_sum = Eigen::Vector3d::Zero();  ///< of the fixes, whitened, with exponential weights
    double innovation_variance = 0.0;                          ///< of each of its components
    bool is_sound = true;
  };

  void move_to(Moment& moment, std::int64_t stamp_ns, const InertialHistory& imu) const;
  void predict_covariance(Moment& moment) const;
  /// At the end of a block of samples.
  void watch_standing(Moment& moment, const InertialHistory::Entry& block) const;
  bool may_stand(const Moment& moment) const;
  /// Also the share of its acceleration that shows the yaw.
  ErrorMatrix<GpsInsState> predicted_covariance(const Moment& moment, double& shown_share) const;
  /// Whether the rejected fix says that the filter is wrong, not the fix.
  bool is_doubted(Moment& moment, const Eigen::Vector3d& nu, const Eigen::Matrix3d& R) const;
  void doubt(Moment& moment, const Eigen::Vector3d& nu) const;
  /// Whether the height alone puts a fix outside its gate, with the variance that the receiver tells of it. If several
  /// in a row agree with each other they are believed.
  bool is_off_in_height(Moment& moment, const Eigen::Vector3d& nu, const Eigen::Matrix3d& S, double variance_m2) const;
  void suppose_no_sideslip(Moment& moment) const;
  GpsInsVerdict apply(Moment& moment, const GpsInsMeasurement& measurement) const;
  template <int Size>
  GpsInsVerdict apply_velocity(Moment& moment, const GpsInsMeasurement& measurement, std::int64_t& last_ns) const;
  template <int Size>
  GpsInsVerdict correct(Moment& moment, const Eigen::Matrix<double, Size, 1>& nu,
                        const Eigen::Matrix<double, Size, 18>& H, const Eigen::Matrix<double, Size, Size>& R,
                        int rows) const;
  template <class OnMoment, class OnVerdict>
  void advance(Moment& moment, std::int64_t stamp_ns, const InertialHistory& imu,
               const std::vector<GpsInsMeasurement>& measurements, const OnMoment& on_moment,
               const OnVerdict& on_verdict) const;
  void keep(const Moment& moment);
  /// Goes on from now_ alone.
  void forget_moments();

  GpsInsModel model_;
  FixNoise fix_noise_;
  double sideslip_sigma_m_s_ = 0.0;
  std::vector<double> gates_;  ///< by degrees of freedom
  Moment now_;
  std::vector<Moment> moments_;  ///< a ring
  std::size_t first_ = 0, kept_ = 0;
};

}  // namespace situation_awareness
