// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/pipeline/reflector_evidence.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/pose/odometry_track.hpp"
#include "situation_awareness/pose/reflector_localization.hpp"
#include "situation_awareness/pose/reflector_map.hpp"
#include "situation_awareness/pose/reflectors.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// A scan with the poses that it is placed by.
struct OdometryScan {
  Pose2 T_odom_base;      ///< by odometry, at the stamp
  Pose2 T_odom_base_end;  ///< at the last beam
  Eigen::Isometry3d T_base_lidar = Eigen::Isometry3d::Identity();
};

/// Where a scan is in the world.
struct PlacedScan {
  Eigen::Isometry3d T_world_lidar = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_world_lidar_end = Eigen::Isometry3d::Identity();  ///< at the last beam
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of the lidar's x, y (m) and yaw (rad), axes of the world
};

/// From scan and odometry to the pose of a base that moves in the plane, without ROS: the same live and offline.
class LocalizationPipeline {
 public:
  /// Throws std::invalid_argument naming field and bound, and as check_reflectors does.
  LocalizationPipeline(const ReflectorMap& map, const ReflectorDetectionParams& reflectors,
                       const ReflectorLocalizationParams& localization);

  /// As ReflectorLocalization::add_odometry.
  OdometryTrack::Verdict add_odometry(std::int64_t stamp_ns, const Pose2& T_odom_base,
                                      std::int64_t received_ns = StampOrder::kNone) {
    return localization_.add_odometry(stamp_ns, T_odom_base, received_ns);
  }

  /// Localises by a scan; the odometry up to its last beam has been added. Throws std::invalid_argument if the scan
  /// cannot be used. The result is overwritten by the next call. No allocation after warm-up.
  const ReflectorUpdate& process(const Scan& scan, const Eigen::Isometry3d& T_base_lidar);

  /// The same, and where the scan is by the pose; none where that is not known.
  std::optional<PlacedScan> place(const Scan& scan, const OdometryScan& placed);

  ReflectorLocalization& localization() { return localization_; }
  const ReflectorLocalization& localization() const { return localization_; }

  /// Why the pose was not known after the latest scan, in one sentence: no reflector was seen since it was known, or
  /// what the latest scan has. Empty if it was known, and before a scan.
  std::string why_unknown() const;

  // Of the latest scan:

  const ReflectorSightings& sightings() const { return sightings_; }
  /// Of the level frame of the sightings.
  const Pose2& T_base_level() const { return points_.T_world_level; }

 private:
  ReflectorDetectionParams params_;
  ReflectorLocalization localization_;
  Points points_;
  ReflectorSightings sightings_;
  ReflectorEvidence evidence_;  ///< since the pose was known
  const char* reason_ = "";     ///< of the latest scan
};

}  // namespace situation_awareness
