// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/splinegons/splinegon_fit.hpp"

namespace situation_awareness {

/// Outlines of obstacles as dense polygons, counter-clockwise.
struct Outline {
  std::string name;
  std::vector<Eigen::Vector2d> points_m;
  std::size_t corners = 0;

  double area_m2() const {
    double sum_m2 = 0.0;
    for (std::size_t i = 0; i < points_m.size(); ++i) {
      const Eigen::Vector2d a = points_m[i], b = points_m[(i + 1) % points_m.size()];
      sum_m2 += 0.5 * (a.x() * b.y() - a.y() * b.x());
    }
    return sum_m2;
  }
};

inline Outline polar_outline(const std::string& name, const std::function<double(double)>& radius_m) {
  constexpr int kPoints = 20'000;
  Outline outline{name, {}};
  for (int i = 0; i < kPoints; ++i) {
    const double phi = 2.0 * kPi * i / kPoints;
    outline.points_m.emplace_back(radius_m(phi) * std::cos(phi), radius_m(phi) * std::sin(phi));
  }
  return outline;
}

inline Outline polygon_outline(const std::string& name, const std::vector<Eigen::Vector2d>& corners_m) {
  Outline outline{name, {}, corners_m.size()};
  for (std::size_t i = 0; i < corners_m.size(); ++i) {
    const Eigen::Vector2d from = corners_m[i], edge = corners_m[(i + 1) % corners_m.size()] - from;
    const int steps = static_cast<int>(std::ceil(edge.norm() / 0.003));
    for (int k = 0; k < steps; ++k) outline.points_m.emplace_back(from + edge * k / steps);
  }
  return outline;
}

inline Outline ellipse_outline() {
  return polar_outline("ellipse",
                       [](double phi) { return 60.0 / std::hypot(6.0 * std::cos(phi), 10.0 * std::sin(phi)); });
}

inline Outline box_outline() { return polygon_outline("box", {{-6.0, -3.5}, {6.0, -3.5}, {6.0, 3.5}, {-6.0, 3.5}}); }

/// The kidney's pocket is 3 m deep.
inline std::vector<Outline> smooth_outlines() {
  return {ellipse_outline(), polar_outline("peanut", [](double phi) { return 7.0 + 3.0 * std::cos(2.0 * phi); }),
          polar_outline("kidney",
                        [](double phi) {
                          const double from_pocket = wrap_to_pi(phi) / 0.5;
                          return 8.0 - 3.0 * std::exp(-from_pocket * from_pocket);
                        }),
          polar_outline("lobes", [](double phi) { return 7.5 + 2.0 * std::cos(3.0 * phi); })};
}

inline std::vector<Outline> cornered_outlines() {
  return {box_outline(),
          polygon_outline("L", {{-6.0, -5.0}, {6.0, -5.0}, {6.0, 0.0}, {0.0, 0.0}, {0.0, 5.0}, {-6.0, 5.0}})};
}

/// Elements of the outline from one part of its length to another, `spacing_m` apart on average, with noise across it.
inline std::vector<SplinegonElement> elements_of(const Outline& outline, double spacing_m, double sigma_m,
                                                 Random& random, double from = 0.0, double to = 1.0) {
  const auto point = [&](std::size_t i) { return outline.points_m[i % outline.points_m.size()]; };
  double length_m = 0.0;
  for (std::size_t i = 0; i < outline.points_m.size(); ++i) length_m += (point(i + 1) - point(i)).norm();
  std::vector<SplinegonElement> elements;
  double way_m = 0.0, next_m = from * length_m + random.uniform() * spacing_m;
  for (std::size_t i = 0; way_m < to * length_m; ++i) {
    const Eigen::Vector2d edge = point(i + 1) - point(i);
    const double edge_m = edge.norm();
    for (; next_m < std::min(way_m + edge_m, to * length_m); next_m += spacing_m * random.uniform(0.7, 1.3)) {
      const Eigen::Vector2d along = edge / edge_m, normal(along.y(), -along.x());
      elements.push_back(
          {point(i) + (next_m - way_m) * along + sigma_m * random.normal() * normal, normal, sigma_m * sigma_m});
    }
    way_m += edge_m;
  }
  return elements;
}

/// The greatest distance of either from the other.
inline double hausdorff_m(const Outline& outline, const Splinegon& splinegon) {
  double greatest_m = 0.0;
  for (std::size_t i = 0; i < outline.points_m.size(); i += 10) {
    greatest_m = std::max(greatest_m, distance_m(splinegon, outline.points_m[i]));
  }
  for (const SplinegonPoint& point : sampled(splinegon, 0.1)) {
    double least_m2 = 1e9;
    for (std::size_t i = 0; i < outline.points_m.size(); i += 3) {
      least_m2 = std::min(least_m2, (outline.points_m[i] - point.p_world_m).squaredNorm());
    }
    greatest_m = std::max(greatest_m, std::sqrt(least_m2));
  }
  return greatest_m;
}

}  // namespace situation_awareness
