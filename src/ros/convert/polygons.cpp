// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/polygons.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

// The message has the same constants.
static_assert(static_cast<int>(ChainState::kWall) == MappedPolygon::WALL);
static_assert(static_cast<int>(ChainState::kKnown) == MappedPolygon::KNOWN);
static_assert(static_cast<int>(ChainState::kNew) == MappedPolygon::NEW);
static_assert(static_cast<int>(ChainState::kDoubted) == MappedPolygon::DOUBTED);

void check_polygon(bool truth, const char* sentence) {
  if (!truth) throw std::invalid_argument(sentence);
}

Chain chain_from_msg(const MappedPolygon& msg) {
  check_polygon(msg.id != 0, "a chain has no id");
  check_polygon(msg.vertices.size() >= 2, "a chain has fewer than two vertices");
  check_polygon(msg.sigma_m.size() == msg.vertices.size(), "a chain has not one sigma_m for each vertex");
  check_polygon(msg.p_exists >= 0.0 && msg.p_exists <= 1.0, "a probability is outside [0, 1]");
  check_polygon(msg.state <= MappedPolygon::DOUBTED, "a state is unknown");
  Chain chain;
  chain.id = msg.id;
  chain.closed = msg.closed != 0;
  chain.vertices.reserve(msg.vertices.size());
  for (std::size_t i = 0; i < msg.vertices.size(); ++i) {
    const geometry_msgs::Point& p = msg.vertices[i];
    check_polygon(std::isfinite(p.x + p.y + p.z), "a vertex is not finite");
    check_polygon(msg.sigma_m[i] > 0.0 && std::isfinite(msg.sigma_m[i]), "a sigma_m is not a number > 0");
    chain.vertices.push_back({{p.x, p.y}, msg.sigma_m[i]});
  }
  chain.first_seen_ns = to_nanoseconds(msg.first_seen);
  chain.last_seen_ns = to_nanoseconds(msg.last_seen);
  chain.p_exists = msg.p_exists;
  chain.state = static_cast<ChainState>(msg.state);
  return chain;
}

}  // namespace

PolygonArray polygons_to_msg(const Polygons& polygons, const std::string& world_frame) {
  PolygonArray msg;
  msg.header.stamp = to_ros_time(polygons.stamp_ns);
  msg.header.frame_id = world_frame;
  msg.polygons.resize(polygons.chains.size());
  for (std::size_t i = 0; i < polygons.chains.size(); ++i) {
    const Chain& chain = polygons.chains[i];
    MappedPolygon& polygon = msg.polygons[i];
    polygon.id = chain.id;
    polygon.closed = static_cast<std::uint8_t>(chain.closed);
    polygon.vertices.resize(chain.vertices.size());
    polygon.sigma_m.resize(chain.vertices.size());
    for (std::size_t k = 0; k < chain.vertices.size(); ++k) {
      polygon.vertices[k].x = chain.vertices[k].p_world_m.x();
      polygon.vertices[k].y = chain.vertices[k].p_world_m.y();
      polygon.vertices[k].z = polygons.height_world_m;
      polygon.sigma_m[k] = chain.vertices[k].sigma_m;
    }
    // A loaded map may have times before this clock's zero.
    polygon.first_seen = to_ros_time(std::max<std::int64_t>(chain.first_seen_ns, 0));
    polygon.last_seen = to_ros_time(std::max<std::int64_t>(chain.last_seen_ns, 0));
    polygon.p_exists = chain.p_exists;
    polygon.state = static_cast<std::uint8_t>(chain.state);
  }
  return msg;
}

Polygons polygons_from_msg(const PolygonArray& msg) {
  Polygons polygons;
  polygons.stamp_ns = to_nanoseconds(msg.header.stamp);
  polygons.chains.reserve(msg.polygons.size());
  std::vector<std::uint64_t> ids;
  ids.reserve(msg.polygons.size());
  for (const MappedPolygon& polygon : msg.polygons) {
    polygons.chains.push_back(chain_from_msg(polygon));
    ids.push_back(polygon.id);
  }
  std::sort(ids.begin(), ids.end());
  check_polygon(std::adjacent_find(ids.begin(), ids.end()) == ids.end(), "an id is there twice");
  if (!msg.polygons.empty()) polygons.height_world_m = msg.polygons.front().vertices.front().z;
  return polygons;
}

}  // namespace situation_awareness
