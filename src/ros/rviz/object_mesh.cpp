// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/object_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/Geometry>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/markers/object_shapes.hpp"

namespace situation_awareness {
namespace {

constexpr double kUnseen_s = 0.5;  ///< an element unseen for longer is drawn as lost
constexpr double kMaxUncertainty_m = 1e3;
constexpr std::size_t kMaxSides = 48;
constexpr std::size_t kMinSides = 12;
constexpr std::size_t kSidesOfAll = 9600;  ///< bound on the sides of all bodies: with more elements each is coarser

/// Height of the top of the bodies.
double top_m(const Objects& map, const MapStyle& style) { return map.height_world_m + 0.5 * style.body_height_m; }

/// The closed outline of an ellipse whose semi-axes are longer by `wider_m`.
Polyline outline_of(const Ellipse& ellipse, std::size_t sides, double wider_m = 0.0) {
  Ellipse wider = ellipse;
  wider.rx_m += wider_m;
  wider.ry_m += wider_m;
  Polyline outline = points_on(wider, static_cast<int>(sides));
  outline.push_back(outline.front());
  return outline;
}

/// The closed outline of a box whose sides are farther out by `wider_m`, in steps for dashes.
Polyline outline_of(const Box& box, std::size_t sides, double wider_m) {
  Box wider = box;
  wider.half_length_m += wider_m;
  wider.half_width_m += wider_m;
  const auto corner = corners(wider);
  const std::size_t steps = sides / corner.size();
  Polyline outline;
  outline.reserve(corner.size() * steps + 1);
  for (std::size_t i = 0; i < corner.size(); ++i) {
    const Eigen::Vector2d side_m = corner[(i + 1) % corner.size()] - corner[i];
    for (std::size_t k = 0; k < steps; ++k) {
      outline.emplace_back(corner[i] + static_cast<double>(k) / static_cast<double>(steps) * side_m);
    }
  }
  outline.push_back(outline.front());
  return outline;
}

Polyline outline_of(const Object& object, std::size_t sides, double wider_m = 0.0) {
  if (object.shape == Shape::kBox) return outline_of(object.box_world, sides, wider_m);
  return outline_of(object.ellipse_world, sides, wider_m);
}

/// Distance of the outline from the centre along a unit vector.
double reach_m(const Object& object, const Eigen::Vector2d& direction) {
  if (object.shape != Shape::kBox) {
    return intersect_ray(object.ellipse_world, object.ellipse_world.center_m, direction).value_or(0.0);
  }
  const Box& box = object.box_world;
  const Eigen::Vector2d along = (Eigen::Rotation2Dd(-box.psi_rad) * direction).cwiseAbs();
  return 1.0 / std::max(along.x() / box.half_length_m, along.y() / box.half_width_m);
}

/// From the edge to the predicted edge in 1 s.
void add_velocity(Mesh& mesh, const Object& object, double z_m, const Paint& paint) {
  const Eigen::Vector2d ahead = object.velocity_world_m_s.normalized();
  add_arrow(mesh, object.ellipse_world.center_m + reach_m(object, ahead) * ahead, object.velocity_world_m_s, z_m,
            paint);
}

Color class_color(ObjectClass object_class) {
  switch (object_class) {
    case ObjectClass::kPerson:
      return kPersonColor;
    case ObjectClass::kVehicle:
      return kVehicleColor;
    case ObjectClass::kPole:
      return kPoleColor;
    case ObjectClass::kUnknown:
      break;
  }
  return kUnknownClassColor;
}

}  // namespace

Color color_of(const Object& object, ObjectStyle::Coloring coloring) {
  if (coloring == ObjectStyle::kId) return color_of(object.id);
  const bool by_motion = coloring == ObjectStyle::kMotion ||
                         (coloring == ObjectStyle::kClassOrMotion && object.object_class == ObjectClass::kUnknown);
  if (!by_motion) return class_color(object.object_class);
  return object.p_moving > 0.5 ? kMovingColor : kStandingColor;
}

void add(const Objects& map, const MapHistory& history, const ObjectStyle& style, MapMesh& mesh) {
  if (map.objects.empty()) return;
  const std::size_t sides = std::clamp(kSidesOfAll / map.objects.size(), kMinSides, kMaxSides);
  const double top = top_m(map, style);
  const double bottom = top - style.body_height_m;
  for (const Object& object : map.objects) {
    add_trail(mesh.translucent, history.path(object.id), map.stamp_ns, style.history_s, bottom - kLayer_m,
              shaded(color_of(object, style.coloring), 0.8));
  }
  for (const Object& object : map.objects) {
    const Color color = color_of(object, style.coloring);
    const Paint body{color, static_cast<float>(style.alpha * object.p_exists)};
    const Polyline outline = outline_of(object, sides);
    const Polyline outer = outline_of(object, sides, kLineWidth_m);
    add_wall(mesh.translucent, outline, outer, bottom, top, body);
    add_fan(mesh.translucent, object.ellipse_world.center_m, outline, top, body);

    const Paint line{shaded(color, 0.7), 1.0F};
    const bool unseen = seconds_between(object.last_seen_ns, map.stamp_ns) > kUnseen_s;
    add_band(mesh.solid, outline, outer, top + kLayer_m, line, unseen);
    if (style.velocity && moves(object)) add_velocity(mesh.solid, object, top + 2.0 * kLayer_m, line);
  }
  if (!style.covariance) return;
  for (const Object& object : map.objects) {
    Ellipse area = position_uncertainty(object);
    area.rx_m = std::min(area.rx_m, kMaxUncertainty_m);
    area.ry_m = std::min(area.ry_m, kMaxUncertainty_m);
    const double z_m = top + 3.0 * kLayer_m;
    const Polyline outline = outline_of(area, sides);
    add_fan(mesh.translucent, area.center_m, outline, z_m, {kUncertaintyColor, 0.3F});
    add_band(mesh.translucent, outline, outline_of(area, sides, 0.4 * kLineWidth_m), z_m, {kUncertaintyColor, 0.9F});
  }
}

std::vector<MapPosition> positions_of(const Objects& map) {
  std::vector<MapPosition> positions;
  positions.reserve(map.objects.size());
  for (const Object& object : map.objects) positions.push_back({object.id, object.ellipse_world.center_m});
  return positions;
}

std::vector<MapLabel> labels_of(const Objects& map, const MapStyle& style) {
  std::vector<MapLabel> labels;
  labels.reserve(map.objects.size());
  const double z_m = top_m(map, style) + 0.2;
  for (const Object& object : map.objects) {
    const Ellipse& ellipse = object.ellipse_world;
    const double aside_m =
        ellipse.ry_m < 0.6 * style.text_size_m ? -half_width_m(ellipse, {0.0, 1.0}) - style.text_size_m : 0.0;
    const Eigen::Vector2d place_m = ellipse.center_m + Eigen::Vector2d(0.0, aside_m);
    labels.push_back(
        {std::to_string(object.id) + class_text(object), Eigen::Vector3d(place_m.x(), place_m.y(), z_m).cast<float>()});
  }
  return labels;
}

}  // namespace situation_awareness
