// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/splinegons.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

void check_splinegon(bool truth, const char* sentence) {
  if (!truth) throw std::invalid_argument(sentence);
}

Splinegon splinegon_from_msg(const MappedSplinegon& msg) {
  check_splinegon(msg.id != 0, "a boundary has no id");
  const std::size_t vertices = msg.vertices.size();
  check_splinegon(vertices >= (msg.closed != 0 ? 4 : 3), "a boundary has too few vertices");
  check_splinegon(msg.bulge.size() == vertices, "a boundary has not one bulge for each vertex");
  check_splinegon(msg.sigma_m.size() == vertices, "a boundary has not one sigma_m for each vertex");
  check_splinegon(msg.corner.size() == vertices, "a boundary has not one corner for each vertex");
  Splinegon splinegon;
  splinegon.id = msg.id;
  splinegon.closed = msg.closed != 0;
  splinegon.vertices.reserve(vertices);
  for (std::size_t i = 0; i < vertices; ++i) {
    const geometry_msgs::Point& p = msg.vertices[i];
    check_splinegon(std::isfinite(p.x + p.y + p.z), "a vertex is not finite");
    check_splinegon(std::isfinite(msg.bulge[i]), "a bulge is not finite");
    check_splinegon(msg.sigma_m[i] >= 0.0 && std::isfinite(msg.sigma_m[i]), "a sigma_m is not a number >= 0");
    splinegon.vertices.push_back({{p.x, p.y}, msg.bulge[i], msg.sigma_m[i], msg.corner[i] != 0});
  }
  splinegon.first_seen_ns = to_nanoseconds(msg.first_seen);
  splinegon.last_seen_ns = to_nanoseconds(msg.last_seen);
  return splinegon;
}

}  // namespace

SplinegonArray splinegons_to_msg(const Splinegons& splinegons, const std::string& world_frame) {
  SplinegonArray msg;
  msg.header.stamp = to_ros_time(std::max<std::int64_t>(splinegons.stamp_ns, 0));
  msg.header.frame_id = world_frame;
  msg.splinegons.resize(splinegons.boundaries.size());
  for (std::size_t i = 0; i < splinegons.boundaries.size(); ++i) {
    const Splinegon& splinegon = splinegons.boundaries[i];
    MappedSplinegon& mapped = msg.splinegons[i];
    mapped.id = splinegon.id;
    mapped.closed = static_cast<std::uint8_t>(splinegon.closed);
    for (const SplinegonVertex& vertex : splinegon.vertices) {
      geometry_msgs::Point& p = mapped.vertices.emplace_back();
      p.x = vertex.p_world_m.x();
      p.y = vertex.p_world_m.y();
      p.z = splinegons.height_world_m;
      mapped.bulge.push_back(vertex.bulge);
      mapped.sigma_m.push_back(vertex.sigma_m);
      mapped.corner.push_back(static_cast<std::uint8_t>(vertex.corner));
    }
    // Loaded boundaries may have times before this clock's zero.
    mapped.first_seen = to_ros_time(std::max<std::int64_t>(splinegon.first_seen_ns, 0));
    mapped.last_seen = to_ros_time(std::max<std::int64_t>(splinegon.last_seen_ns, 0));
  }
  return msg;
}

Splinegons splinegons_from_msg(const SplinegonArray& msg) {
  Splinegons splinegons;
  splinegons.stamp_ns = to_nanoseconds(msg.header.stamp);
  splinegons.boundaries.reserve(msg.splinegons.size());
  std::vector<std::uint64_t> ids;
  ids.reserve(msg.splinegons.size());
  for (const MappedSplinegon& mapped : msg.splinegons) {
    splinegons.boundaries.push_back(splinegon_from_msg(mapped));
    ids.push_back(mapped.id);
  }
  std::sort(ids.begin(), ids.end());
  check_splinegon(std::adjacent_find(ids.begin(), ids.end()) == ids.end(), "an id is there twice");
  if (!msg.splinegons.empty()) splinegons.height_world_m = msg.splinegons.front().vertices.front().z;
  return splinegons;
}

}  // namespace situation_awareness
