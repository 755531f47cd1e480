// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/local_world.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include <GeographicLib/LocalCartesian.hpp>

namespace situation_awareness {

bool is_valid(const GeodeticPosition& position) {
  return std::abs(position.latitude_deg) <= 90.0 && std::abs(position.longitude_deg) <= 360.0 &&
         std::isfinite(position.altitude_m);
}

GeodeticPosition parse_geodetic_position(const std::string& text, const std::string& source) {
  std::istringstream stream(text);
  GeodeticPosition position;
  char comma[2] = {};
  stream >> position.latitude_deg >> comma[0] >> position.longitude_deg >> comma[1] >> position.altitude_m;
  const bool is_position =
      stream && comma[0] == ',' && comma[1] == ',' && stream.peek() == std::istringstream::traits_type::eof();
  if (!is_position || !is_valid(position)) {
    throw std::invalid_argument(source + ": " + text +
                                " is not LAT,LON,ALT in degrees north and east and m above the ellipsoid");
  }
  return position;
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
