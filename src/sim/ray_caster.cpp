// SPDX-License-Identifier: BSD-3-Clause
#include "ray_caster.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <mujoco/mujoco.h>

namespace situation_awareness {
namespace {

/// An ellipsoid this tall is an elliptic cylinder to every ray of a LIDAR: 30 m up or down it is thinner by 5e-6.
constexpr double kHalfHeight_m = 1e4;

/// `user="DIFFUSE GLOSSY RETRO"` of a geom, missing values being 0; all 0: not given.
Surface surface_of(const mjModel& model, int geom) {
  Eigen::Vector3d user = Eigen::Vector3d::Zero();
  for (int i = 0; i < std::min(model.nuser_geom, 3); ++i) user[i] = model.geom_user[model.nuser_geom * geom + i];
  return user.isZero(0.0) ? Surface{} : Surface{user[0], user[1], user[2]};
}

/// Outward normal of the triangle on which a point of a mesh's surface is; both in the mesh's frame.
Eigen::Vector3d mesh_normal(const mjModel& model, int mesh, const Eigen::Vector3d& p) {
  const auto vertex = [&](int face, int corner) -> Eigen::Vector3d {
    const int i = model.mesh_vertadr[mesh] + model.mesh_face[3 * (model.mesh_faceadr[mesh] + face) + corner];
    return Eigen::Map<const Eigen::Vector3f>(model.mesh_vert + 3 * i).cast<double>();
  };
  Eigen::Vector3d best = Eigen::Vector3d::Zero();
  double least_outside = std::numeric_limits<double>::infinity();
  for (int face = 0; face < model.mesh_facenum[mesh]; ++face) {
    const Eigen::Vector3d a = vertex(face, 0), u = vertex(face, 1) - a, v = vertex(face, 2) - a, d = p - a;
    const Eigen::Vector3d n = u.cross(v);
    const double n2 = n.squaredNorm();
    if (!(n2 > 0.0)) continue;
    // Barycentric coordinates of the point's foot on the triangle's plane; and its distance from the plane or the
    // triangle.
    const double s = d.cross(v).dot(n) / n2, t = u.cross(d).dot(n) / n2;
    const double beyond = std::max({0.0, -s, -t, s + t - 1.0}) * std::sqrt(std::max(u.squaredNorm(), v.squaredNorm()));
    const double outside = std::abs(d.dot(n)) / std::sqrt(n2) + beyond;
    if (outside < least_outside) {
      least_outside = outside;
      best = n / std::sqrt(n2);
    }
  }
  return best;
}

}  // namespace

RayCaster::RayCaster(World& world) : world_(world.model()) {
  mjModel& model = world_.model();
  const std::vector<WorldObject>& objects = world_.objects();
  object_of_geom_.assign(static_cast<std::size_t>(model.ngeom), -1);
  for (int geom = 0; geom < model.ngeom; ++geom) surface_of_geom_.push_back(surface_of(model, geom));
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

Eigen::Vector3d RayCaster::normal(int geom, const Eigen::Vector3d& p_world) const {
  const mjModel& model = world_.model();
  const mjData& data = world_.data();
  const Eigen::Matrix3d R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(data.geom_xmat + 9 * geom);
  const Eigen::Vector3d p = R.transpose() * (p_world - Eigen::Map<const Eigen::Vector3d>(data.geom_xpos + 3 * geom));
  const Eigen::Map<const Eigen::Vector3d> size(model.geom_size + 3 * geom);
  const auto radial = [&p] { return Eigen::Vector3d(p.x(), p.y(), 0.0); };
  switch (model.geom_type[geom]) {
    case mjGEOM_PLANE:
      return R.col(2);
    case mjGEOM_SPHERE:
      return R * p;
    case mjGEOM_ELLIPSOID:
      return R * p.cwiseQuotient(size.cwiseAbs2());
    case mjGEOM_CAPSULE:
      return R * (p - Eigen::Vector3d(0.0, 0.0, std::clamp(p.z(), -size[1], size[1])));
    case mjGEOM_CYLINDER:
      if (std::abs(p.z()) - size[1] > radial().norm() - size[0]) return std::copysign(1.0, p.z()) * R.col(2);
      return R * radial();
    case mjGEOM_BOX: {
      int face = 0;
      (p.cwiseAbs() - size).maxCoeff(&face);
      return std::copysign(1.0, p[face]) * R.col(face);
    }
    case mjGEOM_MESH:
      return R * mesh_normal(model, model.geom_dataid[geom], p);
    default:
      return Eigen::Vector3d::Zero();
  }
}

double RayCaster::cos_incidence(const Ray& ray, const Eigen::Vector3d& origin_world,
                                const Eigen::Vector3d& direction_world) const {
  const Eigen::Vector3d n = normal(ray.geom, origin_world + ray.range_m * direction_world);
  const double length = n.norm();
  return length > 0.0 ? std::min(1.0, std::abs(n.dot(direction_world)) / length) : 1.0;
}

Eigen::Vector2d RayCaster::on_body(const Ray& ray, const Eigen::Vector3d& origin_world,
                                   const Eigen::Vector3d& direction_world) const {
  const Eigen::Isometry3d T_world_body = body_pose(world_.data(), world_.model().geom_bodyid[ray.geom]);
  return (T_world_body.inverse() * (origin_world + ray.range_m * direction_world)).head<2>();
}

double RayCaster::intensity(const Ray& ray, const Eigen::Vector3d& origin_world, const Eigen::Vector3d& direction_world,
                            const SimulatedIntensityParams& params) const {
  return true_intensity(params, surface_of_geom_[static_cast<std::size_t>(ray.geom)], ray.range_m,
                        cos_incidence(ray, origin_world, direction_world));
}

double RayCaster::received_power(const Ray& ray, const Eigen::Vector3d& origin_world,
                                 const Eigen::Vector3d& direction_world, const SimulatedIntensityParams& params) const {
  return situation_awareness::received_power(params, surface_of_geom_[static_cast<std::size_t>(ray.geom)], ray.range_m,
                                             cos_incidence(ray, origin_world, direction_world));
}

}  // namespace situation_awareness
