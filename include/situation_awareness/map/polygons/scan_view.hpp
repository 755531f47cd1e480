// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/polygons/surfels.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// What the beams of a scan tell of places. No allocation after warm-up.
class ScanView {
 public:
  /// How a scan saw a place.
  enum class Seen { kUnknown, kHit, kPassed };

  /// How much of a passing beam counts where it has no return: it may be lost.
  static constexpr double kNoReturnWeight = 0.1;
  static constexpr double kWideThing_m = 0.3;  ///< size of a thing that is not known

  void set(std::int64_t stamp_ns, const Pose2& T_level_world, const FreeSpace& free_space);
  /// From now on nothing was seen.
  void forget() { free_space_.range_m.clear(); }

  bool is_known() const { return !free_space_.range_m.empty(); }
  std::int64_t stamp_ns() const { return stamp_ns_; }
  const Pose2& T_level_world() const { return T_level_world_; }
  /// The greatest of its ranges, which is that of beams without a return.
  double most_m() const { return most_m_; }

  /// How the scan saw a place in its level frame. The place is hit if a beam ended within `near_m` of it, and passed if
  /// the beams beside it end farther behind it than `margin_m`; `weight` is then how much they say of a thing of size
  /// `thing_m`, up to 1.
  Seen see(const Eigen::Vector2d& p_level_m, double near_m, double thing_m, double margin_m, double* weight) const;

 protected:
  const std::vector<float>& azimuth_rad() const { return free_space_.azimuth_rad; }
  const std::vector<float>& ranges_m() const { return free_space_.range_m; }
  /// The azimuth of a place, in the turn of the scan's beams.
  double azimuth_of(const Eigen::Vector2d& p_level_m) const;
  /// see() of a place at this azimuth, of a scan with beams.
  Seen see_at(double place_rad, const Eigen::Vector2d& p_level_m, double near_m, double thing_m, double margin_m,
              double* weight) const;

 private:
  std::int64_t stamp_ns_ = std::numeric_limits<std::int64_t>::min();
  Pose2 T_level_world_;
  FreeSpace free_space_;
  std::vector<Eigen::Vector2d> ends_level_m_;  ///< of its beams
  double most_m_ = 0.0;
};

/// What the beams of the latest scan tell of the elements of a map.
class LatestScanView : public ScanView {
 public:
  /// Elements nearer to the sensor than `least_m` are not said to be passed; `margin_m`: as of ScanView::see.
  LatestScanView(double least_m, double margin_m) : least_m_(least_m), margin_m_(margin_m) {}

  void set(std::int64_t stamp_ns, const Pose2& T_level_world, const FreeSpace& free_space);
  /// Sets the angle between the beams of the scan that is set next, and the standard deviation of its hits by range
  /// noise and pose.
  void set_errors(double resolution_rad, double hit_sigma_m);
  double resolution_rad() const { return resolution_rad_; }

  /// How much the beams say that an element is not there: 1 where they went past it with nothing near it, or one went
  /// through it, and none ended on it.
  double passing_weight(const Surfel& surfel, const Eigen::Matrix2d& R_level_world) const;

  /// Whether all beams towards a circle in the world end before it, so that passing_weight() of elements in it is 0.
  /// `extent_m`: of these elements to either side, at most.
  bool is_hidden(const Eigen::Vector2d& middle_world_m, double radius_m, double extent_m) const;

 private:
  double weight_of_grazed(const Surfel& surfel, const Eigen::Vector2d& p_level_m, const Eigen::Vector2d& n_level) const;
  double weight_through(const Surfel& surfel, const Eigen::Vector2d& p_level_m, const Eigen::Vector2d& n_level,
                        double middle_rad) const;

  double least_m_, margin_m_;
  double resolution_rad_ = 0.0, hit_sigma_m_ = 0.0;
  std::vector<Eigen::Vector2d> rays_;  ///< unit, of its beams in the level frame
};

}  // namespace situation_awareness
