// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace situation_awareness {

/// One measurement of a 3D sensor, in the sensor's frame.
struct CloudPoint {
  /// m; all NaN where there is no return.
  float x_m = std::numeric_limits<float>::quiet_NaN();
  float y_m = std::numeric_limits<float>::quiet_NaN();
  float z_m = std::numeric_limits<float>::quiet_NaN();
  float intensity = std::numeric_limits<float>::quiet_NaN();  ///< in the sensor's own units; NaN where there is none
  std::uint16_t ring = 0;                                     ///< laser or row of the sensor
  float time_s = 0.0F;  ///< time of the measurement after the cloud's stamp; NaN: not known
};

/// False also for zeros, which some drivers send where there is no return.
inline bool is_return(const CloudPoint& point) {
  return std::isfinite(point.x_m) && std::isfinite(point.y_m) && std::isfinite(point.z_m) &&
         (point.x_m != 0.0F || point.y_m != 0.0F || point.z_m != 0.0F);
}

/// The measurements of a 3D LIDAR in one revolution, or of a depth camera in one image.
///
/// Points are in rows: that of row r and column c is `points[r * columns + c]`. A structured cloud has a row for each
/// ring, with a point for every measurement, also without a return; an unstructured one is a single row.
struct Cloud {
  std::int64_t stamp_ns = 0;
  std::size_t rows = 1;
  std::size_t columns = 0;
  std::vector<CloudPoint> points;  ///< rows * columns
};

}  // namespace situation_awareness
