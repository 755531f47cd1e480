// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include <ros/subscriber.h>

#include "situation_awareness/MappedObjectArray.h"
#include "situation_awareness/PolygonArray.h"
#include "situation_awareness/SplinegonArray.h"
#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/map/polygons/polygons.hpp"
#include "situation_awareness/map/splinegons/splinegons.hpp"
#include "situation_awareness/ros/stage_context.hpp"

namespace situation_awareness {

/// The latest maps of what stands around a vehicle, by the topics `splinegons`, `polygons` and `objects`: for a stage
/// that leads it. A map that cannot be used is counted; the one before counts on. All calls are on the callback queue
/// of its stage, without a lock; `context` must outlive it.
class MapInputs {
 public:
  /// Subscribes when the stage is made.
  MapInputs(StageContextBase& context, const std::string& world_frame);

  /// Null: none yet.
  const Splinegons* splinegons() const { return has_splinegons_ ? &splinegons_ : nullptr; }
  const Polygons* polygons() const { return has_polygons_ ? &polygons_ : nullptr; }
  const Objects* objects() const { return has_objects_ ? &objects_ : nullptr; }

  /// Number of maps that were taken.
  std::uint64_t taken() const { return taken_; }

  /// Discards all, after a reset of time.
  void clear() { has_splinegons_ = has_polygons_ = has_objects_ = false; }

 private:
  void on_splinegons(const SplinegonArrayConstPtr& msg);
  void on_polygons(const PolygonArrayConstPtr& msg);
  void on_objects(const MappedObjectArrayConstPtr& msg);
  template <class Message, class Take>
  void take(const Message& msg, const char* kind, const Take& take);

  StageContextBase& context_;
  std::string world_frame_;
  Splinegons splinegons_;
  Polygons polygons_;
  Objects objects_;
  bool has_splinegons_ = false, has_polygons_ = false, has_objects_ = false;
  std::uint64_t taken_ = 0;
  ros::Subscriber splinegons_sub_, polygons_sub_, objects_sub_;
};

}  // namespace situation_awareness
