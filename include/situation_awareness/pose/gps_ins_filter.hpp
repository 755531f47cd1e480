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
#include "situation_awareness/pose/inertial_motion.hpp"

namespace situation_awareness {

// One filter of the GPS/INS, which applies measurements at their stamps (docs/math/gps_ins.md). Its history is the
// inertial samples and measurements of the last seconds, which all filters of a bank share, and its own state at some
// moments: a late measurement takes it back to the moment before, from where it goes on.

/// Inertial samples of the last seconds, in the axes of the base; a ring that is numbered from the first one on. The
/// density of their noise is measured as Allan's variance is: by how far the mean of a block of samples is from that of
/// its neighbours, over some seconds, for blocks of several lengths. It is the same for all of them if the noise is
/// white, more for short ones by shaking and for long ones by motion: the least is taken.
class InertialHistory {
 public:
  struct Entry : InertialSample {
    double accelerometer_noise = 0.0;  ///< m/s^2/sqrt(Hz)
    double gyroscope_noise = 0.0;      ///< rad/s/sqrt(Hz)
    double force_change_m_s2 = 0.0;    ///< root mean square of the force about its mean, over some seconds
    /// At the end of a block of kBlock_s: whether its means and those of the block before are those of something that
    /// may stand, the mean of the rate, and what that differs by from the one before.
    bool ends_block = false, may_stand = false;
    double block_s = 0.0;
    Eigen::Vector3d mean_rate_rad_s = Eigen::Vector3d::Zero(), rate_change_rad_s = Eigen::Vector3d::Zero();
  };
  /// Blocks are so long: there the means of two of them differ least, by white noise and by the walk of the bias.
  static constexpr double kBlock_s = 8.0;

  /// It keeps the samples of this time, if they come at `most_hz` at most, and less of faster ones; it grows with their
  /// rate, and then stays.
  /// What stands has rates whose means of two blocks differ by less than `standing_change_rad_s`, each axis.
  InertialHistory(double duration_s, double most_hz, double standing_change_rad_s);

  void add(const InertialSample& sample);
  void clear();

  std::uint64_t begin() const {
    return end_ - begin_ > samples_.size() ? end_ - static_cast<std::uint64_t>(samples_.size()) : begin_;
  }
  std::uint64_t end() const { return end_; }
  bool empty() const { return begin_ == end_; }
  const Entry& operator[](std::uint64_t number) const {
    return samples_[static_cast<std::size_t>(number % samples_.size())];
  }
  const Entry& latest() const { return (*this)[end_ - 1]; }
  /// Whether the samples are too fast for the time it is to keep.
  bool is_short() const;
  /// Number of the last sample that is not later than the stamp; begin() if all are.
  std::uint64_t last_until(std::int64_t stamp_ns) const;

 private:
  bool is_full() const { return end_ - begin_ >= samples_.size(); }
  void grow();
  void add_to_block(Entry& entry, double period_s);

  double duration_s_, standing_change_rad_s_;
  std::size_t most_;
  std::vector<Entry> samples_;
  std::uint64_t begin_ = 0, end_ = 0;
  Eigen::Vector3d mean_force_m_s2_ = Eigen::Vector3d::Zero();
  double force_variance_ = 0.0;
  struct Blocks {
    int length = 1;  ///< samples
    int count = 0;   ///< samples of the present one
    int whole = 0;   ///< blocks until now, 2 at most
    Eigen::Matrix<double, 6, 1> sum = Eigen::Matrix<double, 6, 1>::Zero(), last = sum, last_but_one = sum;
    double duration_s = 0.0;                              ///< that the densities are of
    Eigen::Vector2d densities = Eigen::Vector2d::Zero();  ///< squared, of force and rate
    void add(const InertialSample& sample, double period_s);
  };
  std::array<Blocks, 3> blocks_;
  struct Standing {
    std::int64_t begin_ns = 0;
    int count = 0;  ///< samples of the present block
    bool has_last = false;
    Eigen::Matrix<double, 6, 1> sum = Eigen::Matrix<double, 6, 1>::Zero(), last = sum;  ///< force, rate
  };
  Standing standing_;
};

/// In standard deviations of what noise and walk make of the difference of two means.
constexpr double kStandingSigmas = 3.0;
/// The least that the means of two blocks of the rate of something that stands may differ by (rad/s): what turns
/// slowest, or what noise and the walk of the bias make of it.
double standing_change(double standing_turn_rad_s, const InertialNoiseParams& noise);

/// The sensors whose innovations are watched.
enum class GpsInsSensor { kFix, kAltitude, kHeading, kSideslip, kOther };
constexpr std::size_t kGpsInsSensors = 5;

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
  Eigen::Vector3d value = Eigen::Vector3d::Zero();       ///< a position (m); an altitude (m) or a yaw (rad) first
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
  /// Before a start.
  void set_fix_noise(const FixNoise& fix_noise) { fix_noise_ = fix_noise; }

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
    double accelerometer_noise = 0.0, gyroscope_noise = 0.0;  ///< as measured
    Eigen::Vector3d rate_rad_s = Eigen::Vector3d::Zero();     ///< as measured
    double force_change_m_s2 = 0.0;                           ///< as measured
    double rate_variance = 0.0;                               ///< of its white noise, each axis
    bool is_yaw_known = false, stands = false;
    double stood_s = 0.0;  ///< of `motion`
    double log_likelihood = 0.0;
    std::int64_t yaw_shown_ns = 0;
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
  GpsInsVerdict apply(Moment& moment, const GpsInsMeasurement& measurement) const;
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
  std::vector<double> gates_;  ///< by degrees of freedom
  Moment now_;
  std::vector<Moment> moments_;  ///< a ring
  std::size_t first_ = 0, kept_ = 0;
};

}  // namespace situation_awareness
