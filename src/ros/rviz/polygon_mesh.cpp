// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/polygon_mesh.hpp"

#include <cstddef>
#include <string>

#include "situation_awareness/ros/markers/polygon_markers.hpp"

namespace situation_awareness {
namespace {

double top_of(const Polygons& map, const MapStyle& style) { return map.height_world_m + 0.5 * style.body_height_m; }

Polyline line_of(const Chain& chain) {
  Polyline line;
  line.reserve(chain.vertices.size() + 1);
  for (const ChainVertex& vertex : chain.vertices) line.push_back(vertex.p_world_m);
  if (chain.closed) line.push_back(line.front());
  return line;
}

/// The line moved by a multiple of sigma at each vertex.
Polyline beside(const Chain& chain, const Polyline& line, double sigmas) {
  Polyline moved = right_of(line, 1.0);
  for (std::size_t i = 0; i < line.size(); ++i) {
    const double sigma_m = chain.vertices[i % chain.vertices.size()].sigma_m;
    moved[i] = line[i] + sigmas * sigma_m * (moved[i] - line[i]);
  }
  return moved;
}

}  // namespace

void add(const Chain& chain, const Color& color, double height_m, const PolygonStyle& style, MapMesh& mesh) {
  const double top = height_m + 0.5 * style.body_height_m;
  const Polyline line = line_of(chain);
  const Polyline free_side = right_of(line, -style.line_m);  // which is on the left
  add_wall(mesh.translucent, line, free_side, top - style.body_height_m, top,
           {color, static_cast<float>(style.alpha * chain.p_exists)});
  add_band(mesh.solid, line, free_side, top, {shaded(color, 0.8), 1.0F});
  if (!style.uncertainty) return;
  add_band(mesh.translucent, beside(chain, line, -2.0), beside(chain, line, 2.0), top + kLayer_m,
           {kUncertaintyColor, 0.5F});
}

std::vector<MapLabel> labels_of(const Polygons& map, const MapStyle& style) {
  std::vector<MapLabel> labels;
  labels.reserve(map.chains.size());
  for (const Chain& chain : map.chains) {
    const std::size_t middle = (chain.vertices.size() - 1) / 2;
    const Eigen::Vector2d& from_m = chain.vertices[middle].p_world_m;
    const Eigen::Vector2d way_m = chain.vertices[middle + 1].p_world_m - from_m;
    const Eigen::Vector2d free_side = Eigen::Vector2d(-way_m.y(), way_m.x()).stableNormalized();
    const Eigen::Vector2d place_m = from_m + 0.5 * way_m + 0.6 * style.text_size_m * free_side;
    labels.push_back(
        {std::to_string(chain.id), Eigen::Vector3d(place_m.x(), place_m.y(), top_of(map, style) + 0.2).cast<float>()});
  }
  return labels;
}

}  // namespace situation_awareness
