// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/multirotor.hpp"

#include <cmath>

namespace situation_awareness {
namespace {

/// A unit vector along some vector, and its time derivative.
struct Direction {
  Eigen::Vector3d unit;
  Eigen::Vector3d rate;
};

Direction direction(const Eigen::Vector3d& vector, const Eigen::Vector3d& vector_rate) {
  const double length = vector.norm();
  const Eigen::Vector3d unit = vector / length;
  return {unit, (vector_rate - unit * unit.dot(vector_rate)) / length};
}

}  // namespace

RobotState multirotor_state(const PathState& path, double drag_1_s) {
  // Thrust per mass and its rate, from m a = thrust - m g e_z - m drag v.
  const Eigen::Vector3d thrust =
      path.acceleration_m_s2 + kGravity_m_s2 * Eigen::Vector3d::UnitZ() + drag_1_s * path.velocity_m_s;
  const Eigen::Vector3d thrust_rate = path.jerk_m_s3 + drag_1_s * path.acceleration_m_s2;
  const Direction z = direction(thrust, thrust_rate);

  // x is perpendicular to z and to the horizontal vector `left`, 90 deg left of the heading.
  const Eigen::Vector3d ahead(std::cos(path.yaw_rad), std::sin(path.yaw_rad), 0.0);
  const Eigen::Vector3d left(-ahead.y(), ahead.x(), 0.0);
  const Eigen::Vector3d left_rate = -path.yaw_rate_rad_s * ahead;
  const Direction x = direction(left.cross(z.unit), left_rate.cross(z.unit) + left.cross(z.rate));

  const Direction y = {z.unit.cross(x.unit), z.rate.cross(x.unit) + z.unit.cross(x.rate)};

  RobotState robot;
  robot.T_world_robot.linear() << x.unit, y.unit, z.unit;
  robot.T_world_robot.translation() = path.position_m;
  robot.velocity_world_m_s = path.velocity_m_s;
  // R' = R [w]x: each component of w is the rate at which one axis rotates towards the next.
  robot.angular_velocity_robot_rad_s << z.unit.dot(y.rate), x.unit.dot(z.rate), y.unit.dot(x.rate);
  return robot;
}

}  // namespace situation_awareness
