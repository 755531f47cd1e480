// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/drawable_objects.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <unordered_set>
#include <utility>

#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/markers/object_shapes.hpp"
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

bool is_size(double size_m) { return size_m > 0.0 && size_m <= kMaxRadius_m; }

bool is_beyond(double x_m, double y_m) { return std::max(std::abs(x_m), std::abs(y_m)) > kMaxPosition_m; }

/// The error of the element's shape or class; empty if there is none.
std::string fault_of_shape(const MappedObject& element) {
  if (element.shape > MappedObject::COMPACT) return "its shape is unknown";
  if (element.object_class > MappedObject::POLE) return "its class is unknown";
  if (!is_probability(element.p_shape) || !is_probability(element.p_class)) return "a probability is outside [0, 1]";
  if (element.shape != MappedObject::BOX) return "";
  const geometry_msgs::Pose2D& pose = element.box;
  if (!std::isfinite(pose.x + pose.y + pose.theta)) return "its box is not finite";
  if (is_beyond(pose.x, pose.y)) return "its box is beyond 100 km";
  if (!is_size(0.5 * element.box_length) || !is_size(0.5 * element.box_width)) {
    return "half a side of its box is outside (0, 1000] m";
  }
  return "";
}

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
  if (!is_size(element.rx) || !is_size(element.ry)) return "a radius is outside (0, 1000] m";
  if (is_beyond(p.x, p.y) || std::abs(p.z) > kMaxPosition_m) return "it is beyond 100 km";
  if (std::hypot(v.linear.x, v.linear.y) > kMaxSpeed_m_s) return "it is faster than 1000 m/s";
  return fault_of_shape(element);
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
  DrawableObjects result{objects_from_msg(msg), std::move(names)};
  for (std::size_t i = 0; i < result.names.size(); ++i) result.names[i] += class_text(result.objects.objects[i]);
  return result;
}

}  // namespace situation_awareness
