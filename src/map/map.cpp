// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/map.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

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

struct PointsAlong {
  using Points = std::vector<Eigen::Vector2d>;
  static constexpr std::size_t kMost = 16;

  Points operator()(const EllipseShape& shape) const { return points_on(shape.ellipse_world, 8); }
  Points operator()(const BoxShape& shape) const {
    const auto corner = corners(shape.box_world);
    return evenly({corner.begin(), corner.end()}, true);
  }
  Points operator()(const PolylineShape& shape) const {
    Points points;
    for (const ChainVertex& vertex : shape.vertices) points.push_back(vertex.p_world_m);
    return evenly(points, shape.closed);
  }
  Points operator()(const ArcShape& shape) const {
    constexpr double kSpacing_m = 0.5;
    Points points;
    for (const SplinegonPoint& point : sampled(splinegon_of(shape), kSpacing_m)) points.push_back(point.p_world_m);
    return evenly(points, shape.closed);
  }
  Points operator()(const FootprintShape& /*shape*/) const { return {}; }

 private:
  /// In the middles of kMost parts of the same length.
  static Points evenly(const Points& line, bool closed) {
    double length_m = 0.0;
    const std::size_t edges = line.size() - (closed ? 0 : 1);
    const auto edge_m = [&](std::size_t i) { return Eigen::Vector2d(line[(i + 1) % line.size()] - line[i]); };
    for (std::size_t i = 0; i < edges; ++i) length_m += edge_m(i).norm();
    Points points;
    double begin_m = 0.0;
    for (std::size_t i = 0; i < edges && length_m > 0.0; ++i) {
      const double edge_length_m = edge_m(i).norm();
      for (;;) {
        const double at_m = (static_cast<double>(points.size()) + 0.5) * length_m / static_cast<double>(kMost);
        if (points.size() == kMost || at_m > begin_m + edge_length_m) break;
        points.push_back(line[i] + (at_m - begin_m) / edge_length_m * edge_m(i));
      }
      begin_m += edge_length_m;
    }
    return points;
  }
};

/// Adds a feature to the layer of its kind.
struct AddToLayer {
  const Feature& feature;
  MapLayers& layers;

  void operator()(const EllipseShape& shape) const {
    Object& object = add_body(shape.body);
    object.shape = Shape::kEllipse;
    object.ellipse_world = shape.ellipse_world;
  }
  void operator()(const BoxShape& shape) const {
    Object& object = add_body(shape.body);
    object.shape = Shape::kBox;
    object.box_world = shape.box_world;
    object.ellipse_world = moment_equal_ellipse(shape.box_world);
  }
  void operator()(const PolylineShape& shape) const {
    const ChainState state = feature.motion == Motion::kFixed ? ChainState::kWall : ChainState::kKnown;
    layers.polygons.chains.push_back({feature.id, shape.closed, shape.vertices, feature.first_seen_ns,
                                      feature.last_seen_ns, feature.p_exists, state});
  }
  void operator()(const ArcShape& shape) const {
    layers.boundaries.boundaries.push_back(
        {feature.id, shape.closed, shape.vertices, feature.first_seen_ns, feature.last_seen_ns});
  }
  void operator()(const FootprintShape& shape) const {
    layers.targets.targets.push_back(
        {feature.id, shape.p_world_m, shape.covariance_m2, shape.area_m2, feature.p_exists});
  }

 private:
  Object& add_body(const BodyState& body) const {
    Object& object = layers.objects.objects.emplace_back();
    object.id = feature.id;
    object.velocity_world_m_s = body.velocity_world_m_s;
    object.angular_velocity_rad_s = body.angular_velocity_rad_s;
    object.covariance = body.covariance;
    object.p_moving = feature.p_moving;
    object.p_exists = feature.p_exists;
    object.first_seen_ns = feature.first_seen_ns;
    object.last_seen_ns = feature.last_seen_ns;
    object.object_class = feature.object_class;
    object.p_class = feature.p_class;
    return object;
  }
};

}  // namespace

MapLayers layers_of(const Map& map) {
  MapLayers layers;
  layers.objects.stamp_ns = layers.polygons.stamp_ns = layers.boundaries.stamp_ns = layers.targets.stamp_ns =
      map.stamp_ns;
  layers.objects.height_world_m = layers.polygons.height_world_m = layers.boundaries.height_world_m =
      map.height_world_m;
  for (const Feature& feature : map.features) std::visit(AddToLayer{feature, layers}, feature.shape);
  return layers;
}

void move(Feature& feature, const Pose2& T, double variance_m2) {
  std::visit(MoveShape{T, variance_m2}, feature.shape);
}

std::vector<Eigen::Vector2d> points_along(const FeatureShape& shape) { return std::visit(PointsAlong{}, shape); }

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

Splinegon splinegon_of(const ArcShape& shape) {
  Splinegon splinegon;
  splinegon.closed = shape.closed;
  splinegon.vertices = shape.vertices;
  return splinegon;
}

std::vector<ChainVertex> lines_along(const Splinegon& boundary, double spacing_m) {
  const std::vector<SplinegonPoint> points = sampled(boundary, spacing_m);
  std::vector<ChainVertex> vertices;
  vertices.reserve(points.size());
  for (const SplinegonPoint& point : points) vertices.push_back({point.p_world_m, point.sigma_m});
  return vertices;
}

}  // namespace situation_awareness
