// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/label_camera.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>

#include <gtest/gtest.h>

#include "sim/world_file.hpp"
#include "situation_awareness/sim/camera_view.hpp"
#include "situation_awareness/sim/sensors.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::label_camera_test {
namespace {

/// Two posts of other materials, one with a hat, among grass and a wall without a material; the camera looks ahead, a
/// camera of MuJoCo's own at the same place, too.
const std::string kMeadow = world_text(
    R"(<geom type="plane" size="50 50 1" material="grass"/>
       <geom type="box" size="0.1 0.5 1" pos="6 -3 1" rgba="1 1 1 1"/>
       <body name="near" pos="3 0.6 0.5">
         <geom type="ellipsoid" group="1" size="0.2 0.2 0.5" material="wood"/>
         <geom type="sphere" group="2" pos="0 0 0.7" size="0.15" material="cloth"/>
       </body>
       <body name="walker" mocap="true" pos="0 0 0.5">
         <geom type="ellipsoid" group="1" size="0.3 0.3 0.5" material="cloth"/>
       </body>
       <body name="robot" mocap="true" pos="0 0 1">
         <site name="lidar"/> <site name="eye" pos="0.3 0 0" xyaxes="0 -1 0 0 0 -1"/>
         <camera name="same" pos="0.3 0 0" xyaxes="0 -1 0 0 0 1" fovy="60"/>
       </body>)",
    R"(<text name="walker" data="circle center 5 0 radius 1 rate -0.5"/>
       <text name="robot" data="line from 0 0 to 0 1 period 8"/>
       <text name="eye" data="label_camera rate_hz 2 width 320 height 240"/>)",
    R"(<asset> <material name="grass"/> <material name="wood"/> <material name="cloth"/> </asset>)");

class LabelCamera : public testing::Test {
 protected:
  SimulatedLabelCamera camera() {
    const WorldSensors sensors = sensors_of(world_);
    EXPECT_EQ(sensors.label_cameras.size(), 1U);
    const auto& eye = sensors.label_cameras.at(0);
    EXPECT_EQ(eye.name, "eye");
    return {world_, eye.T_robot_sensor, eye.params};
  }

  /// Index of the pixel that a point in the world projects to.
  static std::size_t pixel_of(const LabelImage& image, const Eigen::Vector3d& p_world) {
    const Eigen::Vector3d p_camera = image.T_world_camera.inverse() * p_world;
    const double u = 0.5 * image.width + image.focal_length_px * p_camera.x() / p_camera.z();
    const double v = 0.5 * image.height + image.focal_length_px * p_camera.y() / p_camera.z();
    EXPECT_TRUE(p_camera.z() > 0.0 && u >= 0.0 && u < image.width && v >= 0.0 && v < image.height) << u << ' ' << v;
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(u);
  }

  WorldFile file_{kMeadow};
  World world_{file_.path()};
};

TEST_F(LabelCamera, LooksFromAnyPlace) {
  SimulatedLabelCamera camera = this->camera(), beside = this->camera();
  for (int i = 0; i < 3; ++i) {
    const LabelImage image = camera.next();
    const LabelImage same = beside.at(0.5 * i, image.T_world_camera);
    EXPECT_EQ(same.classes, image.classes);
    EXPECT_EQ(same.objects, image.objects);
    EXPECT_EQ(same.stamp_ns, image.stamp_ns);
    const LabelImage other = beside.at(0.5 * i, image.T_world_camera * Eigen::Translation3d(0.5, 0.0, 0.0));
    EXPECT_NE(other.classes, image.classes);
  }
  EXPECT_EQ(beside.next_time_s(), 0.0);  // none was passed over
}

TEST_F(LabelCamera, SaysWhatIsWhereItProjectsTo) {
  SimulatedLabelCamera camera = this->camera();
  const std::vector<std::string>& names = camera.class_names();
  const auto class_named = [&](const std::string& name) {
    return std::find(names.begin(), names.end(), name) - names.begin();
  };
  ASSERT_EQ(names, (std::vector<std::string>{"nothing", "no material", "grass", "wood", "cloth"}));
  for (int i = 0; i < 8; ++i) {
    EXPECT_EQ(camera.next_time_s(), 0.5 * i);
    const LabelImage image = camera.next();
    EXPECT_EQ(image.stamp_ns, 500'000'000 * std::int64_t{i});
    ASSERT_EQ(image.objects.size(), 320U * 240U);
    ASSERT_EQ(image.classes.size(), 320U * 240U);
    const double t = 0.5 * i;
    const auto expect = [&](const Eigen::Vector3d& p_world, int object, const std::string& name) {
      const std::size_t pixel = pixel_of(image, p_world);
      EXPECT_EQ(image.objects[pixel], object) << name << ' ' << t;
      EXPECT_EQ(image.classes[pixel], class_named(name)) << name << ' ' << t;
    };
    expect({3.0, 0.6, 0.5}, 1, "wood");
    expect({3.0, 0.6, 1.2}, 1, "cloth");  // of the same body
    const Eigen::Vector3d walker = world_.objects_at(t)[1].T_world_object.translation_m.homogeneous();
    if (walker.y() < -0.5) expect({walker.x(), walker.y(), 0.5}, 2, "cloth");  // else it may be behind the post
    expect({6.0, -3.0, 1.5}, 0, "no material");
    expect({3.0, -0.9, 0.0}, 0, "grass");
    EXPECT_EQ(image.classes[5], class_named("nothing")) << "the sky";
    EXPECT_EQ(image.objects[5], 0);
  }
}

TEST_F(LabelCamera, SeesWhatACameraSees) {
  // A camera in the same place shows the white wall where the labels say so.
  SimulatedLabelCamera camera = this->camera();
  CameraView view(file_.path(), "same", 320, 240);
  const LabelImage image = camera.next();
  const Picture picture = view.at(0.0, world_.robot_at(0.0).T_world_robot);
  EXPECT_LT((view.T_world_camera().matrix() - image.T_world_camera.matrix()).norm(), 1e-9);
  EXPECT_NEAR(view.focal_length_px(), image.focal_length_px, 1e-9);
  // A headlight shines on the wall; the picture has nothing, black, above it.
  const std::size_t wall = pixel_of(image, {6.0, -3.0, 1.9}), above = pixel_of(image, {6.0, -3.0, 2.2});
  EXPECT_EQ(image.classes[above], 0);
  EXPECT_EQ(image.classes[wall], 1);
  EXPECT_GT(picture.rgb[3 * wall], picture.rgb[3 * above] + 20);
}

TEST_F(LabelCamera, HasTheColoursThatACameraSees) {
  const auto eye = sensors_of(world_).label_cameras.at(0);
  SimulatedLabelCameraParams params = eye.params;
  params.color = 1;
  SimulatedLabelCamera plain(world_, eye.T_robot_sensor, eye.params), coloured(world_, eye.T_robot_sensor, params);
  CameraView view(file_.path(), "same", 320, 240);
  for (int i = 0; i < 3; ++i) {
    const double t = plain.next_time_s();
    const LabelImage without = plain.next(), with = coloured.next();
    EXPECT_TRUE(without.rgb.empty());
    EXPECT_EQ(with.objects, without.objects) << t;
    EXPECT_EQ(with.classes, without.classes) << t;
    // Mesa 25 of Debian 13 may round a colour in another way in each of two contexts; Mesa 22 of Debian 12 does not.
    const Picture seen = view.at(t, world_.robot_at(t).T_world_robot);
    ASSERT_EQ(with.rgb.size(), seen.rgb.size());
    int most = 0;
    for (std::size_t k = 0; k < seen.rgb.size(); ++k) most = std::max(most, std::abs(with.rgb[k] - seen.rgb[k]));
    EXPECT_LE(most, 1) << t;
  }
}

TEST_F(LabelCamera, SkippingAnImageDoesNotChangeTheNext) {
  SimulatedLabelCamera all = camera(), some = camera();
  all.next();
  some.skip();
  EXPECT_EQ(some.next_time_s(), all.next_time_s());
  const LabelImage expected = all.next(), image = some.next();
  EXPECT_EQ(image.stamp_ns, expected.stamp_ns);
  EXPECT_EQ(image.objects, expected.objects);
  EXPECT_EQ(image.classes, expected.classes);
  EXPECT_EQ(image.T_world_camera.matrix(), expected.T_world_camera.matrix());
}

TEST_F(LabelCamera, RefusesBadParamsNamingFieldAndBound) {
  SimulatedLabelCameraParams params;
  params.width = 8;
  EXPECT_TRUE(names(refusal_of([&] { SimulatedLabelCamera(world_, Eigen::Isometry3d::Identity(), params); }),
                    {"label_camera.width", "8", "16", "4096"}));
}

}  // namespace
}  // namespace situation_awareness::label_camera_test
