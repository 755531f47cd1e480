// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#ifndef Q_MOC_RUN
#include <memory>
#include <string>
#include <vector>

#include <rviz/message_filter_display.h>

#include "situation_awareness/EllipseMap.h"
#include "situation_awareness/ros/rviz/drawable_map.hpp"
#include "situation_awareness/ros/rviz/map_history.hpp"
#include "situation_awareness/ros/rviz/map_mesh.hpp"
#endif

namespace Ogre {
class ManualObject;
}

namespace rviz {
class EnumProperty;
class FloatProperty;
class MovableText;
}  // namespace rviz

namespace situation_awareness {

/// Draws the topic `objects` in rviz. Messages that cannot be drawn set the status "Map" to Error, and what was drawn
/// before stays.
class EllipseMapDisplay : public rviz::MessageFilterDisplay<EllipseMap> {
  Q_OBJECT

 public:
  EllipseMapDisplay();
  ~EllipseMapDisplay() override;

  void update(float wall_dt, float ros_dt) override;
  void reset() override;

 protected:
  void onInitialize() override;

 private Q_SLOTS:
  void restyle() { stale_ = true; }

 private:
  struct Name {
    std::unique_ptr<rviz::MovableText> text;
    Ogre::SceneNode* node;
  };

  void processMessage(const EllipseMap::ConstPtr& msg) override;
  MapStyle style() const;
  void draw_names(double z_m);

  rviz::EnumProperty* color_property_;
  rviz::FloatProperty* alpha_property_;
  rviz::FloatProperty* height_property_;
  rviz::FloatProperty* history_property_;
  rviz::BoolProperty* names_property_;
  rviz::BoolProperty* velocity_property_;
  rviz::BoolProperty* covariance_property_;

  std::string frame_;
  DrawableMap map_;
  MapHistory history_;
  MapMesh mesh_;
  bool stale_ = false;  ///< what is drawn is not what is known
  Ogre::ManualObject* solid_ = nullptr;
  Ogre::ManualObject* translucent_ = nullptr;
  std::string material_;
  std::vector<Name> names_;  ///< as many as there ever were at once; those not needed are hidden
};

}  // namespace situation_awareness
