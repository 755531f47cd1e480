// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>

#include <Eigen/Core>

namespace situation_awareness {

/// The pose of the base at the time of a scan.
struct BasePose {
  Eigen::Vector2d translation_world_m = Eigen::Vector2d::Zero();
  Eigen::Matrix3d covariance_world = Eigen::Matrix3d::Zero();  ///< of the error in x, y (m) and yaw (rad)
};

/// Whether a source of poses says so well: all is finite, the covariance is one, and the variances of x and y are not
/// zero, by which many a source says that it has none.
bool is_usable(const BasePose& pose);

/// What the messages of a source say of the pose of the base, for all who need its covariance. Once there is a source,
/// a default is no substitute for what it does not say, or does not say well: that is not known.
class PoseCovariances {
 public:
  /// A message serves up to `max_age_s` before and after its stamp.
  explicit PoseCovariances(double max_age_s) : max_age_s_(max_age_s) {}

  /// There is a source, from now on.
  void expect() { has_source_ = true; }
  bool has_source() const { return has_source_; }

  /// A message. False if it cannot be used: then the pose is not known at its time.
  bool add(std::int64_t stamp_ns, const BasePose& pose);

  /// A message that is of no use, as in another frame.
  void refuse(std::int64_t stamp_ns);

  /// After a restart of time: the messages before say nothing; that there is a source stays.
  void restart() { poses_.clear(); }

  /// Whether there was a message of this stamp.
  bool has(std::int64_t stamp_ns) const { return poses_.count(stamp_ns) > 0; }

  /// By the message that is nearest in time; none: not known.
  std::optional<BasePose> at(std::int64_t stamp_ns) const;

  /// By the one that came last, for what happens now.
  std::optional<BasePose> latest(std::int64_t now_ns) const;

 private:
  static constexpr std::size_t kMost = 200;

  double max_age_s_;
  bool has_source_ = false;
  std::int64_t last_ns_ = 0;                               ///< stamp of the one that came last
  std::map<std::int64_t, std::optional<BasePose>> poses_;  ///< by their stamp; none: it could not be used
};

}  // namespace situation_awareness
