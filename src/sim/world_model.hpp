// SPDX-License-Identifier: BSD-3-Clause
// The model of a world file, shared by scanners and cameras. Private to sim/, because it includes MuJoCo.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>
#include <Eigen/Geometry>

#include "situation_awareness/sim/fixed_wing.hpp"
#include "situation_awareness/sim/guided_multirotor.hpp"
#include "situation_awareness/sim/multirotor.hpp"
#include "situation_awareness/sim/path.hpp"
#include "situation_awareness/sim/unicycle.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

// Geom groups of a world file; higher ones are decoration, invisible to the scanner.
constexpr int kSceneryGroup = 0;  // MuJoCo's default: walls, floor
constexpr int kObjectGroup = 1;   // the objects' geoms
constexpr int kAbsentGroup = 5;   // absent bodies; invisible to scanners and cameras

struct DeleteModel {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
};
struct DeleteData {
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using ModelPtr = std::unique_ptr<mjModel, DeleteModel>;
using DataPtr = std::unique_ptr<mjData, DeleteData>;

/// Turns MuJoCo's errors and warnings into exceptions during its lifetime. By default MuJoCo ends the process or writes
/// MUJOCO_LOG.TXT. Its handlers and the latest model are globals: hence the lock.
class MujocoThrows {
 public:
  MujocoThrows();
  ~MujocoThrows();
  MujocoThrows(const MujocoThrows&) = delete;
  MujocoThrows& operator=(const MujocoThrows&) = delete;

 private:
  std::lock_guard<std::mutex> lock_;
  void (*error_)(const char*);
  void (*warning_)(const char*);
};

Eigen::Isometry3d body_pose(const mjData& data, int body);

/// The element's name in quotes, or its number where it has none.
std::string quoted_name(const mjModel& model, mjtObj type, int id);

/// An elliptic cylinder of the world, or a box or a mesh.
struct WorldObject {
  std::string name;
  int geom = -1;
  int mocap = -1;     // -1: cannot move
  double rx_m = 0.0;  // of a cylinder
  double ry_m = 0.0;
  std::vector<Eigen::Vector2d> footprint_m;  // of a box or a mesh, in the body's frame, counter-clockwise
  ScriptedPath path;
  Presence presence;
};

/// One object, or several that are its parts.
struct WorldThing {
  std::string name;
  std::vector<std::size_t> parts;  // indices of objects
  ScriptedPath path;               // of the body of its name, else of its first part
};

/// A moving body that is visible only to cameras.
struct WorldDecoration {
  int mocap = -1;
  ScriptedPath path;
};

/// A body that is not always present.
struct WorldVisitor {
  Presence presence;
  std::vector<int> geoms;
  std::vector<int> groups;  // of the geoms, while they are present
};

/// The outline of a geom that may be hit.
struct WorldOutline {
  std::string thing;
  int object = -1;  // index of the object that it is of; -1: scenery, which stands
  bool can_move = false;
  double bottom_m = 0.0, top_m = 0.0;
  std::vector<Eigen::Vector2d> points_world_m;  // of scenery
  Presence presence;
};

class Flight;

/// A loaded and checked world file, with the poses of everything at any time.
class WorldModel {
 public:
  /// Throws std::runtime_error naming the file, the element and its error.
  explicit WorldModel(const std::string& mjcf_path);
  ~WorldModel();

  mjModel& model() { return *model_; }
  mjData& data() { return *data_; }
  const std::vector<WorldObject>& objects() const { return objects_; }
  const std::vector<std::string>& names() const { return names_; }
  const std::vector<WorldThing>& things() const { return things_; }
  const std::vector<SensorMount>& mounts() const { return mounts_; }
  const std::optional<WorldOrigin>& origin() const { return origin_; }
  const std::vector<Box>& fixtures() const { return fixtures_; }

  const std::vector<WorldOutline>& outlines() const { return outlines_; }
  const std::vector<Eigen::Vector2d>& docks() const { return docks_; }
  const std::vector<Eigen::Vector3d>& rounds() const { return rounds_; }
  Unicycle* vehicle() { return vehicle_.get(); }
  FixedWing* aircraft() { return aircraft_.get(); }
  GuidedMultirotor* multirotor() { return multirotor_.get(); }

  RobotState robot_at(double time_s) const;

  /// See World::begin_transit.
  void begin_transit(int transit, double time_s) {
    transit_ = transit;
    transit_begin_s_ = time_s;
  }
  int transit() const { return transit_; }

  /// The time of paths and presence.
  double time_of_transit(double time_s) const { return time_s - transit_begin_s_; }

  bool is_there(const Presence& presence, double time_s) const {
    return presence.at(time_of_transit(time_s), transit_);
  }

  /// Move the present objects to their poses at that time, and the robot to the given pose.
  void place(double time_s, const Eigen::Isometry3d& T_world_robot);

  /// Move the decoration to its poses at that time; not needed for scans.
  void place_decorations(double time_s);

 private:
  void set_mocap(int mocap, const Eigen::Vector3d& position_world, const Eigen::Quaterniond& q_world);
  void move_along(int mocap, const ScriptedPath& path, double time_s);
  void show_those_there(double time_s);

  ModelPtr model_;
  DataPtr data_;
  std::vector<WorldObject> objects_;
  std::vector<std::string> names_;  // of the objects
  std::vector<WorldThing> things_;
  std::vector<SensorMount> mounts_;
  std::optional<WorldOrigin> origin_;
  std::vector<Box> fixtures_;
  std::vector<WorldDecoration> decorations_;
  std::vector<WorldVisitor> visitors_;
  std::vector<WorldOutline> outlines_;
  std::vector<Eigen::Vector2d> docks_;
  std::vector<Eigen::Vector3d> rounds_;
  int transit_ = 1;
  double transit_begin_s_ = 0.0;
  int robot_ = -1;
  RobotState robot_at_rest_;  // the robot's state without a path
  ScriptedPath robot_path_;
  double robot_drag_1_s_ = 0.0;
  std::unique_ptr<Unicycle> vehicle_;             // of a robot that is driven on wheels
  std::unique_ptr<FixedWing> aircraft_;           // of one that flies on
  std::unique_ptr<GuidedMultirotor> multirotor_;  // of one that goes to goals
  std::unique_ptr<Flight> flight_;  // of a robot that is flown; one that follows its path exactly has none
};

}  // namespace situation_awareness
