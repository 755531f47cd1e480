// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// A scan's place relative to another one, found by matching.
struct ScanMatch {
  static constexpr std::size_t kMaxHits = 180;

  /// A hit that was matched, by its beam, and how far it is from the surfaces along their normal, at most 0.1 m.
  struct Hit {
    int beam;
    float offset_m;
  };

  bool is_valid = false;  ///< enough hits of both are of the same surfaces
  Pose2 T_key_level;
  /// Inverse covariance of its error (x, y in m, yaw in rad), T_key_level = truth * exp(error), by the spread of the
  /// hits about the surfaces; nearly 0 along a corridor.
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  std::array<Hit, kMaxHits> hits;
  std::size_t count = 0;  ///< of them: those near a surface
};

/// A scan by which later ones are placed: their hits are moved onto its surfaces (point to line, Censi, "An ICP variant
/// using a point-to-line metric", 2008). What has moved in between is left out as long as most hits are of what stands.
class KeyScan {
 public:
  /// Takes another scan. The cost is linear in its points.
  void set(const Points& points);

  /// The place of a scan near to `guess`. The cost is that of a number of hits at most, whatever the scan.
  ScanMatch match(const Points& points, const Pose2& guess) const;

 private:
  static constexpr int kCells = 720;  // of azimuth

  /// A hit on a surface that is straight around it.
  struct Surface {
    Eigen::Vector2d p_m = Eigen::Vector2d::Zero();
    Eigen::Vector2d normal = Eigen::Vector2d::Zero();
    bool is_valid = false;
  };

  /// The surface nearest to a point, if it is not farther away than that.
  const Surface* nearest(const Eigen::Vector2d& p_m, double max_distance_m) const;

  std::array<Surface, kCells> surfaces_;  ///< by azimuth
  std::vector<Eigen::Vector2d> hits_m_;   ///< kept for its memory
};

}  // namespace situation_awareness
