// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// A hit of a polyline.
struct PolylineHit {
  Eigen::Vector2d p_level_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal_level = Eigen::Vector2d::UnitX();  ///< unit, of its edge, towards the sensor
  bool has_normal = false;        ///< else its edge has too few hits to tell, and the normal is along the beam
  bool is_behind_beside = false;  ///< a beam beside it ends before it
  double sigma_m = 0.0;           ///< of its error along the normal, from the range noise
  double azimuth_rad = 0.0;
  double range_m = 0.0;
};

/// A vertex with the covariance of its error from the range noise; along the chain that of an end is the spacing of the
/// beams.
struct PolylineVertex {
  Eigen::Vector2d p_level_m = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
};

/// The visible boundary of one thing, or of several that touch, from its right end to its left as seen from the sensor.
struct Polyline {
  std::size_t first_hit = 0;     ///< index in Polylines::hits
  std::size_t hits = 0;          ///< at least one
  std::size_t first_vertex = 0;  ///< index in Polylines::vertices
  std::size_t vertices = 0;      ///< at least one; one only where there is one hit
  SegmentEnd right_end = SegmentEnd::kFree;
  SegmentEnd left_end = SegmentEnd::kFree;
};

/// The polylines of one scan, by increasing azimuth.
struct Polylines {
  std::int64_t stamp_ns = 0;
  Pose2 T_world_level;
  double height_world_m = 0.0;
  double resolution_rad = 0.0;  ///< mean azimuth between neighbouring beams
  double range_sigma_m = 0.0;   ///< range noise that the covariances are made of
  std::vector<PolylineHit> hits;
  std::vector<PolylineVertex> vertices;
  std::vector<Polyline> polylines;
  FreeSpace free_space;  ///< of the whole scan
  Counters refused;      ///< hits on no polyline, by reason
};

}  // namespace situation_awareness
