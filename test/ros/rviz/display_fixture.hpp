// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <functional>

#include <OgreImage.h>
#include <OgreRenderWindow.h>
#include <QApplication>
#include <QTest>

#include <geometry_msgs/TransformStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <rviz/display.h>
#include <rviz/frame_manager.h>
#include <rviz/properties/status_list.h>
#include <rviz/render_panel.h>
#include <rviz/view_manager.h>
#include <rviz/visualization_manager.h>
#include <tf2_msgs/TFMessage.h>
#include <Eigen/Core>

#include "situation_awareness/ros/markers/colors.hpp"

namespace situation_awareness {

constexpr double kScale = 80.0;  // pixels per metre

/// An invisible window with one display, seen from above; the origin of the frame odom is at (0, 1) m in world.
class DisplayFixture : public testing::Test {
 public:
  /// After all suites.
  static void end() {
    delete panel_;
    delete manager_;
  }

 protected:
  // Ogre can be started only once per process: by the first suite.
  static void SetUpTestSuite() {
    if (panel_ != nullptr) return;
    panel_ = new rviz::RenderPanel;
    panel_->resize(800, 600);
    panel_->show();
    manager_ = new rviz::VisualizationManager(panel_);
    panel_->initialize(manager_->getSceneManager(), manager_);
    manager_->initialize();
    manager_->startUpdate();
    manager_->setFixedFrame("world");
    manager_->getViewManager()->setCurrentViewControllerType("rviz/TopDownOrtho");
    manager_->getViewManager()->getCurrent()->subProp("Scale")->setValue(kScale);
  }

  void SetUp() override {
    tf_ = node_.advertise<tf2_msgs::TFMessage>("/tf_static", 10, true);
    geometry_msgs::TransformStamped T_world_odom;
    T_world_odom.header.frame_id = "world";
    T_world_odom.child_frame_id = "odom";
    T_world_odom.transform.translation.y = 1.0;
    T_world_odom.transform.rotation.w = 1.0;
    tf2_msgs::TFMessage transforms;
    transforms.transforms = {T_world_odom};
    tf_.publish(transforms);
  }

  /// Makes the display draw the messages of `maps`, opaque and without names.
  void connect(rviz::Display* display, const ros::Publisher& maps) {
    ASSERT_NE(display, nullptr);
    display_ = display;
    maps_ = maps;
    display_->subProp("Topic")->setValue(QString::fromStdString(maps.getTopic()));
    display_->subProp("Alpha")->setValue(1.0);
    display_->subProp("IDs")->setValue(false);
    ASSERT_TRUE(until([this] { return maps_.getNumSubscribers() > 0; }));
    const auto known = [] {
      Ogre::Vector3 position;
      Ogre::Quaternion orientation;
      return manager_->getFrameManager()->getTransform("odom", ros::Time(), position, orientation);
    };
    ASSERT_TRUE(until(known));
  }

  void TearDown() override { delete display_; }

  static bool until(const std::function<bool()>& condition, int timeout_ms = 10'000) {
    for (int waited_ms = 0; waited_ms < timeout_ms && !condition(); waited_ms += 20) QTest::qWait(20);
    return condition();
  }

  /// The display's status of the map.
  QString status() const {
    for (int i = 0; i < display_->numChildren(); ++i) {
      const rviz::Property* all = display_->childAt(i);
      if (dynamic_cast<const rviz::StatusList*>(all) == nullptr) continue;
      for (int k = 0; k < all->numChildren(); ++k) {
        if (all->childAt(k)->getName() == "Map") return all->childAt(k)->getValue().toString();
      }
    }
    return {};
  }

  /// The latest picture.
  Ogre::Image picture() const {
    QTest::qWait(300);
    Ogre::RenderWindow* window = panel_->getRenderWindow();
    window->update();
    Ogre::Image image;
    const std::size_t size = std::size_t{3} * window->getWidth() * window->getHeight();
    auto* memory = OGRE_ALLOC_T(Ogre::uchar, size, Ogre::MEMCATEGORY_RENDERSYS);
    image.loadDynamicImage(memory, window->getWidth(), window->getHeight(), 1, Ogre::PF_BYTE_RGB, true);
    window->copyContentsToMemory(image.getPixelBox(), image.getPixelBox());
    return image;
  }

  static Color color_at(const Ogre::Image& image, const Eigen::Vector2d& p_world_m) {
    const auto column = std::lround(0.5 * static_cast<double>(image.getWidth()) + kScale * p_world_m.x());
    const auto row = std::lround(0.5 * static_cast<double>(image.getHeight()) - kScale * p_world_m.y());
    const Ogre::ColourValue color =
        image.getColourAt(static_cast<std::size_t>(column), static_cast<std::size_t>(row), 0);
    return {color.r, color.g, color.b};
  }

  static bool alike(const Color& a, const Color& b) {
    return std::abs(a.r - b.r) + std::abs(a.g - b.g) + std::abs(a.b - b.b) < 0.06F;
  }

  struct Blob {
    double area_m2 = 0.0;
    Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  };

  static Blob blob_of(const Ogre::Image& image, const Color& wanted) {
    Blob blob;
    int count = 0;
    for (std::size_t row = 0; row < image.getHeight(); ++row) {
      for (std::size_t column = 0; column < image.getWidth(); ++column) {
        const Ogre::ColourValue color = image.getColourAt(column, row, 0);
        if (!alike({color.r, color.g, color.b}, wanted)) continue;
        ++count;
        blob.center_m += Eigen::Vector2d(static_cast<double>(column), -static_cast<double>(row));
      }
    }
    if (count == 0) return blob;
    blob.center_m /= count;
    blob.center_m -=
        0.5 * Eigen::Vector2d(static_cast<double>(image.getWidth()), -static_cast<double>(image.getHeight()));
    blob.center_m /= kScale;
    blob.area_m2 = count / (kScale * kScale);
    return blob;
  }

  ros::NodeHandle node_;
  ros::Publisher maps_, tf_;
  static inline rviz::RenderPanel* panel_ = nullptr;
  static inline rviz::VisualizationManager* manager_ = nullptr;
  rviz::Display* display_ = nullptr;
};

/// The main() of a program with such tests.
inline int run_display_tests(int argc, char** argv, const char* name) {
  testing::InitGoogleTest(&argc, argv);
  QApplication app(argc, argv);
  ros::init(argc, argv, name);
  ros::NodeHandle node;  // keeps ROS up between the tests
  const int result = RUN_ALL_TESTS();
  DisplayFixture::end();
  return result;
}

}  // namespace situation_awareness
