// SPDX-License-Identifier: BSD-3-Clause
#include "mesh_section.hpp"

#include <algorithm>
#include <map>
#include <stdexcept>
#include <tuple>
#include <utility>

#include <boost/geometry.hpp>
#include <boost/geometry/geometries/point_xy.hpp>
#include <boost/geometry/geometries/ring.hpp>

namespace situation_awareness {
namespace {

using Point = boost::geometry::model::d2::point_xy<double>;
using Ring = boost::geometry::model::ring<Point, /*clockwise=*/false, /*closed=*/true>;

/// Tolerance of collinear corners: vertices of meshes are floats.
constexpr double kStraight_m = 1e-6;

/// An edge of the mesh by its vertices, the one above the plane first.
using Edge = std::pair<int, int>;

/// For each vertex the first one at the same position: files repeat vertices with several normals or colours.
std::vector<int> unique_vertices(const std::vector<Eigen::Vector3d>& vertices_m) {
  std::map<std::tuple<double, double, double>, int> first;
  std::vector<int> unique;
  for (std::size_t i = 0; i < vertices_m.size(); ++i) {
    const Eigen::Vector3d& p = vertices_m[i];
    unique.push_back(first.emplace(std::make_tuple(p.x(), p.y(), p.z()), static_cast<int>(i)).first->second);
  }
  return unique;
}

/// The triangles that cross the plane, each from its descending to its ascending edge. Neighbours share an edge, which
/// is ascending in one of them and descending in the other.
std::map<Edge, Edge> crossings(const TriangleMesh& mesh, double height_m) {
  const std::vector<int> unique = unique_vertices(mesh.vertices_m);
  const auto is_above = [&](int vertex) { return mesh.vertices_m[static_cast<std::size_t>(vertex)].z() >= height_m; };
  std::map<Edge, Edge> next;
  for (const std::array<int, 3>& triangle : mesh.triangles) {
    Edge climbed{-1, -1}, descended{-1, -1};
    for (std::size_t i = 0; i < 3; ++i) {
      const int a = unique[static_cast<std::size_t>(triangle[i])];
      const int b = unique[static_cast<std::size_t>(triangle[(i + 1) % 3])];
      if (is_above(a) == is_above(b)) continue;
      (is_above(b) ? climbed : descended) = is_above(b) ? Edge{b, a} : Edge{a, b};
    }
    if (climbed.first >= 0 && !next.emplace(descended, climbed).second) {
      throw std::invalid_argument("has a mesh whose triangles are not all turned the same way");
    }
  }
  return next;
}

Point crossing(const TriangleMesh& mesh, const Edge& edge, double height_m) {
  const Eigen::Vector3d& a = mesh.vertices_m[static_cast<std::size_t>(edge.first)];
  const Eigen::Vector3d& b = mesh.vertices_m[static_cast<std::size_t>(edge.second)];
  const Eigen::Vector3d p = a + (height_m - a.z()) / (b.z() - a.z()) * (b - a);
  return {p.x(), p.y()};
}

/// The ring without its first corner if that is on a straight line: simplifying keeps a ring's ends.
Ring starting_at_a_corner(Ring ring) {
  const auto farthest = std::max_element(ring.begin(), ring.end() - 1, [&](const Point& a, const Point& b) {
    return boost::geometry::distance(a, ring.front()) < boost::geometry::distance(b, ring.front());
  });
  ring.pop_back();
  std::rotate(ring.begin(), farthest, ring.end());
  ring.push_back(ring.front());
  return ring;
}

}  // namespace

std::vector<Eigen::Vector2d> section_at_half_height(const TriangleMesh& mesh) {
  const auto [lowest, highest] =
      std::minmax_element(mesh.vertices_m.begin(), mesh.vertices_m.end(),
                          [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return a.z() < b.z(); });
  if (lowest == mesh.vertices_m.end() || !(highest->z() > lowest->z())) {
    throw std::invalid_argument("has a mesh without height");
  }
  const double height_m = 0.5 * (lowest->z() + highest->z());
  std::map<Edge, Edge> next = crossings(mesh, height_m);
  if (next.empty()) throw std::invalid_argument("has a mesh without triangles at half its height");

  Ring ring;
  const Edge start = next.begin()->first;
  for (Edge edge = start; ring.empty() || edge != start;) {
    ring.push_back(crossing(mesh, edge, height_m));
    const auto step = next.find(edge);
    if (step == next.end()) throw std::invalid_argument("has a mesh that is not closed at half its height");
    edge = step->second;
    next.erase(step);
  }
  if (!next.empty()) throw std::invalid_argument("has a mesh of several outlines at half its height");
  ring.push_back(ring.front());
  boost::geometry::correct(ring);

  Ring corners;
  boost::geometry::simplify(starting_at_a_corner(ring), corners, kStraight_m);
  if (!boost::geometry::is_valid(corners)) throw std::invalid_argument("has a mesh whose outline crosses itself");
  std::vector<Eigen::Vector2d> section_m;
  for (std::size_t i = 0; i + 1 < corners.size(); ++i) section_m.emplace_back(corners[i].x(), corners[i].y());
  return section_m;
}

}  // namespace situation_awareness
