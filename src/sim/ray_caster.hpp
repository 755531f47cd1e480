// SPDX-License-Identifier: BSD-3-Clause
// Ray casting of scanners in a world. Private to sim/, because it includes MuJoCo.
#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/sim/intensity.hpp"
#include "situation_awareness/sim/world.hpp"
#include "world_model.hpp"

namespace situation_awareness {

struct Ray {
  int geom = -1;          ///< of the model; -1: no hit
  int object = -1;        ///< index of the object that the geom is; -1: scenery
  double range_m = -1.0;  ///< < 0 without a hit
};

/// Casts rays into a world. Ellipsoids of objects become infinitely tall elliptic cylinders, for any third radius in
/// the file: this changes the caster's model.
class RayCaster {
 public:
  explicit RayCaster(World& world);

  RobotState robot_at(double time_s) const { return world_.robot_at(time_s); }

  /// Move everything to its pose at that time. Returns the robot's pose.
  Eigen::Isometry3d move_to(double time_s);

  /// The nearest hit of scenery or objects along the unit vector, at any range.
  Ray cast(const Eigen::Vector3d& origin_world, const Eigen::Vector3d& direction_world) const;

  // Of a ray with a hit:

  /// Cosine of the angle between the ray and the surface's normal, from 0 to 1; 1 where there is no normal.
  double cos_incidence(const Ray& ray, const Eigen::Vector3d& origin_world,
                       const Eigen::Vector3d& direction_world) const;

  /// The place hit, in the frame of the geom's body.
  Eigen::Vector2d on_body(const Ray& ray, const Eigen::Vector3d& origin_world,
                          const Eigen::Vector3d& direction_world) const;

  /// The noiseless intensity.
  double intensity(const Ray& ray, const Eigen::Vector3d& origin_world, const Eigen::Vector3d& direction_world,
                   const SimulatedIntensityParams& params) const;

  /// The light received (intensity.hpp).
  double received_power(const Ray& ray, const Eigen::Vector3d& origin_world, const Eigen::Vector3d& direction_world,
                        const SimulatedIntensityParams& params) const;

 private:
  /// Outward normal, of any length, of a geom at the hit of a ray; in the world. Zero where there is none.
  Eigen::Vector3d normal(int geom, const Eigen::Vector3d& p_world) const;

  WorldModel& world_;
  std::vector<int> object_of_geom_;
  std::vector<Surface> surface_of_geom_;
};

}  // namespace situation_awareness
