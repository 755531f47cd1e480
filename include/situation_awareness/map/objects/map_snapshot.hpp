// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/map_fields.hpp"
#include "situation_awareness/map/objects/map_element.hpp"

namespace situation_awareness {

/// The state of an element.
template <>
struct NumbersOf<Vector8d> {
  template <class Self, class Visit>
  static void visit(Self& value, Visit&& visit) {
    constexpr std::array<const char*, 8> kNames = {"x_m",      "y_m",           "vx_m_s", "vy_m_s",
                                                   "wz_rad_s", "mean_radius_m", "p_m",    "q_m"};
    for (int i = 0; i < 8; ++i) visit(kNames[static_cast<std::size_t>(i)], value(i));
  }
};

/// The whole state of an ObjectMap after an update, sufficient to continue from it.
struct MapSnapshot {
  std::string world_frame;        ///< for users of the snapshot: the map itself has no names of frames
  std::string shape = "ellipse";  ///< ObjectMapParams::shape
  std::int64_t stamp_ns = 0;      ///< of the latest update
  double step_s = 0.0;            ///< time between the last two updates
  Pose2 T_world_level;            ///< of the latest update
  double height_world_m = 0.0;
  double noise = 1.0;                ///< noise factor: ratio of errors to those of the detections' covariances, squared
  std::uint64_t next_id = 1;         ///< id of the next new element: larger than all used before
  std::vector<MapElement> elements;  ///< by ascending id

  /// Every field but the elements, as MapElement::fields does (map/map_fields.hpp).
  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    using namespace map_bounds;
    visit("world_frame", self.world_frame);
    visit("shape", self.shape);
    visit("stamp_ns", self.stamp_ns, 0, kEnd_ns);
    visit("step_s", self.step_s, kDuration_s);
    visit("world_level", self.T_world_level, kState);
    visit("height_world_m", self.height_world_m, kState);
    visit("noise_factor", self.noise, kNoise);
    visit("next_id", self.next_id, 1, kMaxId);
  }

  /// Throws std::invalid_argument naming element and field if the snapshot is invalid: a number that is not finite or
  /// out of bounds, a covariance that is not symmetric and positive semidefinite, radii that are not positive, ids that
  /// are not ascending or not below `next_id`, a `body` without an element, a stamp after the latest update.
  /// `world_frame` may be empty.
  void validate() const;
};

}  // namespace situation_awareness
