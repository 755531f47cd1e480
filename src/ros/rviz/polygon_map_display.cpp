// SPDX-License-Identifier: BSD-3-Clause
// The topic `polygons` in rviz.
#include <cstddef>
#include <vector>

#include <pluginlib/class_list_macros.hpp>

#include "map_display.hpp"
#include "situation_awareness/PolygonArray.h"
#include "situation_awareness/ros/rviz/polygon_mesh.hpp"

namespace situation_awareness {

class PolygonDrawing {
 public:
  using Message = PolygonArray;
  using Map = Polygons;
  static constexpr const char* kColorings[] = {"state", "id"};  // as PolygonStyle::Coloring
  static constexpr const char* kColoringsHelp =
      "Walls dark grey, known chains blue, new ones green and doubted ones magenta; or a colour for each chain.";

  explicit PolygonDrawing(rviz::Property& parent) {
    uncertainty_ = new rviz::BoolProperty("Uncertainty", PolygonStyle().uncertainty,
                                          "The band of two standard deviations to both sides.", &parent);
  }

  static Polygons map_of(const PolygonArray& msg) { return drawable_polygons(msg); }
  static std::size_t size_of(const Polygons& map) { return map.chains.size(); }
  static std::vector<MapPosition> positions_of(const Polygons& /*map*/) { return {}; }  // chains leave no path
  static std::vector<MapLabel> labels_of(const Polygons& map, const MapStyle& style) {
    return situation_awareness::labels_of(map, style);
  }
  void draw(const Polygons& map, const MapHistory& /*history*/, const MapStyle& style, MapMesh& mesh) const {
    situation_awareness::draw(map, {style, uncertainty_->getBool()}, mesh);
  }

 private:
  rviz::BoolProperty* uncertainty_;
};

using PolygonMapDisplay = MapDisplay<PolygonDrawing>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::PolygonMapDisplay, rviz::Display)
