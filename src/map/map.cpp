// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/map.hpp"

#include <array>
#include <cmath>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

namespace {

void move_body(BodyState& body, const Pose2& T, double variance_m2) {
  const Eigen::Matrix2d R = T.rotation();
  body.velocity_world_m_s = R * body.velocity_world_m_s;
  Matrix8d J = Matrix8d::Identity();
  J.block<2, 2>(object_error::kPosition, object_error::kPosition) = R;
  J.block<2, 2>(object_error::kVelocity, object_error::kVelocity) = R;
  body.covariance = J * body.covariance * J.transpose();
  body.covariance.diagonal().segment<2>(object_error::kPosition).array() += variance_m2;
}

struct MoveShape {
  const Pose2& T;
  double variance_m2;

  void operator()(EllipseShape& shape) const {
    shape.ellipse_world.center_m = T * shape.ellipse_world.center_m;
    shape.ellipse_world.psi_rad = wrap_to_half_pi(shape.ellipse_world.psi_rad + T.yaw_rad);
    move_body(shape.body, T, variance_m2);
  }
  void operator()(BoxShape& shape) const {
    shape.box_world.center_m = T * shape.box_world.center_m;
    shape.box_world.psi_rad = wrap_to_half_pi(shape.box_world.psi_rad + T.yaw_rad);
    move_body(shape.body, T, variance_m2);
  }
  void operator()(PolylineShape& shape) const { move_vertices(shape.vertices, T, variance_m2); }
  void operator()(ArcShape& shape) const { move_vertices(shape.vertices, T, variance_m2); }
  void operator()(FootprintShape& shape) const {
    shape.p_world_m.head<2>() = T * Eigen::Vector2d(shape.p_world_m.head<2>());
    const Eigen::Matrix2d R = T.rotation();
    shape.covariance_m2 = R * shape.covariance_m2 * R.transpose() + variance_m2 * Eigen::Matrix2d::Identity();
  }
};

struct BoxAround {
  static Eigen::AlignedBox2d around(const Eigen::Vector2d& center_m, double radius_m) {
    const Eigen::Vector2d half_m = Eigen::Vector2d::Constant(radius_m);
    return {center_m - half_m, center_m + half_m};
  }
  Eigen::AlignedBox2d operator()(const EllipseShape& shape) const {
    return around(shape.ellipse_world.center_m, std::max(shape.ellipse_world.rx_m, shape.ellipse_world.ry_m));
  }
  Eigen::AlignedBox2d operator()(const BoxShape& shape) const {
    return around(shape.box_world.center_m, std::hypot(shape.box_world.half_length_m, shape.box_world.half_width_m));
  }
  Eigen::AlignedBox2d operator()(const PolylineShape& shape) const {
    Eigen::AlignedBox2d box;
    for (const ChainVertex& vertex : shape.vertices) box.extend(vertex.p_world_m);
    return box;
  }
  Eigen::AlignedBox2d operator()(const ArcShape& shape) const {
    Eigen::AlignedBox2d box;
    double height_m = 0.0;  // of an arc above its chord
    for (std::size_t k = 0; k < shape.vertices.size(); ++k) {
      const SplinegonVertex& from = shape.vertices[k];
      const SplinegonVertex& to = shape.vertices[k + 1 < shape.vertices.size() ? k + 1 : 0];
      box.extend(from.p_world_m);
      height_m = std::max(height_m, 0.5 * std::abs(from.bulge) * (to.p_world_m - from.p_world_m).norm());
    }
    const Eigen::Vector2d margin_m = Eigen::Vector2d::Constant(height_m);
    return {box.min() - margin_m, box.max() + margin_m};
  }
  Eigen::AlignedBox2d operator()(const FootprintShape& shape) const {
    return around(shape.p_world_m.head<2>(), std::sqrt(shape.area_m2 / kPi));
  }
};

}  // namespace

void move(Feature& feature, const Pose2& T, double variance_m2) {
  std::visit(MoveShape{T, variance_m2}, feature.shape);
}

Eigen::AlignedBox2d box_around(const FeatureShape& shape) { return std::visit(BoxAround{}, shape); }

const char* name_of(Motion motion) {
  constexpr std::array<const char*, 3> kNames = {"moving", "standing", "fixed"};
  return kNames[static_cast<std::size_t>(motion)];
}

const char* kind_of(const FeatureShape& shape) {
  constexpr std::array<const char*, 5> kKinds = {"ellipse", "box", "polyline", "boundary", "target"};
  return kKinds[shape.index()];
}

const char* name_of(GoneReason reason) {
  constexpr std::array<const char*, 4> kNames = {"left", "seen through", "merged", "forgotten"};
  return kNames[static_cast<std::size_t>(reason)];
}

}  // namespace situation_awareness
