// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// A scan and the lidar's poses at its first and its last beam.
struct SyntheticScan {
  Scan scan;
  Eigen::Isometry3d T_world_lidar = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_world_lidar_end = Eigen::Isometry3d::Identity();
  std::vector<int> hits;  ///< on each object
};

enum class SceneMotion {
  kNone,        ///< all objects stand
  kHalfOfThem,  ///< half of them move
};

/// A robot that hovers and sways in a walled room, in a ring of ellipses of which none occludes another. Each has an
/// equal sector of the scanner's 270 degrees, so more objects are smaller ones. Everything but the noise repeats every
/// kPeriodScans, and follows from the arguments: same seed, same scans.
class SyntheticScene {
 public:
  static constexpr float kRangeMin_m = 0.1F, kRangeMax_m = 30.0F;  ///< of the scanner
  static constexpr int kPeriodScans = 80;
  static constexpr std::int64_t kStep_ns = kNanosecondsPerSecond / 20;

  /// `origin_world_m`: the middle of the room. There is one object at least, and two beams.
  SyntheticScene(int beams, int objects, std::uint64_t seed, SceneMotion motion = SceneMotion::kHalfOfThem,
                 const Eigen::Vector2d& origin_world_m = Eigen::Vector2d::Zero());

  /// The scan at i * kStep_ns, independent of earlier queries.
  SyntheticScan scan(int i) const;

  /// The objects at i * kStep_ns in the world, also between scans.
  std::vector<Ellipse> objects_at(double i) const;

 private:
  struct Thing {
    Ellipse ellipse_room;  ///< about the middle of its orbit
    Eigen::Vector2d radial_m = Eigen::Vector2d::Zero(), tangential_m = Eigen::Vector2d::Zero();  ///< its orbit's axes
    double phase_rad = 0.0;

    Ellipse at(double turns) const;
  };

  Eigen::Isometry3d T_world_lidar_at(double turns) const;

  int beams_;
  std::uint64_t seed_;
  Eigen::Vector2d origin_world_m_;
  double sector_rad_;
  std::vector<Thing> things_;
};

}  // namespace situation_awareness
