// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/obstacles.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <type_traits>
#include <variant>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// m. Shorter pieces are left out; their neighbours then miss each other by as much.
constexpr double kShortPiece_m = 1e-6;
/// Edges of the polygon about an ellipse.
constexpr int kEllipseEdges = 32;
/// Pieces of a run: the fewer, the tighter its circle; the more, the fewer circles.
constexpr std::size_t kRun = 8;
/// Of the radii: an ellipse that differs less from a circle is one.
constexpr double kRound = 1e-3;

/// Of its place, in its worst direction, and of its larger radius.
double outline_sigma_m(const BodyState& body) {
  const Eigen::Matrix2d place = body.covariance.block<2, 2>(object_error::kPosition, object_error::kPosition);
  const double variance_m2 = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>().computeDirect(place).eigenvalues()[1] +
                             body.covariance(object_error::kRadii, object_error::kRadii);
  return std::sqrt(std::max(variance_m2, 0.0));
}

}  // namespace

const char* name_of(ObstacleKind kind) {
  switch (kind) {
    case ObstacleKind::kBoundary:
      return "boundary";
    case ObstacleKind::kChain:
      return "chain";
    case ObstacleKind::kObject:
      return "object";
    case ObstacleKind::kHits:
      return "hits";
  }
  return "";
}

void Obstacles::clear() {
  obstacles_.clear();
  pieces_.clear();
  runs_.clear();
}

void Obstacles::reserve(std::size_t pieces) {
  obstacles_.reserve(pieces);
  pieces_.reserve(pieces);
  runs_.reserve(pieces);
}

void Obstacles::begin(ObstacleKind kind, FeatureId id, bool closed) {
  obstacles_.push_back({kind, id, closed, pieces_.size(), 0, 0.0});
}

void Obstacles::add_piece(const Curve& curve, double sigma_m) {
  if (!(curve.length_m > kShortPiece_m)) return;
  Obstacle& obstacle = obstacles_.back();
  obstacle.sigma_m = std::max(obstacle.sigma_m, sigma_m);
  ObstaclePiece piece;
  piece.curve = curve;
  piece.sigma_m = sigma_m;
  piece.obstacle = obstacles_.size() - 1;
  piece.middle_m = point_at(curve, 0.5 * curve.length_m);
  piece.half_m = 0.5 * curve.length_m;
  pieces_.push_back(piece);
}

void Obstacles::end() {
  Obstacle& obstacle = obstacles_.back();
  obstacle.pieces = pieces_.size() - obstacle.first;
  if (obstacle.pieces == 0) {
    obstacles_.pop_back();
    return;
  }
  const std::size_t last = pieces_.size() - 1;
  for (std::size_t i = obstacle.first; i <= last; ++i) {
    if (i > obstacle.first) pieces_[i].before = i - 1;
    if (i < last) pieces_[i].after = i + 1;
  }
  if (obstacle.closed && obstacle.pieces > 1) {
    pieces_[obstacle.first].before = last;
    pieces_[last].after = obstacle.first;
  }
  for (std::size_t i = obstacle.first; i <= last; i += kRun) {
    PieceRun& run = runs_.emplace_back();
    run.first = i;
    run.end = std::min(i + kRun, last + 1);
    Eigen::AlignedBox2d box;
    for (std::size_t k = run.first; k < run.end; ++k) box.extend(pieces_[k].middle_m);
    run.middle_m = box.center();
    for (std::size_t k = run.first; k < run.end; ++k) {
      run.radius_m = std::max(run.radius_m, (pieces_[k].middle_m - run.middle_m).norm() + pieces_[k].half_m);
      run.sigma_m = std::max(run.sigma_m, pieces_[k].sigma_m);
    }
  }
}

void Obstacles::add(const Feature& feature) {
  std::visit(
      [&](const auto& shape) {
        if constexpr (!std::is_same_v<std::decay_t<decltype(shape)>, FootprintShape>) add(shape, feature.id);
      },
      feature.shape);
}

void Obstacles::add(const ArcShape& shape, FeatureId id) {
  const std::size_t count = shape.vertices.size();
  if (count < 2) return;
  begin(ObstacleKind::kBoundary, id, shape.closed);
  for (std::size_t i = 0; i + (shape.closed ? 0U : 1U) < count; ++i) {
    const SplinegonVertex& from = shape.vertices[i];
    const SplinegonVertex& to = shape.vertices[i + 1 < count ? i + 1 : 0];
    add_piece(curve_with_bulge(from.p_world_m, to.p_world_m, from.bulge), std::max(from.sigma_m, to.sigma_m));
  }
  end();
}

void Obstacles::add(const PolylineShape& shape, FeatureId id) {
  const std::size_t count = shape.vertices.size();
  if (count < 2) return;
  begin(ObstacleKind::kChain, id, shape.closed);
  for (std::size_t i = 0; i + (shape.closed ? 0U : 1U) < count; ++i) {
    const ChainVertex& from = shape.vertices[i];
    const ChainVertex& to = shape.vertices[i + 1 < count ? i + 1 : 0];
    add_piece(straight_curve(from.p_world_m, to.p_world_m), std::max(from.sigma_m, to.sigma_m));
  }
  end();
}

void Obstacles::add(const BoxShape& shape, FeatureId id) {
  const double sigma_m = outline_sigma_m(shape.body);
  const std::array<Eigen::Vector2d, 4> corners_m = corners(shape.box_world);
  begin(ObstacleKind::kObject, id, true);
  for (std::size_t i = 0; i < 4; ++i) add_piece(straight_curve(corners_m[i], corners_m[(i + 1) % 4]), sigma_m);
  end();
}

void Obstacles::add(const EllipseShape& shape, FeatureId id) {
  add(shape.ellipse_world, outline_sigma_m(shape.body), id);
}

void Obstacles::add(const Ellipse& ellipse_world, double sigma_m, FeatureId id) {
  begin(ObstacleKind::kObject, id, true);
  const double rx_m = ellipse_world.rx_m, ry_m = ellipse_world.ry_m;
  if (std::abs(rx_m - ry_m) < kRound * std::max(rx_m, ry_m)) {
    const double radius_m = std::max(rx_m, ry_m);
    for (const double from_rad : {0.0, kPi}) {
      add_piece(curve_of(Arc{ellipse_world.center_m, radius_m, from_rad, kPi}), sigma_m);
    }
  } else {
    // The tangents at equal steps of the parameter angle meet on the ellipse enlarged by 1 / cos of half a step.
    const Pose2 T{ellipse_world.center_m, ellipse_world.psi_rad};
    const double larger = 1.0 / std::cos(kPi / kEllipseEdges);
    const auto corner = [&](int i) -> Eigen::Vector2d {
      const double t = 2.0 * kPi * i / kEllipseEdges;
      return T * Eigen::Vector2d(larger * rx_m * std::cos(t), larger * ry_m * std::sin(t));
    };
    for (int i = 0; i < kEllipseEdges; ++i) {
      add_piece(straight_curve(corner(i), corner((i + 1) % kEllipseEdges)), sigma_m);
    }
  }
  end();
}

void Obstacles::add(const std::vector<Eigen::Vector2d>& polyline_world_m, bool closed, double sigma_m,
                    ObstacleKind kind, FeatureId id) {
  const std::size_t count = polyline_world_m.size();
  if (count < 2) return;
  begin(kind, id, closed);
  for (std::size_t i = 0; i + (closed ? 0U : 1U) < count; ++i) {
    add_piece(straight_curve(polyline_world_m[i], polyline_world_m[i + 1 < count ? i + 1 : 0]), sigma_m);
  }
  end();
}

double distance_m(const Obstacles& obstacles, const Eigen::Vector2d& p_world_m, std::size_t* piece) {
  double least_m = std::numeric_limits<double>::infinity();
  for (const PieceRun& run : obstacles.runs()) {
    if ((p_world_m - run.middle_m).norm() - run.radius_m >= least_m) continue;
    for (std::size_t i = run.first; i < run.end; ++i) {
      const ObstaclePiece& each = obstacles.pieces()[i];
      if ((p_world_m - each.middle_m).norm() - each.half_m >= least_m) continue;
      const double each_m = distance_m(each.curve, p_world_m);
      if (each_m >= least_m) continue;
      least_m = each_m;
      if (piece != nullptr) *piece = i;
    }
  }
  return least_m;
}

}  // namespace situation_awareness
