// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/boundary_evaluation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace situation_awareness {
namespace {

/// Between places that are compared.
constexpr double kSpacing_m = 0.1;

double distance_to_outline(const std::vector<Eigen::Vector2d>& outline, const Eigen::Vector2d& p_m) {
  double least_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d way_m = outline[(i + 1) % outline.size()] - outline[i];
    const double square_m2 = way_m.squaredNorm();
    const double part = square_m2 > 0.0 ? std::clamp(way_m.dot(p_m - outline[i]) / square_m2, 0.0, 1.0) : 0.0;
    least_m = std::min(least_m, (outline[i] + part * way_m - p_m).norm());
  }
  return least_m;
}

double area_of_outline(const std::vector<Eigen::Vector2d>& outline) {
  double twice_m2 = 0.0;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d a = outline[i] - outline[0], b = outline[(i + 1) % outline.size()] - outline[0];
    twice_m2 += a.x() * b.y() - a.y() * b.x();
  }
  return 0.5 * twice_m2;
}

std::vector<Eigen::Vector2d> places_on(const std::vector<Eigen::Vector2d>& outline) {
  std::vector<Eigen::Vector2d> places;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d way_m = outline[(i + 1) % outline.size()] - outline[i];
    const int pieces = std::max(1, static_cast<int>(std::ceil(way_m.norm() / kSpacing_m)));
    for (int k = 0; k < pieces; ++k) places.emplace_back(outline[i] + way_m * k / pieces);
  }
  return places;
}

struct Distances {
  double mean_m, greatest_m;
};

Distances distances_of(const std::vector<SplinegonPoint>& points, const std::vector<Eigen::Vector2d>& outline) {
  Distances result{0.0, 0.0};
  for (const SplinegonPoint& point : points) {
    const double distance = distance_to_outline(outline, point.p_world_m);
    result.mean_m += distance / static_cast<double>(points.size());
    result.greatest_m = std::max(result.greatest_m, distance);
  }
  return result;
}

BoundaryScore score_of(const TrueObstacle& obstacle, const Splinegon& boundary) {
  BoundaryScore score;
  score.closed = boundary.closed;
  score.vertices = boundary.vertices.size();
  const std::vector<SplinegonPoint> points = sampled(boundary, kSpacing_m);
  const Distances distances = distances_of(points, obstacle.outline_world_m);
  score.mean_m = distances.mean_m;
  score.hausdorff_m = distances.greatest_m;
  for (const SplinegonPoint& point : points) score.sigma_m += point.sigma_m / static_cast<double>(points.size());
  const std::vector<Eigen::Vector2d> places = places_on(obstacle.outline_world_m);
  std::size_t inside = 0;
  for (const Eigen::Vector2d& p_m : places) {
    score.hausdorff_m = std::max(score.hausdorff_m, distance_m(boundary, p_m));
    inside += is_in_envelope(boundary, p_m) ? 1 : 0;
  }
  score.in_envelope_part = static_cast<double>(inside) / static_cast<double>(places.size());
  score.area_part = boundary.closed ? area_m2(boundary) / area_of_outline(obstacle.outline_world_m) - 1.0
                                    : std::numeric_limits<double>::quiet_NaN();
  return score;
}

}  // namespace

std::vector<BoundaryScore> score_boundaries(const std::vector<TrueObstacle>& obstacles, const Splinegons& splinegons) {
  std::vector<std::vector<const Splinegon*>> own(obstacles.size());
  for (const Splinegon& boundary : splinegons.boundaries) {
    const std::vector<SplinegonPoint> points = sampled(boundary, kSpacing_m);
    std::size_t nearest = 0;
    double least_m = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < obstacles.size(); ++i) {
      const double mean_m = distances_of(points, obstacles[i].outline_world_m).mean_m;
      if (mean_m >= least_m) continue;
      least_m = mean_m;
      nearest = i;
    }
    if (!obstacles.empty()) own[nearest].push_back(&boundary);
  }
  std::vector<BoundaryScore> scores;
  for (std::size_t i = 0; i < obstacles.size(); ++i) {
    BoundaryScore score;
    score.hausdorff_m = score.mean_m = std::numeric_limits<double>::infinity();
    score.area_part = score.sigma_m = std::numeric_limits<double>::quiet_NaN();
    const auto longest = std::max_element(own[i].begin(), own[i].end(), [](const Splinegon* a, const Splinegon* b) {
      return length_m(*a) < length_m(*b);
    });
    if (longest != own[i].end()) score = score_of(obstacles[i], **longest);
    score.name = obstacles[i].name;
    score.boundaries = own[i].size();
    scores.push_back(score);
  }
  return scores;
}

std::string format_table(const std::vector<BoundaryScore>& scores) {
  char line[200];
  std::snprintf(line, sizeof line, "%-12s %10s %6s %8s %11s %8s %8s %8s %12s\n", "obstacle", "boundaries", "closed",
                "vertices", "Hausdorff m", "mean m", "area %", "sigma m", "in 99 % band");
  std::string table = line;
  for (const BoundaryScore& score : scores) {
    std::snprintf(line, sizeof line, "%-12s %10zu %6s %8zu %11.2f %8.2f %8.2f %8.2f %12.3f\n", score.name.c_str(),
                  score.boundaries, score.closed ? "yes" : "no", score.vertices, score.hausdorff_m, score.mean_m,
                  100.0 * score.area_part, score.sigma_m, score.in_envelope_part);
    table += line;
  }
  return table;
}

}  // namespace situation_awareness
