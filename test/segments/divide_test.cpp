// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/segments/divide.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "situation_awareness/points/horizontal_projection.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::divide_test {
namespace {

SegmentationParams params() {
  SegmentationParams result;
  result.max_gap_m = 0.2;
  result.max_range_gap_m = 0.2;
  result.min_points = 4;
  result.max_object_extent_m = 1.2;
  result.occlusion_margin_m = 0.05;
  result.max_division_offset_m = 0.06;
  return result;
}

Segments segments_of(const LevelScene& scene, Random* random = nullptr) {
  return segment(project_horizontally(scene.scan(random), Eigen::Isometry3d::Identity()), params());
}

void expect_same(const Segments& a, const Segments& b) {
  ASSERT_EQ(a.segments.size(), b.segments.size());
  EXPECT_EQ(a.points.size(), b.points.size());
  EXPECT_EQ(a.stamp_ns, b.stamp_ns);
  EXPECT_EQ(a.resolution_rad, b.resolution_rad);
  for (std::size_t i = 0; i < a.segments.size(); ++i) {
    const Segment& x = a.segments[i];
    const Segment& y = b.segments[i];
    EXPECT_EQ(x.first, y.first);
    EXPECT_EQ(x.count, y.count);
    EXPECT_EQ(x.kind, y.kind);
    EXPECT_EQ(x.right_end, y.right_end);
    EXPECT_EQ(x.left_end, y.left_end);
    EXPECT_EQ(x.right_hidden_rad, y.right_hidden_rad);
    EXPECT_EQ(x.left_hidden_rad, y.left_hidden_rad);
  }
}

/// The object of a noiseless hit.
bool lies_on(const Ellipse& ellipse, const Point& point) {
  const Eigen::Vector2d d = point.p_level_m - ellipse.center_m;
  return std::abs(std::sqrt(d.dot(shape_matrix(ellipse).inverse() * d)) - 1.0) < 1e-3;
}

double width_rad(const Segments& segments, const Segment& segment) {
  return segments.points[segment.first + segment.count - 1].azimuth_rad - segments.points[segment.first].azimuth_rad;
}

const Ellipse kRight{{3.0, -0.25}, 0.0, 0.27, 0.27};
const Ellipse kLeft{{3.0, 0.25}, 0.0, 0.27, 0.27};

TEST(Divide, TwoKnownObjectsThatTouchAreDividedAtTheirBorder) {
  LevelScene scene;
  scene.ellipses = {kRight, kLeft};
  const Segments whole = segments_of(scene);
  ASSERT_EQ(whole.segments.size(), 1U);
  const Segments divided = divide(whole, {kLeft, kRight}, params());
  ASSERT_EQ(divided.segments.size(), 2U);
  const Segment& right = divided.segments[0];
  const Segment& left = divided.segments[1];
  // Every hit is in one of them, and on its own circle.
  EXPECT_EQ(right.first, whole.segments[0].first);
  EXPECT_EQ(left.first, right.first + right.count);
  EXPECT_EQ(right.count + left.count, whole.segments[0].count);
  for (std::size_t i = 0; i < right.count; ++i) EXPECT_TRUE(lies_on(kRight, divided.points[right.first + i]));
  for (std::size_t i = 0; i < left.count; ++i) EXPECT_TRUE(lies_on(kLeft, divided.points[left.first + i]));
  EXPECT_EQ(right.kind, SegmentKind::kObject);
  EXPECT_EQ(left.kind, SegmentKind::kObject);
  // The outer ends are unchanged; at the border either may extend behind the other, as far as that one does.
  EXPECT_EQ(right.right_end, SegmentEnd::kFree);
  EXPECT_EQ(left.left_end, SegmentEnd::kFree);
  EXPECT_EQ(right.right_hidden_rad, 0.0);
  EXPECT_EQ(left.left_hidden_rad, 0.0);
  EXPECT_EQ(right.left_end, SegmentEnd::kOccluded);
  EXPECT_EQ(left.right_end, SegmentEnd::kOccluded);
  EXPECT_NEAR(right.left_hidden_rad, width_rad(divided, left), 1e-12);
  EXPECT_NEAR(left.right_hidden_rad, width_rad(divided, right), 1e-12);
}

TEST(Divide, TheNearerOfTwoHasASilhouetteAndTheFartherAHiddenEnd) {
  const Ellipse near{{2.85, -0.2}, 0.0, 0.2, 0.2};
  const Ellipse far{{3.0, 0.15}, 0.0, 0.25, 0.25};
  LevelScene scene;
  scene.ellipses = {near, far};
  const Segments whole = segments_of(scene);
  ASSERT_EQ(whole.segments.size(), 1U);
  SegmentationParams fine = params();
  fine.occlusion_margin_m = 0.0;  // any difference decides which of them is in front
  const Segments divided = divide(whole, {near, far}, fine);
  ASSERT_EQ(divided.segments.size(), 2U);
  const Segment& right = divided.segments[0];
  const Segment& left = divided.segments[1];
  const double step_m = divided.points[left.first].range_m - divided.points[left.first - 1].range_m;
  ASSERT_NE(step_m, 0.0);
  const bool right_is_nearer = step_m > 0.0;
  EXPECT_EQ(right.left_end, right_is_nearer ? SegmentEnd::kBackground : SegmentEnd::kOccluded);
  EXPECT_EQ(left.right_end, right_is_nearer ? SegmentEnd::kOccluded : SegmentEnd::kBackground);
  EXPECT_EQ(right.left_hidden_rad, right_is_nearer ? 0.0 : width_rad(divided, left));
  EXPECT_EQ(left.right_hidden_rad, right_is_nearer ? width_rad(divided, right) : 0.0);
}

TEST(Divide, TwoKnownObjectsThatTouchAreDividedUnderNoise) {
  Random random(1);
  LevelScene scene;
  scene.ellipses = {kRight, kLeft};
  for (int i = 0; i < 50; ++i) {
    const Segments whole = segments_of(scene, &random);
    if (whole.segments.size() != 1U) continue;
    Ellipse right = kRight;
    Ellipse left = kLeft;
    right.center_m += 0.01 * Eigen::Vector2d(random.normal(), random.normal());
    left.center_m += 0.01 * Eigen::Vector2d(random.normal(), random.normal());
    const Segments divided = divide(whole, {right, left}, params());
    ASSERT_EQ(divided.segments.size(), 2U);
    // The border is at azimuth 0.
    EXPECT_NEAR(degrees(divided.points[divided.segments[1].first].azimuth_rad), 0.0, 1.5);
  }
}

// It was seen with a hole in it once, and each half became an element. Noise may still divide a scan now and then.
TEST(Divide, OneObjectMappedAsTwoStaysWhole) {
  constexpr int kScans = 100;
  for (const double azimuth_rad : {-1.0, 0.0, 2.0}) {
    Random random(3);
    const auto at = [azimuth_rad](double x_m, double y_m, double rx_m, double ry_m) {
      const Eigen::Rotation2Dd R(azimuth_rad);
      return Ellipse{R * Eigen::Vector2d(x_m, y_m), azimuth_rad + 0.5 * kPi, rx_m, ry_m};
    };
    for (const double ry_m : {0.25, 0.1}) {
      LevelScene scene;
      scene.ellipses = {at(3.0, 0.0, 0.25, ry_m)};
      const double x_m = 3.0 - 0.4 * ry_m;
      const std::vector<ExpectedOutline> halves = {at(x_m, -0.12, 0.12, 0.5 * ry_m), at(x_m, 0.12, 0.12, 0.5 * ry_m)};
      int wholes = 0;
      for (int i = 0; i < kScans; ++i) {
        const Segments whole = segments_of(scene, &random);
        ASSERT_EQ(whole.segments.size(), 1U);
        wholes += divide(whole, halves, params()).segments.size() == 1 ? 1 : 0;
      }
      EXPECT_GT(wholes, 3 * kScans / 4) << azimuth_rad << " " << ry_m;
    }
  }
}

TEST(Divide, WithoutOutlinesNothingChanges) {
  LevelScene scene;
  scene.ellipses = {kRight, kLeft, {{2.0, 2.0}, 0.3, 0.3, 0.2}};
  scene.walls = {{{6.0, -8.0}, {6.0, 8.0}}};
  const Segments whole = segments_of(scene);
  expect_same(divide(whole, {}, params()), whole);
  expect_same(divide(Segments{}, {kLeft}, params()), Segments{});
}

TEST(Divide, ASingleKnownObjectStaysWholeWithAPredictionError) {
  Random random(2);
  LevelScene scene;
  scene.ellipses = {{{3.0, 0.5}, 0.4, 0.35, 0.2}};
  for (int i = 0; i < 36; ++i) {
    const Segments whole = segments_of(scene, &random);
    ASSERT_EQ(whole.segments.size(), 1U);
    Ellipse predicted = scene.ellipses[0];
    predicted.center_m += 0.05 * Eigen::Vector2d(std::cos(radians(10.0 * i)), std::sin(radians(10.0 * i)));
    expect_same(divide(whole, {predicted}, params()), whole);
  }
}

TEST(Divide, OutlinesElsewhereChangeNothing) {
  LevelScene scene;
  scene.ellipses = {kRight, kLeft};
  const Segments whole = segments_of(scene);
  // Beside, behind, in front, around the sensor.
  const std::vector<ExpectedOutline> elsewhere{Ellipse{{3.0, 2.0}, 0.0, 0.3, 0.3}, Ellipse{{5.0, 0.0}, 0.0, 0.3, 0.3},
                                               Ellipse{{1.5, 0.1}, 0.0, 0.2, 0.2}, Ellipse{{-3.0, 0.0}, 0.0, 0.3, 0.3},
                                               Ellipse{{0.0, 0.1}, 0.0, 0.3, 0.3}};
  expect_same(divide(whole, elsewhere, params()), whole);
}

TEST(Divide, ABarrelAgainstAWallIsAnObjectAndTheWallStaysStructure) {
  const Ellipse barrel{{3.75, 0.0}, 0.0, 0.25, 0.25};
  LevelScene scene;
  scene.ellipses = {barrel};
  scene.walls = {{{4.0, -4.0}, {4.0, 4.0}}};
  // The hits on the barrel's edge are 0.2 m from the wall; with this gap all is one segment.
  SegmentationParams joining = params();
  joining.max_gap_m = joining.max_range_gap_m = 0.4;
  const Segments whole = segment(project_horizontally(scene.scan(), Eigen::Isometry3d::Identity()), joining);
  ASSERT_EQ(whole.segments.size(), 1U);
  ASSERT_EQ(whole.segments[0].kind, SegmentKind::kStructure);
  const Segments divided = divide(whole, {barrel}, joining);
  ASSERT_EQ(divided.segments.size(), 3U);
  EXPECT_EQ(divided.segments[0].kind, SegmentKind::kStructure);
  EXPECT_EQ(divided.segments[1].kind, SegmentKind::kObject);
  EXPECT_EQ(divided.segments[2].kind, SegmentKind::kStructure);
  const Segment& piece = divided.segments[1];
  for (std::size_t i = 0; i < divided.points.size(); ++i) {
    EXPECT_EQ(lies_on(barrel, divided.points[i]), i >= piece.first && i < piece.first + piece.count) << i;
  }
  // The wall is behind the barrel's edges, and hidden by it.
  EXPECT_EQ(piece.right_end, SegmentEnd::kBackground);
  EXPECT_EQ(piece.left_end, SegmentEnd::kBackground);
  EXPECT_EQ(divided.segments[0].left_end, SegmentEnd::kOccluded);
  EXPECT_EQ(divided.segments[2].right_end, SegmentEnd::kOccluded);
  EXPECT_NEAR(divided.segments[0].left_hidden_rad, width_rad(divided, piece), 1e-12);
}

TEST(Divide, AnArmThatSticksOutOfAKnownTorsoIsASeparatePiece) {
  const Ellipse torso{{3.0, 0.0}, kPi / 2.0, 0.25, 0.15};
  const Ellipse arm{{2.75, 0.2}, 0.0, 0.1, 0.05};
  LevelScene scene;
  scene.ellipses = {torso, arm};
  const Segments whole = segments_of(scene);
  ASSERT_EQ(whole.segments.size(), 1U);
  const Segments divided = divide(whole, {torso}, params());
  ASSERT_GE(divided.segments.size(), 2U);
  for (const Segment& piece : divided.segments) EXPECT_EQ(piece.kind, SegmentKind::kObject);
  // The arm's foremost hits are not on the torso.
  const auto is_of_torso = [&](const Segment& piece) {
    int on_torso = 0;
    for (std::size_t i = 0; i < piece.count; ++i) on_torso += lies_on(torso, divided.points[piece.first + i]) ? 1 : 0;
    return 2 * on_torso > static_cast<int>(piece.count);
  };
  EXPECT_TRUE(is_of_torso(divided.segments[0]));
  EXPECT_FALSE(is_of_torso(divided.segments[1]));
  // Hits against the torso that hardly stick out belong to the torso.
  scene.ellipses[1] = {{2.87, 0.1}, 0.0, 0.05, 0.05};
  const Segments flat = segments_of(scene);
  ASSERT_EQ(flat.segments.size(), 1U);
  expect_same(divide(flat, {torso}, params()), flat);
}

TEST(Divide, PiecesWithTooFewHitsAreDropped) {
  LevelScene scene;
  scene.ellipses = {kRight, kLeft};
  const Segments whole = segments_of(scene);
  SegmentationParams coarse = params();
  coarse.min_points = static_cast<int>(whole.segments[0].count);  // more than either has
  expect_same(divide(whole, {kLeft, kRight}, coarse), whole);
}

// Wherever a full circle begins, and so also across its seam.
TEST(Divide, HasNoSeam) {
  for (int turn = 0; turn < 72; ++turn) {
    const Pose2 T{Eigen::Vector2d::Zero(), radians(5.0 * turn)};
    LevelScene scene;
    scene.beams = 1440;
    scene.angle_increment_rad = radians(0.25);
    scene.angle_min_rad = -kPi;
    scene.ellipses = {T * kRight, T * kLeft};
    const Segments whole = segments_of(scene);
    ASSERT_EQ(whole.segments.size(), 1U) << turn;
    const Segments divided = divide(whole, {scene.ellipses.begin(), scene.ellipses.end()}, params());
    ASSERT_EQ(divided.segments.size(), 2U) << turn;
    for (std::size_t i = 0; i < 2; ++i) {
      const Segment& piece = divided.segments[i];
      for (std::size_t k = 0; k < piece.count; ++k) {
        EXPECT_TRUE(lies_on(scene.ellipses[i], divided.points[piece.first + k])) << turn;
      }
    }
    EXPECT_EQ(divided.segments[0].count + divided.segments[1].count, whole.segments[0].count) << turn;
  }
}

}  // namespace
}  // namespace situation_awareness::divide_test
