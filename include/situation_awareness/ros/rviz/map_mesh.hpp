// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/ros/markers/colors.hpp"
#include "situation_awareness/ros/rviz/map_history.hpp"

namespace situation_awareness {

/// Style of a map.
struct MapStyle {
  enum class Coloring { kId, kMotion };

  Coloring coloring = Coloring::kId;
  double alpha = 0.6;  ///< of the bodies
  double body_height_m = 0.3;
  double history_s = 5.0;
  bool velocity = true;
  bool covariance = true;
};

struct Vertex {
  Eigen::Vector3f position_m;
  Color color;
  float alpha;
};

/// Triangles: three indices each.
struct Mesh {
  std::vector<Vertex> vertices;
  std::vector<std::uint32_t> indices;
};

/// A whole map as two meshes in its own frame, so that a renderer needs two calls for hundreds of elements. Translucent
/// triangles are in drawing order.
struct MapMesh {
  Mesh solid;        ///< outlines and velocities
  Mesh translucent;  ///< paths, bodies and 95 % ellipses of the centres
};

/// Draws the map: each element a body about the map's height, its outline (dashed where the element has not been seen
/// for half a second), an arrow from its edge for its motion in 1 s, if it moves, the 95 % ellipse of its centre, and
/// its path, which fades with age. `mesh` is the previous one: its memory is reused.
void draw(const Objects& map, const MapHistory& history, const MapStyle& style, MapMesh& mesh);

/// The colour of an element.
Color color_of(const Object& object, MapStyle::Coloring coloring);

/// Height of the top of the bodies.
inline double top_m(const Objects& map, const MapStyle& style) {
  return map.height_world_m + 0.5 * style.body_height_m;
}

}  // namespace situation_awareness
