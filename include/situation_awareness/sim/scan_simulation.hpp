// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/scan/scan.hpp"
#include "situation_awareness/sim/scanner.hpp"
#include "situation_awareness/sim/truth.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness {

/// One simulated scan and the truth at its stamp.
struct SimulatedScan {
  Scan scan;
  RobotState robot;
  Eigen::Isometry3d T_world_lidar = Eigen::Isometry3d::Identity();      ///< at the stamp
  Eigen::Isometry3d T_world_lidar_end = Eigen::Isometry3d::Identity();  ///< at the last beam's time
  Objects truth;                    ///< at the stamp (true_map); `beams` counts the beams that hit it in this scan
  std::vector<std::string> names;   ///< of the truth's objects, same order
  std::vector<int> object_of_beam;  ///< by each beam, within the truth's range: index in the truth, else -1
  std::vector<TrueHit> hits;        ///< of each beam, on any object of the world
};

/// A world, the 2D scanner at site `lidar` of its robot, and the truth, for the evaluation of maps.
class ScanSimulation {
 public:
  /// Throws std::runtime_error naming the file, the element and its error, std::invalid_argument for params.
  ScanSimulation(const std::string& mjcf_path, const SimulatedScannerParams& scanner, std::uint64_t seed);
  ~ScanSimulation();
  ScanSimulation(ScanSimulation&&) noexcept;
  ScanSimulation& operator=(ScanSimulation&&) noexcept;

  /// Move everything to the time of the next scan (the first is at time 0) and scan.
  SimulatedScan next();

  const World& world() const;

  RobotState robot_at(double time_s) const { return world().robot_at(time_s); }

  /// The objects at any time. Their counts and times by scans (beams, observations, when seen) are of the latest scan.
  Objects truth_at(double time_s) const;

  /// Pose of the lidar in the robot's frame, from the file.
  const Eigen::Isometry3d& T_robot_lidar() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace situation_awareness
