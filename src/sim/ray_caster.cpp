// SPDX-License-Identifier: BSD-3-Clause
#include "ray_caster.hpp"

#include <array>

#include <mujoco/mujoco.h>

namespace situation_awareness {
namespace {

/// An ellipsoid this tall is an elliptic cylinder to every ray of a LIDAR: 30 m up or down it is thinner by 5e-6.
constexpr double kHalfHeight_m = 1e4;

}  // namespace

RayCaster::RayCaster(World& world) : world_(world.model()) {
  mjModel& model = world_.model();
  const std::vector<WorldObject>& objects = world_.objects();
  object_of_geom_.assign(static_cast<std::size_t>(model.ngeom), -1);
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const int geom = objects[i].geom;
    object_of_geom_[static_cast<std::size_t>(geom)] = static_cast<int>(i);
    if (model.geom_type[geom] != mjGEOM_ELLIPSOID) continue;
    model.geom_size[3 * geom + 2] = kHalfHeight_m;
    model.geom_rbound[geom] = kHalfHeight_m;
  }
}

Eigen::Isometry3d RayCaster::move_to(double time_s) {
  const Eigen::Isometry3d T_world_robot = robot_at(time_s).T_world_robot;
  world_.place(time_s, T_world_robot);
  return T_world_robot;
}

Ray RayCaster::cast(const Eigen::Vector3d& origin_world, const Eigen::Vector3d& direction_world) const {
  std::array<mjtByte, mjNGROUP> seen_groups{};
  seen_groups[kSceneryGroup] = seen_groups[kObjectGroup] = 1;
  Ray ray;
  ray.range_m = mj_ray(&world_.model(), &world_.data(), origin_world.data(), direction_world.data(), seen_groups.data(),
                       /*flg_static=*/1, /*bodyexclude=*/-1, &ray.geom);
  if (ray.geom >= 0) ray.object = object_of_geom_[static_cast<std::size_t>(ray.geom)];
  return ray;
}

}  // namespace situation_awareness
