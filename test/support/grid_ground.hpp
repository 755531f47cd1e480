// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/image/image.hpp"
#include "situation_awareness/map/grid/elevation.hpp"

namespace situation_awareness {

/// A camera of so many pixels squared, with a field of view of 60 degrees.
inline PinholeCamera square_camera(int size_px) {
  const double f_px = 0.5 * size_px / std::tan(radians(30.0)), middle_px = 0.5 * (size_px - 1);
  return {size_px, size_px, f_px, f_px, middle_px, middle_px};
}

/// An elevation that is the same within 500 m of the world's origin.
inline std::shared_ptr<const Elevation> flat_ground(double height_m = 0.0) {
  return std::make_shared<Elevation>(1, 1, Eigen::Vector2d(-500.0, 500.0), Eigen::Vector2d(1000.0, 1000.0),
                                     std::vector<float>{static_cast<float>(height_m)});
}

}  // namespace situation_awareness
