// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/localization_pipeline.hpp"

#include <stdexcept>
#include <string>
#include <utility>

#include "situation_awareness/points/horizontal_projection.hpp"

namespace situation_awareness {

LocalizationPipeline::LocalizationPipeline(const ReflectorMap& map, const ReflectorDetectionParams& reflectors,
                                           const ReflectorLocalizationParams& localization)
    : params_(reflectors), localization_(map, localization), evidence_(reflectors) {
  params_.validate();
}

const ReflectorUpdate& LocalizationPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_base_lidar) {
  const std::string defect = scan_defect(scan);
  if (!defect.empty()) throw std::invalid_argument(defect);
  // Its level frame is planar with the base's, and each reflector is treated at its own time.
  points_ = project_horizontally(scan, T_base_lidar, T_base_lidar, std::move(points_));
  sightings_ = detect_reflectors(points_, params_, std::move(sightings_));
  evidence_.add(points_, sightings_);
  const ReflectorUpdate& update = localization_.update(sightings_, points_.T_world_level);
  if (update.is_known) evidence_.clear();
  reason_ = update.is_known ? "" : update.reason;
  return update;
}

std::optional<PlacedScan> LocalizationPipeline::place(const Scan& scan, const OdometryScan& placed) {
  if (!process(scan, placed.T_base_lidar).is_known) return std::nullopt;
  const LocalizedPose pose = localization_.pose();
  const Pose2& T_world_base = pose.T_world_base.x;
  const Pose2 T_world_base_end = T_world_base * (inverse(placed.T_odom_base) * placed.T_odom_base_end);
  // An error of the yaw moves the lidar, which is not at the base's origin.
  const Eigen::Vector2d lever_m = T_world_base.rotation() * T_base_level().translation_m;
  Eigen::Matrix3d J_lidar_base = Eigen::Matrix3d::Identity();
  J_lidar_base.topRightCorner<2, 1>() << -lever_m.y(), lever_m.x();
  return PlacedScan{isometry_in_plane(T_world_base) * placed.T_base_lidar,
                    isometry_in_plane(T_world_base_end) * placed.T_base_lidar,
                    J_lidar_base * pose.covariance_world * J_lidar_base.transpose()};
}

std::string LocalizationPipeline::why_unknown() const {
  if (*reason_ == '\0') return "";
  const std::string none = evidence_.why_none();
  if (!none.empty()) return none;
  return "the pose by reflectors is not known: " + std::string(reason_) + "; at most " +
         std::to_string(evidence_.most_sightings()) + " in sight at once, of " +
         std::to_string(localization_.map().reflectors.size());
}

}  // namespace situation_awareness
