// SPDX-License-Identifier: BSD-3-Clause
// The shipped ScoutNet on images of the car park, a world that it was not trained on, against what they show.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/image/label_network.hpp"
#include "situation_awareness/sim/label_camera.hpp"
#include "situation_awareness/sim/world.hpp"

namespace situation_awareness::rendered_labels_test {
namespace {

const std::string kModels = SITUATION_AWARENESS_SOURCE_DIR "/models/";
constexpr int kSize = 448, kStride = 16, kLabels = kSize / kStride;
constexpr int kImages = 16;

/// Towards a place on the ground, from somewhere above and beside it.
Eigen::Isometry3d draw_pose(Random& random, const Eigen::Vector2d& aim) {
  const double yaw = random.uniform(-M_PI, M_PI), pitch = radians(random.uniform(20.0, 35.0));
  const double height_m = random.uniform(14.0, 20.0);
  Eigen::Matrix3d R_level_camera;
  R_level_camera << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation().head<2>() = aim - height_m / std::tan(pitch) * Eigen::Vector2d(std::cos(yaw), std::sin(yaw));
  T.translation().z() = height_m + 5.0;  // the hills' mean height
  T.linear() = (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()))
                   .toRotationMatrix() *
               R_level_camera;
  return T;
}

TEST(RenderedLabels, LieOnTheCarsOfAWorldThatTheNetworkHasNotSeen) {
  const World world(kModels + "worlds/carpark.xml");
  SimulatedLabelCameraParams params;
  params.width = params.height = kSize;
  params.color = 1;
  SimulatedLabelCamera camera(world, Eigen::Isometry3d::Identity(), params);
  std::vector<bool> is_car;
  for (const std::string& name : camera.class_names()) is_car.push_back(name.rfind("car", 0) == 0);
  LabelNetwork network(kModels + "scoutnet.onnx", {});
  const std::size_t car = network.index_of("car");
  std::vector<Eigen::Vector2d> aims;
  for (const TrueObject& object : world.objects_at(0.0)) aims.push_back(object.T_world_object.translation_m);
  ASSERT_FALSE(aims.empty());
  Random random(3);
  int cars = 0, found = 0, labelled = 0, far = 0;
  for (int i = 0; i < kImages; ++i) {
    const LabelImage seen = camera.at(0.0, draw_pose(random, aims[static_cast<std::size_t>(i) % aims.size()]));
    ColorImage image;
    image.camera.width = image.camera.height = kSize;
    image.camera.fx_px = image.camera.fy_px = seen.focal_length_px;
    image.camera.cx_px = image.camera.cy_px = 0.5 * kSize - 0.5;
    image.rgb = seen.rgb;
    std::vector<int> pixels(kLabels * kLabels);  // of cars in each label pixel
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        const auto at = static_cast<std::size_t>(y * kSize + x);
        if (is_car[seen.classes[at]]) ++pixels[static_cast<std::size_t>((y / kStride) * kLabels + x / kStride)];
      }
    }
    const SoftLabels& labels = network.label(image)[car];
    for (int y = 0; y < kLabels; ++y) {
      for (int x = 0; x < kLabels; ++x) {
        const auto at = static_cast<std::size_t>(y * kLabels + x);
        const bool says_car = labels.probability[at] > 0.5F;
        const bool shows_car = 2 * pixels[at] > kStride * kStride;
        cars += shows_car ? 1 : 0;
        found += shows_car && labels.probability[at] > 0.3F ? 1 : 0;
        if (!says_car) continue;
        ++labelled;
        bool near = false;
        for (int v = std::max(0, y - 1); v <= std::min(kLabels - 1, y + 1); ++v) {
          for (int u = std::max(0, x - 1); u <= std::min(kLabels - 1, x + 1); ++u) {
            near = near || pixels[static_cast<std::size_t>(v * kLabels + u)] > 0;
          }
        }
        far += near ? 0 : 1;
      }
    }
  }
  ASSERT_GE(cars, 30);
  EXPECT_GE(found, 0.7 * cars) << cars;
  EXPECT_LE(far, 0.1 * labelled) << labelled;
  RecordProperty("cars", cars);
  RecordProperty("found", found);
  RecordProperty("labelled", labelled);
  RecordProperty("far", far);
}

}  // namespace
}  // namespace situation_awareness::rendered_labels_test
