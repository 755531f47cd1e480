// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "situation_awareness/GetSplinegons.h"
#include "situation_awareness/LoadSplinegons.h"
#include "situation_awareness/SaveSplinegons.h"
#include "situation_awareness/SplinegonArray.h"
#include "situation_awareness/map/splinegons/geojson.hpp"
#include "situation_awareness/pipeline/timed_splinegon_map.hpp"
#include "situation_awareness/ros/convert/splinegons.hpp"
#include "situation_awareness/ros/markers/splinegon_markers.hpp"

namespace situation_awareness {

/// The boundaries of large obstacles at the ROS boundary: MapServices, MapPublisher. Files are GeoJSON
/// (map/splinegons/geojson.hpp); what is loaded from one begins with elements on its boundaries.
struct SplinegonKind {
  using Map = TimedSplinegonMap;
  using Value = Splinegons;
  using Message = SplinegonArray;
  using Get = GetSplinegons;
  using Save = SaveSplinegons;
  using Load = LoadSplinegons;
  using Markers = SplinegonMarkers;
  static constexpr const char* kName = "splinegons";
  static constexpr const char* kMarkersTopic = "splinegon_markers";

  static void check_geojson(std::string_view file) {
    constexpr std::string_view kEnd = ".geojson";
    if (file.size() < kEnd.size() || file.substr(file.size() - kEnd.size()) != kEnd) {
      throw std::invalid_argument("'" + std::string(file) + "' does not end in .geojson");
    }
  }

  static SplinegonArray to_msg(const Splinegons& splinegons, const std::string& world_frame) {
    return splinegons_to_msg(splinegons, world_frame);
  }
  static SplinegonArray& map_of(GetSplinegons::Response& response) { return response.splinegons; }
  static void save(const std::string& file, const SplinegonMapSnapshot& snapshot) {
    check_geojson(file);
    save_geojson(file, Splinegons{snapshot.stamp_ns, snapshot.elements}, snapshot.world_frame);
  }
  static SplinegonMapSnapshot load(const std::string& file, const std::string& world_frame) {
    check_geojson(file);
    Splinegons loaded = load_splinegons_geojson(file, world_frame);
    return {world_frame, loaded.stamp_ns, std::move(loaded.boundaries)};
  }
};

}  // namespace situation_awareness
