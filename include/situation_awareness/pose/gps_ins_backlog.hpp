// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/pose/gps_ins.hpp"

namespace situation_awareness {

/// Where the vehicle was before the pose was ready, which is known once the yaw is: it is followed back by the
/// gyroscopes to the first sample, and a second GpsIns goes through samples and fixes again, with that heading at its
/// start. Of use for what was measured meanwhile and waits; not a pose of the time, since later data are in it.
class GpsInsBacklog {
 public:
  /// Keeps the latest `duration_s`. Throws std::invalid_argument as params.validate().
  GpsInsBacklog(const GpsInsParams& params, const GpsInsMounting& mounting, double duration_s);

  /// To be called as those of GpsIns, until it is ready.
  void add_imu(const InertialSample& sample);
  void add_fix(const GeodeticFix& fix);

  /// Poses at the samples before `ready`, a pose that is, by stamps; the first ones may be missing. What was kept is
  /// given up.
  std::vector<GpsInsPose> take_poses(const GpsInsPose& ready, const GeodeticPosition& origin);

 private:
  struct Entry {
    std::optional<GeodeticFix> fix;  ///< else it is a sample
    InertialSample sample;
  };

  GpsInsParams params_;
  GpsInsMounting mounting_;
  double duration_s_;
  std::int64_t latest_ns_ = StampOrder::kNone;  ///< of samples
  std::deque<Entry> entries_;                   ///< in the order in which they came
};

}  // namespace situation_awareness
