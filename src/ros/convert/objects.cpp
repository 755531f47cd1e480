// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/objects.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

using RowMajor8d = Eigen::Matrix<double, 8, 8, Eigen::RowMajor>;

// The numbers of the message are those of the enumerations.
static_assert(static_cast<int>(Shape::kEllipse) == MappedObject::ELLIPSE);
static_assert(static_cast<int>(Shape::kBox) == MappedObject::BOX);
static_assert(static_cast<int>(Shape::kCompact) == MappedObject::COMPACT);
static_assert(static_cast<int>(ObjectClass::kUnknown) == MappedObject::UNKNOWN);
static_assert(static_cast<int>(ObjectClass::kPerson) == MappedObject::PERSON);
static_assert(static_cast<int>(ObjectClass::kVehicle) == MappedObject::VEHICLE);
static_assert(static_cast<int>(ObjectClass::kPole) == MappedObject::POLE);

void shape_to_msg(const Object& object, MappedObject& element) {
  element.shape = static_cast<std::uint8_t>(object.shape);
  element.p_shape = object.p_shape;
  element.object_class = static_cast<std::uint8_t>(object.object_class);
  element.p_class = object.p_class;
  if (object.shape != Shape::kBox) return;
  element.box.x = object.box_world.center_m.x();
  element.box.y = object.box_world.center_m.y();
  element.box.theta = object.box_world.psi_rad;
  element.box_length = 2.0 * object.box_world.half_length_m;
  element.box_width = 2.0 * object.box_world.half_width_m;
}

void shape_from_msg(const MappedObject& element, Object& object) {
  if (element.shape > MappedObject::COMPACT) throw std::invalid_argument("a shape is unknown");
  if (element.object_class > MappedObject::POLE) throw std::invalid_argument("a class is unknown");
  if (!std::isfinite(element.p_shape + element.p_class)) throw std::invalid_argument("an element is not finite");
  object.shape = static_cast<Shape>(element.shape);
  object.p_shape = element.p_shape;
  object.object_class = static_cast<ObjectClass>(element.object_class);
  object.p_class = element.p_class;
  if (object.shape != Shape::kBox) return;
  object.box_world = {
      {element.box.x, element.box.y}, element.box.theta, 0.5 * element.box_length, 0.5 * element.box_width};
  if (!object.box_world.center_m.allFinite() || !std::isfinite(object.box_world.psi_rad) ||
      !std::isfinite(element.box_length + element.box_width)) {
    throw std::invalid_argument("a box is not finite");
  }
  if (!(element.box_length > 0.0 && element.box_width > 0.0)) {
    throw std::invalid_argument("a side of a box is not positive");
  }
}

}  // namespace

MappedObjectArray objects_to_msg(const Objects& objects, const std::string& world_frame,
                                 const std::vector<std::string>& labels) {
  MappedObjectArray msg;
  msg.header.stamp = to_ros_time(objects.stamp_ns);
  msg.header.frame_id = world_frame;
  msg.objects.resize(objects.objects.size());
  for (std::size_t i = 0; i < objects.objects.size(); ++i) {
    const Object& object = objects.objects[i];
    MappedObject& element = msg.objects[i];
    element.id = object.id;
    if (i < labels.size()) element.label = labels[i];
    element.pose.position.x = object.ellipse_world.center_m.x();
    element.pose.position.y = object.ellipse_world.center_m.y();
    element.pose.position.z = objects.height_world_m;
    element.pose.orientation.z = std::sin(0.5 * object.ellipse_world.psi_rad);
    element.pose.orientation.w = std::cos(0.5 * object.ellipse_world.psi_rad);
    element.rx = object.ellipse_world.rx_m;
    element.ry = object.ellipse_world.ry_m;
    element.twist.linear.x = object.velocity_world_m_s.x();
    element.twist.linear.y = object.velocity_world_m_s.y();
    element.twist.angular.z = object.angular_velocity_rad_s;
    Eigen::Map<RowMajor8d>(element.covariance.data()) = object.covariance;
    shape_to_msg(object, element);
    element.p_moving = object.p_moving;
    element.p_exists = object.p_exists;
    // A loaded map may have times before this clock's zero.
    element.first_seen = to_ros_time(std::max<std::int64_t>(object.first_seen_ns, 0));
    element.last_seen = to_ros_time(std::max<std::int64_t>(object.last_seen_ns, 0));
    element.observations = static_cast<std::uint32_t>(object.observations);
    element.beams = static_cast<std::uint32_t>(object.beams);
  }
  return msg;
}

Objects objects_from_msg(const MappedObjectArray& msg) {
  Objects objects;
  objects.stamp_ns = to_nanoseconds(msg.header.stamp);
  if (!msg.objects.empty()) objects.height_world_m = msg.objects.front().pose.position.z;
  objects.objects.resize(msg.objects.size());
  for (std::size_t i = 0; i < msg.objects.size(); ++i) {
    const MappedObject& element = msg.objects[i];
    Object& object = objects.objects[i];
    object.id = element.id;
    object.ellipse_world.center_m = {element.pose.position.x, element.pose.position.y};
    object.ellipse_world.psi_rad = wrap_to_pi(2.0 * std::atan2(element.pose.orientation.z, element.pose.orientation.w));
    object.ellipse_world.rx_m = element.rx;
    object.ellipse_world.ry_m = element.ry;
    object.velocity_world_m_s = {element.twist.linear.x, element.twist.linear.y};
    object.angular_velocity_rad_s = element.twist.angular.z;
    object.covariance = Eigen::Map<const RowMajor8d>(element.covariance.data());
    shape_from_msg(element, object);
    object.p_moving = element.p_moving;
    object.p_exists = element.p_exists;
    object.first_seen_ns = to_nanoseconds(element.first_seen);
    object.last_seen_ns = to_nanoseconds(element.last_seen);
    object.observations = static_cast<int>(element.observations);
    object.beams = static_cast<int>(element.beams);
    const bool finite = object.ellipse_world.center_m.allFinite() && std::isfinite(object.ellipse_world.psi_rad) &&
                        object.velocity_world_m_s.allFinite() && std::isfinite(object.angular_velocity_rad_s) &&
                        std::isfinite(element.rx + element.ry) && object.covariance.allFinite();
    if (!finite) throw std::invalid_argument("an element is not finite");
    if (!(element.rx > 0.0 && element.ry > 0.0)) throw std::invalid_argument("a radius is not positive");
  }
  return objects;
}

}  // namespace situation_awareness
