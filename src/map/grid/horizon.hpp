// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "seen_row.hpp"
#include "situation_awareness/map/grid/elevation.hpp"

namespace situation_awareness {

/// Which ground and how much above it the camera sees past nearer ground: the steepest sight line so far, outwards.
class Horizon {
 public:
  Horizon(const Elevation& elevation, double reach_m, double step_m, double class_height_m);

  void set_elevation(const Elevation& elevation) { elevation_ = &elevation; }

  /// Begins the horizon of a camera at another place.
  void begin(const Eigen::Vector3d& p_world_camera_m);

  /// The steepest slope of the ground before a point, given from the camera on, but for the point's own surroundings.
  double slope_before(const Eigen::Vector2d& away_m, double range_m) {
    return static_cast<double>(ground_slopes_[place_before(away_m, range_m, kOwn_m)]);
  }

  /// Writes the slope before each cell of a row that is in the image to SeenRow::hidden_below_m.
  void find_slopes_before(double y_m, SeenRow& row);

  /// The steepest slope of the tops of what may stand on the ground before a point, but for what is as near to the
  /// point as its own size.
  double top_slope_before(const Eigen::Vector2d& away_m, double range_m, double size_m) {
    return static_cast<double>(top_slopes_[place_before(away_m, range_m, size_m)]);
  }

 private:
  static constexpr int kDirections = 2048;
  static constexpr double kOwn_m = 1.5;

  std::size_t place_before(const Eigen::Vector2d& away_m, double range_m, double own_m);

  /// The index of the slopes up to a ring in a direction, which is marched to it; before the first ring there is none.
  std::size_t place_of(int direction, int ring) {
    const int last = std::min(ring, rings_ - 1);
    if (last >= marched_[static_cast<std::size_t>(direction)]) march(direction, last);
    return first_place(direction) + static_cast<std::size_t>(std::max(last + 1, 0));
  }

  std::size_t first_place(int direction) const {
    return static_cast<std::size_t>(direction) * static_cast<std::size_t>(rings_ + 1);
  }

  /// Goes on in a direction to a ring, or a few more.
  void march(int direction, int to_ring);

  /// The steepest slopes up to where a direction was marched.
  struct Steepest {
    double ground = -1e6, top = -1e6;
  };

  const Elevation* elevation_;
  Eigen::Vector3d p_ = Eigen::Vector3d::Zero();
  double rings_per_m_;
  int rings_;
  std::vector<std::int32_t> marched_;              ///< rings, by direction
  std::vector<Steepest> steepest_;                 ///< by direction
  std::vector<float> ground_slopes_, top_slopes_;  ///< by direction and ring; before the first ring there is none
  std::vector<double> rings_m_;                    ///< from the camera, to the rings' middles
  std::vector<double> per_ring_m_;                 ///< 1 by each of these
  std::vector<double> class_slopes_;               ///< that the class's height adds there
};

}  // namespace situation_awareness
