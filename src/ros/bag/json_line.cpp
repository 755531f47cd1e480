// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/json_line.hpp"

#include <array>
#include <cmath>
#include <cstdio>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

std::string json_line(std::int64_t stamp_ns, const Json& rest) {
  std::array<char, 40> stamp{};
  std::snprintf(stamp.data(), stamp.size(), "%lld.%09lld", static_cast<long long>(stamp_ns / kNanosecondsPerSecond),
                static_cast<long long>(stamp_ns % kNanosecondsPerSecond));
  std::string line = rest.dump();
  line.replace(0, 1, std::string("{\"stamp\":") + stamp.data() + ",");
  return line += '\n';
}

Json json_of_pose(const Eigen::Isometry3d& T_world_base, const Eigen::Matrix<double, 6, 6>& covariance) {
  Json pose = Json::object();
  const Eigen::Matrix3d& R = T_world_base.linear();
  pose["x"] = finite(T_world_base.translation().x());
  pose["y"] = finite(T_world_base.translation().y());
  pose["z"] = finite(T_world_base.translation().z());
  pose["roll"] = finite(std::atan2(R(2, 1), R(2, 2)));
  pose["pitch"] = finite(std::atan2(-R(2, 0), std::hypot(R(2, 1), R(2, 2))));
  pose["yaw"] = finite(std::atan2(R(1, 0), R(0, 0)));
  pose["covariance"] = list_of(36, [&](int i) { return covariance(i / 6, i % 6); });
  return pose;
}

}  // namespace situation_awareness
