// SPDX-License-Identifier: BSD-3-Clause
// What the rays of a scanner meet in a world. Private to sim/, because it shows MuJoCo.
#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/sim/intensity.hpp"
#include "situation_awareness/sim/world.hpp"
#include "world_model.hpp"

namespace situation_awareness {

struct Ray {
  int geom = -1;          ///< of the model; -1: it meets nothing
  int object = -1;        ///< index of the object that the geom is; -1: scenery
  double range_m = -1.0;  ///< < 0 where it meets nothing
};

/// Casts rays into a world. To them the ellipsoids of objects are infinitely tall elliptic cylinders, whatever their
/// third radius in the file is: making them so changes the model that the caster is given.
class RayCaster {
 public:
  explicit RayCaster(World& world);

  RobotState robot_at(double time_s) const { return world_.robot_at(time_s); }

  /// Put everything where it is at that time. Returns where the robot is then.
  Eigen::Isometry3d move_to(double time_s);

  /// The nearest thing of scenery and objects along the unit vector, at any range.
  Ray cast(const Eigen::Vector3d& origin_world, const Eigen::Vector3d& direction_world) const;

  /// How much light comes back along a ray that was cast in that way and meets something, without noise.
  double intensity(const Ray& ray, const Eigen::Vector3d& origin_world, const Eigen::Vector3d& direction_world,
                   const SimulatedIntensityParams& params) const;

 private:
  /// Outward normal, of any length, of a geom where a ray meets it; in the world. Zero where there is none.
  Eigen::Vector3d normal(int geom, const Eigen::Vector3d& p_world) const;

  WorldModel& world_;
  std::vector<int> object_of_geom_;
  std::vector<Surface> surface_of_geom_;
};

}  // namespace situation_awareness
