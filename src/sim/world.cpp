// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/world.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <mujoco/mujoco.h>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "world_model.hpp"

namespace situation_awareness {
namespace {

/// An ellipsoid this tall is an elliptic cylinder to every ray of a LIDAR: 30 m up or down it is thinner by 5e-6.
constexpr double kHalfHeight_m = 1e4;

/// One seed per scan, so that its noise depends on nothing else: SplitMix64 (Steele, Lea, Flood, 2014).
std::uint64_t seed_of_scan(std::uint64_t seed, std::uint64_t scan) {
  const auto mix = [](std::uint64_t z) {
    z += 0x9E3779B97F4A7C15U;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
    return z ^ (z >> 31);
  };
  return mix(mix(seed) + scan);
}

}  // namespace

void SimulatedLidarParams::validate() const {
  check_bounds(*this, "lidar");
  if (!(range_max_m > range_min_m)) throw std::invalid_argument("lidar.range_max_m must be above lidar.range_min_m");
  if (!(sweep_s < 1.0 / rate_hz)) throw std::invalid_argument("lidar.sweep_s must be below 1 / lidar.rate_hz");
  const std::string defect = scan_defect(static_cast<std::size_t>(beams), angle_min_rad, angle_increment_rad);
  if (!defect.empty()) throw std::invalid_argument("lidar.angle_increment_rad: " + defect);
}

class World::Impl {
 public:
  Impl(const std::string& mjcf_path, const SimulatedLidarParams& lidar, std::uint64_t seed)
      : lidar_(lidar), seed_(seed), world_(mjcf_path) {
    mjModel& model = world_.model();
    const std::vector<WorldObject>& objects = world_.objects();
    sightings_.resize(objects.size());
    object_of_geom_.assign(static_cast<std::size_t>(model.ngeom), kNoObject);
    for (std::size_t i = 0; i < objects.size(); ++i) {
      const int geom = objects[i].geom;
      object_of_geom_[static_cast<std::size_t>(geom)] = i;
      model.geom_size[3 * geom + 2] = kHalfHeight_m;
      model.geom_rbound[geom] = kHalfHeight_m;
    }
  }

  SimulatedScan next() {
    const double time_s = static_cast<double>(scans_) / lidar_.rate_hz;
    SimulatedScan out;
    out.robot = robot_at(time_s);
    out.T_world_lidar = out.robot.T_world_robot * T_robot_lidar();
    out.T_world_lidar_end = robot_at(time_s + lidar_.sweep_s).T_world_robot * T_robot_lidar();
    scan_from(time_s, out);
    ++scans_;
    out.truth = truth_at(time_s);
    for (const WorldObject& object : world_.objects()) out.names.push_back(object.name);
    return out;
  }

  RobotState robot_at(double time_s) const { return world_.robot_at(time_s); }

  Objects truth_at(double time_s) const {
    Objects truth;
    truth.stamp_ns = nanoseconds(time_s);
    truth.height_world_m = (robot_at(time_s).T_world_robot * T_robot_lidar()).translation().z();
    for (std::size_t i = 0; i < world_.objects().size(); ++i) {
      const WorldObject& true_object = world_.objects()[i];
      const PathState state = true_object.path(time_s);
      Object object = sightings_[i];
      object.id = i + 1;
      object.ellipse_world = canonical({state.position_m.head<2>(), state.yaw_rad, true_object.rx_m, true_object.ry_m});
      object.velocity_world_m_s = state.velocity_m_s.head<2>();
      object.angular_velocity_rad_s = state.yaw_rate_rad_s;
      truth.objects.push_back(object);
    }
    return truth;
  }

  const Eigen::Isometry3d& T_robot_lidar() const { return world_.T_robot_lidar(); }

 private:
  static constexpr std::size_t kNoObject = static_cast<std::size_t>(-1);

  /// Returns where the lidar is then.
  Eigen::Isometry3d move_to(double time_s) {
    const Eigen::Isometry3d T_world_robot = robot_at(time_s).T_world_robot;
    world_.place(time_s, T_world_robot);
    return T_world_robot * T_robot_lidar();
  }

  /// Scan the world as it moves from `start_s` on, and note in sightings_ what was hit.
  void scan_from(double start_s, SimulatedScan& out) {
    std::array<mjtByte, mjNGROUP> seen_groups{};
    seen_groups[kSceneryGroup] = seen_groups[kObjectGroup] = 1;
    const auto min_range_m = static_cast<float>(lidar_.range_min_m);
    const auto max_range_m = static_cast<float>(lidar_.range_max_m);
    Random noise(seed_of_scan(seed_, scans_));

    Scan& scan = out.scan;
    scan.stamp_ns = nanoseconds(start_s);
    scan.angle_min_rad = lidar_.angle_min_rad;
    scan.angle_increment_rad = lidar_.angle_increment_rad;
    scan.time_increment_s = lidar_.sweep_s / (lidar_.beams - 1);
    scan.beams.resize(static_cast<std::size_t>(lidar_.beams));
    out.object_of_beam.assign(scan.beams.size(), -1);
    for (Object& sighting : sightings_) sighting.beams = 0;
    Eigen::Isometry3d T_world_lidar = move_to(start_s);
    for (int i = 0; i < lidar_.beams; ++i) {
      if (i > 0 && scan.time_increment_s > 0.0) T_world_lidar = move_to(start_s + i * scan.time_increment_s);
      const Eigen::Vector3d origin_world = T_world_lidar.translation();
      const double angle_rad = lidar_.angle_min_rad + i * lidar_.angle_increment_rad;
      const Eigen::Vector3d beam_world =
          T_world_lidar.linear() * Eigen::Vector3d(std::cos(angle_rad), std::sin(angle_rad), 0.0);
      int geom = -1;
      const double range_m = mj_ray(&world_.model(), &world_.data(), origin_world.data(), beam_world.data(),
                                    seen_groups.data(), /*flg_static=*/1, /*bodyexclude=*/-1, &geom);
      const double error_m = lidar_.range_sigma_m * noise.normal();  // one draw per beam, whatever it meets

      Beam& beam = scan.beams[static_cast<std::size_t>(i)];
      if (geom < 0 || range_m > lidar_.range_max_m) {
        beam = {max_range_m, BeamState::kFree};
      } else if (range_m < lidar_.range_min_m) {
        beam.state = BeamState::kTooClose;
      } else {
        beam.state = BeamState::kHit;
        beam.range_m = std::clamp(static_cast<float>(range_m + error_m), min_range_m, max_range_m);
        const std::size_t object = object_of_geom_[static_cast<std::size_t>(geom)];
        if (object != kNoObject && range_m <= lidar_.truth_range_m) {
          ++sightings_[object].beams;
          out.object_of_beam[static_cast<std::size_t>(i)] = static_cast<int>(object);
        }
      }
    }
    for (Object& sighting : sightings_) {
      if (sighting.beams == 0) continue;
      if (sighting.observations++ == 0) sighting.first_seen_ns = scan.stamp_ns;
      sighting.last_seen_ns = scan.stamp_ns;
    }
  }

  SimulatedLidarParams lidar_;
  std::uint64_t seed_;
  WorldModel world_;
  std::vector<Object> sightings_;  // what scans say of the objects, nothing else
  std::vector<std::size_t> object_of_geom_;
  std::uint64_t scans_ = 0;
};

World::World(const std::string& mjcf_path, const SimulatedLidarParams& lidar, std::uint64_t seed) {
  lidar.validate();
  impl_ = std::make_unique<Impl>(mjcf_path, lidar, seed);
}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

SimulatedScan World::next() { return impl_->next(); }

RobotState World::robot_at(double time_s) const { return impl_->robot_at(time_s); }

Objects World::truth_at(double time_s) const { return impl_->truth_at(time_s); }

const Eigen::Isometry3d& World::T_robot_lidar() const { return impl_->T_robot_lidar(); }

}  // namespace situation_awareness
