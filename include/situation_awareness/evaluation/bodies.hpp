// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// A true body that should be one element of the map: one object, or several that are its parts, such as the torso and
/// the arms of a person.
struct Body {
  std::string name;
  std::vector<std::size_t> parts;  ///< indices of the truth's objects; the first has the position of the body
};

/// The bodies of a truth's objects, in the order of their first parts. Objects whose names agree up to the last '/' are
/// parts of one body of the name before it: person/torso, person/left_arm.
std::vector<Body> bodies_of(const std::vector<std::string>& names);

/// True if the point is within `margin_m` of the convex hull of the ellipses; to 1e-4 of their size.
bool within_reach(const std::vector<Ellipse>& ellipses, const Eigen::Vector2d& point_m, double margin_m);

/// Number of parts with a separate segment: one with at least `min_points` points of the part, more than of any other
/// object. `object_of_beam`: the object hit by each beam of the scan, -1 for none.
int separate_parts(const Body& body, const Segments& segments, const std::vector<int>& object_of_beam, int min_points);

}  // namespace situation_awareness
