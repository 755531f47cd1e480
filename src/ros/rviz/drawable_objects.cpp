// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/drawable_objects.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <unordered_set>

#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/rviz/map_mesh.hpp"

namespace situation_awareness {
namespace {

constexpr double kMaxRadius_m = 1e3;
constexpr double kMaxPosition_m = 1e5;  ///< a float has steps of 8 mm there
constexpr double kMaxSpeed_m_s = 1e3;
constexpr double kMaxVariance = 1e12;  ///< in any unit; its square does not overflow
constexpr double kTurnTolerance = 1e-3;

bool is_turn_about_z(const geometry_msgs::Quaternion& q) {
  const double norm = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  return std::abs(norm - 1.0) <= kTurnTolerance && std::hypot(q.x, q.y) <= kTurnTolerance;
}

bool is_probability(double p) { return p >= 0.0 && p <= 1.0; }

/// The element's error; empty if it is valid.
std::string fault(const MappedObject& element) {
  const auto finite = [](double number) { return std::isfinite(number); };
  const auto bounded = [](double variance) { return std::abs(variance) <= kMaxVariance; };
  const auto& p = element.pose.position;
  const auto& v = element.twist;
  if (!finite(p.x + p.y + p.z)) return "its position is not finite";
  if (!finite(v.linear.x + v.linear.y + v.angular.z)) return "its velocity is not finite";
  if (!std::all_of(element.covariance.begin(), element.covariance.end(), bounded)) {
    return "its covariance is not finite, or beyond 1e12";
  }
  if (!is_turn_about_z(element.pose.orientation)) return "its orientation is not a rotation about z";
  if (!is_probability(element.p_moving) || !is_probability(element.p_exists)) return "a probability is outside [0, 1]";
  for (const double radius_m : {element.rx, element.ry}) {
    if (!(radius_m > 0.0 && radius_m <= kMaxRadius_m)) return "a radius is outside (0, 1000] m";
  }
  if (std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) > kMaxPosition_m) return "it is beyond 100 km";
  if (std::hypot(v.linear.x, v.linear.y) > kMaxSpeed_m_s) return "it is faster than 1000 m/s";
  return "";
}

}  // namespace

DrawableObjects drawable_objects(const MappedObjectArray& msg) {
  std::unordered_set<std::uint64_t> ids;
  std::vector<std::string> names;
  for (const MappedObject& element : msg.objects) {
    std::string wrong = fault(element);
    if (!ids.insert(element.id).second) wrong = "its id appears twice";
    if (!wrong.empty()) throw std::invalid_argument("element " + std::to_string(element.id) + ": " + wrong);
    names.push_back(label_text(element.id, element.label));
  }
  return {objects_from_msg(msg), names};
}

}  // namespace situation_awareness
