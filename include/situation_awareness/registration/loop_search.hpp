// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"
#include "situation_awareness/polylines/polylines.hpp"

namespace situation_awareness {

/// Part of the hits whose errors are independent. No source is recorded, and its sensitivity was not measured.
constexpr double kIndependentPart = 0.25;

/// What was drawn now was drawn long before, too: where, by the motion of x, y (m) and yaw (rad) about a place that
/// brings the one to the other, as A and b of its cost motion' A motion / 2 - b' motion.
struct FoundLoop {
  std::int64_t drawn_ns = 0;
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
};

/// Finds the motion that brings the scans, and what was mapped lately, to what was mapped long before, where poses have
/// drifted meanwhile (docs/math/splinegons.md).
///
/// A scan alone often leaves a motion along the boundary open. So the motion is estimated with all scans in turn that
/// meet what is old: the weighted least squares of their hits' distances from it, with what poses may have drifted.
class LoopSearch {
 public:
  /// What was hit within this time is not old: it is of the same lap.
  static constexpr double kRecent_s = 4.0;

  /// `hit_sigma_m`: standard deviation of a hit's distance from the boundary, in addition to those of both.
  explicit LoopSearch(double hit_sigma_m) : hit_sigma_m_(hit_sigma_m) {}

  /// Takes a scan that is at `T_map_level` in the map, with the covariance of that place's error in x, y (m) and yaw
  /// (rad). The loop that is to be closed now, if any: some scans agree, and the motion is known well, or what is old
  /// is not seen any more.
  std::optional<FoundLoop> see(const PolygonMap& map, const Polylines& polylines, const Pose2& T_map_level,
                               const Eigen::Matrix3d& covariance);

  /// While a loop is found, and is not to be closed yet: about the motion in the map of what was drawn at a time. None
  /// of what the scans of the loop met, and the whole one of what is drawn now.
  Pose2 motion_of(std::int64_t drawn_ns) const;

 private:
  struct Loop {
    int scans = 0;                                       ///< that found it
    std::int64_t begin_ns = 0, found_ns = 0;             ///< stamps of the first and of the latest of them
    std::int64_t since_ns = 0, drawn_ns = 0;             ///< when what they met was hit last, and was drawn
    Eigen::Vector2d center_m = Eigen::Vector2d::Zero();  ///< of the motion
    Eigen::Vector3d motion = Eigen::Vector3d::Zero();    ///< of x, y (m) and yaw (rad)
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero(), drift_information = Eigen::Matrix3d::Zero();
  };
  /// What a scan says of the motion, and of what it met.
  struct Sight;

  std::optional<Sight> meet(const PolygonMap& map, const Polylines& polylines, const Pose2& T_map_level,
                            const Eigen::Vector2d& center_m, double reach_m, std::int64_t before_ns) const;
  void find(const PolygonMap& map, const Polylines& polylines, const Pose2& T_map_level,
            const Eigen::Matrix3d& covariance);
  double variance_m2(const Eigen::Vector2d& p_map_m) const;

  double hit_sigma_m_;
  Loop loop_;
  std::int64_t stamp_ns_ = 0;  ///< of the latest scan
};

}  // namespace situation_awareness
