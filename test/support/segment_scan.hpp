// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>

#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/scan/scan.hpp"
#include "situation_awareness/segments/segmentation.hpp"

namespace situation_awareness {

/// The segments of a scan by a level scanner at the world's origin.
inline Segments segment_scan(const Scan& scan, const SegmentationParams& params = {}, double yaw_rad = 0.0) {
  Eigen::Isometry3d T_world_lidar = Eigen::Isometry3d::Identity();
  T_world_lidar.rotate(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()));
  return segment(project_horizontally(scan, T_world_lidar), params);
}

}  // namespace situation_awareness
