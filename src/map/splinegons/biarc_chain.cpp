// SPDX-License-Identifier: BSD-3-Clause
#include "biarc_chain.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "directions.hpp"
#include "situation_awareness/geometry/biarc.hpp"
#include "situation_awareness/geometry/vectors.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// An element is looked for among so many arcs to either side, and everywhere for so many elements.
constexpr std::size_t kNearArcs = 4, kMostSearches = 16;

/// Chord of an arc that turns by twice this angle, over its length.
double chord_over_arc(double half_rad) {
  return std::abs(half_rad) < 1e-4 ? 1.0 - half_rad * half_rad / 6.0 : std::sin(half_rad) / half_rad;
}

}  // namespace

bool BiarcChain::is_smooth(std::size_t arc) const {
  return arc % 2 == 1 || ((closed || arc > 0) && !nodes[arc / 2].corner);
}

void BiarcChain::compute_arcs() {
  arcs.resize(2 * biarcs());
  Eigen::Vector2d along_out = unit(nodes[0].yaw_out_rad);
  for (std::size_t k = 0; k < biarcs(); ++k) {
    const Node& from = nodes[k];
    const Node& to = nodes[next_node(k)];
    const Biarc biarc = equal_chord_biarc({from.p_m, from.yaw_out_rad}, {to.p_m, to.yaw_in_rad});
    const Eigen::Vector2d chord_m = to.p_m - from.p_m;
    const double c_m = chord_m.norm();
    const Eigen::Vector2d u = chord_m / c_m, n = left_of(u);
    // kappa0 = 4 sin(A) cos(D) / c, kappa1 = 4 sin(B) cos(D) / c with half sweeps A = -(3 theta0 + theta1) / 4,
    // B = (theta0 + 3 theta1) / 4, and D = (theta1 - theta0) / 4.
    const double A = 0.5 * biarc.sweep0_rad, B = 0.5 * biarc.sweep1_rad;
    const double D = 0.5 * (A + B);
    const double cos_D = std::cos(D), sin_D = std::sin(D);
    const auto fill = [&](Arc& arc, double half_rad, double by_theta0, double by_theta1) {
      const double cos_h = std::cos(half_rad), sin_h = std::sin(half_rad);
      const double kappa = 4.0 * sin_h * cos_D / c_m;
      const double k0 = 4.0 / c_m * (by_theta0 * cos_h * cos_D + 0.25 * sin_h * sin_D);
      const double k1 = 4.0 / c_m * (by_theta1 * cos_h * cos_D - 0.25 * sin_h * sin_D);
      const Eigen::Vector2d by_to = -(k0 + k1) / c_m * n - kappa / c_m * u;
      arc.curvature_1pm = kappa;
      arc.curvature_slope << -by_to, k0, by_to, k1;
      arc.length_m = biarc.chord_m / chord_over_arc(half_rad);
    };
    Arc& first = arcs[2 * k];
    Arc& second = arcs[2 * k + 1];
    fill(first, A, -0.75, -0.25);
    fill(second, B, 0.25, 0.75);
    first.p_m = first.begin_m = from.p_m;
    first.begin_yaw_rad = from.yaw_out_rad;
    first.along = along_out;
    second.p_m = to.p_m;
    second.along = unit(to.yaw_in_rad);
    second.begin_m = biarc.joint.translation_m;
    second.begin_yaw_rad = biarc.joint.yaw_rad;
    first.begin_along = from.yaw_in_rad == from.yaw_out_rad
                            ? first.along
                            : unit(0.5 * wrap_to_pi(from.yaw_in_rad - from.yaw_out_rad) + from.yaw_out_rad);
    second.begin_along = unit(biarc.joint.yaw_rad);
    along_out = to.yaw_in_rad == to.yaw_out_rad ? second.along : unit(to.yaw_out_rad);
  }
}

bool BiarcChain::assign_nearest(const BoundaryElements& elements) {
  const std::size_t count = arcs.size();
  arc_of.resize(elements.points_m.size());
  std::size_t at = 0, searches = 0;
  for (std::size_t i = 0; i < elements.points_m.size(); ++i) {
    double least_m2 = std::numeric_limits<double>::infinity();
    const auto look_at = [&](std::size_t j) {
      const Eigen::Vector2d begin_m = arcs[j].begin_m;
      const Eigen::Vector2d chord_m = (j % 2 == 0 ? arcs[j + 1].begin_m : nodes[next_node(j / 2)].p_m) - begin_m;
      const Eigen::Vector2d v = elements.points_m[i] - begin_m;
      const double part = std::clamp(v.dot(chord_m) / std::max(chord_m.squaredNorm(), 1e-12), 0.0, 1.0);
      const bool other_side = left_of(chord_m).dot(elements.normals[i]) > 0.0;
      const double distance_m2 = (v - part * chord_m).squaredNorm() + (other_side ? 1.0 : 0.0);
      if (distance_m2 < least_m2) {
        least_m2 = distance_m2;
        arc_of[i] = j;
      }
    };
    if (i > 0) {
      for (std::size_t k = 0; k <= 2 * kNearArcs; ++k) {
        const std::size_t j = at + count + k;
        const bool is_there = j >= count + kNearArcs && j < 2 * count + kNearArcs;
        if (is_there) {
          look_at(j - count - kNearArcs);
        } else if (closed) {
          look_at((j - kNearArcs) % count);
        }
      }
    }
    if (least_m2 > kNear_m * kNear_m) {
      if (++searches > kMostSearches) return false;
      for (std::size_t j = 0; j < count; ++j) look_at(j);
    }
    at = arc_of[i];
  }
  return true;
}

void BiarcChain::assign_stepwise(const BoundaryElements& elements) {
  const std::size_t count = arcs.size();
  for (std::size_t i = 0; i < elements.points_m.size(); ++i) {
    for (int k = 0; k < 2; ++k) {
      const std::size_t j = arc_of[i];
      const bool has_before = closed || j > 0, has_after = closed || j + 1 < count;
      const std::size_t after = j + 1 < count ? j + 1 : 0;
      if (has_before && arcs[j].begin_along.dot(elements.points_m[i] - arcs[j].begin_m) < 0.0) {
        arc_of[i] = j > 0 ? j - 1 : count - 1;
      } else if (has_after && arcs[after].begin_along.dot(elements.points_m[i] - arcs[after].begin_m) >= 0.0) {
        arc_of[i] = after;
      } else {
        break;
      }
    }
  }
}

/// d = (1 - S) / kappa with S^2 = 1 - 2 kappa b + kappa^2
/// (a^2 + b^2), where (a, b) is the point in the node's frame.
BiarcChain::Residual BiarcChain::residual_of(const Eigen::Vector2d& p_m, std::size_t index) const {
  const Arc& arc = arcs[index];
  const Eigen::Vector2d v = p_m - arc.p_m, normal = left_of(arc.along);
  const double a = arc.along.dot(v), b = normal.dot(v), kappa = arc.curvature_1pm, squares = a * a + b * b;
  const double S = std::sqrt(std::max(1.0 - 2.0 * kappa * b + kappa * kappa * squares, 1e-6));
  const double d = (2.0 * b - kappa * squares) / (1.0 + S);
  BiarcChain::Residual residual{d, (-0.5 * (squares - d * d) / S) * arc.curvature_slope};
  const Eigen::Vector2d normal_at_foot = (normal - kappa * v) / S;
  const Eigen::Index of_node = index % 2 == 0 ? 0 : 3;
  residual.slope.segment<2>(of_node) -= normal_at_foot;
  residual.slope(of_node + 2) -= a / S;
  return residual;
}

void BiarcChain::compute_residuals(const BoundaryElements& elements) {
  of_elements.resize(elements.points_m.size());
  for (std::size_t i = 0; i < elements.points_m.size(); ++i)
    of_elements[i] = residual_of(elements.points_m[i], arc_of[i]);
}

double BiarcChain::way_to_foot_m(const Eigen::Vector2d& p_m, std::size_t index) const {
  const Arc& arc = arcs[index];
  const Eigen::Vector2d v = p_m - arc.begin_m;
  const Eigen::Vector2d& along = index % 2 == 0 ? arc.along : arc.begin_along;  // of the arc at its begin
  const double a = along.dot(v), b = left_of(along).dot(v), kappa = arc.curvature_1pm;
  return std::abs(kappa) < 1e-9 ? a : std::atan2(kappa * a, 1.0 - kappa * b) / kappa;
}

Eigen::Vector2d point_on(const BiarcChain::Arc& arc, double s_m) {
  const double half_rad = 0.5 * arc.curvature_1pm * s_m;
  return arc.begin_m + s_m * chord_over_arc(half_rad) * unit(arc.begin_yaw_rad + half_rad);
}

}  // namespace situation_awareness
