// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/large_obstacles.hpp"

#include <cstddef>
#include <variant>

namespace situation_awareness {
namespace {

/// As the boundary of an obstacle: the free side of a polyline is to its left, that of a boundary to its right. A joint
/// is in the middle of each line.
void set_outline(const PolylineShape& shape, Splinegon& outline) {
  outline.closed = shape.closed;
  outline.vertices.clear();
  const std::size_t count = shape.vertices.size();
  for (std::size_t i = count; i-- > 0;) {
    const ChainVertex& from = shape.vertices[i];
    outline.vertices.push_back({from.p_world_m, 0.0, from.sigma_m, true});
    if (i == 0 && !shape.closed) break;
    const ChainVertex& to = shape.vertices[i > 0 ? i - 1 : count - 1];
    outline.vertices.push_back({0.5 * (from.p_world_m + to.p_world_m), 0.0, 0.5 * (from.sigma_m + to.sigma_m), false});
  }
}

void set_outline(const ArcShape& shape, Splinegon& outline) {
  outline.closed = shape.closed;
  outline.vertices.assign(shape.vertices.begin(), shape.vertices.end());
}

}  // namespace

std::vector<Splinegon> outlines_of_large_obstacles(const Map& map, double min_extent_m, std::vector<Splinegon> memory) {
  std::size_t count = 0;
  const auto add = [&](const Feature& feature, const auto& shape) {
    if (memory.size() == count) memory.emplace_back();
    Splinegon& outline = memory[count++];
    outline.id = feature.id;
    outline.first_seen_ns = feature.first_seen_ns;
    outline.last_seen_ns = feature.last_seen_ns;
    set_outline(shape, outline);
  };
  for (const Feature& feature : map.features) {
    if (const auto* const arcs = std::get_if<ArcShape>(&feature.shape)) add(feature, *arcs);
    const auto* const lines = std::get_if<PolylineShape>(&feature.shape);
    if (lines != nullptr && box_around(feature.shape).diagonal().norm() >= min_extent_m) add(feature, *lines);
  }
  memory.resize(count);
  return memory;
}

}  // namespace situation_awareness
