// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <OgreQuaternion.h>
#include <OgreVector3.h>

#include "situation_awareness/ros/rviz/map_mesh.hpp"

namespace Ogre {
class ManualObject;
class SceneManager;
class SceneNode;
}  // namespace Ogre

namespace rviz {
class MovableText;
}

namespace situation_awareness {

/// The meshes and labels of a map in the scene of rviz. Buffers and texts are reused.
class MapScene {
 public:
  /// Draws below `node`. Both must outlive this.
  MapScene(Ogre::SceneManager& manager, Ogre::SceneNode& node);
  MapScene(const MapScene&) = delete;
  MapScene& operator=(const MapScene&) = delete;
  ~MapScene();

  /// Pose of the map's frame in the fixed frame.
  void place(const Ogre::Vector3& position, const Ogre::Quaternion& orientation);

  /// `text_size_m`: of the labels.
  void show(const MapMesh& mesh, const std::vector<MapLabel>& labels, double text_size_m);

 private:
  struct Text {
    std::unique_ptr<rviz::MovableText> text;
    Ogre::SceneNode* node;
  };

  Ogre::SceneManager& manager_;
  Ogre::SceneNode& node_;
  std::string material_;
  Ogre::ManualObject* solid_;
  Ogre::ManualObject* translucent_;
  std::vector<Text> texts_;  ///< grows to the largest number needed; unused ones are hidden
};

}  // namespace situation_awareness
