// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/local_world.hpp"

#include <cmath>

#include <GeographicLib/LocalCartesian.hpp>

namespace situation_awareness {

bool is_valid(const GeodeticPosition& position) {
  return std::abs(position.latitude_deg) <= 90.0 && std::abs(position.longitude_deg) <= 360.0 &&
         std::isfinite(position.altitude_m);
}

Eigen::Vector3d local_position(const GeodeticPosition& origin, const GeodeticPosition& position) {
  const GeographicLib::LocalCartesian world(origin.latitude_deg, origin.longitude_deg, origin.altitude_m);
  Eigen::Vector3d p_world_m;
  world.Forward(position.latitude_deg, position.longitude_deg, position.altitude_m, p_world_m.x(), p_world_m.y(),
                p_world_m.z());
  return p_world_m;
}

GeodeticPosition geodetic_position(const GeodeticPosition& origin, const Eigen::Vector3d& p_world_m) {
  const GeographicLib::LocalCartesian world(origin.latitude_deg, origin.longitude_deg, origin.altitude_m);
  GeodeticPosition position;
  world.Reverse(p_world_m.x(), p_world_m.y(), p_world_m.z(), position.latitude_deg, position.longitude_deg,
                position.altitude_m);
  return position;
}

}  // namespace situation_awareness
