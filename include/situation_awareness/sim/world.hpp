// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/sim/multirotor.hpp"

namespace situation_awareness {

class FixedWing;
class GuidedMultirotor;
class Unicycle;
class WorldModel;

/// An object of a world in truth, at one time: an elliptic cylinder, or something whose outline is a polygon.
struct TrueObject {
  std::uint64_t id = 0;                  ///< from 1 in the order of the file
  bool is_there = true;                  ///< false before it appears and once it has gone
  Pose2 T_world_object;                  ///< of its body
  std::optional<Ellipse> ellipse_world;  ///< of a cylinder, canonical
  /// Of a box or a mesh: its corners, counter-clockwise, without the first again at the end. Of a mesh those of its
  /// section at half its height.
  std::vector<Eigen::Vector2d> footprint_world_m;
  Eigen::Vector2d velocity_world_m_s = Eigen::Vector2d::Zero();  ///< of the body's origin
  double angular_velocity_rad_s = 0.0;                           ///< about world z
};

/// The corners of an object's outline, counter-clockwise; those of an ellipse are points on it.
inline std::vector<Eigen::Vector2d> outline_of(const TrueObject& object) {
  constexpr int kSides = 48;
  return object.ellipse_world ? points_on(*object.ellipse_world, kSides) : object.footprint_world_m;
}

/// A thing of a world in truth, at one time: an object, or all those named THING/PART together, such as the legs of a
/// table or of a person.
struct TrueThing {
  std::string name;  ///< of the object, without its part
  std::string kind;  ///< the name without a number at its end: `table` of table_2
  bool is_there = true;
  Pose2 T_world_thing;             ///< of the body THING where there is one, else of the first part
  std::vector<std::size_t> parts;  ///< indices of the objects
  Eigen::Vector2d velocity_world_m_s = Eigen::Vector2d::Zero();  ///< of the origin
  double angular_velocity_rad_s = 0.0;                           ///< about world z
};

/// What a 2D scanner at one height may hit, in truth: the outline of a geom of the scenery or of an object.
struct TrueOutline {
  std::string thing;  ///< name of the body, or of a geom of the world body; of THING/PART it is THING
  bool is_there = true;
  bool can_move = false;                        ///< it has `mocap`
  std::vector<Eigen::Vector2d> points_world_m;  ///< counter-clockwise, without the first again at the end
};

/// A place on the robot where the file mounts a sensor.
struct SensorMount {
  std::string name;
  std::string text;  ///< the file's text of the sensor; sensors.hpp reads it
  Eigen::Isometry3d T_robot_sensor = Eigen::Isometry3d::Identity();
};

/// Where the origin of a world is on the WGS 84 ellipsoid; the world's x axis points east there, y north, z up.
struct WorldOrigin {
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  double altitude_m = 0.0;  ///< above the ellipsoid
};

/// A world in MuJoCo: named objects that stand or follow scripted paths, and a robot: a multirotor that follows its own
/// path, tilted as its acceleration demands, or a vehicle on wheels or wings that is driven by commands. Everything but
/// that vehicle is a function of time. Measurements are in the sensors, counts of hits in the truth.
/// models/worlds/README.md describes the file.
class World {
 public:
  /// Throws std::runtime_error naming the file, the element and its error.
  explicit World(const std::string& mjcf_path);
  ~World();
  World(World&&) noexcept;
  World& operator=(World&&) noexcept;

  const std::string& path() const;

  /// State of the robot at any time. Throws std::out_of_range for a vehicle where its motion is not known.
  RobotState robot_at(double time_s) const;

  /// The vehicle, where the robot is one; else nothing.
  Unicycle* vehicle();
  const Unicycle* vehicle() const;

  /// The vehicle, where the robot is one that flies on; else nothing.
  FixedWing* aircraft();

  /// The vehicle, where the robot is a multirotor that goes to goals; else nothing.
  GuidedMultirotor* multirotor();

  /// The circles around the world's obstacles: centre and radius; empty without `rounds` in the file.
  const std::vector<Eigen::Vector3d>& rounds() const;

  /// Where the vehicle's transits begin and end; empty without `docks` in the file.
  const std::vector<Eigen::Vector2d>& docks() const;

  /// A new transit begins: paths and presence of all bodies but the robot have the time since then. Poses of earlier
  /// times are then no longer those of the transit before. In the beginning it is transit 1, from time 0 on.
  void begin_transit(int transit, double time_s);

  int transit() const;

  /// Of all boxes and cylinders of the scenery that are upright and of all objects, where they reach `height_m`; in the
  /// order of the file. Other shapes have none.
  std::vector<TrueOutline> outlines_at(double time_s, double height_m) const;

  /// All objects at any time, in the order of the file.
  std::vector<TrueObject> objects_at(double time_s) const;

  /// All things at any time, in the order of their first objects in the file.
  std::vector<TrueThing> things_at(double time_s) const;

  /// Of all objects: that of id i at place i - 1.
  const std::vector<std::string>& names() const;

  /// In the order of the file.
  const std::vector<SensorMount>& mounts() const;

  /// Where the site `lidar` is. Throws std::runtime_error naming the file where there is none.
  const Eigen::Isometry3d& T_robot_lidar() const;

  /// Where the file says that the world is; nothing where it does not.
  const std::optional<WorldOrigin>& origin() const;

  /// Boxes of the room, such as cabinets, that the scanner sees and the truth does not have: those of the world body
  /// with the name fixture/NAME.
  const std::vector<Box>& fixtures() const;

  /// For the sensors: the world as MuJoCo has it, which they move to the times at which they measure.
  WorldModel& model() { return *model_; }

 private:
  std::string path_;
  std::unique_ptr<WorldModel> model_;
};

}  // namespace situation_awareness
