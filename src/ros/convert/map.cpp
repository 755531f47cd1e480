// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/map.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

using FeatureMatrix8d = Eigen::Matrix<double, 8, 8, Eigen::RowMajor>;
using FeatureMatrix2d = Eigen::Matrix<double, 2, 2, Eigen::RowMajor>;

// The numbers of the messages are those of the enumerations.
static_assert(static_cast<int>(ObjectClass::kUnknown) == MapFeature::UNKNOWN);
static_assert(static_cast<int>(ObjectClass::kPerson) == MapFeature::PERSON);
static_assert(static_cast<int>(ObjectClass::kVehicle) == MapFeature::VEHICLE);
static_assert(static_cast<int>(ObjectClass::kPole) == MapFeature::POLE);
static_assert(static_cast<int>(Motion::kMoving) == MapFeature::MOVING);
static_assert(static_cast<int>(Motion::kStanding) == MapFeature::STANDING);
static_assert(static_cast<int>(Motion::kFixed) == MapFeature::FIXED);
static_assert(static_cast<int>(GoneReason::kLeft) == GoneFeature::LEFT);
static_assert(static_cast<int>(GoneReason::kSeenThrough) == GoneFeature::SEEN_THROUGH);
static_assert(static_cast<int>(GoneReason::kMerged) == GoneFeature::MERGED);
static_assert(static_cast<int>(GoneReason::kForgotten) == GoneFeature::FORGOTTEN);

void check_feature(bool truth, const char* sentence) {
  if (!truth) throw std::invalid_argument(sentence);
}

bool is_probability(double p) { return p >= 0.0 && p <= 1.0; }

/// A map that was loaded may have times before this clock's zero.
ros::Time time_or_zero(std::int64_t stamp_ns) { return to_ros_time(std::max<std::int64_t>(stamp_ns, 0)); }

std::optional<std::int64_t> known_time(const ros::Time& time) {
  if (time.isZero()) return std::nullopt;
  return to_nanoseconds(time);
}

geometry_msgs::Point point_of(const Eigen::Vector2d& p_m, double z_m) {
  geometry_msgs::Point point;
  point.x = p_m.x();
  point.y = p_m.y();
  point.z = z_m;
  return point;
}

struct ShapeToMsg {
  MapFeature& msg;
  double height_world_m;

  void operator()(const EllipseShape& shape) const {
    msg.kind = MapFeature::ELLIPSE;
    const Ellipse& ellipse = shape.ellipse_world;
    set_body(ellipse.center_m, ellipse.psi_rad, ellipse.rx_m, ellipse.ry_m, shape.body);
  }
  void operator()(const BoxShape& shape) const {
    msg.kind = MapFeature::BOX;
    const Box& box = shape.box_world;
    set_body(box.center_m, box.psi_rad, box.half_length_m, box.half_width_m, shape.body);
  }
  void operator()(const PolylineShape& shape) const {
    msg.kind = MapFeature::POLYLINE;
    msg.closed = static_cast<std::uint8_t>(shape.closed);
    set_vertices(shape.vertices);
  }
  void operator()(const ArcShape& shape) const {
    msg.kind = MapFeature::BOUNDARY;
    msg.closed = static_cast<std::uint8_t>(shape.closed);
    set_vertices(shape.vertices);
    for (const SplinegonVertex& vertex : shape.vertices) {
      msg.bulge.push_back(vertex.bulge);
      msg.corner.push_back(static_cast<std::uint8_t>(vertex.corner));
    }
  }
  void operator()(const FootprintShape& shape) const {
    msg.kind = MapFeature::TARGET;
    msg.center = point_of(shape.p_world_m.head<2>(), shape.p_world_m.z());
    msg.area = shape.area_m2;
    msg.covariance.resize(4);
    Eigen::Map<FeatureMatrix2d>(msg.covariance.data()) = shape.covariance_m2;
  }

 private:
  void set_body(const Eigen::Vector2d& center_m, double psi_rad, double rx_m, double ry_m,
                const BodyState& body) const {
    msg.center = point_of(center_m, height_world_m);
    msg.psi = psi_rad;
    msg.rx = rx_m;
    msg.ry = ry_m;
    msg.twist.x = body.velocity_world_m_s.x();
    msg.twist.y = body.velocity_world_m_s.y();
    msg.twist.z = body.angular_velocity_rad_s;
    msg.covariance.resize(64);
    Eigen::Map<FeatureMatrix8d>(msg.covariance.data()) = body.covariance;
  }
  template <class Vertices>
  void set_vertices(const Vertices& vertices) const {
    msg.outline.reserve(vertices.size());
    msg.sigma.reserve(vertices.size());
    for (const auto& vertex : vertices) {
      msg.outline.push_back(point_of(vertex.p_world_m, height_world_m));
      msg.sigma.push_back(vertex.sigma_m);
    }
  }
};

MapFeature feature_to_msg(const Feature& feature, double height_world_m) {
  MapFeature msg;
  msg.id = feature.id;
  msg.object_class = static_cast<std::uint8_t>(feature.object_class);
  msg.p_class = feature.p_class;
  msg.p_exists = feature.p_exists;
  msg.p_moving = feature.p_moving;
  msg.motion = static_cast<std::uint8_t>(feature.motion);
  const Sensors& by = feature.seen_by;
  msg.seen_by = static_cast<std::uint8_t>((by.scan ? MapFeature::SCAN : 0) | (by.cloud ? MapFeature::CLOUD : 0) |
                                          (by.camera ? MapFeature::CAMERA : 0) | (by.robot ? MapFeature::ROBOT : 0) |
                                          (by.file ? MapFeature::FILE : 0));
  msg.first_seen = time_or_zero(feature.first_seen_ns);
  msg.last_seen = time_or_zero(feature.last_seen_ns);
  if (feature.last_absent_ns) msg.last_absent = time_or_zero(*feature.last_absent_ns);
  if (feature.first_absent_ns) msg.first_absent = time_or_zero(*feature.first_absent_ns);
  std::visit(ShapeToMsg{msg, height_world_m}, feature.shape);
  return msg;
}

BodyState body_from_msg(const MapFeature& msg) {
  check_feature(msg.covariance.size() == 64, "a covariance has not 64 numbers");
  check_feature(msg.rx > 0.0 && msg.ry > 0.0 && std::isfinite(msg.rx + msg.ry), "an extent is not a number > 0");
  check_feature(std::isfinite(msg.center.x + msg.center.y + msg.psi), "a place is not finite");
  BodyState body;
  body.velocity_world_m_s = {msg.twist.x, msg.twist.y};
  body.angular_velocity_rad_s = msg.twist.z;
  body.covariance = Eigen::Map<const FeatureMatrix8d>(msg.covariance.data());
  check_feature(body.velocity_world_m_s.allFinite() && std::isfinite(body.angular_velocity_rad_s),
                "a velocity is not finite");
  check_feature(body.covariance.allFinite(), "a covariance is not finite");
  return body;
}

/// The vertices of an outline, with what lines and arcs have both.
template <class Vertex>
std::vector<Vertex> vertices_from_msg(const MapFeature& msg) {
  check_feature(msg.sigma.size() == msg.outline.size(), "an outline has not one sigma for each vertex");
  std::vector<Vertex> vertices(msg.outline.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const geometry_msgs::Point& p = msg.outline[i];
    check_feature(std::isfinite(p.x + p.y + p.z), "a vertex is not finite");
    check_feature(msg.sigma[i] >= 0.0 && std::isfinite(msg.sigma[i]), "a sigma is not a number >= 0");
    vertices[i].p_world_m = {p.x, p.y};
    vertices[i].sigma_m = msg.sigma[i];
  }
  return vertices;
}

FeatureShape arcs_from_msg(const MapFeature& msg) {
  ArcShape shape;
  shape.closed = msg.closed != 0;
  shape.vertices = vertices_from_msg<SplinegonVertex>(msg);
  check_feature(shape.vertices.size() >= (shape.closed ? 4 : 3), "a boundary has too few vertices");
  check_feature(msg.bulge.size() == shape.vertices.size(), "a boundary has not one bulge for each vertex");
  check_feature(msg.corner.size() == shape.vertices.size(), "a boundary has not one corner for each vertex");
  for (std::size_t i = 0; i < shape.vertices.size(); ++i) {
    check_feature(std::isfinite(msg.bulge[i]), "a bulge is not finite");
    shape.vertices[i].bulge = msg.bulge[i];
    shape.vertices[i].corner = msg.corner[i] != 0;
  }
  return shape;
}

FeatureShape shape_from_msg(const MapFeature& msg) {
  switch (msg.kind) {
    case MapFeature::ELLIPSE:
      return EllipseShape{{{msg.center.x, msg.center.y}, msg.psi, msg.rx, msg.ry}, body_from_msg(msg)};
    case MapFeature::BOX:
      return BoxShape{{{msg.center.x, msg.center.y}, msg.psi, msg.rx, msg.ry}, body_from_msg(msg)};
    case MapFeature::POLYLINE: {
      PolylineShape shape{vertices_from_msg<ChainVertex>(msg), msg.closed != 0};
      check_feature(shape.vertices.size() >= 2, "a polyline has fewer than two vertices");
      return shape;
    }
    case MapFeature::BOUNDARY:
      return arcs_from_msg(msg);
    case MapFeature::TARGET: {
      check_feature(msg.covariance.size() == 4, "the covariance of a target has not 4 numbers");
      FootprintShape shape;
      shape.p_world_m = {msg.center.x, msg.center.y, msg.center.z};
      shape.covariance_m2 = Eigen::Map<const FeatureMatrix2d>(msg.covariance.data());
      shape.area_m2 = msg.area;
      check_feature(shape.p_world_m.allFinite() && shape.covariance_m2.allFinite() && std::isfinite(shape.area_m2),
                    "a target is not finite");
      check_feature(shape.area_m2 >= 0.0, "an area is negative");
      return shape;
    }
    default:
      throw std::invalid_argument("a kind is unknown");
  }
}

Feature feature_from_msg(const MapFeature& msg) {
  check_feature(msg.id != 0, "a feature has no id");
  check_feature(msg.object_class <= MapFeature::POLE, "a class is unknown");
  check_feature(msg.motion <= MapFeature::FIXED, "a motion is unknown");
  check_feature(is_probability(msg.p_class) && is_probability(msg.p_exists) && is_probability(msg.p_moving),
                "a probability is outside [0, 1]");
  Feature feature;
  feature.id = msg.id;
  feature.object_class = static_cast<ObjectClass>(msg.object_class);
  feature.p_class = msg.p_class;
  feature.p_exists = msg.p_exists;
  feature.p_moving = msg.p_moving;
  feature.motion = static_cast<Motion>(msg.motion);
  feature.first_seen_ns = to_nanoseconds(msg.first_seen);
  feature.last_seen_ns = to_nanoseconds(msg.last_seen);
  feature.last_absent_ns = known_time(msg.last_absent);
  feature.first_absent_ns = known_time(msg.first_absent);
  const auto has = [&](int bit) { return (msg.seen_by & bit) != 0; };
  feature.seen_by = {has(MapFeature::SCAN), has(MapFeature::CLOUD), has(MapFeature::CAMERA), has(MapFeature::ROBOT),
                     has(MapFeature::FILE)};
  feature.shape = shape_from_msg(msg);
  return feature;
}

Gone gone_from_msg(const GoneFeature& msg) {
  check_feature(msg.id != 0, "a feature that is gone has no id");
  check_feature(msg.reason <= GoneFeature::FORGOTTEN, "a reason is unknown");
  check_feature((msg.reason == GoneFeature::MERGED) == (msg.into != 0),
                "a merged feature, and no other, is in another");
  Gone gone;
  gone.id = msg.id;
  gone.reason = static_cast<GoneReason>(msg.reason);
  if (msg.into != 0) gone.into = msg.into;
  return gone;
}

template <class Elements>
void check_ascending(const Elements& elements) {
  const auto is_not_before = [](const auto& a, const auto& b) { return a.id >= b.id; };
  check_feature(std::adjacent_find(elements.begin(), elements.end(), is_not_before) == elements.end(),
                "ids do not ascend");
}

}  // namespace

MapUpdate map_delta_to_msg(const MapDelta& delta, const std::string& uuid, const std::string& world_frame) {
  MapUpdate msg;
  msg.header.stamp = time_or_zero(delta.stamp_ns);
  msg.header.frame_id = world_frame;
  msg.map = uuid;
  msg.base = delta.base;
  msg.version = delta.version;
  msg.full = static_cast<std::uint8_t>(delta.full);
  msg.height = delta.height_world_m;
  msg.objects_stamp = time_or_zero(delta.objects_stamp_ns);
  msg.changed.reserve(delta.changed.size());
  for (const Feature& feature : delta.changed) msg.changed.push_back(feature_to_msg(feature, delta.height_world_m));
  msg.gone = gone_to_msg(delta.gone);
  return msg;
}

std::vector<GoneFeature> gone_to_msg(const std::vector<Gone>& gone) {
  std::vector<GoneFeature> msgs(gone.size());
  for (std::size_t i = 0; i < gone.size(); ++i) {
    msgs[i].id = gone[i].id;
    msgs[i].reason = static_cast<std::uint8_t>(gone[i].reason);
    msgs[i].into = gone[i].into.value_or(0);
  }
  return msgs;
}

MapDelta map_delta_from_msg(const MapUpdate& msg) {
  check_feature(!msg.map.empty(), "the map has no UUID");
  check_feature(std::isfinite(msg.height), "the height is not finite");
  MapDelta delta;
  delta.stamp_ns = to_nanoseconds(msg.header.stamp);
  delta.objects_stamp_ns = to_nanoseconds(msg.objects_stamp);
  delta.map = std::hash<std::string>()(msg.map);
  delta.base = msg.base;
  delta.version = msg.version;
  delta.full = msg.full != 0;
  delta.height_world_m = msg.height;
  delta.changed.reserve(msg.changed.size());
  for (const MapFeature& feature : msg.changed) delta.changed.push_back(feature_from_msg(feature));
  for (const GoneFeature& gone : msg.gone) delta.gone.push_back(gone_from_msg(gone));
  check_ascending(delta.changed);
  check_ascending(delta.gone);
  return delta;
}

}  // namespace situation_awareness
