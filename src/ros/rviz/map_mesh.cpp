// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/map_mesh.hpp"

#include <algorithm>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

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

}  // namespace

void clear(MapMesh& mesh) {
  for (Mesh* part : {&mesh.solid, &mesh.translucent}) {
    part->vertices.clear();
    part->indices.clear();
  }
}

Color shaded(const Color& color, double factor) {
  const auto f = static_cast<float>(factor);
  return {f * color.r, f * color.g, f * color.b};
}

Polyline right_of(const Polyline& line, double distance_m) {
  Polyline right;
  right.reserve(line.size());
  Eigen::Vector2d aside = -Eigen::Vector2d::UnitY();
  const bool closed = line.size() > 2 && line.front() == line.back();
  for (std::size_t i = 0; i < line.size(); ++i) {
    const std::size_t last = line.size() - 1;
    const Eigen::Vector2d& before = i > 0 ? line[i - 1] : closed ? line[last - 1] : line[i];
    const Eigen::Vector2d& after = i < last ? line[i + 1] : closed ? line[1] : line[i];
    const Eigen::Vector2d along = after - before;
    if (along.norm() > 0.0) aside = -left_of(along).normalized();
    right.push_back(line[i] + distance_m * aside);
  }
  return right;
}

void add_fan(Mesh& mesh, const Eigen::Vector2d& center_m, const Polyline& line, double z_m, const Paint& paint) {
  const std::uint32_t center = add(mesh, center_m, z_m, paint);
  for (std::size_t i = 0; i < line.size(); ++i) {
    const std::uint32_t edge = add(mesh, line[i], z_m, paint);
    if (i > 0) add_triangle(mesh, center, edge - 1, edge);
  }
}

void add_band(Mesh& mesh, const Polyline& inner, const Polyline& outer, double z_m, const Paint& paint, bool dashed) {
  for (std::size_t i = 0; i < inner.size(); ++i) {
    const std::uint32_t vertex = add(mesh, inner[i], z_m, paint);
    add(mesh, outer[i], z_m, paint);
    if (i > 0 && !(dashed && i % 3 == 0)) add_quad(mesh, vertex - 2);
  }
}

void add_wall(Mesh& mesh, const Polyline& line, const Polyline& outer, double bottom_m, double top_m,
              const Paint& paint) {
  const Eigen::Vector2d light = Eigen::Vector2d(-1.0, 2.0).normalized();
  for (std::size_t i = 0; i < line.size(); ++i) {
    const Eigen::Vector2d outwards = (outer[i] - line[i]).normalized();
    const Paint lit{shaded(paint.color, 0.65 + 0.25 * outwards.dot(light)), paint.alpha};
    const std::uint32_t low = add(mesh, line[i], bottom_m, lit);
    add(mesh, line[i], top_m, lit);
    if (i > 0) add_quad(mesh, low - 2);
  }
}

void add_arrow(Mesh& mesh, const Eigen::Vector2d& from_m, const Eigen::Vector2d& way_m, double z_m,
               const Paint& paint) {
  const double length_m = way_m.norm();
  const Eigen::Vector2d ahead = way_m / length_m;
  const Eigen::Vector2d aside = left_of(ahead);
  const double head_m = std::min(0.16, length_m);
  const double width_m = 0.6 * head_m;
  const Eigen::Vector2d tip_m = from_m + way_m;
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

void add_trail(Mesh& mesh, const std::deque<PathPoint>& path, std::int64_t stamp_ns, double length_s, double z_m,
               const Color& color) {
  if (path.size() < 2 || length_s <= 0.0) return;
  Polyline line;
  line.reserve(path.size());
  for (const PathPoint& point : path) line.push_back(point.position_m);
  const Polyline left = right_of(line, -0.75 * kLineWidth_m), right = right_of(line, 0.75 * kLineWidth_m);
  for (std::size_t i = 0; i < path.size(); ++i) {
    const double age = std::clamp(seconds_between(path[i].stamp_ns, stamp_ns) / length_s, 0.0, 1.0);
    const Paint paint{color, static_cast<float>(1.0 - age)};
    const std::uint32_t vertex = add(mesh, left[i], z_m, paint);
    add(mesh, right[i], z_m, paint);
    if (i > 0) add_quad(mesh, vertex - 2);
  }
}

}  // namespace situation_awareness
