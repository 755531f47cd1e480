// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/world.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "world_model.hpp"

namespace situation_awareness {

World::World(const std::string& mjcf_path) : path_(mjcf_path), model_(std::make_unique<WorldModel>(mjcf_path)) {}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

const std::string& World::path() const { return path_; }

RobotState World::robot_at(double time_s) const { return model_->robot_at(time_s); }

Unicycle* World::vehicle() { return model_->vehicle(); }
const Unicycle* World::vehicle() const { return model_->vehicle(); }

FixedWing* World::aircraft() { return model_->aircraft(); }

GuidedMultirotor* World::multirotor() { return model_->multirotor(); }

const std::vector<Eigen::Vector3d>& World::rounds() const { return model_->rounds(); }

const std::vector<Eigen::Vector2d>& World::docks() const { return model_->docks(); }

void World::begin_transit(int transit, double time_s) { model_->begin_transit(transit, time_s); }

int World::transit() const { return model_->transit(); }

std::vector<TrueOutline> World::outlines_at(double time_s, double height_m) const {
  const std::vector<TrueObject> objects = objects_at(time_s);
  std::vector<TrueOutline> outlines;
  for (const WorldOutline& of_file : model_->outlines()) {
    if (height_m < of_file.bottom_m || height_m > of_file.top_m) continue;
    TrueOutline outline;
    outline.thing = of_file.thing;
    outline.can_move = of_file.can_move;
    outline.is_there = model_->is_there(of_file.presence, time_s);
    outline.points_world_m =
        of_file.object < 0 ? of_file.points_world_m : outline_of(objects[static_cast<std::size_t>(of_file.object)]);
    outlines.push_back(std::move(outline));
  }
  return outlines;
}

std::vector<TrueObject> World::objects_at(double time_s) const {
  std::vector<TrueObject> objects;
  const std::vector<WorldObject>& of_file = model_->objects();
  for (std::size_t i = 0; i < of_file.size(); ++i) {
    const PathState state = of_file[i].path(model_->time_of_transit(time_s));
    TrueObject object;
    object.id = i + 1;
    object.is_there = model_->is_there(of_file[i].presence, time_s);
    object.T_world_object = {state.position_m.head<2>(), state.yaw_rad};
    if (of_file[i].footprint_m.empty()) {
      object.ellipse_world = canonical({state.position_m.head<2>(), state.yaw_rad, of_file[i].rx_m, of_file[i].ry_m});
    }
    for (const Eigen::Vector2d& p_object : of_file[i].footprint_m) {
      object.footprint_world_m.push_back(object.T_world_object * p_object);
    }
    object.velocity_world_m_s = state.velocity_m_s.head<2>();
    object.angular_velocity_rad_s = state.yaw_rate_rad_s;
    objects.push_back(object);
  }
  return objects;
}

std::vector<TrueThing> World::things_at(double time_s) const {
  std::vector<TrueThing> things;
  for (const WorldThing& of_file : model_->things()) {
    const PathState state = of_file.path(model_->time_of_transit(time_s));
    TrueThing thing;
    thing.name = of_file.name;
    thing.kind = of_file.name.substr(0, of_file.name.find_last_not_of("_0123456789") + 1);
    thing.is_there = std::any_of(of_file.parts.begin(), of_file.parts.end(), [&](std::size_t part) {
      return model_->is_there(model_->objects()[part].presence, time_s);
    });
    thing.T_world_thing = {state.position_m.head<2>(), state.yaw_rad};
    thing.parts = of_file.parts;
    thing.velocity_world_m_s = state.velocity_m_s.head<2>();
    thing.angular_velocity_rad_s = state.yaw_rate_rad_s;
    things.push_back(std::move(thing));
  }
  return things;
}

const std::vector<std::string>& World::names() const { return model_->names(); }

const std::vector<SensorMount>& World::mounts() const { return model_->mounts(); }

const std::optional<WorldOrigin>& World::origin() const { return model_->origin(); }

const std::vector<Box>& World::fixtures() const { return model_->fixtures(); }

const Eigen::Isometry3d& World::T_robot_lidar() const {
  const auto lidar =
      std::find_if(mounts().begin(), mounts().end(), [](const SensorMount& mount) { return mount.name == "lidar"; });
  if (lidar == mounts().end()) throw std::runtime_error(path_ + ": there is no site 'lidar' on 'robot'");
  return lidar->T_robot_sensor;
}

}  // namespace situation_awareness
