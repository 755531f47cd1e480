// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/expected_outline.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/geometry/shape.hpp"

namespace situation_awareness {

using Matrix8d = Eigen::Matrix<double, 8, 8>;
using Vector8d = Eigen::Matrix<double, 8, 1>;

/// Index of each error state in `Object::covariance`.
namespace object_error {
constexpr int kPosition = 0;         ///< 2, m, world
constexpr int kVelocity = 2;         ///< 2, m/s, world
constexpr int kOrientation = 4;      ///< 1, rad, about world z
constexpr int kAngularVelocity = 5;  ///< 1, rad/s, about world z
constexpr int kRadii = 6;            ///< 2, m, (rx, ry)
}  // namespace object_error

/// What an object is.
enum class ObjectClass : std::uint8_t {
  kUnknown,
  kPerson,
  kVehicle,
  kPole,
};

/// "unknown", "person", "vehicle", "pole".
const char* name_of(ObjectClass object_class);

/// One element of the semantic map: a body that moves, as an ellipse (ellipse paper, eq. 4) and, if it is one, as a
/// box.
struct Object {
  std::uint64_t id = 0;
  Ellipse ellipse_world;  ///< that stands for the object, rx >= ry > 0; of a box its moment-equal one
  Eigen::Vector2d velocity_world_m_s = Eigen::Vector2d::Zero();
  double angular_velocity_rad_s = 0.0;
  Matrix8d covariance = Matrix8d::Zero();  ///< of the error state, ordered as object_error says
  double p_moving = 0.0;                   ///< probability that it moves rather than stands
  double p_exists = 1.0;                   ///< probability of existence
  std::int64_t first_seen_ns = 0;
  std::int64_t last_seen_ns = 0;
  int observations = 0;                              ///< number of scans it was seen in
  int beams = 0;                                     ///< number of hits on it in the latest scan, 0 if it was not seen
  Shape shape = Shape::kEllipse;                     ///< the likeliest
  double p_shape = 1.0;                              ///< its probability
  ObjectClass object_class = ObjectClass::kUnknown;  ///< the likeliest
  double p_class = 0.0;                              ///< its probability; 0 for kUnknown
  Box box_world;                                     ///< half length >= half width > 0; used for Shape::kBox only
};

/// The semantic map at one time, by ascending id.
struct Objects {
  std::int64_t stamp_ns = 0;
  double height_world_m = 0.0;
  std::vector<Object> objects;
};

/// Number of points of an outline that is an ellipse: the polygon is inside it by at most 0.5 % of its radii.
constexpr int kOutlinePoints = 32;

/// Points of the object's outline, counter-clockwise, without the first again at the end: the corners of a box, else
/// kOutlinePoints points on the ellipse that stands for it.
std::vector<Eigen::Vector2d> outline_world(const Object& object);

/// Maps older than this give no expected outlines.
constexpr double kMaxMapAge_s = 0.5;

/// The outlines of the map's elements in the level frame, predicted to a later time by their velocities; none where the
/// map is older than `max_age_s` or of a later time. `memory` is a result no longer needed, whose memory this one
/// reuses.
std::vector<ExpectedOutline> outlines_at(std::int64_t stamp_ns, const Pose2& T_world_level, const Objects& map,
                                         double max_age_s = kMaxMapAge_s, std::vector<ExpectedOutline> memory = {});

}  // namespace situation_awareness
