// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/ransac.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "support/degenerate_segments.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::ransac_test {
namespace {

constexpr std::size_t kOnCurve = 40;

/// The whole curve, and after it `outliers` points outside it by 0.2 to 0.4 m.
std::vector<Eigen::Vector2d> curve_and_outliers(const Ellipse& ellipse, int outliers, Random& random) {
  std::vector<Eigen::Vector2d> points_m;
  for (std::size_t k = 0; k < kOnCurve + static_cast<std::size_t>(outliers); ++k) {
    const double off_m = k < kOnCurve ? 0.0 : random.uniform(0.2, 0.4);
    const double angle_rad = 2.0 * kPi * (k < kOnCurve ? static_cast<double>(k) / kOnCurve : random.uniform());
    const Eigen::Vector2d own((ellipse.rx_m + off_m) * std::cos(angle_rad),
                              (ellipse.ry_m + off_m) * std::sin(angle_rad));
    points_m.push_back(ellipse.center_m + Eigen::Rotation2Dd(ellipse.psi_rad) * own);
  }
  return points_m;
}

/// Largest distance between parallel tangents of the two curves: nothing about how their axes are described.
double curve_distance(const Ellipse& a, const Ellipse& b) {
  double largest = 0.0;
  for (int k = 0; k < 360; ++k) {
    const Eigen::Vector2d n(std::cos(radians(k)), std::sin(radians(k)));
    const double difference =
        n.dot(a.center_m - b.center_m) + std::sqrt(n.dot(shape_matrix(a) * n)) - std::sqrt(n.dot(shape_matrix(b) * n));
    largest = std::max(largest, std::abs(difference));
  }
  return largest;
}

Segments noisy_segments() {
  Random random(3);
  LevelScene scene;
  scene.ellipses = {{{2.0, 0.0}, 0.4, 0.3, 0.2}, {{0.0, -3.0}, 0.0, 0.2, 0.2}, {{-1.0, 3.0}, 1.0, 0.4, 0.1}};
  return segment(project_horizontally(scene.scan(&random), Eigen::Isometry3d::Identity()), SegmentationParams{});
}

TEST(Ransac, IgnoresOutliersWhereAllPointsTogetherDoNot) {
  Random random(1);
  for (int i = 0; i < 50; ++i) {
    const Ellipse truth{{random.uniform(1.0, 5.0), random.uniform(-5.0, 5.0)},
                        random.uniform(-kPi / 2.0, kPi / 2.0),
                        random.uniform(0.2, 0.25),
                        random.uniform(0.2, 0.25)};
    const std::vector<Eigen::Vector2d> points_m = curve_and_outliers(truth, 8, random);
    const RansacFit fit = fit_ransac(points_m, {}, {}, random);
    ASSERT_FALSE(fit.inliers.empty());
    EXPECT_LT(fit.inliers.back(), kOnCurve);
    EXPECT_LT(curve_distance(truth, fit.refined.ellipse_level), 0.05) << i;
    EXPECT_GT(curve_distance(truth, fit_dogleg(points_m, {}).ellipse_level), 0.2) << i;
  }
}

TEST(Ransac, WithoutOutliersIsTheFitOfAllPoints) {
  Random random(2);
  const Ellipse truth{{3.0, 1.0}, 0.3, 0.25, 0.2};
  const std::vector<Eigen::Vector2d> points_m = curve_and_outliers(truth, 0, random);
  RansacParams params;
  params.inlier_distance_m = 10.0;
  const RansacFit fit = fit_ransac(points_m, params, {}, random);
  EXPECT_EQ(fit.inliers.size(), points_m.size());
  EXPECT_EQ(fit.refined.cost, fit_dogleg(points_m, {}).cost);
}

TEST(RansacDetector, GivesTheSameResultForAnyHistory) {
  const Segments segments = noisy_segments();
  ASSERT_EQ(segments.segments.size(), 3U);
  RansacDetector detector({}, {}, {});
  const Detections first = detector.detect(segments);
  const Detections again = detector.detect(segments);
  ASSERT_EQ(first.detections.size(), 3U);
  ASSERT_EQ(again.detections.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    Segments alone = segments;
    alone.segments = {segments.segments[i]};
    const Detections of_one = RansacDetector({}, {}, {}).detect(alone);
    ASSERT_EQ(of_one.detections.size(), 1U);
    const Ellipse& ellipse = first.detections[i].ellipse_level;
    EXPECT_EQ(characteristic_distance(ellipse, again.detections[i].ellipse_level), 0.0);
    EXPECT_EQ(characteristic_distance(ellipse, of_one.detections[0].ellipse_level), 0.0);
    EXPECT_LT(first.detections[i].residual_rms_m, 0.03);
    EXPECT_EQ(Eigen::LLT<Matrix5d>(first.detections[i].covariance).info(), Eigen::Success);
  }
}

TEST(RansacDetector, GivesAFiniteDetectionOrARefusalOfDegenerateSegments) {
  RansacDetector detector({}, {}, {});
  expect_degenerate_segments_are_survived(detector);
}

TEST(RansacParams, RefusesWrongValuesByName) {
  RansacParams params;
  params.inlier_distance_m = 0.0;
  EXPECT_THROW(RansacDetector(params, {}, {}), std::invalid_argument);
  DoglegParams dogleg_params;
  dogleg_params.max_evaluations = 0;
  EXPECT_THROW(RansacDetector({}, dogleg_params, {}), std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness::ransac_test
