// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/grid/grid.hpp"
#include "situation_awareness/map/id_source.hpp"
#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/map/splinegons/splinegons.hpp"

namespace situation_awareness {

/// How a feature moves.
enum class Motion : std::uint8_t {
  kMoving,
  kStanding,  ///< it may move, or has moved
  kFixed,     ///< it was never seen to move, and stands for long
};

/// "moving", "standing", "fixed".
const char* name_of(Motion motion);

/// By what a feature was seen. Bits, as several may have.
struct Sensors {
  bool scan = false, cloud = false, camera = false, robot = false, file = false;
};

/// What moves, or may: an estimate of its state.
struct BodyState {
  Eigen::Vector2d velocity_world_m_s = Eigen::Vector2d::Zero();
  double angular_velocity_rad_s = 0.0;
  Matrix8d covariance = Matrix8d::Zero();  ///< ordered as object_error says
};

struct EllipseShape {
  Ellipse ellipse_world;
  BodyState body;
};

struct BoxShape {
  Box box_world;
  BodyState body;
};

/// The boundary of what stands; the free side is to the left (Chain).
struct PolylineShape {
  std::vector<ChainVertex> vertices;
  bool closed = false;
};

/// The boundary of a large obstacle as arcs; the free side is to the right (Splinegon).
struct ArcShape {
  std::vector<SplinegonVertex> vertices;
  bool closed = false;
};

/// What an image shows on the ground: only where and how large it is.
struct FootprintShape {
  Eigen::Vector3d p_world_m = Eigen::Vector3d::Zero();
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();
  double area_m2 = 0.0;
};

/// A boundary as its layer has it, without its id, times and covariances.
Splinegon splinegon_of(const ArcShape& shape);

/// Vertices no further apart than `spacing_m` > 0 along a boundary, in its order: the free side is to the right.
std::vector<ChainVertex> lines_along(const Splinegon& boundary, double spacing_m);

using FeatureShape = std::variant<EllipseShape, BoxShape, PolylineShape, ArcShape, FootprintShape>;

/// "ellipse", "box", "polyline", "boundary", "target".
const char* kind_of(const FeatureShape& shape);

/// Around a shape, or a little more.
Eigen::AlignedBox2d box_around(const FeatureShape& shape);

/// Points along an outline, 16 at most, at the same distance from each to the next; none of a target.
std::vector<Eigen::Vector2d> points_along(const FeatureShape& shape);

/// A thing on the map, whatever it is seen by and whatever shape it has.
struct Feature {
  FeatureId id = 0;
  ObjectClass object_class = ObjectClass::kUnknown;
  double p_class = 0.0;  ///< 0 for kUnknown
  double p_exists = 1.0;
  double p_moving = 0.0;
  Motion motion = Motion::kFixed;
  std::int64_t first_seen_ns = 0, last_seen_ns = 0;
  std::optional<std::int64_t> last_absent_ns;   ///< when its place was free before it was seen
  std::optional<std::int64_t> first_absent_ns;  ///< when its place was free after it was seen
  Sensors seen_by;
  FeatureShape shape;
};

/// Moves vertices of chains or splinegons by a motion in the plane, whose place is known with this variance in any
/// direction.
template <class Vertices>
void move_vertices(Vertices& vertices, const Pose2& T, double variance_m2) {
  const Eigen::Matrix2d R = T.rotation();
  for (auto& vertex : vertices) {
    vertex.p_world_m = R * vertex.p_world_m + T.translation_m;
    vertex.sigma_m = std::sqrt(vertex.sigma_m * vertex.sigma_m + variance_m2);
  }
}

/// Moves a feature by a motion in the plane, whose place is known with this variance in any direction.
void move(Feature& feature, const Pose2& T, double variance_m2);

/// All that is around, at one time, by ascending id.
struct Map {
  std::int64_t stamp_ns = 0;
  std::int64_t objects_stamp_ns = 0;  ///< of the scan that its bodies are known by; 0: none, as without objects
  double height_world_m = 0.0;
  std::vector<Feature> features;
};

/// The features of a map in the types of the layers that follow them, each under its id.
struct MapLayers {
  Objects objects;
  Polygons polygons;
  Splinegons boundaries;
  GridTargets targets;
};

/// Chains are walls where they are fixed, else known.
MapLayers layers_of(const Map& map);

/// Why a feature is not on the map any more.
enum class GoneReason : std::uint8_t {
  kLeft,         ///< it moved out of sight, or is not seen any more
  kSeenThrough,  ///< beams pass where it was
  kMerged,       ///< it is part of another one
  kForgotten,    ///< the map begins anew
};

/// "left", "seen through", "merged", "forgotten".
const char* name_of(GoneReason reason);

struct Gone {
  FeatureId id = 0;
  GoneReason reason = GoneReason::kSeenThrough;
  std::optional<FeatureId> into;  ///< of kMerged: that has it now
};

/// What has changed on the map between two of its versions.
struct MapDelta {
  std::int64_t stamp_ns = 0;
  std::int64_t objects_stamp_ns = 0;    ///< Map
  std::uint64_t map = 0;                ///< number of the map, of those that one program makes: ids of two never mix
  std::uint64_t base = 0, version = 0;  ///< from this one to that; with `full` from nothing
  bool full = false;
  double height_world_m = 0.0;   ///< of the latest scan
  std::vector<Feature> changed;  ///< new ones, and all that are not as they were; by ascending id
  std::vector<Gone> gone;        ///< by ascending id
};

}  // namespace situation_awareness
