// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/movers.hpp"

#include <algorithm>
#include <cmath>

namespace situation_awareness {

MoverOutline::MoverOutline(const Ellipse& world, double margin_m)
    : center_world_m_(world.center_m),
      along_world_(std::cos(world.psi_rad), std::sin(world.psi_rad)),
      half_m_(world.rx_m, world.ry_m),
      is_box_(false),
      margin_m_(margin_m),
      reach_m_(half_m_.maxCoeff() + margin_m) {}

MoverOutline::MoverOutline(const Box& world, double margin_m)
    : center_world_m_(world.center_m),
      along_world_(std::cos(world.psi_rad), std::sin(world.psi_rad)),
      half_m_(world.half_length_m, world.half_width_m),
      is_box_(true),
      margin_m_(margin_m),
      reach_m_(half_m_.norm() + margin_m) {}

bool MoverOutline::covers(const Eigen::Vector2d& p_world_m) const {
  const Eigen::Vector2d d_m = p_world_m - center_world_m_;
  const double distance2_m2 = d_m.squaredNorm();
  if (distance2_m2 > reach_m_ * reach_m_) return false;
  const Eigen::Vector2d own_m(along_world_.dot(d_m), along_world_.x() * d_m.y() - along_world_.y() * d_m.x());
  if (is_box_) return (own_m.cwiseAbs() - half_m_).cwiseMax(0.0).squaredNorm() <= margin_m_ * margin_m_;
  // Along the way from the centre the outline is at 1 / scale.
  const double scale = own_m.cwiseQuotient(half_m_).norm();
  return scale <= 1.0 || std::sqrt(distance2_m2) * (1.0 - 1.0 / scale) <= margin_m_;
}

}  // namespace situation_awareness
