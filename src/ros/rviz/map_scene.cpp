// SPDX-License-Identifier: BSD-3-Clause
#include "map_scene.hpp"

#include <cstdint>

#include <OgreManualObject.h>
#include <OgreMaterialManager.h>
#include <OgreSceneManager.h>
#include <OgreSceneNode.h>
#include <OgreTechnique.h>
#include <rviz/ogre_helpers/movable_text.h>

namespace situation_awareness {
namespace {

void make_material(const std::string& name, bool translucent) {
  Ogre::MaterialPtr material =
      Ogre::MaterialManager::getSingleton().create(name, Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME);
  material->setReceiveShadows(false);
  material->setCullingMode(Ogre::CULL_NONE);
  material->getTechnique(0)->setLightingEnabled(false);
  if (translucent) {
    material->getTechnique(0)->setSceneBlending(Ogre::SBT_TRANSPARENT_ALPHA);
    material->getTechnique(0)->setDepthWriteEnabled(false);
  }
}

/// Fills the only section of `object`, whose buffers are reused.
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

MapScene::MapScene(Ogre::SceneManager& manager, Ogre::SceneNode& node)
    : manager_(manager),
      node_(node),
      material_("situation_awareness/Map/" + std::to_string(reinterpret_cast<std::uintptr_t>(this)) + "/") {
  make_material(material_ + "solid", false);
  make_material(material_ + "translucent", true);
  for (Ogre::ManualObject** object : {&solid_, &translucent_}) {
    *object = manager_.createManualObject();
    (*object)->setDynamic(true);
    (*object)->setVisible(false);
    node_.attachObject(*object);
  }
}

MapScene::~MapScene() {
  texts_.clear();  // a text detaches itself from its node
  manager_.destroyManualObject(solid_);
  manager_.destroyManualObject(translucent_);
  for (const char* kind : {"solid", "translucent"}) Ogre::MaterialManager::getSingleton().remove(material_ + kind);
}

void MapScene::place(const Ogre::Vector3& position, const Ogre::Quaternion& orientation) {
  node_.setPosition(position);
  node_.setOrientation(orientation);
}

void MapScene::show(const MapMesh& mesh, const std::vector<MapLabel>& labels, double text_size_m) {
  fill(*solid_, mesh.solid, material_ + "solid");
  fill(*translucent_, mesh.translucent, material_ + "translucent");
  while (texts_.size() < labels.size()) {
    Text text{
        std::make_unique<rviz::MovableText>(labels[texts_.size()].text, "Liberation Sans",
                                            static_cast<float>(text_size_m), Ogre::ColourValue(0.05F, 0.05F, 0.05F)),
        node_.createChildSceneNode()};
    text.text->setTextAlignment(rviz::MovableText::H_CENTER, rviz::MovableText::V_CENTER);
    text.node->attachObject(text.text.get());
    texts_.push_back(std::move(text));
  }
  for (std::size_t i = 0; i < texts_.size(); ++i) {
    texts_[i].node->setVisible(i < labels.size());
    if (i >= labels.size()) continue;
    const auto& [text, position_m] = labels[i];
    if (texts_[i].text->getCaption() != text) texts_[i].text->setCaption(text);
    texts_[i].text->setCharacterHeight(static_cast<float>(text_size_m));
    texts_[i].node->setPosition(position_m.x(), position_m.y(), position_m.z());
  }
}

}  // namespace situation_awareness
