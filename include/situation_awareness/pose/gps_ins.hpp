// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/estimation/nis_monitor.hpp"
#include "situation_awareness/pose/gps_ins_filter.hpp"
#include "situation_awareness/pose/local_world.hpp"

namespace situation_awareness {

/// Parameters of the pose by GPS and INS.
struct GpsInsParams {
  InertialNoiseParams imu;
  double min_fix_sigma_m = 0.02;
  double fix_stamp_sigma_s = 0.01;
  double sideslip_sigma_m_s = 0.0;
  double standing_turn_rad_s = 0.0003;
  double max_yaw_sigma_rad = 0.1;
  double max_imu_gap_s = 1.0;
  double max_delay_s = 1.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("imu", self.imu);
    visit("min_fix_sigma_m", self.min_fix_sigma_m, Bounds{0.001, 100.0}, "m",
          "standard deviation added to that of each fix, each axis");
    visit("fix_stamp_sigma_s", self.fix_stamp_sigma_s, Bounds{0.0, 1.0}, "s",
          "standard deviation of a fix's stamp against those of the IMU");
    visit("sideslip_sigma_m_s", self.sideslip_sigma_m_s, Bounds{0.0, 100.0}, "m/s",
          "standard deviation of the velocity sideways of a vehicle that goes where it heads; 0: it need not (wind)");
    visit("standing_turn_rad_s", self.standing_turn_rad_s, Bounds{1e-6, 0.1}, "rad/s",
          "largest rate of turn of a vehicle that stands, by which its yaw gets uncertain: least that the IMU shows; "
          "less where what it stands on does not turn");
    visit("max_yaw_sigma_rad", self.max_yaw_sigma_rad, Bounds{0.01, 1.0}, "rad",
          "the pose is ready once the standard deviation of the yaw is well below this, and as long as it is below");
    visit("max_imu_gap_s", self.max_imu_gap_s, Bounds{0.01, 100.0}, "s",
          "the pose starts anew after a longer gap between samples of the IMU");
    visit("max_delay_s", self.max_delay_s, Bounds{0.1, 10.0}, "s", "measurements that are later than this are dropped");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// Where the sensors are on the base.
struct GpsInsMounting {
  Eigen::Isometry3d T_base_imu = Eigen::Isometry3d::Identity();
  Eigen::Vector3d antenna_base_m = Eigen::Vector3d::Zero();
};

/// A fix of a receiver.
struct GeodeticFix {
  std::int64_t stamp_ns = 0;
  bool is_fix = true;  ///< false: the receiver has none
  GeodeticPosition position;
  Eigen::Matrix3d covariance_m2 = Eigen::Matrix3d::Zero();  ///< east, north, up
  bool has_altitude = true;  ///< false: that of the position is a guess, of the variance that the covariance has
};

/// Pose, velocity and what is known of them.
struct GpsInsPose {
  std::int64_t stamp_ns = 0;
  bool is_ready = false;                                           ///< the rest is invalid if not
  const char* reason = "";                                         ///< why not: one sentence; empty if it is
  Eigen::Isometry3d T_world_base = Eigen::Isometry3d::Identity();  ///< world: east, north, up at the origin
  /// Of the position in the world (m), and of the attitude's error delta in the base: R_true = R exp(delta).
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Vector3d velocity_world_m_s = Eigen::Vector3d::Zero();  ///< of the base
  Eigen::Matrix3d velocity_covariance = Eigen::Matrix3d::Zero();
  Eigen::Vector3d velocity_base_m_s = Eigen::Vector3d::Zero();  ///< the same in the axes of the base
  Eigen::Vector3d angular_velocity_base_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d specific_force_base_m_s2 = Eigen::Vector3d::Zero();  ///< at the IMU, less its bias
  /// Of the two in the axes of the base.
  Eigen::Matrix<double, 6, 6> twist_covariance = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Vector3d accelerometer_bias_m_s2 = Eigen::Vector3d::Zero();  ///< axes of the base
  Eigen::Vector3d gyroscope_bias_rad_s = Eigen::Vector3d::Zero();     ///< axes of the base
};

/// Pose by GPS and INS: a bank of error-state filters (Magill, "Optimal adaptive estimation of sampled stochastic
/// processes", 1965). Until the yaw is known they differ in it, later in how the error of fixes is correlated in time;
/// each has the weight of its likelihood. Measurements are applied at their stamps, in any order of arrival, and
/// nothing else but what has been added is used. Time and memory per call are bounded; no allocation after warm-up.
class GpsIns {
 public:
  /// The world's origin is `origin`, or else the first good fix. Throws std::invalid_argument as params.validate().
  GpsIns(const GpsInsParams& params, const GpsInsMounting& mounting, std::optional<GeodeticPosition> origin = {});

  /// A sample, in the axes of the IMU. Counts what it refuses: "imu not finite", "imu out of range", "imu stamped
  /// twice", "imu out of order"; and what it repairs: "imu gap", "restarted after an imu gap", "imu restarted" (time
  /// went back).
  void add_imu(const InertialSample& sample, std::int64_t received_ns = StampOrder::kNone);

  /// A fix. Counts what is dropped: "no fix", "fix not finite", "fix out of range", "fix without covariance", "fix
  /// covariance not positive semidefinite", "fix too late", "fix ahead of the imu"; "fix outside its gate", and "fix
  /// outside its gate in height: used in x and y", of which the height is believed if several agree. A filter
  /// whose estimate is not finite all the same begins anew: "restarted: estimate not finite".
  void add_fix(const GeodeticFix& fix);
  /// The same in the world, for receivers that measure in a frame of their own.
  void add_position(std::int64_t stamp_ns, const Eigen::Vector3d& antenna_world_m,
                    const Eigen::Matrix3d& covariance_m2);

  /// The height of the IMU in the world (m), such as a barometer's.
  void add_altitude(std::int64_t stamp_ns, double altitude_world_m, double sigma_m);
  /// Yaw of the base in the world (rad, from east to north), such as a magnetometer's.
  void add_heading(std::int64_t stamp_ns, double yaw_rad, double sigma_rad);

  /// A correction of another kind, linear about a state, such as that of state_at.
  void correct(const GpsInsCorrection& correction);

  /// The pose at the latest sample.
  GpsInsPose pose() const;
  /// The pose at a stamp; not ready if the stamp is beyond the latest sample, or too long ago.
  GpsInsPose pose_at(std::int64_t stamp_ns) const;
  /// The state of the filter at a stamp, for corrections; false if there is none.
  bool state_at(std::int64_t stamp_ns, Estimate<GpsInsState>& estimate) const;
  /// The pose of the base in terms of the state: position and attitude, and the Jacobian of their error by that of x.
  Eigen::Isometry3d pose_of(const GpsInsState& x) const;
  Eigen::Matrix<double, 6, 18> pose_jacobian(const GpsInsState& x) const;

  /// What contradiction() says.
  static constexpr const char* kContradicted =
      "the IMU and the fixes contradict each other: for seconds the fixes were not where the IMU says (its units and "
      "axes, the places of IMU and antenna on the base, the stamps of both?)";
  /// One sentence if fixes were elsewhere than the IMU says for so long, within the last half minute, that neither was
  /// believed any more; else empty.
  std::string contradiction() const;

  bool is_ready() const { return phase_ == Phase::kReady && is_yaw_known_; }
  const char* reason() const { return reason_; }
  const std::optional<GeodeticPosition>& origin() const { return origin_; }
  std::int64_t stamp_ns() const { return imu_.empty() ? StampOrder::kNone : imu_.latest().stamp_ns; }
  /// How fixes are correlated in time, by the likeliest filter.
  FixNoise fix_noise() const;
  /// Densities of the IMU's noise as measured, m/s^2/sqrt(Hz) and rad/s/sqrt(Hz).
  Eigen::Vector2d imu_noise() const;
  const Counters& counters() const { return counters_; }
  NisMonitor& nis(GpsInsSensor sensor) { return monitors_[static_cast<std::size_t>(sensor)]; }

  /// Starts anew; the origin stays.
  void reset();

 private:
  /// Bounds of a number that is measured, and why it is dropped.
  struct Number {
    const char *not_finite, *out_of_range, *too_late, *ahead;
    double most, least_sigma, most_sigma;
  };
  enum class Phase { kLevelling, kAligning, kReady };
  /// The errors of the IMU at a stamp, axes of the base, with their covariance.
  struct Biases {
    std::int64_t stamp_ns;
    Eigen::Vector3d accelerometer_m_s2, gyroscope_rad_s;
    Eigen::Matrix<double, 6, 6> covariance;
  };

  /// Up in the axes of the IMU's samples, and whether the vehicle stood or moved steadily.
  struct Level {
    Eigen::Vector3d up_imu;
    bool is_steady;
  };

  void add_position(std::int64_t stamp_ns, const Eigen::Vector3d& antenna_world_m, const Eigen::Matrix3d& covariance_m2,
                    bool is_level);
  bool has_jumped(std::int64_t stamp_ns, double height_m, double variance_m2);
  void add(const GpsInsMeasurement& measurement, const char* too_late, const char* ahead);
  void add_number(GpsInsSensor sensor, std::int64_t stamp_ns, double value, double sigma, const Number& number);
  /// Those of the estimate where it is ready, else those that it will start with.
  std::optional<Biases> known_biases() const;
  void process();
  GpsInsMeasurement* first_fix();
  std::optional<Level> level_at(GpsInsMeasurement& fix);
  Estimate<GpsInsState> start_at(const GpsInsMeasurement& fix, bool is_steady) const;
  bool try_start();
  void align();
  void align_anew();
  void watch_yaw();
  void widen_by_misfit();
  /// Of the yaws of the filters about the best one's.
  double yaw_variance(bool with_their_own) const;
  /// Counts why not.
  bool is_usable(const Eigen::Matrix3d& covariance_m2);
  /// Whether there were any.
  bool count_verdicts();
  std::size_t best() const;
  Estimate<GpsInsState> mixed(std::int64_t stamp_ns) const;

  GpsInsParams params_;
  GpsInsMounting mounting_;
  std::optional<GeodeticPosition> origin_;
  GpsInsModel model_;
  StampOrder order_;
  InertialHistory imu_;
  std::vector<GpsInsMeasurement> measurements_;    ///< by stamp
  std::int64_t forgotten_ns_ = StampOrder::kNone;  ///< of the latest that was dropped, as they were too many
  std::vector<GpsInsFilter> filters_;
  std::vector<std::vector<GpsInsVerdict>> verdicts_;  ///< of each filter on each measurement
  std::vector<FixNoise> fix_noises_;                  ///< of each filter
  std::size_t used_ = 0;                              ///< filters
  Phase phase_ = Phase::kLevelling;
  std::int64_t waiting_since_ns_ = StampOrder::kNone;
  std::int64_t yaw_watched_ns_ = 0;
  std::int64_t learning_since_ns_ = 0;                      ///< how the error of fixes is correlated
  std::optional<std::pair<double, double>> height_before_;  ///< of the latest fix, and its variance
  std::int64_t height_jumped_ns_ = StampOrder::kNone;
  int contradictions_ = 0;                            ///< of the likeliest filter
  std::int64_t contradicted_ns_ = StampOrder::kNone;  ///< when fixes last contradicted the estimate
  bool is_yaw_known_ = false;
  std::optional<Biases> biases_;  ///< of before a gap, in which they stay what they are
  const char* reason_ = "";
  Counters counters_;
  std::array<NisMonitor, kGpsInsSensors> monitors_;
};

}  // namespace situation_awareness
