// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/map_mesh.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/ros/markers/object_shapes.hpp"

namespace situation_awareness {
namespace {

constexpr double kLine_m = 0.03;   ///< width of outlines and paths
constexpr double kLayer_m = 0.01;  ///< between what lies on top of one another
constexpr double kUnseen_s = 0.5;  ///< from then on an element is remembered rather than seen
constexpr double kMaxUncertainty_m = 1e3;
constexpr std::size_t kMaxSides = 48;
constexpr std::size_t kMinSides = 12;
constexpr std::size_t kSidesOfAll = 9600;  ///< the more elements, the coarser each: what is drawn stays bounded

struct Paint {
  Color color;
  float alpha;
};

Color shaded(const Color& color, double factor) {
  const auto f = static_cast<float>(factor);
  return {f * color.r, f * color.g, f * color.b};
}

std::uint32_t add(Mesh& mesh, const Eigen::Vector2d& p_m, double z_m, const Paint& paint) {
  mesh.vertices.push_back({Eigen::Vector3d(p_m.x(), p_m.y(), z_m).cast<float>(), paint.color, paint.alpha});
  return static_cast<std::uint32_t>(mesh.vertices.size() - 1);
}

void add_triangle(Mesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  mesh.indices.insert(mesh.indices.end(), {a, b, c});
}

/// The four vertices from `first` on as two triangles: a pair, and the pair after it.
void add_quad(Mesh& mesh, std::uint32_t first) {
  add_triangle(mesh, first, first + 1, first + 2);
  add_triangle(mesh, first + 2, first + 1, first + 3);
}

/// The point of the curve at the eccentric angle of side i, on an ellipse whose semi-axes are longer by `wider_m`.
Eigen::Vector2d point_of(const Ellipse& ellipse, std::size_t i, std::size_t sides, double wider_m = 0.0) {
  const double angle_rad = 2.0 * kPi * static_cast<double>(i % sides) / static_cast<double>(sides);
  const Eigen::Vector2d own_m((ellipse.rx_m + wider_m) * std::cos(angle_rad),
                              (ellipse.ry_m + wider_m) * std::sin(angle_rad));
  return ellipse.center_m + Eigen::Rotation2Dd(ellipse.psi_rad) * own_m;
}

void add_disc(Mesh& mesh, const Ellipse& ellipse, double z_m, const Paint& paint, std::size_t sides) {
  const std::uint32_t center = add(mesh, ellipse.center_m, z_m, paint);
  for (std::size_t i = 0; i <= sides; ++i) {
    const std::uint32_t edge = add(mesh, point_of(ellipse, i, sides), z_m, paint);
    if (i > 0) add_triangle(mesh, center, edge - 1, edge);
  }
}

/// The side wall, lit from one direction so that it looks round.
void add_wall(Mesh& mesh, const Ellipse& ellipse, double bottom_m, double top_m, const Paint& paint,
              std::size_t sides) {
  const Eigen::Vector2d light = Eigen::Vector2d(-1.0, 2.0).normalized();
  for (std::size_t i = 0; i <= sides; ++i) {
    const Eigen::Vector2d edge_m = point_of(ellipse, i, sides);
    const Eigen::Vector2d outwards = (point_of(ellipse, i, sides, kLine_m) - edge_m).normalized();
    const Paint lit{shaded(paint.color, 0.65 + 0.25 * outwards.dot(light)), paint.alpha};
    const std::uint32_t low = add(mesh, edge_m, bottom_m, lit);
    add(mesh, edge_m, top_m, lit);
    if (i > 0) add_quad(mesh, low - 2);
  }
}

void add_ring(Mesh& mesh, const Ellipse& ellipse, double z_m, double width_m, const Paint& paint, std::size_t sides,
              bool dashed) {
  for (std::size_t i = 0; i <= sides; ++i) {
    const std::uint32_t inner = add(mesh, point_of(ellipse, i, sides), z_m, paint);
    add(mesh, point_of(ellipse, i, sides, width_m), z_m, paint);
    if (i > 0 && !(dashed && i % 3 == 0)) add_quad(mesh, inner - 2);
  }
}

void add_arrow(Mesh& mesh, const Object& object, double z_m, const Paint& paint) {
  const double speed_m_s = object.velocity_world_m_s.norm();
  const Eigen::Vector2d ahead = object.velocity_world_m_s / speed_m_s;
  const Eigen::Vector2d aside(-ahead.y(), ahead.x());
  const Ellipse& ellipse = object.ellipse_world;
  const Eigen::Vector2d start_m = intersect_ray(ellipse, ellipse.center_m, ahead).value_or(0.0) * ahead;
  const double head_m = std::min(0.16, speed_m_s);
  const double width_m = 0.6 * head_m;
  const Eigen::Vector2d from_m = ellipse.center_m + start_m;
  const Eigen::Vector2d tip_m = from_m + object.velocity_world_m_s;
  const Eigen::Vector2d neck_m = tip_m - head_m * ahead;
  const std::uint32_t shaft = add(mesh, from_m - 0.3 * width_m * aside, z_m, paint);
  add(mesh, from_m + 0.3 * width_m * aside, z_m, paint);
  add(mesh, neck_m - 0.3 * width_m * aside, z_m, paint);
  add(mesh, neck_m + 0.3 * width_m * aside, z_m, paint);
  add_quad(mesh, shaft);
  const std::uint32_t head = add(mesh, neck_m - width_m * aside, z_m, paint);
  add(mesh, neck_m + width_m * aside, z_m, paint);
  add(mesh, tip_m, z_m, paint);
  add_triangle(mesh, head, head + 1, head + 2);
}

/// A ribbon that fades from where the element is now, at `stamp_ns`, to nothing at `length_s` before.
void add_path(Mesh& mesh, const std::deque<PathPoint>& path, std::int64_t stamp_ns, double length_s, double z_m,
              const Color& color) {
  if (path.size() < 2 || length_s <= 0.0) return;
  Eigen::Vector2d aside = Eigen::Vector2d::UnitY();
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Eigen::Vector2d& p_m = path[i].position_world_m;
    const Eigen::Vector2d along_m =
        path[std::min(i + 1, path.size() - 1)].position_world_m - path[i == 0 ? 0 : i - 1].position_world_m;
    if (along_m.norm() > 0.0) aside = Eigen::Vector2d(-along_m.y(), along_m.x()).normalized();
    const double age = std::clamp(seconds_between(path[i].stamp_ns, stamp_ns) / length_s, 0.0, 1.0);
    const Paint paint{color, static_cast<float>(1.0 - age)};
    const std::uint32_t left = add(mesh, p_m + 0.75 * kLine_m * aside, z_m, paint);
    add(mesh, p_m - 0.75 * kLine_m * aside, z_m, paint);
    if (i > 0) add_quad(mesh, left - 2);
  }
}

}  // namespace

Color color_of(const Object& object, MapStyle::Coloring coloring) {
  if (coloring == MapStyle::Coloring::kId) return color_of(object.id);
  return object.p_moving > 0.5 ? kMovingColor : kStandingColor;
}

void draw(const Objects& map, const MapHistory& history, const MapStyle& style, MapMesh& mesh) {
  for (Mesh* part : {&mesh.solid, &mesh.translucent}) {
    part->vertices.clear();
    part->indices.clear();
  }
  if (map.objects.empty()) return;
  const std::size_t sides = std::clamp(kSidesOfAll / map.objects.size(), kMinSides, kMaxSides);
  const double top = top_m(map, style);
  const double bottom = top - style.body_height_m;
  for (const Object& object : map.objects) {
    add_path(mesh.translucent, history.path(object.id), map.stamp_ns, style.history_s, bottom - kLayer_m,
             shaded(color_of(object, style.coloring), 0.8));
  }
  for (const Object& object : map.objects) {
    const Color color = color_of(object, style.coloring);
    const Paint body{color, static_cast<float>(style.alpha * object.p_exists)};
    add_wall(mesh.translucent, object.ellipse_world, bottom, top, body, sides);
    add_disc(mesh.translucent, object.ellipse_world, top, body, sides);

    const Paint line{shaded(color, 0.7), 1.0F};
    const bool unseen = seconds_between(object.last_seen_ns, map.stamp_ns) > kUnseen_s;
    add_ring(mesh.solid, object.ellipse_world, top + kLayer_m, kLine_m, line, sides, unseen);
    if (style.velocity && moves(object)) add_arrow(mesh.solid, object, top + 2.0 * kLayer_m, line);
  }
  if (!style.covariance) return;
  for (const Object& object : map.objects) {
    Ellipse area = position_uncertainty(object);
    area.rx_m = std::min(area.rx_m, kMaxUncertainty_m);
    area.ry_m = std::min(area.ry_m, kMaxUncertainty_m);
    const double z_m = top + 3.0 * kLayer_m;
    add_disc(mesh.translucent, area, z_m, {kUncertaintyColor, 0.3F}, sides);
    add_ring(mesh.translucent, area, z_m, 0.4 * kLine_m, {kUncertaintyColor, 0.9F}, sides, false);
  }
}

}  // namespace situation_awareness
