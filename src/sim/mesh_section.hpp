// SPDX-License-Identifier: BSD-3-Clause
// Outlines of meshes. Private to sim/.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

struct TriangleMesh {
  std::vector<Eigen::Vector3d> vertices_m;
  std::vector<std::array<int, 3>> triangles;  ///< indices of vertices
};

/// The section of a closed mesh by the horizontal plane at half its height: its corners, counter-clockwise. Throws
/// std::invalid_argument saying why there is none, or more than one.
std::vector<Eigen::Vector2d> section_at_half_height(const TriangleMesh& mesh);

}  // namespace situation_awareness
