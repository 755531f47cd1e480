// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

/// A vertex of a chain, with the standard deviation of the boundary there, across it, and at an open end along it, too:
/// absolute, the pose's error included.
struct ChainVertex {
  Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
  double sigma_m = 0.0;
};

/// What a chain is to who drives past it.
enum class ChainState : std::uint8_t {
  kWall,     ///< larger than an object, and there for long
  kKnown,    ///< there since before the present transit, or for long
  kNew,      ///< first seen a short time ago
  kDoubted,  ///< beams passed a part of it: it is about to be removed, there or as a whole
};

/// The boundary of a standing thing, or of several that touch, as far as it was seen. Its free side lies to the left
/// of the way from a vertex to the next: seen from there, the vertices go from right to left.
struct Chain {
  std::uint64_t id = 0;               ///< never used twice
  bool closed = false;                ///< an edge leads from the last vertex to the first
  std::vector<ChainVertex> vertices;  ///< two at least
  std::int64_t first_seen_ns = 0;     ///< stamps of scans that hit it
  std::int64_t last_seen_ns = 0;
  double p_exists = 0.0;  ///< probability, of its least certain part
  ChainState state = ChainState::kNew;
};

/// As `to = from`, with room for some more vertices where there was too little: a chain that is copied again and again
/// stops allocating though its vertices come and go.
inline void copy_with_room(const Chain& from, Chain& to) {
  constexpr std::size_t kMore = 4;
  const std::size_t size = from.vertices.size();
  if (to.vertices.capacity() < size) to.vertices.reserve(size + size / 2 + kMore);
  to = from;
}

/// All standing things, walls included.
struct Polygons {
  std::int64_t stamp_ns = 0;
  std::vector<Chain> chains;
  double height_world_m = 0.0;  ///< of the plane that they are in
};

}  // namespace situation_awareness
