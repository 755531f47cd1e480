// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
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

/// Outlines of obstacles as dense polygons, counter-clockwise; open ones run so that their free side is to the right.
struct Outline {
  std::string name;
  std::vector<Eigen::Vector2d> points_m;
  std::size_t corners = 0;
  bool closed = true;

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

/// A building of 40 m x 20 m with columns 1 m in front of its wall, of this width.
inline Outline columns_outline(int columns, double width_m) {
  const std::vector<Eigen::Vector2d> wall_m = {{-20.0, -10.0}, {20.0, -10.0}, {20.0, 10.0}, {-20.0, 10.0}};
  std::vector<Eigen::Vector2d> corners_m;
  const double step_m = 120.0 / columns;
  double way_m = 0.0, next_m = 0.5 * step_m;
  for (std::size_t i = 0; i < wall_m.size(); ++i) {
    const Eigen::Vector2d from = wall_m[i], edge = wall_m[(i + 1) % wall_m.size()] - from, u = edge.normalized();
    const Eigen::Vector2d out(u.y(), -u.x()), half = 0.5 * width_m * u;
    corners_m.push_back(from);
    for (; next_m < way_m + edge.norm(); next_m += step_m) {
      const double at_m = next_m - way_m;
      if (at_m < width_m || at_m > edge.norm() - width_m) continue;
      const Eigen::Vector2d foot = from + at_m * u;
      for (const Eigen::Vector2d& p : {Eigen::Vector2d(foot - half), Eigen::Vector2d(foot - half + out),
                                       Eigen::Vector2d(foot + half + out), Eigen::Vector2d(foot + half)}) {
        corners_m.push_back(p);
      }
    }
    way_m += edge.norm();
  }
  return polygon_outline(std::to_string(columns) + " columns of " + std::to_string(width_m), corners_m);
}

/// Wings of this width and depth beside each other on one side of a building: two are a U.
inline Outline comb_outline(int wings, double width_m, double apart_m, double depth_m) {
  const double length_m = wings * (width_m + apart_m) - apart_m;
  std::vector<Eigen::Vector2d> corners_m = {{0.0, -5.0}, {length_m, -5.0}};
  for (int i = wings - 1; i >= 0; --i) {
    const double x_m = i * (width_m + apart_m);
    corners_m.emplace_back(x_m + width_m, depth_m);
    corners_m.emplace_back(x_m, depth_m);
    if (i == 0) break;
    corners_m.emplace_back(x_m, 0.0);
    corners_m.emplace_back(x_m - apart_m, 0.0);
  }
  return polygon_outline("comb of " + std::to_string(wings), corners_m);
}

inline Outline stepped_outline(int steps, double step_m, double depth_m) {
  std::vector<Eigen::Vector2d> corners_m = {{0.0, -8.0}, {steps * step_m, -8.0}};
  for (int i = steps - 1; i >= 0; --i) {
    corners_m.emplace_back((i + 1) * step_m, i * depth_m);
    corners_m.emplace_back(i * step_m, i * depth_m);
  }
  return polygon_outline("steps of " + std::to_string(depth_m), corners_m);
}

/// A street's front of houses that are 4 to 15 m long, and stand 0.5 to 3 m before or behind each other.
inline Outline street_outline(double length_m, Random& random) {
  std::vector<Eigen::Vector2d> corners_m = {{0.0, 0.0}};
  for (Eigen::Vector2d at_m(0.0, 0.0); at_m.x() < length_m;) {
    at_m.x() += random.uniform(4.0, 15.0);
    corners_m.push_back(at_m);
    const double depth_m = random.uniform(0.5, 3.0);
    at_m.y() += at_m.y() + depth_m > 0.0 || (at_m.y() > -5.0 && random.uniform() < 0.5) ? -depth_m : depth_m;
    corners_m.push_back(at_m);
  }
  Outline outline = polygon_outline("street", corners_m);
  const Eigen::Vector2d back_m = corners_m.front() - corners_m.back();
  outline.points_m.resize(outline.points_m.size() - static_cast<std::size_t>(std::ceil(back_m.norm() / 0.003)));
  outline.closed = false;
  return outline;
}

/// A bank with bends of 8 to 200 m.
inline Outline bank_outline(double length_m, Random& random) {
  Outline outline{"bank", {}, 0, false};
  std::vector<std::array<double, 3>> waves;
  for (const double wave_m : {200.0, 90.0, 40.0, 21.0, 13.0, 8.0}) {
    waves.push_back({wave_m, 0.02 * wave_m * random.uniform(0.5, 1.5), random.uniform(0.0, 2.0 * kPi)});
  }
  for (double x_m = 0.0; x_m < length_m; x_m += 0.003) {
    double y_m = 0.0;
    for (const auto& [wave_m, height_m, phase] : waves) y_m += height_m * std::sin(2.0 * kPi * x_m / wave_m + phase);
    outline.points_m.emplace_back(x_m, y_m);
  }
  return outline;
}

/// Elements of the outline from one part of its length to another, `spacing_m` apart on average, with noise across it.
inline std::vector<SplinegonElement> elements_of(const Outline& outline, double spacing_m, double sigma_m,
                                                 Random& random, double from = 0.0, double to = 1.0) {
  const auto point = [&](std::size_t i) { return outline.points_m[i % outline.points_m.size()]; };
  double length_m = 0.0;
  const std::size_t edges = outline.points_m.size() - (outline.closed ? 0 : 1);
  for (std::size_t i = 0; i < edges; ++i) length_m += (point(i + 1) - point(i)).norm();
  std::vector<SplinegonElement> elements;
  double way_m = 0.0, next_m = from * length_m + random.uniform() * spacing_m;
  for (std::size_t i = 0; i < edges && way_m < to * length_m; ++i) {
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
