// SPDX-License-Identifier: BSD-3-Clause
// The topic `objects` in rviz.
#include <cstddef>
#include <vector>

#include <pluginlib/class_list_macros.hpp>

#include "map_display.hpp"
#include "situation_awareness/MappedObjectArray.h"
#include "situation_awareness/ros/rviz/drawable_objects.hpp"
#include "situation_awareness/ros/rviz/object_mesh.hpp"

namespace situation_awareness {

class ObjectDrawing {
 public:
  using Message = MappedObjectArray;
  using Map = DrawableObjects;
  static constexpr const char* kColorings[] = {"id", "standing or moving", "class"};  // as ObjectStyle::Coloring
  static constexpr const char* kColoringsHelp =
      "A colour for each element, one for all that stands and one for all that moves, or one for each class.";

  explicit ObjectDrawing(rviz::Property& parent) {
    const ObjectStyle style;
    velocity_ = new rviz::BoolProperty("Velocity", style.velocity,
                                       "An arrow over the way an element will go in 1 s, if it moves.", &parent);
    covariance_ = new rviz::BoolProperty("Covariance", style.covariance,
                                         "The ellipse in which the centre lies with 95 %.", &parent);
  }

  static DrawableObjects map_of(const MappedObjectArray& msg) { return drawable_objects(msg); }
  static std::size_t size_of(const DrawableObjects& map) { return map.names.size(); }
  static std::vector<MapPosition> positions_of(const DrawableObjects& map) {
    return situation_awareness::positions_of(map.objects);
  }
  static std::vector<MapLabel> labels_of(const DrawableObjects& map, const MapStyle& style) {
    return situation_awareness::labels_of(map, style);
  }
  void draw(const DrawableObjects& map, const MapHistory& history, const MapStyle& style, MapMesh& mesh) const {
    situation_awareness::draw(map.objects, history, {style, velocity_->getBool(), covariance_->getBool()}, mesh);
  }

 private:
  rviz::BoolProperty* velocity_;
  rviz::BoolProperty* covariance_;
};

using ObjectMapDisplay = MapDisplay<ObjectDrawing>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::ObjectMapDisplay, rviz::Display)
