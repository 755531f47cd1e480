// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <ros/service_server.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include "situation_awareness/GetObjects.h"
#include "situation_awareness/LoadObjects.h"
#include "situation_awareness/SaveObjects.h"
#include "situation_awareness/map/objects/object_map.hpp"
#include "situation_awareness/ros/stage_context.hpp"

namespace situation_awareness {

/// Services of the mapping nodelet (docs/ros.md, "Services"). All calls are on the callback queue of its stage, without
/// a lock; `context` and `map` must outlive it.
class MapServices {
 public:
  /// Publishes the changed map at once.
  using Publish = std::function<void(const Objects&)>;

  MapServices(StageContextBase& context, const std::string& world_frame, ObjectMap& map, Publish publish);

  /// True while the map is paused.
  bool paused() const { return paused_; }

 private:
  void advertise();
  std::string reset();
  std::string pause(bool paused);
  EllipseMap map_at(const ros::Time& stamp) const;
  std::string save(const std::string& file) const;
  std::string load(const std::string& file);

  StageContextBase& context_;
  std::string world_frame_;
  ObjectMap& map_;
  Publish publish_;
  bool paused_ = false;
  std::vector<ros::ServiceServer> servers_;
};

}  // namespace situation_awareness
