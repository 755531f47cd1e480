// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/GetObjects.h"
#include "situation_awareness/LoadObjects.h"
#include "situation_awareness/MappedObjectArray.h"
#include "situation_awareness/SaveObjects.h"
#include "situation_awareness/map/objects/map_file.hpp"
#include "situation_awareness/map/objects/object_map.hpp"
#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/markers/object_markers.hpp"

namespace situation_awareness {

/// The map of objects at the ROS boundary: MapServices, MapPublisher.
struct ObjectKind {
  using Map = ObjectMap;
  using Value = Objects;
  using Message = MappedObjectArray;
  using Get = GetObjects;
  using Save = SaveObjects;
  using Load = LoadObjects;
  using Markers = ObjectMarkers;
  static constexpr const char* kName = "objects";
  static constexpr const char* kMarkersTopic = "object_markers";

  static MappedObjectArray to_msg(const Objects& objects, const std::string& world_frame) {
    return objects_to_msg(objects, world_frame);
  }
  static MappedObjectArray& map_of(GetObjects::Response& response) { return response.objects; }
  static void save(const std::string& file, const MapSnapshot& snapshot) { save_map(file, snapshot); }
  static MapSnapshot load(const std::string& file, const std::string& world_frame) {
    return load_map(file, world_frame);
  }
};

}  // namespace situation_awareness
