// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/pose/key_scan.hpp"

namespace situation_awareness {

/// What is to be added to the stamps of scans to get the times of the poses that belong to them.
struct PoseOffset {
  bool is_known = false;  ///< the motion has shown it; else the numbers below are 0
  double offset_s = 0.0;
  double sigma_s = 0.0;     ///< standard deviation of offset_s
  std::size_t windows = 0;  ///< stretches of motion that were used, also where they were too few
};

/// Whether scans are used with poses of another time than theirs: by more than 3 standard deviations and 20 ms.
bool is_out_of_step(const PoseOffset& estimate, double used_offset_s);

/// Estimates the time between scans and poses from both alone (docs/math/pose.md): the motion from scan to scan is
/// found by matching what stands, and compared with that of the poses at earlier and later times. Nothing is known as
/// long as the robot stands, or moves at a constant velocity and turns at a constant rate.
///
/// Time and memory per scan are bounded; no allocation after warm-up.
class PoseOffsetEstimator {
 public:
  /// Offsets are found up to this far from the one in use.
  static constexpr double kMaxLag_s = 0.5;

  /// `used_offset_s`: what was added to the stamps of the scans to come to get the times of their poses.
  explicit PoseOffsetEstimator(double used_offset_s);

  /// Adds a scan, in the order of the stamps; T_world_level is its pose with the offset in use. A stamp that goes back
  /// starts anew.
  void add(const Points& points);

  const PoseOffset& estimate() const { return estimate_; }

  double used_offset_s() const { return used_offset_s_; }

 private:
  static constexpr int kLags = 51;
  static constexpr double kLagStep_s = 2.0 * kMaxLag_s / (kLags - 1);

  template <class Value>
  using OfLags = std::array<Value, kLags>;

  struct TimedPose {
    std::int64_t stamp_ns = 0;
    Pose2 T_world_level;
  };

  /// A scan of a window, placed by its key scan.
  struct Placed {
    std::int64_t stamp_ns = 0;
    bool is_key = false;
    Pose2 T_key_level;
    Eigen::Matrix3d information;
  };

  /// Sums over the scans of a window, for each lag; errors are in the frame of the key scan.
  struct Sums {
    OfLags<Pose2> T_world_key;
    int scans = 0;
    Eigen::Matrix3d information;
    OfLags<Eigen::Vector3d> weighted;
    OfLags<double> squares;
    Eigen::Vector3d change_weighted;  ///< of what a change of the lag changes
    double change_squares = 0.0;
  };

  /// What a finished window says about the lag.
  struct Window {
    double information_1_s2 = 0.0;
    double degrees_of_freedom = 0.0;
    OfLags<double> cost;  ///< least where poses and scans agree best
  };

  static double lag_s(int lag) { return lag * kLagStep_s - kMaxLag_s; }

  void add_pose(TimedPose pose);
  void place(const Points& points);
  bool pose_at(std::int64_t stamp_ns, double lag_s, Pose2& T_world_level) const;
  void use_placed();
  void begin_window(const Placed& key);
  void clear_sums();
  void add_to_window(const Placed& placed);
  double lag_information(const Eigen::Matrix3d& inverse) const;
  void finish_window();
  void update_estimate();

  double used_offset_s_;
  std::vector<TimedPose> poses_;     ///< the latest two
  std::vector<TimedPose> controls_;  ///< of the spline through the poses of the last seconds
  KeyScan key_;
  std::vector<Placed> placed_;  ///< wait for later poses
  std::int64_t key_stamp_ns_ = 0;
  bool has_key_ = false;
  TimedPose last_;  ///< the latest scan that was placed
  Pose2 T_key_last_;
  bool in_window_ = false;  ///< sums_ have a key
  Sums sums_;
  std::vector<Window> windows_;  ///< the latest, in a ring
  std::size_t oldest_window_ = 0;
  PoseOffset estimate_;
};

}  // namespace situation_awareness
