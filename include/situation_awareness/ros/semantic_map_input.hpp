// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include <ros/subscriber.h>

#include "situation_awareness/MapUpdate.h"
#include "situation_awareness/map/map_replica.hpp"
#include "situation_awareness/ros/stage_context.hpp"

namespace situation_awareness {

/// The latest map of all that is around a vehicle, by the topic `semantic_map/updates`: for a stage that leads it. An
/// update that cannot be used is counted, and the map before it counts on until a whole one comes, within 2 s. All
/// calls are on the callback queue of its stage, without a lock; `context` must outlive it.
class SemanticMapInput {
 public:
  /// Subscribes when the stage is made.
  SemanticMapInput(StageContextBase& context, const std::string& world_frame);

  /// Null: none yet.
  const Map* map() const { return replica_.has_map() ? &replica_.map() : nullptr; }

  /// Number of updates that were taken.
  std::uint64_t taken() const { return taken_; }

 private:
  void on_update(const MapUpdate& msg);

  StageContextBase& context_;
  std::string world_frame_;
  MapReplica replica_;
  std::uint64_t taken_ = 0;
  ros::Subscriber subscriber_;
};

}  // namespace situation_awareness
