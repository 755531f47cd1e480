// SPDX-License-Identifier: BSD-3-Clause
// Boxes from scan to map (docs/math/boxes.md), with the shipped shape network.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <set>
#include <string>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::box_tracks_test {
namespace {

constexpr double kPeriod_s = 0.05;
const Box kRoom_world{{0.0, 0.0}, 0.0, 9.0, 8.0};

ObjectPipelineParams params_with_boxes() {
  ObjectPipelineParams params;
  params.detections.model_folder = SITUATION_AWARENESS_SOURCE_DIR "/models";
  params.detections.boxes = true;
  params.segments.free_faces = true;
  return params;
}

void add_faces(const Box& box, LevelScene& scene) {
  const std::array<Eigen::Vector2d, 4> at = corners(box);
  for (std::size_t i = 0; i < at.size(); ++i) scene.walls.push_back({at[i], at[(i + 1) % at.size()]});
}

/// What is on the map after each of the scans of a box in a room.
class Flight {
 public:
  explicit Flight(std::uint64_t seed) : pipeline_(params_with_boxes()), random_(seed) {}

  /// The only object on the map, or null.
  const Object* see(const Pose2& T_world_lidar, const Box& box_world) {
    LevelScene scene;
    const Pose2 T_lidar_world = inverse(T_world_lidar);
    add_faces(T_lidar_world * box_world, scene);
    add_faces(T_lidar_world * kRoom_world, scene);
    Scan scan = scene.scan(&random_);
    scan.stamp_ns = nanoseconds(kPeriod_s * scans_++);
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation().head<2>() = T_world_lidar.translation_m;
    T.rotate(Eigen::AngleAxisd(T_world_lidar.yaw_rad, Eigen::Vector3d::UnitZ()));
    const ObjectPipelineResult& result = pipeline_.process(scan, T);
    for (const Object& object : result.objects.objects) ids_.insert(object.id);
    more_than_one_ += result.objects.objects.size() > 1 ? 1 : 0;
    none_ += result.objects.objects.empty() ? 1 : 0;
    return result.objects.objects.size() == 1 ? &result.objects.objects[0] : nullptr;
  }

  std::size_t ids() const { return ids_.size(); }
  int more_than_one() const { return more_than_one_; }
  int none() const { return none_; }

 private:
  ObjectPipeline pipeline_;
  Random random_;
  int scans_ = 0;
  int more_than_one_ = 0;
  int none_ = 0;
  std::set<std::uint64_t> ids_;
};

/// On a circle around the origin, looking at it.
Pose2 on_circle(double radius_m, double bearing_rad) {
  return {radius_m * Eigen::Vector2d(std::cos(bearing_rad), std::sin(bearing_rad)), bearing_rad + kPi};
}

class StandingBox : public testing::TestWithParam<Box> {};

TEST_P(StandingBox, KeepsItsIdAroundAllItsFaces) {
  const Box box = GetParam();
  const double away_m = 1.7 + 2.0 * box.half_length_m;
  Flight flight(1);
  const Object* object = nullptr;
  constexpr int kScans = 240;
  for (int i = 0; i < kScans; ++i) object = flight.see(on_circle(away_m, 2.0 * kPi * i / kScans), box);
  EXPECT_EQ(flight.ids(), 1U);
  EXPECT_EQ(flight.more_than_one(), 0);
  EXPECT_LE(flight.none(), 3);
  ASSERT_NE(object, nullptr);
  EXPECT_EQ(object->shape, Shape::kBox);
  EXPECT_GT(object->p_shape, 0.9);
  EXPECT_LT((object->box_world.center_m - box.center_m).norm(), 0.03);
  EXPECT_NEAR(object->box_world.half_length_m, box.half_length_m, 0.015);
  EXPECT_NEAR(object->box_world.half_width_m, box.half_width_m, 0.015);
  EXPECT_LT(std::abs(std::remainder(object->box_world.psi_rad - box.psi_rad, kPi)), 0.05);
  EXPECT_LT(object->velocity_world_m_s.norm(), 0.02);
}

INSTANTIATE_TEST_SUITE_P(BoxTracks, StandingBox,
                         testing::Values(Box{{0.0, 0.0}, 0.4, 0.4, 0.25}, Box{{0.0, 0.0}, 0.4, 0.75, 0.25},
                                         Box{{0.0, 0.0}, 0.0, 0.6, 0.45}));

TEST(BoxTracks, ASquareHasTheOrientationOfItsFaces) {
  const Box box{{0.0, 0.0}, 0.5, 0.3, 0.3};
  Flight flight(2);
  const Object* object = nullptr;
  for (int i = 0; i < 100; ++i) object = flight.see(on_circle(2.5, 0.01 * i), box);
  ASSERT_NE(object, nullptr);
  EXPECT_EQ(object->shape, Shape::kBox);
  EXPECT_LT(std::abs(std::remainder(object->box_world.psi_rad - box.psi_rad, 0.5 * kPi)), 0.06);
}

// One face square on: its width is known, its depth is not, and the covariance says so.
TEST(BoxTracks, AFaceIsOnTheMapWithItsDepthOpen) {
  const Box box{{0.0, 0.0}, 0.0, 0.2, 0.3};
  Flight flight(3);
  const Object* object = nullptr;
  for (int i = 0; i < 40; ++i) object = flight.see({{-2.0, 0.0}, 0.0}, box);
  EXPECT_LE(flight.none(), 3);
  EXPECT_EQ(flight.ids(), 1U);
  ASSERT_NE(object, nullptr);
  const Eigen::Vector2d error_m = object->ellipse_world.center_m - box.center_m;
  const double depth_sigma_m = std::sqrt(object->covariance(0, 0));
  EXPECT_GT(depth_sigma_m, 0.03);
  EXPECT_LT(std::abs(error_m.x()), 3.0 * depth_sigma_m);
  EXPECT_LT(std::abs(error_m.y()), 0.03);
}

TEST(BoxTracks, AMovingBoxKeepsItsIdAndItsVelocity) {
  constexpr double kSpeed_m_s = 0.8;
  Flight flight(4);
  const Object* object = nullptr;
  Box box;
  for (int i = 0; i < 120; ++i) {
    box = {{-2.4 + kSpeed_m_s * kPeriod_s * i, 1.5}, 0.0, 0.4, 0.25};
    object = flight.see({{0.0, -0.5}, 0.5 * kPi}, box);
  }
  EXPECT_EQ(flight.ids(), 1U);
  EXPECT_LE(flight.none(), 3);
  ASSERT_NE(object, nullptr);
  EXPECT_EQ(object->shape, Shape::kBox);
  EXPECT_LT((object->ellipse_world.center_m - box.center_m).norm(), 0.05);
  EXPECT_LT((object->velocity_world_m_s - Eigen::Vector2d(kSpeed_m_s, 0.0)).norm(), 0.1);
}

// The velocity of a vehicle turns with it: around a curve it does not lag behind.
TEST(BoxTracks, AVelocityFollowsACurve) {
  constexpr double kSpeed_m_s = 0.8;
  constexpr double kRadius_m = 0.5;
  Flight flight(6);
  double sum2 = 0.0;
  int scans = 0;
  for (int i = 0; i < 240; ++i) {
    const double angle_rad = kSpeed_m_s / kRadius_m * kPeriod_s * i;
    const Eigen::Vector2d outward(std::cos(angle_rad), std::sin(angle_rad));
    const Eigen::Vector2d along(-outward.y(), outward.x());
    const Object* const object =
        flight.see({{-2.0, 0.0}, 0.0}, {kRadius_m * outward, angle_rad + 0.5 * kPi, 0.22, 0.1});
    if (i < 60 || object == nullptr) continue;
    sum2 += (object->velocity_world_m_s - kSpeed_m_s * along).squaredNorm();
    ++scans;
  }
  EXPECT_EQ(flight.ids(), 1U);
  EXPECT_GT(scans, 170);
  EXPECT_LT(std::sqrt(sum2 / scans), 0.15);
}

TEST(BoxTracks, ABoxThatSetsOffIsPublishedSoMoving) {
  constexpr double kSpeed_m_s = 0.8;
  Flight flight(7);
  double lag_s = -1.0;
  for (int i = 0; i < 100; ++i) {
    const double moved_s = std::max(0.0, kPeriod_s * (i - 60));
    const Object* const object =
        flight.see({{0.0, -0.5}, 0.5 * kPi}, {{-0.5 + kSpeed_m_s * moved_s, 1.5}, 0.0, 0.4, 0.25});
    const bool moving = object != nullptr && object->velocity_world_m_s.norm() > 0.5 * kSpeed_m_s;
    if (moved_s == 0.0) {
      EXPECT_FALSE(moving) << i;
    }
    if (moving && lag_s < 0.0) lag_s = moved_s;
  }
  EXPECT_EQ(flight.ids(), 1U);
  EXPECT_GT(lag_s, 0.0);
  EXPECT_LT(lag_s, 0.55);  // 0.3 m take 0.38 s
}

// An ellipse stays one, from near and far.
TEST(BoxTracks, AnEllipseIsNoBox) {
  ObjectPipeline pipeline(params_with_boxes());
  Random random(5);
  const Ellipse truth{{2.5, 0.3}, 0.6, 0.4, 0.25};
  const ObjectPipelineResult* result = nullptr;
  for (int i = 0; i < 60; ++i) {
    LevelScene scene;
    scene.ellipses = {truth};
    add_faces(kRoom_world, scene);
    Scan scan = scene.scan(&random);
    scan.stamp_ns = nanoseconds(kPeriod_s * i);
    result = &pipeline.process(scan, Eigen::Isometry3d::Identity());
  }
  ASSERT_EQ(result->objects.objects.size(), 1U);
  const Object& object = result->objects.objects[0];
  EXPECT_EQ(object.shape, Shape::kEllipse);
  EXPECT_GT(object.p_shape, 0.9);
  EXPECT_LT((object.ellipse_world.center_m - truth.center_m).norm(), 0.02);
}

}  // namespace
}  // namespace situation_awareness::box_tracks_test
