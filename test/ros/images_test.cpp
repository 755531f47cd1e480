// SPDX-License-Identifier: BSD-3-Clause
// Images as messages: what CameraInfo says a pixel sees is what it shows.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>
#include <sensor_msgs/image_encodings.h>

#include "sim/world_file.hpp"
#include "situation_awareness/ros/convert/images.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness::images_test {
namespace {

using RowMatrix3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

TEST(CameraInfo, GivesTheRayOfEachPixel) {
  // The front of a box, x = 4 with half extents of 0.8 m and 0.6 m, hides its other faces from where the camera is.
  const WorldFile file(world_text(kRobot + R"(<geom type="box" pos="4.5 0.2 1.5" size="0.5 0.8 0.6"/>)"));
  const World world(file.path());
  Eigen::Isometry3d T_robot_camera = Eigen::Isometry3d::Identity();
  T_robot_camera.translation() << 0.3, 0.1, -0.1;
  T_robot_camera.linear().col(2) = Eigen::Vector3d(1.0, 0.2, 0.1).normalized();
  T_robot_camera.linear().col(0) = Eigen::Vector3d(0.0, 0.3, -1.0).cross(T_robot_camera.linear().col(2)).normalized();
  T_robot_camera.linear().col(1) = T_robot_camera.linear().col(2).cross(T_robot_camera.linear().col(0));
  for (const auto& [width, height] : {std::pair(320, 240), std::pair(101, 75)}) {
    SimulatedLabelCameraParams params;
    params.width = width;
    params.height = height;
    const LabelImage image = SimulatedLabelCamera(world, T_robot_camera, params).next();
    const sensor_msgs::CameraInfo info = camera_info_to_msg(width, height, image.focal_length_px, 0, "eye");
    const Eigen::Matrix3d K = Eigen::Map<const RowMatrix3d>(info.K.data());
    const Eigen::Vector3d origin = image.T_world_camera.translation();
    int of_box = 0;
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        const Eigen::Vector3d ray = image.T_world_camera.linear() * K.inverse() * Eigen::Vector3d(u, v, 1.0);
        const Eigen::Vector3d hit = origin + (4.0 - origin.x()) / ray.x() * ray;
        // How far inside the front the ray is, in pixels.
        const double inside_px = std::min(0.8 - std::abs(hit.y() - 0.2), 0.6 - std::abs(hit.z() - 1.5)) *
                                 image.focal_length_px * ray.x() / (4.0 - origin.x());
        const int label = image.classes[static_cast<std::size_t>(v * width + u)];
        of_box += label;
        if (std::abs(inside_px) < 0.05) continue;  // on the edge
        ASSERT_EQ(label, inside_px > 0.0 ? 1 : 0) << u << ' ' << v;
      }
    }
    EXPECT_GT(of_box, width * height / 20);
  }
}

TEST(CameraInfo, IsOfAPinholeCameraWithoutDistortion) {
  const sensor_msgs::CameraInfo info = camera_info_to_msg(64, 48, 50.0, 1'234'567'890, "eye");
  EXPECT_EQ(to_nanoseconds(info.header.stamp), 1'234'567'890);
  EXPECT_EQ(info.header.frame_id, "eye");
  EXPECT_EQ(info.width, 64U);
  EXPECT_EQ(info.height, 48U);
  EXPECT_TRUE(std::all_of(info.D.begin(), info.D.end(), [](double d) { return d == 0.0; }));
  // P = K [R | 0], rectified as it is.
  Eigen::Matrix<double, 3, 4> expected = Eigen::Matrix<double, 3, 4>::Zero();
  expected.leftCols<3>() = Eigen::Map<const RowMatrix3d>(info.K.data()) * Eigen::Map<const RowMatrix3d>(info.R.data());
  EXPECT_EQ((Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(info.P.data())), expected);
}

TEST(PictureMessage, HasThePictureRowByRow) {
  Picture picture{2, 3, {}};
  for (int i = 0; i < 2 * 3 * 3; ++i) picture.rgb.push_back(static_cast<std::uint8_t>(7 * i));
  const sensor_msgs::Image msg = picture_to_msg(picture, 5, "eye");
  EXPECT_EQ(to_nanoseconds(msg.header.stamp), 5);
  EXPECT_EQ(msg.header.frame_id, "eye");
  EXPECT_EQ(msg.encoding, sensor_msgs::image_encodings::RGB8);
  EXPECT_EQ(msg.width, 2U);
  EXPECT_EQ(msg.height, 3U);
  EXPECT_EQ(msg.step, 6U);
  EXPECT_EQ(msg.data, picture.rgb);
}

}  // namespace
}  // namespace situation_awareness::images_test
