// SPDX-License-Identifier: BSD-3-Clause
#include "chain_cover.hpp"

#include <algorithm>
#include <limits>

#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/ellipse.hpp"

namespace situation_awareness {
namespace {

/// m. Steps in which it is found how much of a chain is on an object.
constexpr double kStep_m = 0.02;
/// m. A place is beside a chain that is so near; it is found in such steps how much is.
constexpr double kSamePlace_m = 0.1, kSameStep_m = 0.1;
/// m. The same of chains one of which comes in the place of the other: elements may be as far apart.
constexpr double kSameThing_m = 0.25;
/// m. Extent of a thing of which a part may be detected inside, and how far behind its surface, at most.
constexpr double kMostThing_m = 7.0, kMostInside_m = 1.5;
/// Cosine of the angle between two surfaces that face the same way.
constexpr double kSameWay = 0.5;
/// A margin is larger by so many standard deviations of the object's position, and is kMostMargin_m at most.
constexpr double kMarginSigmas = 2.0, kMostMargin_m = 0.3;

double reach_of(const Object& object) {
  if (object.shape != Shape::kBox) return object.ellipse_world.rx_m;
  return std::hypot(object.box_world.half_length_m, object.box_world.half_width_m);
}

double distance_to(const Chain& chain, const Eigen::Vector2d& p_world_m) {
  double least_m2 = std::numeric_limits<double>::infinity();
  for_each_edge(chain, [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const Eigen::Vector2d edge = to - from;
    const double part = std::clamp((p_world_m - from).dot(edge) / std::max(edge.squaredNorm(), 1e-12), 0.0, 1.0);
    least_m2 = std::min(least_m2, (p_world_m - from - part * edge).squaredNorm());
  });
  return std::sqrt(least_m2);
}

}  // namespace

double margin_of(const Object& object, double margin_m) {
  const auto P = object.covariance.block<2, 2>(object_error::kPosition, object_error::kPosition);
  return std::min(margin_m + kMarginSigmas * std::sqrt(std::max(P.diagonal().maxCoeff(), 0.0)), kMostMargin_m);
}

bool covers(const Object& object, const Eigen::Vector2d& p_world_m, double margin_m) {
  if (object.shape == Shape::kBox) return offset_m(object.box_world, p_world_m) <= margin_m;
  Ellipse ellipse = object.ellipse_world;
  ellipse.rx_m += margin_m;
  ellipse.ry_m += margin_m;
  return contains(ellipse, p_world_m);
}

double lesser_width_of(const Object& object) {
  if (object.shape != Shape::kBox) return 2.0 * object.ellipse_world.ry_m;
  return 2.0 * std::min(object.box_world.half_length_m, object.box_world.half_width_m);
}

double extent_of(const Object& object) { return 2.0 * reach_of(object); }

Eigen::AlignedBox2d box_around(const Object& object, double margin_m) {
  const Eigen::Vector2d half_m = Eigen::Vector2d::Constant(reach_of(object) + margin_m);
  const Eigen::Vector2d& center_m = object.ellipse_world.center_m;
  return {center_m - half_m, center_m + half_m};
}

double length_of(const Chain& chain) {
  double length_m = 0.0;
  for_each_edge(chain, [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) { length_m += (to - from).norm(); });
  return length_m;
}

double length_on(const Object& object, const Chain& chain, double margin_m) {
  const Eigen::AlignedBox2d box = box_around(object, margin_m);
  double on_m = 0.0;
  for_each_edge(chain, [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    Eigen::AlignedBox2d edge(from);
    edge.extend(to);
    if (!edge.intersects(box)) return;
    const double edge_m = (to - from).norm();
    const auto steps = std::max(1.0, std::ceil(edge_m / kStep_m));
    for (double step = 0.5; step < steps; step += 1.0) {
      if (covers(object, from + step / steps * (to - from), margin_m)) on_m += edge_m / steps;
    }
  });
  return on_m;
}

bool is_inside(const Object& object, const Chain& chain) {
  const Eigen::Vector2d p_m = object.ellipse_world.center_m;
  Eigen::AlignedBox2d box;
  double least_m = std::min(extent_of(object), kMostInside_m);
  bool result = false;
  for_each_edge(chain, [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    box.extend(from);
    box.extend(to);
    const Eigen::Vector2d edge = to - from, way = p_m - from;
    const double length_m = edge.norm();
    if (!(length_m > 0.0)) return;
    const double at_m = way.dot(edge) / length_m;
    const double left_m = (edge.x() * way.y() - edge.y() * way.x()) / length_m;
    const double beyond_m = std::max({0.0, -at_m, at_m - length_m});
    const double apart_m = std::hypot(left_m, beyond_m);
    if (apart_m >= least_m) return;
    least_m = apart_m;
    result = left_m < 0.0 && beyond_m == 0.0;
  });
  return result && box.diagonal().norm() <= kMostThing_m;
}

bool is_beside(const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& along, const Chain& chain, double begin_m,
               double end_m) {
  bool result = false;
  double before_m = 0.0;
  for_each_edge(chain, [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const Eigen::Vector2d edge = to - from, way = p_world_m - from;
    const double length_m = edge.norm();
    if (!result && along.dot(edge) > kSameWay * length_m) {
      const double at_m = way.dot(edge) / length_m;
      const double across_m = std::abs(edge.x() * way.y() - edge.y() * way.x()) / length_m;
      result = across_m <= kSamePlace_m && at_m >= std::max(0.0, begin_m - before_m) &&
               at_m <= std::min(length_m, end_m - before_m);
    }
    before_m += length_m;
  });
  return result;
}

std::vector<ChainVertex> part_of(const Chain& chain, double begin_m, double end_m) {
  if (chain.closed || (begin_m <= 0.0 && end_m >= length_of(chain))) return chain.vertices;
  std::vector<ChainVertex> vertices;
  double at_m = 0.0;
  for (std::size_t k = 0; k + 1 < chain.vertices.size(); ++k) {
    const ChainVertex &from = chain.vertices[k], &to = chain.vertices[k + 1];
    const double edge_m = (to.p_world_m - from.p_world_m).norm();
    const auto at = [&](double m) {
      const double part = edge_m > 0.0 ? std::clamp((m - at_m) / edge_m, 0.0, 1.0) : 0.0;
      return ChainVertex{from.p_world_m + part * (to.p_world_m - from.p_world_m),
                         from.sigma_m + part * (to.sigma_m - from.sigma_m)};
    };
    if (at_m + edge_m > begin_m && at_m < end_m) {
      if (vertices.empty()) vertices.push_back(at(begin_m));
      vertices.push_back(at(end_m));
    }
    at_m += edge_m;
  }
  return vertices;
}

bool is_all_beside(const Chain& chain, const Chain& other, double most_m) {
  return std::all_of(chain.vertices.begin(), chain.vertices.end(),
                     [&](const ChainVertex& vertex) { return distance_to(other, vertex.p_world_m) <= most_m; });
}

double part_beside(const Chain& chain, const Chain& other) {
  double beside = 0.0, all = 0.0;
  for_each_edge(chain, [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const double steps = std::max(1.0, std::ceil((to - from).norm() / kSameStep_m));
    for (double step = 0.5; step < steps; step += 1.0) {
      all += 1.0;
      if (distance_to(other, from + step / steps * (to - from)) <= kSameThing_m) beside += 1.0;
    }
  });
  return all > 0.0 ? beside / all : 0.0;
}

}  // namespace situation_awareness
