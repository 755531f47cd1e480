// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/geometry/parse_pose2.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

namespace situation_awareness {

Pose2 parse_pose2(const std::string& text, const std::string& source) {
  std::istringstream stream(text);
  Pose2 pose;
  char comma[2] = {};
  stream >> pose.translation_m.x() >> comma[0] >> pose.translation_m.y() >> comma[1] >> pose.yaw_rad;
  const bool is_pose =
      stream && comma[0] == ',' && comma[1] == ',' && stream.peek() == std::istringstream::traits_type::eof();
  if (!is_pose || !std::isfinite(pose.translation_m.sum() + pose.yaw_rad)) {
    throw std::invalid_argument(source + ": " + text + " is not X,Y,YAW in m and rad");
  }
  return pose;
}

}  // namespace situation_awareness
