// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"

namespace situation_awareness {

/// Calls visit(from, to) with the ends of each edge of a chain, Eigen::Vector2d in the world.
template <class Visit>
void for_each_edge(const Chain& chain, Visit&& visit) {
  const std::size_t n = chain.vertices.size();
  for (std::size_t k = 0; k + (chain.closed ? 0 : 1) < n; ++k) {
    visit(chain.vertices[k].p_world_m, chain.vertices[(k + 1) % n].p_world_m);
  }
}

double length_of(const Chain& chain);

/// How far beside the outline of an object a chain may be that is of it: `margin_m` and two standard deviations of the
/// object's position.
double margin_of(const Object& object, double margin_m);

/// Around the outline of an object and this margin, and more.
Eigen::AlignedBox2d box_around(const Object& object, double margin_m);

double lesser_width_of(const Object& object);

/// Of the outline of an object, its greatest.
double extent_of(const Object& object);

/// Whether a place is within the outline of an object, or beside it by the margin at most.
bool covers(const Object& object, const Eigen::Vector2d& p_world_m, double margin_m);

/// Length (m) of that of a chain that an object covers.
double length_on(const Object& object, const Chain& chain, double margin_m);

/// Whether the middle of an object is behind the surface of a chain that may be of something as large as a vehicle, and
/// not farther than its own greatest extent: so it is inside of that thing.
bool is_inside(const Object& object, const Chain& chain);

/// Calls visit(p_m, along, step_m) with the middle of each step along a chain, its direction (unit) and its length (m).
template <class Visit>
void for_each_step(const Chain& chain, double most_m, Visit&& visit) {
  for_each_edge(chain, [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const double edge_m = (to - from).norm();
    if (!(edge_m > 0.0)) return;
    const double steps = std::max(1.0, std::ceil(edge_m / most_m));
    const Eigen::Vector2d along = (to - from) / edge_m;
    for (double step = 0.5; step < steps; step += 1.0) visit(from + step / steps * (to - from), along, edge_m / steps);
  });
}

/// Whether a chain, between two places along it, in m, goes past a place by .1 m at most, in that direction: so it is a
/// surface that faces the same way.
bool is_beside(const Eigen::Vector2d& p_world_m, const Eigen::Vector2d& along, const Chain& chain, double begin_m,
               double end_m);

/// Vertices of that of an open chain between two places along it, in m; all if that is its length.
std::vector<ChainVertex> part_of(const Chain& chain, double begin_m, double end_m);

/// Whether no place on a chain is farther from another one than that.
bool is_all_beside(const Chain& chain, const Chain& other, double most_m);

/// Part of a chain that is beside another one by .25 m at most: so it may be of the same thing.
double part_beside(const Chain& chain, const Chain& other);

}  // namespace situation_awareness
