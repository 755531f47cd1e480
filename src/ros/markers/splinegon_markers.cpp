// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/markers/splinegon_markers.hpp"

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "make_marker.hpp"

namespace situation_awareness {
namespace {

using visualization_msgs::Marker;

constexpr Color kClosedColor{0.12F, 0.42F, 0.82F};
constexpr Color kOpenColor{0.15F, 0.65F, 0.3F};
constexpr Color kEnvelopeColor{1.0F, 0.85F, 0.62F};  // opaque, since its pieces overlap where the boundary bends

constexpr double kBoundaryWidth_m = 0.2;
constexpr double kVertex_m = 0.5;
constexpr double kJoint_m = 0.25;
/// Between points along a boundary: half a metre of an arc of 5 m is 6 mm off its chord.
constexpr double kSpacing_m = 0.5;
constexpr double kLabelHeight_m = 2.0;
/// Below the boundary, so that it is seen on it from above.
constexpr double kEnvelopeBelow_m = 0.1;

Marker boundaries_of(const std_msgs::Header& header, const Splinegons& splinegons, bool closed) {
  Marker m =
      make_marker(header, closed ? "closed" : "open", 0, Marker::LINE_LIST, closed ? kClosedColor : kOpenColor, 1.0F);
  m.scale.x = kBoundaryWidth_m;
  for (const Splinegon& splinegon : splinegons.boundaries) {
    if (splinegon.closed != closed) continue;
    const std::vector<SplinegonPoint> points = sampled(splinegon, kSpacing_m);
    for (std::size_t i = 0; i + 1 < points.size() + (closed ? 1 : 0); ++i) {
      m.points.push_back(make_point(points[i].p_world_m, splinegons.height_world_m));
      m.points.push_back(make_point(points[(i + 1) % points.size()].p_world_m, splinegons.height_world_m));
    }
  }
  return m;
}

/// Counter-clockwise: from behind it would be black.
void add_triangle(const Eigen::Vector2d& a_m, const Eigen::Vector2d& b_m, const Eigen::Vector2d& c_m, double z_m,
                  Marker& m) {
  const Eigen::Vector2d ab_m = b_m - a_m, ac_m = c_m - a_m;
  const bool is_left = ab_m.x() * ac_m.y() - ab_m.y() * ac_m.x() >= 0.0;
  m.points.push_back(make_point(a_m, z_m));
  m.points.push_back(make_point(is_left ? b_m : c_m, z_m));
  m.points.push_back(make_point(is_left ? c_m : b_m, z_m));
}

Marker envelopes_of(const std_msgs::Header& header, const Splinegons& splinegons) {
  Marker m = make_marker(header, "envelope", 0, Marker::TRIANGLE_LIST, kEnvelopeColor, 1.0F);
  m.scale.x = m.scale.y = m.scale.z = 1.0;
  const double z_m = splinegons.height_world_m - kEnvelopeBelow_m;
  for (const Splinegon& splinegon : splinegons.boundaries) {
    const SplinegonEnvelope envelope = envelope_of(splinegon, kSpacing_m);
    const std::size_t samples = envelope.free_side_world_m.size();
    for (std::size_t i = 0; i + 1 < samples + (splinegon.closed ? 1 : 0); ++i) {
      const std::size_t next = (i + 1) % samples;
      add_triangle(envelope.free_side_world_m[i], envelope.free_side_world_m[next],
                   envelope.obstacle_side_world_m[next], z_m, m);
      add_triangle(envelope.free_side_world_m[i], envelope.obstacle_side_world_m[next],
                   envelope.obstacle_side_world_m[i], z_m, m);
    }
  }
  return m;
}

Marker vertices_of(const std_msgs::Header& header, const Splinegons& splinegons, bool joints) {
  Marker m = make_marker(header, "vertices", joints ? 1 : 0, Marker::SPHERE_LIST, kInkColor, joints ? 0.5F : 1.0F);
  m.scale.x = m.scale.y = m.scale.z = joints ? kJoint_m : kVertex_m;
  for (const Splinegon& splinegon : splinegons.boundaries) {
    for (std::size_t i = joints ? 1 : 0; i < splinegon.vertices.size(); i += 2) {
      m.points.push_back(make_point(splinegon.vertices[i].p_world_m, splinegons.height_world_m));
    }
  }
  return m;
}

}  // namespace

std::vector<visualization_msgs::Marker> markers_of(const Splinegons& splinegons, const std::string& world_frame) {
  const std_msgs::Header header = make_header(world_frame, splinegons.stamp_ns);
  std::vector<Marker> markers;
  const auto add = [&markers](Marker marker) {
    if (!marker.points.empty()) markers.push_back(std::move(marker));
  };
  add(envelopes_of(header, splinegons));
  for (const bool closed : {true, false}) add(boundaries_of(header, splinegons, closed));
  for (const bool joints : {true, false}) add(vertices_of(header, splinegons, joints));
  for (const Splinegon& splinegon : splinegons.boundaries) {
    markers.push_back(make_label(header, splinegon.id, std::to_string(splinegon.id),
                                 splinegon.vertices.front().p_world_m, splinegons.height_world_m + 1.0));
    markers.back().scale.z = kLabelHeight_m;
  }
  return markers;
}

}  // namespace situation_awareness
