// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/localization_pipeline.hpp"

#include <stdexcept>
#include <string>
#include <utility>

#include "situation_awareness/points/horizontal_projection.hpp"

namespace situation_awareness {

LocalizationPipeline::LocalizationPipeline(const ReflectorMap& map, const ReflectorDetectionParams& reflectors,
                                           const ReflectorLocalizationParams& localization)
    : params_(reflectors), localization_(map, localization) {
  params_.validate();
}

const ReflectorUpdate& LocalizationPipeline::process(const Scan& scan, const Eigen::Isometry3d& T_base_lidar) {
  const std::string defect = scan_defect(scan);
  if (!defect.empty()) throw std::invalid_argument(defect);
  // Its level frame is planar with the base's, and each reflector is treated at its own time.
  points_ = project_horizontally(scan, T_base_lidar, T_base_lidar, std::move(points_));
  sightings_ = detect_reflectors(points_, params_, std::move(sightings_));
  return localization_.update(sightings_, points_.T_world_level);
}

}  // namespace situation_awareness
