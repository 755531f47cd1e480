// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/camera_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

#include "sim/world_file.hpp"

namespace situation_awareness::camera_view_test {
namespace {

/// A red post that moves, a red flag that only cameras see, a blue robot at a given pose, on a green floor; one camera
/// aslant from above, one straight down, one on the robot.
const std::string kColours = world_text(
    R"(<light pos="0 0 9" dir="0 0 -1" directional="true" diffuse="0.3 0.3 0.3"/>
       <geom type="plane" size="20 20 1" rgba="0 1 0 1"/>
       <body name="post" mocap="true" pos="0 0 0.5">
         <geom type="ellipsoid" group="1" size="0.2 0.2 0.5" rgba="1 0 0 1"/>
       </body>
       <body name="flag" mocap="true" pos="0 0 0.3"> <geom group="2" type="sphere" size="0.2" rgba="1 0 0 1"/> </body>
       <body name="robot" mocap="true" pos="0 0 1">
         <site name="lidar"/> <camera name="ahead" pos="0.3 0 0" xyaxes="0 -1 0 0 0 1"/>
         <geom group="2" type="sphere" size="0.2" rgba="0 0 1 1"/>
       </body>
       <camera name="aslant" pos="0 -6 5" xyaxes="1 0 0 0 0.64 0.768" fovy="50"/>
       <camera name="down" pos="0 0 10" xyaxes="1 0 0 0 1 0" fovy="50"/>)",
    R"(<text name="post" data="circle center 0 0 radius 2 rate 1"/>
       <text name="flag" data="circle center 0 0 radius 3 rate -1"/>)");

/// Index of the strongest of red, green, blue at the pixel that the point in the world projects to.
int colour_at(const CameraView& view, const Picture& picture, const Eigen::Vector3d& p_world) {
  const Eigen::Vector3d p_camera = view.T_world_camera().inverse() * p_world;
  const double u = 0.5 * picture.width + view.focal_length_px() * p_camera.x() / p_camera.z();
  const double v = 0.5 * picture.height + view.focal_length_px() * p_camera.y() / p_camera.z();
  EXPECT_TRUE(p_camera.z() > 0.0 && u >= 0.0 && u < picture.width && v >= 0.0 && v < picture.height) << u << ' ' << v;
  const std::size_t pixel =
      static_cast<std::size_t>(v) * static_cast<std::size_t>(picture.width) + static_cast<std::size_t>(u);
  const auto rgb = picture.rgb.begin() + 3 * static_cast<std::ptrdiff_t>(pixel);
  return static_cast<int>(std::max_element(rgb, rgb + 3) - rgb);
}

TEST(CameraView, ShowsObjectsAtTheirProjections) {
  const WorldFile file(kColours);
  for (const std::string camera : {"aslant", "down"}) {
    CameraView view(file.path(), camera, 400, 300);
    Eigen::Isometry3d T_world_robot = Eigen::Isometry3d::Identity();
    for (const double t : {0.0, 1.0, 2.5, 4.0, 1.0}) {
      T_world_robot.translation() << 1.2 * std::cos(2.0 - t), std::sin(2.0 - t), 1.0;
      const Picture picture = view.at(t, T_world_robot);
      ASSERT_EQ(picture.rgb.size(), 400U * 300U * 3U);
      EXPECT_EQ(colour_at(view, picture, {2.0 * std::cos(t), 2.0 * std::sin(t), 0.5}), 0) << camera << t;
      EXPECT_EQ(colour_at(view, picture, {3.0 * std::cos(t), -3.0 * std::sin(t), 0.3}), 0) << camera << t;
      EXPECT_EQ(colour_at(view, picture, T_world_robot.translation()), 2) << camera << t;
      EXPECT_EQ(colour_at(view, picture, {-2.0 * std::cos(t), -2.0 * std::sin(t), 0.0}), 1) << camera << t;
    }
  }
}

TEST(CameraView, IsMountedOnTheRobot) {
  const WorldFile file(kColours);
  CameraView view(file.path(), "ahead", 64, 48);
  Eigen::Isometry3d T_world_robot(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ()));
  T_world_robot.translation() << -1.0, 0.5, 0.8;
  view.at(0.0, T_world_robot);
  const Eigen::Isometry3d T_robot_camera = T_world_robot.inverse() * view.T_world_camera();
  EXPECT_LT((T_robot_camera.translation() - Eigen::Vector3d(0.3, 0, 0)).norm(), 1e-9);
  EXPECT_LT((T_robot_camera.linear().col(2) - Eigen::Vector3d::UnitX()).norm(), 1e-9);
  EXPECT_LT((T_robot_camera.linear().col(1) + Eigen::Vector3d::UnitZ()).norm(), 1e-9);
}

TEST(CameraView, EveryWorldHasAnOverviewAndAViewFromAbove) {
  for (const std::string world : {"demo", "lab", "orchard", "warehouse", "crowd"}) {
    for (const std::string camera : {"overview"}) {
      CameraView view(kWorlds + world + ".xml", camera, 160, 120);
      const Picture picture = view.at(1.0, World(kWorlds + world + ".xml").robot_at(1.0).T_world_robot);
      const auto [dark, bright] = std::minmax_element(picture.rgb.begin(), picture.rgb.end());
      EXPECT_GT(*bright - *dark, 100) << world;
    }
  }
}

TEST(CameraView, NamesTheCauseOfErrors) {
  const WorldFile file(kColours);
  EXPECT_TRUE(
      names(refusal_of<std::runtime_error>([&] { CameraView(file.path(), "aloft", 64, 48); }), {file.path(), "aloft"}));
  EXPECT_THROW(CameraView(file.path(), "down", 0, 48), std::invalid_argument);
  EXPECT_THROW(CameraView(file.path(), "down", 64, 5000), std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness::camera_view_test
