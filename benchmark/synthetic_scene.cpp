// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic_scene.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

constexpr double kFieldRad = radians(270.0);
constexpr double kObjectsRad = radians(258.0);  // of the field of view, without margins for swaying and tilting
constexpr double kSweep_s = 0.01875;            // UTM-30LX: three quarters of a turn of 25 ms
constexpr double kRangeSigma_m = 0.01;
constexpr double kWall_m = 9.5;  // half of the room: partly within the range of interest, its corners beyond

double period_s() { return SyntheticScene::kPeriodScans * seconds_between(0, SyntheticScene::kStep_ns); }

/// Horizontal distance to the walls from inside.
double wall_range_m(const Eigen::Vector2d& origin_m, const Eigen::Vector2d& direction) {
  double range_m = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 2; ++axis) {
    if (direction(axis) == 0.0) continue;
    range_m = std::min(range_m, (std::copysign(kWall_m, direction(axis)) - origin_m(axis)) / direction(axis));
  }
  return range_m;
}

}  // namespace

Ellipse SyntheticScene::Thing::at(double turns) const {
  const double angle_rad = 2.0 * kPi * turns + phase_rad;
  Ellipse moved = ellipse_room;
  moved.center_m += std::cos(angle_rad) * radial_m + std::sin(angle_rad) * tangential_m;
  return moved;
}

SyntheticScene::SyntheticScene(int beams, int objects, std::uint64_t seed, SceneMotion motion,
                               const Eigen::Vector2d& origin_world_m)
    : beams_(beams), seed_(seed), origin_world_m_(origin_world_m), sector_rad_(kObjectsRad / objects) {
  Random random(seed);
  for (int i = 0; i < objects; ++i) {
    const double azimuth_rad = -0.5 * kObjectsRad + (i + 0.5) * sector_rad_;
    const Eigen::Vector2d ahead(std::cos(azimuth_rad), std::sin(azimuth_rad));
    // Neighbours are alternately near and far, so that they are separate in sectors of any width.
    const double range_m = i % 2 == 0 ? random.uniform(4.6, 6.0) : random.uniform(7.2, 8.2);
    Thing thing;
    thing.ellipse_room.center_m = range_m * ahead;
    thing.ellipse_room.psi_rad = random.uniform(-0.5 * kPi, 0.5 * kPi);
    const double widest_m = 0.4 * sector_rad_ * range_m;
    const double rx_m = random.uniform(0.15, 0.4);
    thing.ellipse_room.rx_m = std::min(rx_m, widest_m);
    thing.ellipse_room.ry_m = std::min(rx_m * random.uniform(0.5, 1.0), widest_m);
    thing.phase_rad = random.uniform(-kPi, kPi);
    if (motion == SceneMotion::kHalfOfThem && i % 4 < 2) {
      thing.radial_m = 0.3 * ahead;
      thing.tangential_m = std::min(0.3, 0.05 * sector_rad_ * range_m) * Eigen::Vector2d(-ahead.y(), ahead.x());
    }
    things_.push_back(thing);
  }
}

Eigen::Isometry3d SyntheticScene::T_world_lidar_at(double turns) const {
  const double c = std::cos(2.0 * kPi * turns);
  const double s = std::sin(2.0 * kPi * turns);
  Eigen::Isometry3d T_world_lidar = Eigen::Isometry3d::Identity();
  T_world_lidar.linear() = (Eigen::AngleAxisd(radians(1.0) * s, Eigen::Vector3d::UnitZ()) *
                            Eigen::AngleAxisd(radians(2.0) * c, Eigen::Vector3d::UnitY()) *
                            Eigen::AngleAxisd(radians(2.0) * s, Eigen::Vector3d::UnitX()))
                               .toRotationMatrix();
  T_world_lidar.translation() << origin_world_m_.x() + 0.01 * c, origin_world_m_.y() + 0.01 * s, 1.5;
  return T_world_lidar;
}

std::vector<Ellipse> SyntheticScene::objects_at(double i) const {
  std::vector<Ellipse> objects;
  for (const Thing& thing : things_) {
    objects.push_back(thing.at(i / kPeriodScans));
    objects.back().center_m += origin_world_m_;
  }
  return objects;
}

SyntheticScan SyntheticScene::scan(int i) const {
  const double turns = static_cast<double>(i) / kPeriodScans;
  const double sweep_turns = kSweep_s / period_s();
  Random noise(seed_ ^ (static_cast<std::uint64_t>(i + 1) << 32));

  SyntheticScan result;
  result.T_world_lidar = T_world_lidar_at(turns);
  result.T_world_lidar_end = T_world_lidar_at(turns + sweep_turns);
  result.hits.assign(things_.size(), 0);
  Scan& scan = result.scan;
  scan.stamp_ns = i * kStep_ns;
  scan.angle_min_rad = -0.5 * kFieldRad;
  scan.angle_increment_rad = kFieldRad / (beams_ - 1);
  scan.time_increment_s = kSweep_s / (beams_ - 1);
  for (int k = 0; k < beams_; ++k) {
    const double beam_turns = turns + sweep_turns * k / (beams_ - 1);
    const Eigen::Isometry3d T_world_lidar = T_world_lidar_at(beam_turns);
    const double angle_rad = scan.angle_min_rad + k * scan.angle_increment_rad;
    const Eigen::Vector3d ray = T_world_lidar.linear() * Eigen::Vector3d(std::cos(angle_rad), std::sin(angle_rad), 0.0);
    const double horizontal = ray.head<2>().norm();  // all surfaces are vertical
    const Eigen::Vector2d direction = ray.head<2>() / horizontal;
    const Eigen::Vector2d origin_m = T_world_lidar.translation().head<2>() - origin_world_m_;

    double range_m = wall_range_m(origin_m, direction);
    int met = -1;
    const double azimuth_rad = std::atan2(direction.y(), direction.x());
    const int sector = static_cast<int>(std::floor((azimuth_rad + 0.5 * kObjectsRad) / sector_rad_));
    const int last = std::min(sector + 1, static_cast<int>(things_.size()) - 1);
    for (int j = std::max(sector - 1, 0); j <= last; ++j) {
      const std::optional<double> distance_m =
          intersect_ray(things_[static_cast<std::size_t>(j)].at(beam_turns), origin_m, direction);
      if (!distance_m || *distance_m >= range_m) continue;
      range_m = *distance_m;
      met = j;
    }
    if (met >= 0) ++result.hits[static_cast<std::size_t>(met)];
    const double measured_m = range_m / horizontal + kRangeSigma_m * noise.normal();
    scan.beams.push_back(beam_from_range(static_cast<float>(measured_m), kRangeMin_m, kRangeMax_m));
  }
  return result;
}

}  // namespace situation_awareness
