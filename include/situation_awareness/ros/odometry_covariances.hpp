// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>

#include <nav_msgs/Odometry.h>

#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/map/grid/grid.hpp"

namespace situation_awareness {

/// The latest covariances of a vehicle's pose, by its odometry: of x, y, z and of the attitude about the world's axes,
/// which are those of a camera on it but for the lever arm.
class OdometryCovariances {
 public:
  /// One that is no covariance (is_positive_semidefinite) or is zero throughout says nothing, and is counted; so is one
  /// whose stamp is not in order. `received_ns` as StampOrder::judge; a restart forgets all before.
  void add(const nav_msgs::Odometry& msg, std::int64_t received_ns = StampOrder::kNone);

  /// Of the latest message until `stamp_ns`, or else the first after it; nothing where both are 0.2 s away and more.
  std::optional<CameraPoseCovariance> at(std::int64_t stamp_ns) const;

  std::size_t unknown() const { return unknown_; }
  std::size_t refused() const { return refused_; }
  void clear() { covariances_.clear(); }

 private:
  std::map<std::int64_t, CameraPoseCovariance> covariances_;
  StampOrder order_;
  std::size_t unknown_ = 0, refused_ = 0;
};

}  // namespace situation_awareness
