// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/markers/polygon_markers.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include "make_marker.hpp"

namespace situation_awareness {
namespace {

using visualization_msgs::Marker;

constexpr double kLineWidth_m = 0.04;
constexpr double kBarWidth_m = 0.01;
/// Half the length of the shortest bar that is seen.
constexpr double kVisibleBar_m = 0.003;

const char* namespace_of(ChainState state) {
  switch (state) {
    case ChainState::kWall:
      return "wall";
    case ChainState::kKnown:
      return "known";
    case ChainState::kNew:
      return "new";
    case ChainState::kDoubted:
      return "doubted";
  }
  return "";
}

Marker edges_of(const std_msgs::Header& header, const Polygons& polygons, ChainState state) {
  Marker m = make_marker(header, namespace_of(state), 0, Marker::LINE_LIST, color_of(state), 1.0F);
  m.scale.x = kLineWidth_m;
  for (const Chain& chain : polygons.chains) {
    if (chain.state != state) continue;
    const std::size_t vertices = chain.vertices.size();
    for (std::size_t i = 0; i + 1 < vertices + (chain.closed ? 1 : 0); ++i) {
      m.points.push_back(make_point(chain.vertices[i].p_world_m, polygons.height_world_m));
      m.points.push_back(make_point(chain.vertices[(i + 1) % vertices].p_world_m, polygons.height_world_m));
    }
  }
  return m;
}

/// Across the boundary at a vertex: along the bisector of its edges.
Eigen::Vector2d across(const Chain& chain, std::size_t i) {
  const std::size_t vertices = chain.vertices.size();
  const Eigen::Vector2d& here_m = chain.vertices[i].p_world_m;
  Eigen::Vector2d along = Eigen::Vector2d::Zero();
  if (i > 0 || chain.closed)
    along += (here_m - chain.vertices[(i + vertices - 1) % vertices].p_world_m).stableNormalized();
  if (i + 1 < vertices || chain.closed)
    along += (chain.vertices[(i + 1) % vertices].p_world_m - here_m).stableNormalized();
  return Eigen::Vector2d(-along.y(), along.x()).stableNormalized();
}

Marker bars_of(const std_msgs::Header& header, const Polygons& polygons) {
  Marker m = make_marker(header, "uncertainty", 0, Marker::LINE_LIST, kUncertaintyColor, 0.8F);
  m.scale.x = kBarWidth_m;
  for (const Chain& chain : polygons.chains) {
    for (std::size_t i = 0; i < chain.vertices.size(); ++i) {
      const ChainVertex& vertex = chain.vertices[i];
      const Eigen::Vector2d bar_m = std::max(2.0 * vertex.sigma_m, kVisibleBar_m) * across(chain, i);
      m.points.push_back(make_point(vertex.p_world_m - bar_m, polygons.height_world_m));
      m.points.push_back(make_point(vertex.p_world_m + bar_m, polygons.height_world_m));
    }
  }
  return m;
}

Marker number_of_chain(const std_msgs::Header& header, const Chain& chain, double height_m) {
  // Of a corridor's wall it would be on the way of the vehicle if it were the mean of the vertices.
  const std::size_t middle = (chain.vertices.size() - 1) / 2;
  const Eigen::Vector2d p_m = 0.5 * (chain.vertices[middle].p_world_m + chain.vertices[middle + 1].p_world_m);
  return make_label(header, chain.id, std::to_string(chain.id), p_m, height_m + kBodyHeight_m);
}

}  // namespace

Color color_of(ChainState state) {
  switch (state) {
    case ChainState::kWall:
      return {0.3F, 0.3F, 0.3F};
    case ChainState::kKnown:
      return kStandingColor;
    case ChainState::kNew:
      return {0.15F, 0.65F, 0.3F};
    case ChainState::kDoubted:
      return {0.8F, 0.15F, 0.7F};
  }
  return kNoIdColor;
}

std::vector<visualization_msgs::Marker> markers_of(const Polygons& polygons, const std::string& world_frame) {
  const std_msgs::Header header = make_header(world_frame, polygons.stamp_ns);
  std::vector<Marker> markers;
  markers.reserve(polygons.chains.size() + 5);
  for (const ChainState state : {ChainState::kWall, ChainState::kKnown, ChainState::kNew, ChainState::kDoubted}) {
    Marker edges = edges_of(header, polygons, state);
    if (!edges.points.empty()) markers.push_back(std::move(edges));
  }
  for (const Chain& chain : polygons.chains) {
    markers.push_back(number_of_chain(header, chain, polygons.height_world_m));
  }
  Marker bars = bars_of(header, polygons);
  if (!bars.points.empty()) markers.push_back(std::move(bars));
  return markers;
}

}  // namespace situation_awareness
