// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/geometry/box.hpp"

namespace situation_awareness {
namespace {

constexpr double kSemiAxisPerHalfSide = 1.1547005383792515;  // 2 / sqrt(3)

}  // namespace

Box operator*(const Pose2& T_a_b, const Box& box_b) {
  return {T_a_b * box_b.center_m, T_a_b.yaw_rad + box_b.psi_rad, box_b.half_length_m, box_b.half_width_m};
}

std::array<Eigen::Vector2d, 4> corners(const Box& box) {
  const Pose2 T_frame_box{box.center_m, box.psi_rad};
  const double x = box.half_length_m;
  const double y = box.half_width_m;
  return {T_frame_box * Eigen::Vector2d(x, y), T_frame_box * Eigen::Vector2d(-x, y),
          T_frame_box * Eigen::Vector2d(-x, -y), T_frame_box * Eigen::Vector2d(x, -y)};
}

Ellipse moment_equal_ellipse(const Box& box) {
  return {box.center_m, box.psi_rad, kSemiAxisPerHalfSide * box.half_length_m, kSemiAxisPerHalfSide * box.half_width_m};
}

Box moment_equal_box(const Ellipse& ellipse) {
  return {ellipse.center_m, ellipse.psi_rad, ellipse.rx_m / kSemiAxisPerHalfSide, ellipse.ry_m / kSemiAxisPerHalfSide};
}

}  // namespace situation_awareness
