// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/scan/scan.hpp"
#include "situation_awareness/sim/multirotor.hpp"

namespace situation_awareness {

/// The simulated scanner; the defaults are the Hokuyo UTM-30LX of the papers.
struct SimulatedLidarParams {
  int beams = 1081;
  double angle_min_rad = radians(-135.0);
  double angle_increment_rad = radians(0.25);
  double rate_hz = 20.0;
  double sweep_s = 0.0;
  double range_min_m = 0.1;
  double range_max_m = 30.0;
  double range_sigma_m = 0.01;
  double truth_range_m = 10.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("beams", self.beams, Bounds{2, 100000}, "", "beams of one scan");
    visit("angle_min_rad", self.angle_min_rad, Bounds{-2.0 * kPi, 2.0 * kPi}, "rad", "azimuth of the first beam");
    visit("angle_increment_rad", self.angle_increment_rad, Bounds{-kPi, kPi}, "rad",
          "azimuth from beam to beam, negative for a scanner that turns clockwise");
    visit("rate_hz", self.rate_hz, Bounds{0.1, 1000.0}, "Hz", "scans per second");
    visit(
        "sweep_s", self.sweep_s, Bounds{0.0, 1.0}, "s",
        "time from the first beam to the last, less than from scan to scan; 0: all at one instant (UTM-30LX: 0.01875)");
    visit("range_min_m", self.range_min_m, Bounds{0.001, 1000.0}, "m", "what is nearer is too close");
    visit("range_max_m", self.range_max_m, Bounds{0.001, 1000.0}, "m", "what is farther is not seen");
    visit("range_sigma_m", self.range_sigma_m, Bounds{0.0, 1.0}, "m", "standard deviation of the ranges, Gaussian");
    visit("truth_range_m", self.truth_range_m, Bounds{0.001, 1000.0}, "m",
          "hits farther away do not count as seen in the truth: the papers' range of interest");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// One simulated scan and the truth at its stamp.
///
/// The stamp is the time of the first beam. Where the scanner takes time to sweep, each beam is cast from where the
/// robot is at the beam's own time, among the objects where they are then; else nothing moves during a scan. True
/// ranges decide whether a beam is a hit, too close or free; noise is added to hits only and never takes them across
/// the sensor's limits.
struct SimulatedScan {
  Scan scan;
  RobotState robot;
  Eigen::Isometry3d T_world_lidar = Eigen::Isometry3d::Identity();      ///< at the stamp
  Eigen::Isometry3d T_world_lidar_end = Eigen::Isometry3d::Identity();  ///< at the last beam's time
  Objects truth;                    ///< every object of the world; `beams` counts the beams that hit it in this scan
  std::vector<std::string> names;   ///< of the truth's objects, same order
  std::vector<int> object_of_beam;  ///< what each beam hit that counts as seen: index in the truth, else -1
};

/// A world in MuJoCo: named objects that stand or follow scripted paths, and a multirotor that follows its own, tilted
/// as its acceleration demands. Everything is a function of time and seed: same seed, same scans, bit for bit.
/// models/worlds/README.md explains the file.
class World {
 public:
  /// Throws std::runtime_error naming the file, the element and what is wrong with it, std::invalid_argument for
  /// params.
  World(const std::string& mjcf_path, const SimulatedLidarParams& lidar, std::uint64_t seed);
  ~World();
  World(World&&) noexcept;
  World& operator=(World&&) noexcept;

  /// Move everything to the time of the next scan (the first is at time 0) and scan.
  SimulatedScan next();

  /// State of the robot at any time, without scanning.
  RobotState robot_at(double time_s) const;

  /// The objects at any time, without scanning: ids from 1 in the order of the file, radii in canonical order, exact
  /// velocities, no covariance. What scans say of them (beams, observations, when seen) is as of the latest scan.
  Objects truth_at(double time_s) const;

  /// Pose of the lidar in the robot's frame, from the file.
  const Eigen::Isometry3d& T_robot_lidar() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace situation_awareness
