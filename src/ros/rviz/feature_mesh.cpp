// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/feature_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include <Eigen/Eigenvalues>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/ros/markers/polygon_markers.hpp"
#include "situation_awareness/ros/rviz/polygon_mesh.hpp"

namespace situation_awareness {
namespace {

constexpr double kFarthestFeature_m = 1e5;  ///< a float has steps of 8 mm there
constexpr double kMostFeatureSigma_m = 1e3;
/// Between points along a boundary: half a metre of an arc of 5 m is 6 mm off its chord.
constexpr double kBoundarySpacing_m = 0.5;
constexpr Color kBoundaryColor{0.05F, 0.5F, 0.5F};
constexpr Color kTargetColor{0.85F, 0.1F, 0.1F};
constexpr Color kTargetRegionColor{1.0F, 0.6F, 0.2F};
constexpr double kRadius99 = 3.0349;  ///< sqrt of the 99 % quantile of chi-square with two degrees of freedom
constexpr int kTargetPoints = 32;
constexpr double kLargestFilled_m = 6.0;  ///< a car

/// The largest standard deviation that a shape has of a place.
struct WorstSigma {
  double operator()(const EllipseShape& shape) const { return of(shape.body); }
  double operator()(const BoxShape& shape) const { return of(shape.body); }
  double operator()(const PolylineShape& shape) const { return of_vertices(shape.vertices); }
  double operator()(const ArcShape& shape) const { return of_vertices(shape.vertices); }
  double operator()(const FootprintShape& shape) const { return std::sqrt(shape.covariance_m2.cwiseAbs().maxCoeff()); }

 private:
  static double of(const BodyState& body) { return std::sqrt(body.covariance.cwiseAbs().maxCoeff()); }
  template <class Vertices>
  static double of_vertices(const Vertices& vertices) {
    double worst_m = 0.0;
    for (const auto& vertex : vertices) worst_m = std::max(worst_m, vertex.sigma_m);
    return worst_m;
  }
};

void check_drawable(const Feature& feature) {
  const Eigen::AlignedBox2d box = box_around(feature.shape);
  const std::string name = "feature " + std::to_string(feature.id);
  // Written so that a number that is not finite is beyond.
  if (!(box.min().minCoeff() >= -kFarthestFeature_m && box.max().maxCoeff() <= kFarthestFeature_m)) {
    throw std::invalid_argument(name + ": it is beyond 100 km");
  }
  if (!(std::visit(WorstSigma{}, feature.shape) <= kMostFeatureSigma_m)) {
    throw std::invalid_argument(name + ": a standard deviation is beyond 1000 m");
  }
}

/// The boundary as a chain, whose free side is on the other hand.
Chain chain_of(const Splinegon& splinegon) {
  Chain chain;
  chain.id = splinegon.id;
  chain.closed = splinegon.closed;
  chain.p_exists = 1.0;
  chain.state = ChainState::kWall;
  chain.vertices = lines_along(splinegon, kBoundarySpacing_m);
  std::reverse(chain.vertices.begin(), chain.vertices.end());
  return chain;
}

Polyline around(const Ellipse& ellipse) {
  Polyline outline = points_on(ellipse, kTargetPoints);
  outline.push_back(outline.front());
  return outline;
}

void add(const GridTarget& target, MapMesh& mesh) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(target.covariance_m2);
  const Eigen::Vector2d sigma_m = eigen.eigenvalues().cwiseMax(1e-6).cwiseSqrt();
  const Eigen::Vector2d major = eigen.eigenvectors().col(1);  // eigenvalues grow
  const Eigen::Vector2d center_m = target.p_world_m.head<2>();
  const double z_m = target.p_world_m.z() + kLayer_m;
  const Ellipse region{center_m, std::atan2(major.y(), major.x()), kRadius99 * sigma_m.y(), kRadius99 * sigma_m.x()};
  const double radius_m = std::sqrt(std::max(target.area_m2, 1e-4) / kPi);
  const auto alpha = static_cast<float>(target.probability);
  add_fan(mesh.translucent, center_m, around(region), z_m, {kTargetRegionColor, 0.4F});
  add_fan(mesh.translucent, center_m, around({center_m, 0.0, radius_m, radius_m}), z_m + kLayer_m,
          {kTargetColor, 0.7F * alpha});
}

/// The body of a thing that was seen all around.
void fill(const Chain& chain, double z_m, const Paint& paint, MapMesh& mesh) {
  if (!chain.closed) return;
  Polyline outline;
  Eigen::AlignedBox2d box;
  for (const ChainVertex& vertex : chain.vertices) {
    outline.push_back(vertex.p_world_m);
    box.extend(vertex.p_world_m);
  }
  if (box.sizes().maxCoeff() > kLargestFilled_m) return;
  outline.push_back(outline.front());
  add_fan(mesh.translucent, box.center(), outline, z_m, paint);
}

}  // namespace

DrawableMap drawable_map(const Map& map) {
  for (const Feature& feature : map.features) check_drawable(feature);
  MapLayers layers = layers_of(map);
  DrawableMap result;
  result.objects = std::move(layers.objects);
  result.polygons = std::move(layers.polygons);
  result.boundaries.stamp_ns = layers.boundaries.stamp_ns;
  result.boundaries.height_world_m = layers.boundaries.height_world_m;
  for (const Splinegon& splinegon : layers.boundaries.boundaries) {
    result.boundaries.chains.push_back(chain_of(splinegon));
  }
  result.targets = std::move(layers.targets);
  return result;
}

std::size_t size_of(const DrawableMap& map) {
  return map.objects.objects.size() + map.polygons.chains.size() + map.boundaries.chains.size() +
         map.targets.targets.size();
}

void draw(const DrawableMap& map, const MapHistory& history, const FeatureStyle& style, MapMesh& mesh) {
  clear(mesh);
  for (const GridTarget& target : map.targets.targets) add(target, mesh);
  PolygonStyle lines;
  static_cast<MapStyle&>(lines) = style;
  lines.uncertainty = style.covariance;
  lines.line_m = style.line_m;
  const bool by_id = style.coloring == ObjectStyle::kId;
  for (const Chain& chain : map.boundaries.chains) {
    add(chain, by_id ? color_of(chain.id) : kBoundaryColor, map.boundaries.height_world_m, lines, mesh);
  }
  for (const Chain& chain : map.polygons.chains) {
    const Color color = by_id ? color_of(chain.id) : color_of(chain.state);
    add(chain, color, map.polygons.height_world_m, lines, mesh);
    fill(chain, map.polygons.height_world_m + 0.5 * style.body_height_m, {color, static_cast<float>(style.alpha)},
         mesh);
  }
  add(map.objects, history, style, mesh);
}

std::vector<MapPosition> positions_of(const DrawableMap& map) { return positions_of(map.objects); }

std::vector<MapLabel> labels_of(const DrawableMap& map, const MapStyle& style) {
  std::vector<MapLabel> labels = labels_of(map.objects, style);
  for (const Polygons* lines : {&map.polygons, &map.boundaries}) {
    const std::vector<MapLabel> of_lines = labels_of(*lines, style);
    labels.insert(labels.end(), of_lines.begin(), of_lines.end());
  }
  for (const GridTarget& target : map.targets.targets) {
    labels.push_back({std::to_string(target.id), (target.p_world_m + Eigen::Vector3d(0.0, 0.0, 0.5)).cast<float>()});
  }
  return labels;
}

}  // namespace situation_awareness
