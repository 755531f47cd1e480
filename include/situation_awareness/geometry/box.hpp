// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness {

/// Rectangle in the plane of some frame b: centre, orientation of its own x axis in b, and half of its length and width
/// along its own x and y axes. Four parameter sets describe the same rectangle.
struct Box {
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  double psi_rad = 0.0;
  double half_length_m = 0.0;  ///< along its x axis
  double half_width_m = 0.0;   ///< along its y axis
};

/// Prior of half a side that was not seen, in m.
namespace box_prior {
constexpr double kMeanHalf_m = 0.2;
constexpr double kHalfSigma_m = 0.15;
}  // namespace box_prior

/// The box `box_b` of frame b seen in frame a.
Box operator*(const Pose2& T_a_b, const Box& box_b);

/// Counter-clockwise, from that at +x, +y of its own axes.
std::array<Eigen::Vector2d, 4> corners(const Box& box);

/// The ellipse with the box's centre and axes, and the same second moments of area about the centre relative to the
/// area: a uniform ellipse of semi-axis a has the variance a^2 / 4 along it, a uniform box of half length h has h^2 /
/// 3, so that a = 2 / sqrt(3) h.
Ellipse moment_equal_ellipse(const Box& box);

/// The box of which `ellipse` is the moment-equal ellipse.
Box moment_equal_box(const Ellipse& ellipse);

/// Distance of a point from the outline, negative inside.
inline double offset_m(const Box& box, const Eigen::Vector2d& p) {
  const Eigen::Vector2d p_box = Eigen::Rotation2Dd(-box.psi_rad) * (p - box.center_m);
  const Eigen::Vector2d beyond = p_box.cwiseAbs() - Eigen::Vector2d(box.half_length_m, box.half_width_m);
  return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
}

}  // namespace situation_awareness
