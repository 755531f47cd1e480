// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/ros/markers/colors.hpp"
#include "situation_awareness/ros/rviz/map_history.hpp"

namespace situation_awareness {

// Meshes and labels of a map, in its frame, z up.

constexpr double kLineWidth_m = 0.03;  ///< of outlines
constexpr double kLayer_m = 0.01;      ///< distance between overlapping layers
constexpr double kLabelHeight_m = 0.26;

/// How features of any kind are drawn.
struct MapStyle {
  double alpha = 0.6;  ///< of the bodies
  double body_height_m = 0.3;
  double history_s = 5.0;
  double text_size_m = kLabelHeight_m;
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

/// A whole map as two meshes, so that a renderer needs two calls for hundreds of elements. Translucent triangles are in
/// drawing order.
struct MapMesh {
  Mesh solid;
  Mesh translucent;
};

/// Empties the meshes; their memory is reused.
void clear(MapMesh& mesh);

struct MapLabel {
  std::string text;
  Eigen::Vector3f position_m;
};

struct Paint {
  Color color;
  float alpha;
};

Color shaded(const Color& color, double factor);

/// The points of a line from one end to the other; of a closed one, the last is the first.
using Polyline = std::vector<Eigen::Vector2d>;

/// The points of `line` moved to the right of its direction, at each point by `distance_m` across its neighbours'
/// chord.
Polyline right_of(const Polyline& line, double distance_m);

/// The triangles between a point and a line around it.
void add_fan(Mesh& mesh, const Eigen::Vector2d& center_m, const Polyline& line, double z_m, const Paint& paint);

/// The band between two lines of as many points; every third part is left out of a dashed one.
void add_band(Mesh& mesh, const Polyline& inner, const Polyline& outer, double z_m, const Paint& paint,
              bool dashed = false);

/// The vertical wall above a line, lit from one direction; `outer` has the points of the line moved outwards.
void add_wall(Mesh& mesh, const Polyline& line, const Polyline& outer, double bottom_m, double top_m,
              const Paint& paint);

/// `way_m` is from the shaft's end to the tip; not zero.
void add_arrow(Mesh& mesh, const Eigen::Vector2d& from_m, const Eigen::Vector2d& way_m, double z_m, const Paint& paint);

/// A ribbon along a path, which fades from the position at `stamp_ns` to nothing at `length_s` before.
void add_trail(Mesh& mesh, const std::deque<PathPoint>& path, std::int64_t stamp_ns, double length_s, double z_m,
               const Color& color);

}  // namespace situation_awareness
