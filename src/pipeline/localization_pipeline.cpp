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

std::string LocalizationPipeline::why_unknown() const {
  if (*reason_ == '\0') return "";
  const std::string none = evidence_.why_none();
  if (!none.empty()) return none;
  return "the pose by reflectors is not known: " + std::string(reason_) + "; at most " +
         std::to_string(evidence_.most_sightings()) + " in sight at once, of " +
         std::to_string(localization_.map().reflectors.size());
}

}  // namespace situation_awareness
