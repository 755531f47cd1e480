// SPDX-License-Identifier: BSD-3-Clause
// The topic `semantic_map/updates` in rviz.
#include <cstddef>
#include <stdexcept>
#include <vector>

#include <pluginlib/class_list_macros.hpp>

#include "map_display.hpp"
#include "situation_awareness/MapUpdate.h"
#include "situation_awareness/map/map_replica.hpp"
#include "situation_awareness/ros/convert/map.hpp"
#include "situation_awareness/ros/rviz/feature_mesh.hpp"

namespace situation_awareness {

class SemanticMapDrawing {
 public:
  using Message = MapUpdate;
  using Map = DrawableMap;
  static constexpr const char* kColorings[] = {"id", "standing or moving", "class",
                                               "class or motion"};  // as ObjectStyle::Coloring
  static constexpr const char* kColoringsHelp =
      "A colour for each feature; one for all bodies that stand and one for all that move; one for each class, or the "
      "former where it is not known. But for the first, walls are dark grey, other lines of what stands blue and "
      "boundaries of large obstacles teal.";

  explicit SemanticMapDrawing(rviz::Property& parent) {
    const FeatureStyle style;
    parent.subProp("Color")->setValue(kColorings[ObjectStyle::kClassOrMotion]);
    velocity_ = new rviz::BoolProperty("Velocity", style.velocity,
                                       "An arrow over the way a body will go in 1 s, if it moves.", &parent);
    uncertainty_ = new rviz::BoolProperty(
        "Uncertainty", true,
        "The ellipse in which the centre of a body lies with 95 %, and two standard deviations to both sides of lines.",
        &parent);
    line_ = new rviz::FloatProperty("Line width", static_cast<float>(style.line_m), "Of walls, in m.", &parent);
    line_->setMin(0.0F);
    line_->setMax(10.0F);
  }

  /// Throws where an update was missed; a whole map comes within 2 s then.
  DrawableMap map_of(const MapUpdate& msg) {
    if (replica_.apply(map_delta_from_msg(msg)) == MapReplica::Verdict::kMissed) {
      throw std::runtime_error("an update was missed, the whole map is awaited");
    }
    return drawable_map(replica_.map());
  }
  static std::size_t size_of(const DrawableMap& map) { return situation_awareness::size_of(map); }
  static std::vector<MapPosition> positions_of(const DrawableMap& map) {
    return situation_awareness::positions_of(map);
  }
  static std::vector<MapLabel> labels_of(const DrawableMap& map, const MapStyle& style) {
    return situation_awareness::labels_of(map, style);
  }
  void draw(const DrawableMap& map, const MapHistory& history, const MapStyle& style, MapMesh& mesh) const {
    situation_awareness::draw(map, history, {{style, velocity_->getBool(), uncertainty_->getBool()}, line_->getFloat()},
                              mesh);
  }

 private:
  MapReplica replica_;
  rviz::BoolProperty* velocity_;
  rviz::BoolProperty* uncertainty_;
  rviz::FloatProperty* line_;
};

using SemanticMapDisplay = MapDisplay<SemanticMapDrawing>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::SemanticMapDisplay, rviz::Display)
