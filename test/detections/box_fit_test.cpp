// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/box_fit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "support/covariance.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::box_fit_test {
namespace {

const EllipseFitParams kParams;

/// The box before a wall, so that both its ends are silhouettes.
LevelScene scene_of(const Box& box) {
  LevelScene scene;
  const std::array<Eigen::Vector2d, 4> at = corners(box);
  for (std::size_t i = 0; i < at.size(); ++i) scene.walls.push_back({at[i], at[(i + 1) % at.size()]});
  scene.max_range_m = 60.0;
  const std::array<Eigen::Vector2d, 4> room = corners({{0.0, 0.0}, 0.0, 20.0, 20.0});
  for (std::size_t i = 0; i < room.size(); ++i) scene.walls.push_back({room[i], room[(i + 1) % room.size()]});
  return scene;
}

/// Of what is nearer than the room.
Segments near_segments(const LevelScene& scene, Random* random = nullptr, double sigma_m = 0.01) {
  Segments segments = segment(project_horizontally(scene.scan(random, sigma_m), Eigen::Isometry3d::Identity()), {});
  std::vector<Segment> near;
  for (const Segment& segment : segments.segments) {
    if (segments.points[segment.first].range_m < 10.0) near.push_back(segment);
  }
  segments.segments = near;
  return segments;
}

double wrapped_to_quarter(double psi_rad) { return std::abs(std::remainder(psi_rad, 0.5 * kPi)); }

Ellipse ellipse_of(const Box& box) { return moment_equal_ellipse(box); }

double distance(const Ellipse& a, const Ellipse& b) { return (smooth_parameters(a) - smooth_parameters(b)).norm(); }

TEST(BoxFit, RecoversABoxOfWhichTwoSidesAreSeen) {
  Random random(1);
  int fitted = 0;
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector2d center_m(random.uniform(1.5, 5.0), random.uniform(-1.0, 1.0));
    const double bearing_rad = std::atan2(center_m.y(), center_m.x());
    const Box truth{center_m, bearing_rad + random.uniform(0.5, 1.07), random.uniform(0.15, 0.5),
                    random.uniform(0.15, 0.5)};
    const Segments segments = near_segments(scene_of(truth), &random);
    if (segments.segments.size() != 1U || segments.segments[0].count < 30U) continue;
    const Detection detection = fit_box(segments, 0, kParams);
    ASSERT_EQ(detection.shape, Shape::kBox);
    EXPECT_LT((detection.box_level.center_m - truth.center_m).norm(), 0.06) << i;
    EXPECT_LT(wrapped_to_quarter(detection.box_level.psi_rad - truth.psi_rad), 0.08) << i;
    EXPECT_LT(distance(detection.ellipse_level, ellipse_of(truth)), 0.08) << i;
    ++fitted;
  }
  EXPECT_GT(fitted, 150);
}

TEST(BoxFit, StandsForItsBoxByTheEllipseOfEqualMoments) {
  const Segments segments = near_segments(scene_of({{2.0, 0.3}, 0.6, 0.4, 0.2}));
  const Detection detection = fit_box(segments, 0, kParams);
  EXPECT_LT(distance(detection.ellipse_level, ellipse_of(detection.box_level)), 1e-9);
}

// A face says nothing of the depth: whatever it is, the covariance covers it.
TEST(BoxFit, LeavesTheDepthOpenWhereOneFaceIsSeen) {
  for (const double depth_m : {0.15, 0.3, 0.45, 0.6}) {
    const Box truth{{2.0 + 0.5 * depth_m, 0.0}, 0.0, 0.5 * depth_m, 0.2};
    const Segments segments = near_segments(scene_of(truth));
    ASSERT_EQ(segments.segments.size(), 1U);
    const Detection detection = fit_box(segments, 0, kParams);
    const Vector5d error = smooth_parameters(detection.ellipse_level) - smooth_parameters(ellipse_of(truth));
    EXPECT_GT(std::sqrt(detection.covariance(0, 0)), 0.1);
    EXPECT_LT(std::sqrt(detection.covariance(1, 1)), 0.04);
    EXPECT_LT(mahalanobis2(error, detection.covariance), 9.24) << depth_m;  // 90 % of 5 degrees of freedom
  }
}

// Half lengths are drawn from the fit's prior.
TEST(BoxFit, ErrorsAreAsLargeAsTheCovarianceSays) {
  Random random(2);
  int inside = 0;
  int fitted = 0;
  while (fitted < 600) {
    const auto half = [&] { return box_prior::kMeanHalf_m + box_prior::kHalfSigma_m * random.normal(); };
    const Box truth{{random.uniform(1.5, 5.0), random.uniform(-1.0, 1.0)}, random.uniform(-kPi, kPi), half(), half()};
    if (std::min(truth.half_length_m, truth.half_width_m) < 0.05) continue;
    const Segments segments = near_segments(scene_of(truth), &random);
    if (segments.segments.size() != 1U) continue;
    const Detection detection = fit_box(segments, 0, kParams);
    const Vector5d error = smooth_parameters(detection.ellipse_level) - smooth_parameters(ellipse_of(truth));
    inside += mahalanobis2(error, detection.covariance) < 9.24 ? 1 : 0;
    ++fitted;
  }
  // The fit allows for rough faces, which these boxes do not have.
  EXPECT_GT(inside, 0.87 * fitted);
}

// Of what is known of a box too little may be right: hits beyond the far end of a face show that it is longer.
TEST(BoxFit, AKnownBoxIsAsLongAsItsHitsShow) {
  Random random(6);
  for (const double psi_rad : {0.25, 0.4, 0.6}) {
    const Box truth{{3.0, 0.0}, psi_rad, 0.5, 0.35};
    const Eigen::Vector2d e1(std::cos(psi_rad), std::sin(psi_rad));
    const Box known{truth.center_m - 0.3 * e1, psi_rad, 0.2, 0.35};  // the same near face
    const Segments segments = near_segments(scene_of(truth), &random);
    ASSERT_EQ(segments.segments.size(), 1U);
    Detection detection = refit_box(segments, 0, kParams, known);
    EXPECT_GT(detection.box_level.half_length_m, 0.4) << psi_rad;
    for (int scan = 0; scan < 3; ++scan) detection = refit_box(segments, 0, kParams, detection.box_level);
    EXPECT_NEAR(detection.box_level.half_length_m, truth.half_length_m, 0.03) << psi_rad;
    EXPECT_NEAR(detection.box_level.half_width_m, truth.half_width_m, 0.03) << psi_rad;
    EXPECT_LT((detection.box_level.center_m - truth.center_m).norm(), 0.04) << psi_rad;
  }
}

/// The box with corners of this radius.
LevelScene rounded_scene_of(const Box& box, double radius_m) {
  LevelScene scene = scene_of(box);
  scene.walls.erase(scene.walls.begin(), scene.walls.begin() + 4);
  const Eigen::Rotation2Dd turned(box.psi_rad);
  const Eigen::Vector2d inner(box.half_length_m - radius_m, box.half_width_m - radius_m);
  for (const double sx : {-1.0, 1.0}) {
    for (const double sy : {-1.0, 1.0}) {
      const Eigen::Vector2d center_m = box.center_m + turned * Eigen::Vector2d(sx * inner.x(), sy * inner.y());
      scene.ellipses.push_back({center_m, 0.0, radius_m, radius_m});
    }
    const Eigen::Vector2d x(sx * box.half_length_m, inner.y()), y(inner.x(), sx * box.half_width_m);
    scene.walls.push_back({box.center_m + turned * x, box.center_m + turned * Eigen::Vector2d(x.x(), -x.y())});
    scene.walls.push_back({box.center_m + turned * y, box.center_m + turned * Eigen::Vector2d(-y.x(), y.y())});
  }
  return scene;
}

// The last hit on a rounded corner is before the corner of the box, in every scan of a view: many of them do not make
// the box certainly too small.
TEST(BoxFit, ManyViewsOfRoundedCornersTellTheSidesAsWellAsTheySay) {
  constexpr double kViews = 40.0;
  for (const double radius_m : {0.01, 0.05, 0.1}) {
    const Box truth{{3.0, 0.0}, 0.8, 0.4, 0.2};
    const Segments segments = near_segments(rounded_scene_of(truth, radius_m));
    ASSERT_EQ(segments.segments.size(), 1U);
    const Detection detection = refit_box(segments, 0, kParams, truth);
    const double error_m = smooth_parameters(detection.ellipse_level)(2) - smooth_parameters(ellipse_of(truth))(2);
    EXPECT_LT(std::abs(error_m), 0.03) << radius_m;
    EXPECT_LT(std::abs(error_m), 3.0 * std::sqrt(detection.covariance(2, 2) / kViews)) << radius_m;
  }
}

TEST(BoxFit, IsEquivariantUnderRotation) {
  const Box truth{{3.0, 0.2}, 0.5, 0.4, 0.2};
  const Segments segments = near_segments(scene_of(truth));
  const Detection detection = fit_box(segments, 0, kParams);
  for (const int turn : {-300, -17, 100, 310}) {
    LevelScene scene = scene_of(truth);
    const Pose2 rotation{Eigen::Vector2d::Zero(), turn * scene.angle_increment_rad};
    scene = scene_of(rotation * truth);
    const Detection turned = fit_box(near_segments(scene), 0, kParams);
    // The coarse orientations are fixed in the level frame.
    EXPECT_LT(distance(rotation * detection.ellipse_level, turned.ellipse_level), 0.003) << turn;
  }
}

// What is seen corrects the known box, what is not keeps it with a covariance that does not count.
TEST(BoxFit, RefitsAKnownBoxWhereItIsSeen) {
  const Box truth{{2.3, 0.0}, 0.0, 0.3, 0.2};
  const Segments segments = near_segments(scene_of(truth));
  Box known = truth;
  known.center_m += Eigen::Vector2d(0.03, 0.04);
  const Detection detection = refit_box(segments, 0, kParams, known);
  const double front_m = detection.box_level.center_m.x() - detection.box_level.half_length_m;
  EXPECT_NEAR(front_m, 2.0, 0.002);
  EXPECT_NEAR(detection.box_level.center_m.y(), 0.0, 0.005);
  EXPECT_NEAR(detection.box_level.half_length_m, 0.3, 0.03);
  EXPECT_GT(std::sqrt(detection.covariance(0, 0)), 1.0);
  EXPECT_LT(std::sqrt(detection.covariance(1, 1)), 0.04);
}

// Each is the cheaper one for its own shape, if seen well enough.
TEST(BoxFit, CostsLessThanAnEllipseForABoxAndMoreForAnEllipse) {
  Random random(3);
  const Segments of_box = near_segments(scene_of({{2.0, 0.2}, 0.6, 0.4, 0.3}), &random);
  const Segments of_ellipse = [&] {
    LevelScene scene = scene_of({{-2.0, 0.0}, 0.0, 0.1, 0.1});
    scene.walls.erase(scene.walls.begin(), scene.walls.begin() + 4);
    scene.ellipses.push_back({{2.0, 0.2}, 0.6, 0.4, 0.3});
    return near_segments(scene, &random);
  }();
  const auto advantage_of_box = [](const Segments& segments) {
    const Detection box = fit_box(segments, 0, kParams);
    const Detection ellipse = fit_ellipse(segments, 0, kParams);
    return ellipse_cost(segments, 0, kParams, ellipse.ellipse_level) - box_cost(segments, 0, kParams, box.box_level);
  };
  EXPECT_GT(advantage_of_box(of_box), 20.0);
  EXPECT_LT(advantage_of_box(of_ellipse), -5.0);
}

TEST(BoxFit, MeanOffsetIsTheDistanceFromTheVisibleFaces) {
  const Box truth{{2.3, 0.0}, 0.0, 0.3, 0.2};
  const Segments segments = near_segments(scene_of(truth));
  EXPECT_NEAR(mean_offset_m(segments, segments.segments[0], truth), 0.0, 1e-6);
  Box other = truth;
  other.center_m.x() += 0.05;
  EXPECT_NEAR(mean_offset_m(segments, segments.segments[0], other), 0.05, 1e-6);
}

}  // namespace
}  // namespace situation_awareness::box_fit_test
