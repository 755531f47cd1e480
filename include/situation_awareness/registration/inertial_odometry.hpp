// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "situation_awareness/registration/map_alignment.hpp"

namespace situation_awareness {

/// The pose of the base in the world, with the covariance of its position (m, axes of the world) and of its attitude's
/// error (rad, axes of the base).
struct WorldPose {
  Eigen::Isometry3d T_world_base = Eigen::Isometry3d::Identity();
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/// The covariance of the pose's x, y (m) and yaw (rad) in the axes of the world.
Eigen::Matrix3d planar_covariance(const WorldPose& pose);

/// The pose of the base in a frame `odom` by gyroscopes and accelerations: it drifts, and does not jump where a fix
/// moves the pose by GPS and INS; height, roll and pitch are those of that pose. With it, where GPS and INS say that
/// `odom` is in the world, and the fixes in `odom`. Memory is bounded by the time for which poses are kept.
class InertialOdometry {
 public:
  /// s. A fix that is older is not placed any more.
  static constexpr double kLatestFix_s = 2.0;

  struct Pose {
    std::int64_t stamp_ns;
    Eigen::Isometry3d T_odom_base;
  };

  /// `kept_s` > 0: the time for which it is kept what was known, where nothing asks for it.
  explicit InertialOdometry(double kept_s) : kept_s_(kept_s) {}

  /// Begins where the pose by GPS and INS got ready: at the first of the poses before it, with the tilt and the biases
  /// of the ready one; or at that itself. All of them are then to be added.
  void begin(const GpsInsPose& ready, const std::vector<GpsInsPose>& earlier);
  bool has_begun() const { return ready_since_ns_ != StampOrder::kNone; }
  /// Whether the pose was ready at the stamp; poses of stamps before that are made of what came later.
  bool was_ready_at(std::int64_t stamp_ns) const { return stamp_ns >= ready_since_ns_; }

  /// Adds the next pose by GPS and INS. Returns the pose in `odom`; nothing for one that does not follow.
  std::optional<Pose> add(const GpsInsPose& pose);

  /// Adds a fix that the filter of GPS and INS used, and the stamp of its latest pose then: what is known at a stamp
  /// does not depend on when it is asked for.
  void add_fix(const GeodeticFix& fix, std::int64_t known_ns);

  /// Places the fixes in `odom`, up to its latest pose. `antenna_base_m`: of the receiver, on the base.
  void place_fixes(const GeodeticPosition& origin, const Eigen::Vector3d& antenna_base_m);

  /// Forgets everything. At a stamp that is later than the latest pose, the next `odom` is the one before; otherwise
  /// another one.
  void restart(std::int64_t stamp_ns);

  /// The stamp of the latest pose; StampOrder::kNone without one.
  std::int64_t stamp_ns() const { return known_.empty() ? StampOrder::kNone : known_.back().stamp_ns; }

  /// What MapAlignment needs of a scan, as it was known at the stamp. This and pose_at() need a pose, and stamps that
  /// ascend: what is before is forgotten.
  InertialPlacement placement_at(std::int64_t stamp_ns, const Eigen::Isometry3d& T_odom_base,
                                 const Eigen::Isometry3d& T_odom_lidar);
  /// The pose by GPS and INS, or by the map where they know it worse than the map does: then x, y and yaw are the
  /// map's; height, roll and pitch stay.
  WorldPose pose_at(std::int64_t stamp_ns, const Eigen::Isometry3d& T_odom_base, const MapAlignment& alignment);

 private:
  /// What was known at a stamp.
  struct Known {
    std::int64_t stamp_ns = 0;
    Eigen::Isometry3d T_world_odom;
    Eigen::Matrix<double, 6, 6> covariance;                   ///< as that of WorldPose
    Eigen::Vector3d v_odom_m_s, angular_velocity_odom_rad_s;  ///< of the base
    Eigen::Vector3d v_world_m_s;
    double velocity_sigma_m_s = 0.0;
  };

  /// A fix, and the stamp from which on it is known.
  template <class Fix>
  struct KnownFix {
    Fix fix;
    std::int64_t known_ns;
  };

  void turn(const GpsInsPose& pose, double step_s);
  Eigen::Isometry3d move(const GpsInsPose& pose, double step_s);
  const Known& known_at(std::int64_t stamp_ns);

  double kept_s_;
  std::int64_t ready_since_ns_ = StampOrder::kNone;
  std::deque<Known> known_;
  std::deque<KnownFix<GeodeticFix>> fixes_;  ///< of which it is not known yet where the base was
  std::deque<Pose> odom_;                    ///< where it was lately
  std::deque<KnownFix<PlacedFix>> placed_fixes_;
  Pose2 T_world_odom_begin_;  ///< where `odom` begins
  Eigen::Quaterniond q_odom_base_ = Eigen::Quaterniond::Identity();
  Eigen::Vector3d accelerometer_bias_m_s2_ = Eigen::Vector3d::Zero(), gyroscope_bias_rad_s_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d rate_base_rad_s_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d p_odom_m_ = Eigen::Vector3d::Zero(), v_odom_m_s_ = p_odom_m_, a_odom_m_s2_ = p_odom_m_;
};

}  // namespace situation_awareness
