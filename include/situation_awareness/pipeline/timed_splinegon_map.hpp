// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/pipeline/splinegon_pipeline.hpp"

namespace situation_awareness {

/// The boundaries that a file holds, for programs that save and load them.
struct SplinegonMapSnapshot {
  std::string world_frame;
  std::int64_t stamp_ns = 0;
  std::vector<Splinegon> elements;
};

/// The boundaries of large obstacles of a program that runs for long: a SplinegonPipeline with restarts of time, reset
/// and loaded maps.
class TimedSplinegonMap {
 public:
  static constexpr std::int64_t kNoStamp = StampOrder::kNone;

  /// Stamps that go back by more than `reset_time_jump_s` begin a new map (StampOrder). Throws std::invalid_argument
  /// naming field and bound.
  TimedSplinegonMap(const SplinegonPipelineParams& params, double reset_time_jump_s);

  /// As StampOrder::trust, where another has judged the stamps.
  void trust_stamps() { order_.trust(); }

  /// As SplinegonPipeline::process, which throws where a scan or a pose cannot be used. kRefused: the stamp is not
  /// in order (StampOrder), and the scan is not used; kRestart: it was used in a new map.
  StampOrder::Verdict process(const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
                              const Eigen::Isometry3d& T_world_lidar_end, const Eigen::Matrix3d& pose_covariance);
  StampOrder::Verdict process(const Scan& scan, const Eigen::Isometry3d& T_odom_lidar,
                              const Eigen::Isometry3d& T_odom_lidar_end, const InertialPlacement& placement);

  /// By ascending id, as of the latest scan.
  const Splinegons& splinegons() const { return splinegons_; }

  const SplinegonPipeline& pipeline() const { return pipeline_; }
  const Polygons& polygons_in_world() { return pipeline_.polygons_in_world(); }

  /// Stamp of the latest scan, kNoStamp before the first.
  std::int64_t stamp_ns() const { return order_.latest_ns(); }

  /// Number of boundaries.
  std::size_t size() const { return splinegons_.boundaries.size(); }

  /// The boundaries at a time from the latest scan on: what stands is where it is.
  Splinegons at(std::int64_t stamp_ns) const;

  /// Deletes the boundaries and their time. Ids are not used again.
  void reset();

  /// `world_frame` is left empty.
  SplinegonMapSnapshot snapshot() const;

  /// Continues from boundaries that may be of another time (SplinegonPipeline::resume). Times later than the running
  /// map's are moved to before that.
  void resume(const SplinegonMapSnapshot& snapshot);

 private:
  template <class... Pose>
  StampOrder::Verdict process_in_order(const Scan& scan, const Pose&... pose);
  void take_over();
  void resume_before(std::int64_t stamp_ns);

  StampOrder order_;
  SplinegonPipeline pipeline_;
  Splinegons splinegons_;
  bool resumed_ = false;  ///< before the first scan, and not updated since
};

}  // namespace situation_awareness
