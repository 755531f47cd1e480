// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>

#include "input.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/map/objects/objects.hpp"
#include "support/covariance.hpp"

// Common code of the map's targets: detections of an arbitrary detector, and invariants of any map.

namespace situation_awareness::fuzz {

/// A covariance of any size and shape: L L^T.
inline Matrix5d draw_covariance(Input& input) {
  Matrix5d L = Matrix5d::Zero();
  const bool usual = input.flag();
  for (int i = 0; i < 5; ++i) {
    L(i, i) = usual ? 0.02 : input.by_magnitude(1e-6, 100.0);
    if (usual) continue;
    for (int j = 0; j < i; ++j) L(i, j) = L(i, i) * input.uniform(-10.0, 10.0);
  }
  const Matrix5d covariance = L * L.transpose();
  return 0.5 * (covariance + covariance.transpose());
}

inline Detection draw_detection(Input& input, const Ellipse& ellipse_level) {
  Detection detection;
  detection.ellipse_level = ellipse_level;
  if (input.flag()) detection.ellipse_level.center_m += Eigen::Vector2d::Constant(input.uniform(-0.1, 0.1));
  detection.covariance = draw_covariance(input);
  detection.time_offset_s = input.flag() ? 0.0 : input.uniform(0.0, 1.0);
  detection.beams = input.integer(1, 1000);
  detection.hidden_end = input.integer(0, 3) == 0;
  if (*detection_defect(detection) != '\0') detection.covariance = 1e-4 * Matrix5d::Identity();
  return detection;
}

inline FreeSpace draw_free_space(Input& input) {
  FreeSpace free_space;
  const std::size_t count = input.count(60);
  const double step_rad = input.uniform(0.0, 0.2);
  const double first_rad = input.coordinate(kPi, 1e3);
  const float range_m = static_cast<float>(input.by_magnitude(1e-3, 1e3));
  for (std::size_t i = 0; i < count; ++i) {
    free_space.azimuth_rad.push_back(static_cast<float>(first_rad + static_cast<double>(i) * step_rad));
    free_space.range_m.push_back(i % 8 != 7 ? range_m : std::numeric_limits<float>::infinity());
  }
  free_space.full_circle = input.flag();
  return free_space;
}

/// Mostly at the period of scans.
inline std::int64_t draw_stamp(Input& input, std::int64_t latest_ns) {
  std::int64_t step_ns = 0;
  switch (input.integer(0, 7)) {
    case 0:
      return input.any_int64();
    case 1:
      step_ns = nanoseconds(input.uniform(-2.0, 0.0));
      break;
    case 2:
      step_ns = nanoseconds(input.by_magnitude(1e-9, 1e5));
      break;
    default:
      step_ns = nanoseconds(0.05);
  }
  std::int64_t stamp_ns = 0;
  return __builtin_add_overflow(latest_ns, step_ns, &stamp_ns) ? 0 : stamp_ns;
}

inline void check_objects(const Objects& objects, std::uint64_t largest_id) {
  std::uint64_t previous = 0;
  for (const Object& object : objects.objects) {
    require(object.id > previous, "ids grow");
    require(object.id <= largest_id, "an id on the map was given");
    previous = object.id;
    const Ellipse& ellipse = object.ellipse_world;
    require(ellipse.center_m.allFinite() && std::isfinite(ellipse.psi_rad), "ellipses are finite");
    require(std::isfinite(ellipse.rx_m) && ellipse.rx_m >= ellipse.ry_m && ellipse.ry_m > 0.0, "rx >= ry > 0");
    require(object.velocity_world_m_s.allFinite() && std::isfinite(object.angular_velocity_rad_s),
            "velocities are finite");
    require(is_covariance(object.covariance), "a covariance is symmetric and positive");
    require(object.p_moving >= 0.0 && object.p_moving <= 1.0, "p_moving is a probability");
    require(object.p_exists >= 0.0 && object.p_exists <= 1.0, "p_exists is a probability");
    require(object.observations > 0 && object.beams >= 0, "an element was seen");
  }
}

}  // namespace situation_awareness::fuzz
