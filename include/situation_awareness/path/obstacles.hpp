// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/curve.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/map/map.hpp"

namespace situation_awareness {

/// What an obstacle is on the map as, or hits of a scan that are not on it.
enum class ObstacleKind : std::uint8_t {
  kBoundary,  ///< a boundary of arcs
  kChain,     ///< a polyline
  kObject,    ///< an ellipse or a box
  kHits,
};

const char* name_of(ObstacleKind kind);  ///< "boundary", "chain", "object", "hits"

/// A line or an arc of an obstacle's outline.
struct ObstaclePiece {
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);

  Curve curve;                 ///< in the world
  double sigma_m = 0.0;        ///< of the outline, across it: the greatest along the piece
  std::size_t obstacle = 0;    ///< index
  std::size_t before = kNone;  ///< the piece at its begin, and
  std::size_t after = kNone;   ///< that at its end
  Eigen::Vector2d middle_m;    ///< of the curve; it is within
  double half_m = 0.0;         ///< of that
};

struct Obstacle {
  ObstacleKind kind = ObstacleKind::kBoundary;
  FeatureId id = 0;  ///< on the map; 0 of hits
  bool closed = false;
  std::size_t first = 0;   ///< piece
  std::size_t pieces = 0;  ///< number of them
  double sigma_m = 0.0;    ///< the greatest of the pieces
};

/// Consecutive pieces of one obstacle, and a circle around them: what is far from that is far from all of them.
struct PieceRun {
  std::size_t first = 0;  ///< piece
  std::size_t end = 0;    ///< after the last one
  Eigen::Vector2d middle_m = Eigen::Vector2d::Zero();
  double radius_m = 0.0;
  double sigma_m = 0.0;  ///< the greatest of the pieces
};

/// The outlines of all that a vehicle keeps away from, in the world, as lines and arcs. A closed one is known by its
/// outline alone, which no path from outside passes. Keeps its memory.
class Obstacles {
 public:
  void clear();

  /// Memory for so many pieces.
  void reserve(std::size_t pieces);

  /// Adds the outline of a feature, without pieces shorter than 1 um. Of a target nothing is added: it is on the
  /// ground, and the map has no outline of it. The standard deviation of an ellipse or a box is that of its place, in
  /// its worst direction, and of its larger radius.
  void add(const Feature& feature);
  /// By a polygon of 32 edges about it: larger by half a percent at most; a circle exactly. Radii > 0.
  void add(const Ellipse& ellipse_world, double sigma_m, FeatureId id);
  void add(const std::vector<Eigen::Vector2d>& polyline_world_m, bool closed, double sigma_m, ObstacleKind kind,
           FeatureId id);

  const std::vector<Obstacle>& obstacles() const { return obstacles_; }
  const std::vector<ObstaclePiece>& pieces() const { return pieces_; }
  const std::vector<PieceRun>& runs() const { return runs_; }  ///< all pieces, in order

 private:
  void add(const EllipseShape& shape, FeatureId id);
  void add(const BoxShape& shape, FeatureId id);
  void add(const PolylineShape& shape, FeatureId id);
  void add(const ArcShape& shape, FeatureId id);
  void begin(ObstacleKind kind, FeatureId id, bool closed);
  void add_piece(const Curve& curve, double sigma_m);
  void end();

  std::vector<Obstacle> obstacles_;
  std::vector<ObstaclePiece> pieces_;
  std::vector<PieceRun> runs_;
};

/// Distance of a point from the nearest outline; infinite without obstacles. `piece`, if given: the nearest one.
double distance_m(const Obstacles& obstacles, const Eigen::Vector2d& p_world_m, std::size_t* piece = nullptr);

}  // namespace situation_awareness
