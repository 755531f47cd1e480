// SPDX-License-Identifier: BSD-3-Clause
// The topic `semantic_map/updates` in rviz.
#include <exception>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <QObject>
#include <QString>

#include <rviz/display_context.h>
#include <rviz/frame_manager.h>
#include <rviz/message_filter_display.h>
#include <rviz/properties/bool_property.h>
#include <rviz/properties/enum_property.h>
#include <rviz/properties/float_property.h>
#include <pluginlib/class_list_macros.hpp>

#include "map_scene.hpp"
#include "situation_awareness/MapUpdate.h"
#include "situation_awareness/map/map_replica.hpp"
#include "situation_awareness/ros/convert/map.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/rviz/feature_mesh.hpp"
#include "situation_awareness/ros/rviz/map_history.hpp"
#include "situation_awareness/ros/rviz/map_mesh.hpp"

namespace situation_awareness {

/// Draws the one map. A map that cannot be drawn sets the status "Map" to Error, and the previous picture stays.
class SemanticMapDisplay : public rviz::MessageFilterDisplay<MapUpdate> {
  using Base = rviz::MessageFilterDisplay<MapUpdate>;

 public:
  SemanticMapDisplay() {
    add_color();
    const FeatureStyle style;
    alpha_ = add_number("Alpha", style.alpha, 1.0,
                        "Opacity of the bodies; less where it is doubtful that an element exists.");
    height_ = add_number("Height", style.body_height_m, 100.0,
                         "Height of the bodies in m; the map's plane cuts them in the middle.");
    history_ =
        add_number("History", style.history_s, 600.0, "How many seconds of its path trail behind an element; 0: none.");
    text_size_ = add_number("Text size", style.text_size_m, 100.0, "Height of the ids' letters in m.");
    ids_ = new rviz::BoolProperty("IDs", true, "Write each feature's id, of a body with its class.", this);
    velocity_ = new rviz::BoolProperty("Velocity", style.velocity,
                                       "An arrow over the way a body will go in 1 s, if it moves.", this);
    uncertainty_ = new rviz::BoolProperty(
        "Uncertainty", style.covariance,
        "The ellipse in which the centre of a body lies with 95 %, and two standard deviations to both sides of lines.",
        this);
    line_ = add_number("Line width", style.line_m, 10.0, "Of walls, in m.");
    for (int i = 0; i < numChildren(); ++i) {
      // Moc is not run on this file, so a lambda is the slot.
      QObject::connect(childAt(i), &rviz::Property::changed, this, [this] { stale_ = true; });
    }
  }

  void update(float /*wall_dt*/, float /*ros_dt*/) override {
    if (!stale_) return;  // maps may come more often than frames
    stale_ = false;
    const FeatureStyle look = style();
    draw(map_, paths_, look, mesh_);
    scene_->show(mesh_, ids_->getBool() ? labels_of(map_, look) : std::vector<MapLabel>(), look.text_size_m);
    queueRender();
  }

  void reset() override {
    Base::reset();
    map_ = {};
    paths_.clear();
    stale_ = true;
  }

 protected:
  void onInitialize() override {
    Base::onInitialize();
    scene_.emplace(*scene_manager_, *scene_node_);
  }

 private:
  static constexpr const char* kStatus = "Map";

  void add_color() {
    color_ = new rviz::EnumProperty(
        "Color", "class or motion",
        "A colour for each feature; one for all bodies that stand and one for all that move; one for each class, or "
        "the former where it is not known. But for the first, walls are dark grey, other lines of what stands blue and "
        "boundaries of large obstacles teal.",
        this);
    color_->addOption("id", ObjectStyle::kId);
    color_->addOption("standing or moving", ObjectStyle::kMotion);
    color_->addOption("class", ObjectStyle::kClass);
    color_->addOption("class or motion", ObjectStyle::kClassOrMotion);
  }

  rviz::FloatProperty* add_number(const char* name, double value, double high, const char* help) {
    auto* property = new rviz::FloatProperty(name, static_cast<float>(value), help, this);
    property->setMin(0.0F);
    property->setMax(static_cast<float>(high));
    return property;
  }

  void processMessage(const MapUpdateConstPtr& msg) override {
    try {
      if (replica_.apply(map_delta_from_msg(*msg)) == MapReplica::Verdict::kMissed) {
        throw std::runtime_error("an update was missed, the whole map is awaited");  // it comes within 2 s
      }
      DrawableMap map = drawable_map(replica_.map());
      const std::string frame = tf2_frame(msg->header.frame_id);
      Ogre::Vector3 position;
      Ogre::Quaternion orientation;
      if (!context_->getFrameManager()->getTransform(frame, msg->header.stamp, position, orientation)) {
        return setStatus(rviz::StatusProperty::Error, kStatus, "no transform from " + QString::fromStdString(frame));
      }
      if (frame != frame_) paths_.clear();
      frame_ = frame;
      map_ = std::move(map);
      paths_.add(to_nanoseconds(msg->header.stamp), positions_of(map_), history_->getFloat());
      scene_->place(position, orientation);
      stale_ = true;
      setStatus(rviz::StatusProperty::Ok, kStatus, QString::number(size_of(map_)) + " elements");
    } catch (const std::exception& error) {
      setStatus(rviz::StatusProperty::Error, kStatus, QString("not drawn: ") + error.what());
    }
  }

  FeatureStyle style() const {
    FeatureStyle style;
    style.coloring = static_cast<ObjectStyle::Coloring>(color_->getOptionInt());
    style.alpha = alpha_->getFloat();
    style.body_height_m = height_->getFloat();
    style.history_s = history_->getFloat();
    style.text_size_m = text_size_->getFloat();
    style.velocity = velocity_->getBool();
    style.covariance = uncertainty_->getBool();
    style.line_m = line_->getFloat();
    return style;
  }

  rviz::EnumProperty* color_;
  rviz::FloatProperty* alpha_;
  rviz::FloatProperty* height_;
  rviz::FloatProperty* history_;
  rviz::FloatProperty* text_size_;
  rviz::BoolProperty* ids_;
  rviz::BoolProperty* velocity_;
  rviz::BoolProperty* uncertainty_;
  rviz::FloatProperty* line_;

  MapReplica replica_;
  std::string frame_;
  DrawableMap map_;
  MapHistory paths_;
  MapMesh mesh_;
  bool stale_ = false;  ///< the picture is older than the map
  std::optional<MapScene> scene_;
};

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::SemanticMapDisplay, rviz::Display)
