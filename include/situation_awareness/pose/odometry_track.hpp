// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/geometry/pose2.hpp"

namespace situation_awareness {

/// Parameters of the poses by odometry that are kept.
struct OdometryTrackParams {
  double max_speed_m_s = 5.0;
  double max_yaw_rate_rad_s = 6.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("max_speed_m_s", self.max_speed_m_s, Bounds{0.01, 100.0}, "m/s",
          "between two poses by odometry; a faster one is a jump, which is no motion");
    visit("max_yaw_rate_rad_s", self.max_yaw_rate_rad_s, Bounds{0.01, 100.0}, "rad/s",
          "between two poses by odometry; a faster one is a jump, which is no motion");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// Poses by odometry of the last seconds, without their jumps: the frame `track` is that of the first pose since the
/// latest restart, and a jump of odometry is replaced by the motion before it. Memory is of fixed size.
class OdometryTrack {
 public:
  /// Poses that are kept: of 5 s at 100 Hz.
  static constexpr std::size_t kCapacity = 512;

  struct Entry {
    std::int64_t stamp_ns = 0;
    Pose2 T_track_base;
    int jumps = 0;  ///< up to here, since the restart
  };

  explicit OdometryTrack(const OdometryTrackParams& params);

  enum class Verdict { kAdded, kRefused, kRestarted };

  /// Adds a pose; `received_ns` as StampOrder::judge. Counts what it refuses: "odometry not finite", "odometry stamped
  /// twice", "odometry out of order", "odometry of another time"; and what it repairs: "odometry jumped", "odometry
  /// restarted".
  Verdict add(std::int64_t stamp_ns, const Pose2& T_odom_base, std::int64_t received_ns = StampOrder::kNone);

  /// Pose at a stamp: on the arc between two poses, or beyond the latest by its velocity. False if there is none.
  bool at(std::int64_t stamp_ns, Entry& entry) const;

  bool empty() const { return size_ == 0; }
  std::size_t size() const { return size_; }
  /// From the oldest on.
  const Entry& operator[](std::size_t i) const { return entries_[(begin_ + i) % kCapacity]; }
  const Entry& latest() const { return (*this)[size_ - 1]; }
  /// Index of the first entry later than the stamp; size() if none is.
  std::size_t after(std::int64_t stamp_ns) const;

  const Counters& counters() const { return counters_; }
  void clear() { size_ = 0; }

 private:
  OdometryTrackParams params_;
  StampOrder order_;
  std::vector<Entry> entries_;  ///< a ring
  std::size_t begin_ = 0, size_ = 0;
  Pose2 T_odom_latest_;  ///< as it was given
  Counters counters_;
};

}  // namespace situation_awareness
