// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/bodies.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

std::vector<Body> bodies_of(const std::vector<std::string>& names) {
  std::vector<Body> bodies;
  std::map<std::string, std::size_t> place_of;  // of the bodies with parts
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::size_t slash = names[i].rfind('/');
    if (slash == std::string::npos) {
      bodies.push_back({names[i], {i}});
      continue;
    }
    const auto [place, is_new] = place_of.emplace(names[i].substr(0, slash), bodies.size());
    if (is_new) bodies.push_back({place->first, {}});
    bodies[place->second].parts.push_back(i);
  }
  return bodies;
}

bool within_reach(const std::vector<Ellipse>& ellipses, const Eigen::Vector2d& point_m, double margin_m) {
  constexpr int kDirections = 360;
  for (int i = 0; i < kDirections; ++i) {
    const double angle_rad = 2.0 * kPi * i / kDirections;
    const Eigen::Vector2d n(std::cos(angle_rad), std::sin(angle_rad));
    double reach_m = -std::numeric_limits<double>::infinity();
    for (const Ellipse& ellipse : ellipses) {
      reach_m = std::max(reach_m, n.dot(ellipse.center_m) + half_width_m(ellipse, n));
    }
    if (n.dot(point_m) > reach_m + margin_m) return false;
  }
  return true;
}

int separate_parts(const Body& body, const Segments& segments, const std::vector<int>& object_of_beam, int min_points) {
  std::set<int> owners;
  for (const Segment& segment : segments.segments) {
    std::map<int, int> points_of;
    for (std::size_t i = segment.first; i < segment.first + segment.count; ++i) {
      ++points_of[object_of_beam[static_cast<std::size_t>(segments.points[i].beam)]];
    }
    const auto owner = std::max_element(points_of.begin(), points_of.end(),
                                        [](const auto& a, const auto& b) { return a.second < b.second; });
    if (owner != points_of.end() && owner->second >= min_points) owners.insert(owner->first);
  }
  return static_cast<int>(std::count_if(body.parts.begin(), body.parts.end(),
                                        [&](std::size_t part) { return owners.count(static_cast<int>(part)) != 0; }));
}

}  // namespace situation_awareness
