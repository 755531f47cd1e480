// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <exception>
#include <optional>
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

#include "map_scene.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/rviz/map_history.hpp"
#include "situation_awareness/ros/rviz/map_mesh.hpp"

namespace situation_awareness {

/// Draws a topic with maps of one kind in rviz. An invalid map sets the status "Map" to Error, and the previous picture
/// stays. `Drawing` is specific to the kind:
///
///     using Message = MappedObjectArray;        // with a header
///     using Map = DrawableObjects;              // the data of a message
///     static constexpr const char* kColorings[] = {"id", "standing or moving"};  // by MapStyle::coloring
///     static constexpr const char* kColoringsHelp = "A colour for each element, or ...";
///     explicit Drawing(rviz::Property& parent);      // adds its own properties, if any
///     Map map_of(const Message&);                    // throws std::exception if it cannot be drawn
///     static std::vector<MapPosition> positions_of(const Map&);  // of elements with a path
///     static std::vector<MapLabel> labels_of(const Map&, const MapStyle&);
///     void draw(const Map&, const MapHistory&, const MapStyle&, MapMesh&) const;  // refills an earlier mesh
///     static std::size_t size_of(const Map&);        // number of elements
///
/// Moc does not support templates, so properties are connected without slots.
template <class Drawing>
class MapDisplay : public rviz::MessageFilterDisplay<typename Drawing::Message> {
  using Base = rviz::MessageFilterDisplay<typename Drawing::Message>;

 public:
  MapDisplay() {
    const MapStyle style;
    const auto number = [this](const char* name, double value, double high, const char* help) {
      auto* property = new rviz::FloatProperty(name, static_cast<float>(value), help, this);
      property->setMin(0.0F);
      property->setMax(static_cast<float>(high));
      return property;
    };
    color_ = new rviz::EnumProperty("Color", Drawing::kColorings[0], Drawing::kColoringsHelp, this);
    int coloring = 0;
    for (const char* name : Drawing::kColorings) color_->addOption(name, coloring++);
    alpha_ =
        number("Alpha", style.alpha, 1.0, "Opacity of the bodies; less where it is doubtful that an element exists.");
    height_ = number("Height", style.body_height_m, 100.0,
                     "Height of the bodies in m; the map's plane cuts them in the middle.");
    history_ =
        number("History", style.history_s, 600.0, "How many seconds of its path trail behind an element; 0: none.");
    text_size_ = number("Text size", style.text_size_m, 100.0, "Height of the ids' letters in m.");
    ids_ = new rviz::BoolProperty("IDs", true, "Write each element's id, and its label if it has one.", this);
    drawing_.emplace(*this);  // its properties come last
    for (int i = 0; i < this->numChildren(); ++i) {
      QObject::connect(this->childAt(i), &rviz::Property::changed, this, [this] { stale_ = true; });
    }
  }

  void update(float /*wall_dt*/, float /*ros_dt*/) override {
    if (!stale_) return;  // maps may come more often than frames
    stale_ = false;
    const MapStyle look = style();
    drawing_->draw(map_, paths_, look, mesh_);
    scene_->show(mesh_, ids_->getBool() ? Drawing::labels_of(map_, look) : std::vector<MapLabel>(), look.text_size_m);
    this->queueRender();
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
    scene_.emplace(*this->scene_manager_, *this->scene_node_);
  }

 private:
  static constexpr const char* kStatus = "Map";

  void processMessage(const typename Drawing::Message::ConstPtr& msg) override {
    try {
      typename Drawing::Map map = drawing_->map_of(*msg);
      const std::string frame = tf2_frame(msg->header.frame_id);
      Ogre::Vector3 position;
      Ogre::Quaternion orientation;
      if (!this->context_->getFrameManager()->getTransform(frame, msg->header.stamp, position, orientation)) {
        return this->setStatus(rviz::StatusProperty::Error, kStatus,
                               "no transform from " + QString::fromStdString(frame));
      }
      if (frame != frame_) paths_.clear();
      frame_ = frame;
      map_ = std::move(map);
      paths_.add(to_nanoseconds(msg->header.stamp), Drawing::positions_of(map_), history_->getFloat());
      scene_->place(position, orientation);
      stale_ = true;
      this->setStatus(rviz::StatusProperty::Ok, kStatus, QString::number(Drawing::size_of(map_)) + " elements");
    } catch (const std::exception& error) {
      this->setStatus(rviz::StatusProperty::Error, kStatus, QString("not drawn: ") + error.what());
    }
  }

  MapStyle style() const {
    return {color_->getOptionInt(), alpha_->getFloat(), height_->getFloat(), history_->getFloat(),
            text_size_->getFloat()};
  }

  rviz::EnumProperty* color_;
  rviz::FloatProperty* alpha_;
  rviz::FloatProperty* height_;
  rviz::FloatProperty* history_;
  rviz::FloatProperty* text_size_;
  rviz::BoolProperty* ids_;
  std::optional<Drawing> drawing_;

  std::string frame_;
  typename Drawing::Map map_;
  MapHistory paths_;
  MapMesh mesh_;
  bool stale_ = false;  ///< the picture is older than the map
  std::optional<MapScene> scene_;
};

}  // namespace situation_awareness
