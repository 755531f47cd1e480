// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/visibility.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "situation_awareness/points/horizontal_projection.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::visibility_test {
namespace {

constexpr double kMargin_m = 0.1;

FreeSpace free_space_of(const Scan& scan) {
  return free_space(project_horizontally(scan, Eigen::Isometry3d::Identity()));
}

Sight look_at_in(const Ellipse& ellipse, const LevelScene& scene) {
  return look_at(ellipse, free_space_of(scene.scan()), kMargin_m);
}

LevelScene full_circle() {
  LevelScene scene;
  scene.beams = 720;
  scene.angle_increment_rad = radians(0.5);
  scene.angle_min_rad = -kPi;
  return scene;
}

const Ellipse kPlace{{4.0, 0.5}, 0.3, 0.3, 0.2};

TEST(Visibility, FreeSpaceIsSeenThrough) {
  LevelScene scene;
  EXPECT_EQ(look_at_in(kPlace, scene), Sight::kSeenThrough);  // no object
  scene.walls = {{{8.0, -8.0}, {8.0, 8.0}}};
  EXPECT_EQ(look_at_in(kPlace, scene), Sight::kSeenThrough);  // a wall behind
  scene.ellipses = {{{4.0, 1.5}, 0.0, 0.3, 0.3}, {{4.0, -0.5}, 0.0, 0.3, 0.3}};
  EXPECT_EQ(look_at_in(kPlace, scene), Sight::kSeenThrough);  // others beside
}

TEST(Visibility, AnObjectIsHit) {
  LevelScene scene;
  scene.ellipses = {kPlace};
  EXPECT_EQ(look_at_in(kPlace, scene), Sight::kHit);
  // The position is known to some centimetres.
  for (const Eigen::Vector2d& error : {Eigen::Vector2d(0.08, 0.0), Eigen::Vector2d(-0.08, 0.0),
                                       Eigen::Vector2d(0.0, 0.08), Eigen::Vector2d(0.0, -0.08)}) {
    Ellipse expected = kPlace;
    expected.center_m += error;
    EXPECT_EQ(look_at_in(expected, scene), Sight::kHit) << error.transpose();
  }
}

TEST(Visibility, NearerHitsHide) {
  LevelScene scene;
  scene.ellipses = {{{2.0, 0.25}, 0.0, 0.2, 0.2}};
  EXPECT_EQ(look_at_in(kPlace, scene), Sight::kHidden);
  scene.ellipses.push_back(kPlace);
  EXPECT_EQ(look_at_in(kPlace, scene), Sight::kHidden);
  // A thin pole before it does not.
  scene.ellipses = {{{2.0, 0.25}, 0.0, 0.005, 0.005}};
  EXPECT_EQ(look_at_in(kPlace, scene), Sight::kSeenThrough);
}

TEST(Visibility, TheMarginSeparatesBehindAndBefore) {
  const Ellipse place{{4.0, 0.0}, 0.0, 0.2, 0.2};
  const auto with_wall_at = [&](double x_m) {
    LevelScene scene;
    scene.walls = {{{x_m, -8.0}, {x_m, 8.0}}};
    return look_at_in(place, scene);
  };
  EXPECT_EQ(with_wall_at(4.0 + 0.2 + kMargin_m + 0.01), Sight::kSeenThrough);
  EXPECT_EQ(with_wall_at(4.0 + 0.2 + kMargin_m - 0.01), Sight::kHit);
  EXPECT_EQ(with_wall_at(4.0 - 0.2 - kMargin_m + 0.01), Sight::kHit);
  EXPECT_EQ(with_wall_at(4.0 - 0.2 - kMargin_m - 0.01), Sight::kHidden);
}

TEST(Visibility, OutsideTheScanItIsHidden) {
  const LevelScene scene;  // 270 deg: nothing behind
  EXPECT_EQ(look_at_in({{-3.0, 0.0}, 0.0, 0.3, 0.3}, scene), Sight::kHidden);
  EXPECT_EQ(look_at_in({{-3.0, 0.5}, 0.0, 0.3, 0.3}, scene), Sight::kHidden);
}

TEST(Visibility, InvalidBeamsHide) {
  LevelScene scene;
  for (const BeamState state : {BeamState::kInvalid, BeamState::kTooClose}) {
    Scan scan = scene.scan();
    for (Beam& beam : scan.beams) beam = {0.0F, state};
    EXPECT_EQ(look_at(kPlace, free_space_of(scan), kMargin_m), Sight::kHidden);
  }
  EXPECT_EQ(look_at(kPlace, FreeSpace{}, kMargin_m), Sight::kHidden);
}

TEST(Visibility, FromInsideItIsHidden) {
  EXPECT_EQ(look_at_in({{0.1, 0.0}, 0.0, 0.3, 0.3}, {}), Sight::kHidden);
  EXPECT_EQ(look_at_in({{0.0, 0.0}, 0.0, 0.3, 0.3}, {}), Sight::kHidden);
}

TEST(Visibility, AnObjectThinnerThanTheBeamSpacingIsTestedToo) {
  LevelScene scene;
  scene.walls = {{{10.0, -10.0}, {10.0, 10.0}}};
  for (double y_m = -0.05; y_m < 0.05; y_m += 0.003) {  // beams are 35 mm apart there
    const Ellipse pole{{8.0, y_m}, 0.0, 0.004, 0.004};
    EXPECT_EQ(look_at_in(pole, scene), Sight::kSeenThrough) << y_m;
    LevelScene hidden = scene;
    hidden.ellipses = {{{4.0, 0.0}, 0.0, 0.3, 0.3}};
    EXPECT_EQ(look_at_in(pole, hidden), Sight::kHidden) << y_m;
  }
}

// A scene rotated about a full circle, over the seam too, gives the same result; so does one that is half hidden, where
// each beam counts.
TEST(Visibility, TurnsWithTheScene) {
  const Ellipse hider{{2.0, 0.0}, 0.0, 0.2, 0.2};
  for (int turn = 0; turn < 720; ++turn) {
    const Pose2 T{Eigen::Vector2d::Zero(), radians(0.5 * turn)};
    LevelScene scene = full_circle();
    EXPECT_EQ(look_at_in(T * kPlace, scene), Sight::kSeenThrough) << turn;
    scene.ellipses = {T * kPlace};
    EXPECT_EQ(look_at_in(T * kPlace, scene), Sight::kHit) << turn;
    scene.ellipses = {T * hider};
    // The hider's edge is at 5.7 deg: the inner half of one place lies mostly behind it, that of the other mostly not.
    EXPECT_EQ(look_at_in(T * Ellipse{{4.0, 0.3}, 0.0, 0.3, 0.3}, scene), Sight::kHidden) << turn;
    EXPECT_EQ(look_at_in(T * Ellipse{{4.0, 0.5}, 0.0, 0.3, 0.3}, scene), Sight::kSeenThrough) << turn;
  }
}

}  // namespace
}  // namespace situation_awareness::visibility_test
