// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "situation_awareness/GetPolygons.h"
#include "situation_awareness/LoadPolygons.h"
#include "situation_awareness/PolygonArray.h"
#include "situation_awareness/SavePolygons.h"
#include "situation_awareness/map/polygons/geojson.hpp"
#include "situation_awareness/map/polygons/map_file.hpp"
#include "situation_awareness/map/polygons/timed_polygon_map.hpp"
#include "situation_awareness/ros/convert/polygons.hpp"
#include "situation_awareness/ros/markers/polygon_markers.hpp"

namespace situation_awareness {

/// The map of polygons at the ROS boundary: MapServices, MapPublisher. A file whose name ends in .geojson has the
/// chains alone (map/polygons/geojson.hpp); a map that is loaded from one begins with elements on them.
struct PolygonKind {
  using Map = TimedPolygonMap;
  using Value = Polygons;
  using Message = PolygonArray;
  using Get = GetPolygons;
  using Save = SavePolygons;
  using Load = LoadPolygons;
  using Markers = PolygonMarkers;
  static constexpr const char* kName = "polygons";
  static constexpr const char* kMarkersTopic = "polygon_markers";

  static bool is_geojson(std::string_view file) {
    constexpr std::string_view kEnd = ".geojson";
    return file.size() >= kEnd.size() && file.substr(file.size() - kEnd.size()) == kEnd;
  }

  static PolygonArray to_msg(const Polygons& polygons, const std::string& world_frame) {
    return polygons_to_msg(polygons, world_frame);
  }
  static PolygonArray& map_of(GetPolygons::Response& response) { return response.polygons; }
  static void save(const std::string& file, const PolygonMapSnapshot& snapshot) {
    if (is_geojson(file)) return save_geojson(file, snapshot.polygons, snapshot.world_frame);
    save_polygon_map(file, snapshot);
  }
  static PolygonMapSnapshot load(const std::string& file, const std::string& world_frame) {
    if (!is_geojson(file)) return load_polygon_map(file, world_frame);
    return snapshot_of_chains(load_geojson(file, world_frame), PolygonMapParams{}.spacing_m);
  }
};

}  // namespace situation_awareness
