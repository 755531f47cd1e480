// SPDX-License-Identifier: BSD-3-Clause
#include "ellipse_map_display.hpp"

#include <cstdint>
#include <exception>

#include <OgreManualObject.h>
#include <OgreMaterialManager.h>
#include <OgreSceneManager.h>
#include <OgreSceneNode.h>
#include <OgreTechnique.h>
#include <rviz/display_context.h>
#include <rviz/frame_manager.h>
#include <rviz/ogre_helpers/movable_text.h>
#include <rviz/properties/enum_property.h>
#include <rviz/properties/float_property.h>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/ros/convert/poses.hpp"

namespace situation_awareness {
namespace {

constexpr float kNameHeight_m = 0.26F;
const char* const kMapStatus = "Map";

Ogre::MaterialPtr make_material(const std::string& name, bool translucent) {
  Ogre::MaterialPtr material =
      Ogre::MaterialManager::getSingleton().create(name, Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME);
  material->setReceiveShadows(false);
  material->setCullingMode(Ogre::CULL_NONE);
  material->getTechnique(0)->setLightingEnabled(false);
  if (translucent) {
    material->getTechnique(0)->setSceneBlending(Ogre::SBT_TRANSPARENT_ALPHA);
    material->getTechnique(0)->setDepthWriteEnabled(false);
  }
  return material;
}

/// Fills the one section of `object`, whose buffers are used again.
void fill(Ogre::ManualObject& object, const Mesh& mesh, const std::string& material) {
  object.setVisible(!mesh.indices.empty());
  if (mesh.indices.empty()) return;
  object.estimateVertexCount(mesh.vertices.size());
  object.estimateIndexCount(mesh.indices.size());
  if (object.getSections().empty()) {
    object.begin(material, Ogre::RenderOperation::OT_TRIANGLE_LIST);
  } else {
    object.beginUpdate(0);
  }
  for (const Vertex& vertex : mesh.vertices) {
    object.position(vertex.position_m.x(), vertex.position_m.y(), vertex.position_m.z());
    object.colour(vertex.color.r, vertex.color.g, vertex.color.b, vertex.alpha);
  }
  for (const std::uint32_t index : mesh.indices) object.index(index);
  object.end();
}

}  // namespace

EllipseMapDisplay::EllipseMapDisplay() {
  const MapStyle style;
  color_property_ = new rviz::EnumProperty("Color", "id",
                                           "A colour for each element, or one for all that stands and "
                                           "one for all that moves.",
                                           this, SLOT(restyle()));
  color_property_->addOption("id", static_cast<int>(MapStyle::Coloring::kId));
  color_property_->addOption("standing or moving", static_cast<int>(MapStyle::Coloring::kMotion));
  alpha_property_ = new rviz::FloatProperty("Alpha", static_cast<float>(style.alpha),
                                            "Opacity of the bodies; less where it is doubtful that an element exists.",
                                            this, SLOT(restyle()));
  alpha_property_->setMin(0.0F);
  alpha_property_->setMax(1.0F);
  height_property_ = new rviz::FloatProperty("Height", static_cast<float>(style.body_height_m),
                                             "Height of the bodies in m; the map's plane cuts them in the middle.",
                                             this, SLOT(restyle()));
  height_property_->setMin(0.0F);
  height_property_->setMax(100.0F);
  history_property_ =
      new rviz::FloatProperty("History", static_cast<float>(style.history_s),
                              "How many seconds of its path trail behind an element; 0: none.", this, SLOT(restyle()));
  history_property_->setMin(0.0F);
  history_property_->setMax(600.0F);
  names_property_ = new rviz::BoolProperty("IDs", true, "Write each element's id, and its label if it has one.", this,
                                           SLOT(restyle()));
  velocity_property_ = new rviz::BoolProperty("Velocity", style.velocity,
                                              "An arrow over the way an element will go in "
                                              "1 s, if it moves.",
                                              this, SLOT(restyle()));
  covariance_property_ = new rviz::BoolProperty(
      "Covariance", style.covariance, "The ellipse in which the centre lies with 95 %.", this, SLOT(restyle()));
}

EllipseMapDisplay::~EllipseMapDisplay() {
  if (!initialized()) return;
  names_.clear();  // a text takes itself off its node
  scene_manager_->destroyManualObject(solid_);
  scene_manager_->destroyManualObject(translucent_);
  for (const char* kind : {"solid", "translucent"}) Ogre::MaterialManager::getSingleton().remove(material_ + kind);
}

void EllipseMapDisplay::onInitialize() {
  MFDClass::onInitialize();
  material_ = "situation_awareness/EllipseMap/" + std::to_string(reinterpret_cast<std::uintptr_t>(this)) + "/";
  make_material(material_ + "solid", false);
  make_material(material_ + "translucent", true);
  for (Ogre::ManualObject** object : {&solid_, &translucent_}) {
    *object = scene_manager_->createManualObject();
    (*object)->setDynamic(true);
    (*object)->setVisible(false);
    scene_node_->attachObject(*object);
  }
}

void EllipseMapDisplay::reset() {
  MFDClass::reset();
  map_ = {};
  history_.clear();
  stale_ = true;
}

void EllipseMapDisplay::processMessage(const EllipseMap::ConstPtr& msg) {
  try {
    DrawableMap map = drawable_map(*msg);
    const std::string frame = tf2_frame(msg->header.frame_id);
    Ogre::Vector3 position;
    Ogre::Quaternion orientation;
    if (!context_->getFrameManager()->getTransform(frame, msg->header.stamp, position, orientation)) {
      return setStatus(rviz::StatusProperty::Error, kMapStatus, "no transform from " + QString::fromStdString(frame));
    }
    if (frame != frame_) history_.clear();
    frame_ = frame;
    map_ = std::move(map);
    history_.add(map_.objects, history_property_->getFloat());
    scene_node_->setPosition(position);
    scene_node_->setOrientation(orientation);
    stale_ = true;
    setStatus(rviz::StatusProperty::Ok, kMapStatus, QString::number(map_.names.size()) + " elements");
  } catch (const std::exception& error) {
    setStatus(rviz::StatusProperty::Error, kMapStatus, QString("not drawn: ") + error.what());
  }
}

void EllipseMapDisplay::update(float /*wall_dt*/, float /*ros_dt*/) {
  if (!stale_) return;  // maps may come more often than pictures
  stale_ = false;
  const MapStyle look = style();
  draw(map_.objects, history_, look, mesh_);
  fill(*solid_, mesh_.solid, material_ + "solid");
  fill(*translucent_, mesh_.translucent, material_ + "translucent");
  draw_names(top_m(map_.objects, look) + 0.2);
  queueRender();
}

void EllipseMapDisplay::draw_names(double z_m) {
  const std::size_t count = names_property_->getBool() ? map_.names.size() : 0;
  while (names_.size() < count) {
    Name name{std::make_unique<rviz::MovableText>(map_.names[names_.size()], "Liberation Sans", kNameHeight_m,
                                                  Ogre::ColourValue(0.05F, 0.05F, 0.05F)),
              scene_node_->createChildSceneNode()};
    name.text->setTextAlignment(rviz::MovableText::H_CENTER, rviz::MovableText::V_CENTER);
    name.node->attachObject(name.text.get());
    names_.push_back(std::move(name));
  }
  for (std::size_t i = 0; i < names_.size(); ++i) {
    names_[i].node->setVisible(i < count);
    if (i >= count) continue;
    if (names_[i].text->getCaption() != map_.names[i]) names_[i].text->setCaption(map_.names[i]);
    // In the body, or below it where it has no room.
    const Ellipse& ellipse = map_.objects.objects[i].ellipse_world;
    const double aside_m =
        ellipse.ry_m < 0.6 * kNameHeight_m ? -half_width_m(ellipse, {0.0, 1.0}) - kNameHeight_m : 0.0;
    const Eigen::Vector2f place_m = (ellipse.center_m + Eigen::Vector2d(0.0, aside_m)).cast<float>();
    names_[i].node->setPosition(place_m.x(), place_m.y(), static_cast<float>(z_m));
  }
}

MapStyle EllipseMapDisplay::style() const {
  MapStyle style;
  style.coloring = static_cast<MapStyle::Coloring>(color_property_->getOptionInt());
  style.alpha = alpha_property_->getFloat();
  style.body_height_m = height_property_->getFloat();
  style.history_s = history_property_->getFloat();
  style.velocity = velocity_property_->getBool();
  style.covariance = covariance_property_->getBool();
  return style;
}

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::EllipseMapDisplay, rviz::Display)
