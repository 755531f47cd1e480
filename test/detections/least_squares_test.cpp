// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/least_squares.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/LU>

#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "support/covariance.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::least_squares_test {
namespace {

Segments segments_of(const Scan& scan) {
  return segment(project_horizontally(scan, Eigen::Isometry3d::Identity()), SegmentationParams{});
}

/// An ellipse as the ellipse paper draws them (Sect. IV-C), between 1 and 6 m away.
Ellipse random_ellipse(Random& random) {
  const double rx_m = random.uniform(0.05, 0.5);
  const double range_m = random.uniform(1.0, 6.0);
  const double azimuth_rad = random.uniform(radians(-110.0), radians(110.0));
  return {{range_m * std::cos(azimuth_rad), range_m * std::sin(azimuth_rad)},
          random.uniform(-kPi / 2.0, kPi / 2.0),
          rx_m,
          random.uniform(0.05, rx_m)};
}

TEST(LeastSquares, EstimatesEllipsesWithinTheNoise) {
  Random random(3);
  const EllipseFitParams params;
  std::vector<double> errors;
  for (int i = 0; i < 500; ++i) {
    LevelScene scene;
    const Ellipse truth = random_ellipse(random);
    scene.ellipses = {truth};
    const Segments segments = segments_of(scene.scan(&random));
    if (segments.segments.size() != 1U) continue;
    const Detection detection = fit_ellipse(segments, 0, params);
    EXPECT_EQ(detection.beams, static_cast<int>(segments.segments[0].count));
    EXPECT_GE(detection.ellipse_level.rx_m, detection.ellipse_level.ry_m);
    errors.push_back(symmetric_characteristic_distance(truth, detection.ellipse_level));
  }
  ASSERT_GT(errors.size(), 450U);
  const double mean = std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(errors.size());
  std::sort(errors.begin(), errors.end());
  RecordProperty("mean_error_mm", static_cast<int>(1e3 * mean));
  EXPECT_LT(mean, 0.045);
  EXPECT_LT(errors[errors.size() / 2], 0.035);
}

// Rotating scene and sensor frame together must rotate the answer.
TEST(LeastSquares, IsEquivariantUnderRotation) {
  Random random(4);
  for (int i = 0; i < 50; ++i) {
    const Ellipse ellipse{{3.0, 0.2}, 0.5, 0.4, 0.2};
    LevelScene scene;
    scene.ellipses = {ellipse};
    const int turn = static_cast<int>(random.uniform(-300.0, 300.0));
    const Pose2 rotation{Eigen::Vector2d::Zero(), turn * scene.angle_increment_rad};
    LevelScene turned = scene;
    turned.ellipses = {rotation * ellipse};
    const Segments a = segments_of(scene.scan());
    const Segments b = segments_of(turned.scan());
    ASSERT_EQ(a.segments.size(), 1U);
    ASSERT_EQ(b.segments.size(), 1U);
    const Detection detection_a = fit_ellipse(a, 0, {});
    const Detection detection_b = fit_ellipse(b, 0, {});
    EXPECT_LT(symmetric_characteristic_distance(rotation * detection_a.ellipse_level, detection_b.ellipse_level), 1e-4);
  }
}

// With the detector's own prior as the truth's distribution, the squared Mahalanobis distance of centre and radii must
// be distributed as its covariance says.
TEST(LeastSquares, ErrorsAreAsLargeAsTheCovarianceSays) {
  Random random(5);
  EllipseFitParams params;
  params.shape_sigma_m = 0.0;
  std::vector<double> distances;
  for (int i = 0; i < 1500; ++i) {
    Vector5d x;
    const double range_m = random.uniform(1.5, 4.0);
    x << range_m, 0.0, params.mean_radius_m + 0.5 * params.mean_radius_sigma_m * random.normal(),
        params.radius_difference_sigma_m * random.normal(), params.radius_difference_sigma_m * random.normal();
    if (x.tail<2>().norm() > 0.8 * x(2)) continue;
    const Ellipse truth = ellipse_from_smooth_parameters(x);
    LevelScene scene;
    scene.ellipses = {truth};
    const Segments segments = segments_of(scene.scan(&random));
    if (segments.segments.size() != 1U) continue;
    const Detection detection = fit_ellipse(segments, 0, params);
    Eigen::Vector4d error;
    error << detection.ellipse_level.center_m - truth.center_m, detection.ellipse_level.rx_m - truth.rx_m,
        detection.ellipse_level.ry_m - truth.ry_m;
    Eigen::Matrix<double, 4, 5> J = Eigen::Matrix<double, 4, 5>::Identity();
    J.bottomRightCorner<2, 3>() = radii_jacobian(detection.ellipse_level);
    const Eigen::Matrix4d covariance = J * detection.covariance * J.transpose();
    distances.push_back(mahalanobis2(error, covariance));
  }
  ASSERT_GT(distances.size(), 1000U);
  // Laplace's approximation is not exact (edges are uniform, radii folded, the posterior of few points skewed): the
  // body must be right, and the tail not much heavier than a normal one.
  std::sort(distances.begin(), distances.end());
  const double median = distances[distances.size() / 2];
  EXPECT_GT(median, 0.5 * chi_square_quantile(0.5, 4.0));
  EXPECT_LT(median, 1.5 * chi_square_quantile(0.5, 4.0));
  const auto inside = std::lower_bound(distances.begin(), distances.end(), chi_square_quantile(0.95, 4.0));
  EXPECT_GT(static_cast<double>(inside - distances.begin()) / static_cast<double>(distances.size()), 0.85);
}

TEST(LeastSquares, AHiddenEndLeavesMoreUncertaintyThanASilhouette) {
  LevelScene scene;
  const Ellipse truth{{4.0, 0.4}, 0.0, 0.35, 0.35};
  scene.ellipses = {truth};
  const Detection whole = fit_ellipse(segments_of(scene.scan()), 0, {});
  scene.ellipses.push_back({{2.0, 0.0}, 0.0, 0.15, 0.15});
  const Segments segments = segments_of(scene.scan());
  ASSERT_EQ(segments.segments.size(), 2U);
  const Detection hidden = fit_ellipse(segments, 1, {});
  EXPECT_LT(hidden.beams, whole.beams);
  const auto center_variance = [](const Detection& d) { return d.covariance(0, 0) + d.covariance(1, 1); };
  EXPECT_GT(center_variance(hidden), center_variance(whole));
  EXPECT_LT((hidden.ellipse_level.center_m - truth.center_m).norm(), 3.0 * std::sqrt(center_variance(hidden)));
}

TEST(LeastSquaresDetector, DetectsObjectsAndNeverStructures) {
  Random random(6);
  LevelScene scene;
  scene.ellipses = {{{2.0, 0.0}, 0.0, 0.3, 0.2}};
  scene.walls = {{{5.0, -6.0}, {5.0, 6.0}}};
  LeastSquaresDetector detector{EllipseFitParams{}};
  const Segments segments = segments_of(scene.scan(&random));
  ASSERT_EQ(segments.segments.size(), 3U);
  const Detections detections = detector.detect(segments);
  ASSERT_EQ(detections.detections.size(), 1U);
  EXPECT_EQ(segments.segments[detections.detections[0].segment].kind, SegmentKind::kObject);
}

TEST(LeastSquaresDetector, CountsWhatItRefuses) {
  LevelScene scene;
  scene.walls = {{{2.0, 0.0}, {2.5, 0.4}}, {{2.0, 0.0}, {2.5, -0.4}}};  // an outer corner: no ellipse
  EllipseFitParams params;
  params.max_residual_m = 0.01;
  params.max_radius_m = 10.0;
  LeastSquaresDetector detector(params);
  const Detections detections = detector.detect(segments_of(scene.scan()));
  EXPECT_TRUE(detections.detections.empty());
  EXPECT_EQ(detections.refused, (Counters{{"points do not lie on an ellipse", 1}}));

  // Between two nearer posts neither edge is visible, so the size is unknown.
  scene.walls.clear();
  scene.ellipses = {{{3.0, 0.0}, 0.0, 0.4, 0.4}, {{1.5, 0.26}, 0.0, 0.1, 0.1}, {{1.5, -0.26}, 0.0, 0.1, 0.1}};
  LeastSquaresDetector default_detector{EllipseFitParams{}};
  const Detections of_posts = default_detector.detect(segments_of(scene.scan()));
  EXPECT_EQ(of_posts.detections.size(), 2U);
  EXPECT_EQ(of_posts.refused, (Counters{{"both ends hidden", 1}}));
}

TEST(LeastSquaresDetector, PassesOnTheFreeSpaceAndTheTimesOfItsBeams) {
  LevelScene scene;
  scene.ellipses = {{{2.0, 0.0}, 0.0, 0.3, 0.2}, {{0.0, 2.0}, 0.0, 0.2, 0.2}};
  Scan scan = scene.scan();
  scan.time_increment_s = 2e-5;
  const Segments segments = segments_of(scan);
  const Detections detections = LeastSquaresDetector(EllipseFitParams{}).detect(segments);
  EXPECT_EQ(detections.free_space.azimuth_rad.size(), 1081U);
  EXPECT_EQ(detections.free_space.azimuth_rad, segments.free_space.azimuth_rad);
  EXPECT_EQ(detections.free_space.range_m, segments.free_space.range_m);
  ASSERT_EQ(detections.detections.size(), 2U);
  // Beams start at -135 deg; the objects are symmetric about 0 and 90 deg.
  for (const Detection& detection : detections.detections) {
    Eigen::Vector2d sum_m = Eigen::Vector2d::Zero();
    const Segment& segment = segments.segments[detection.segment];
    for (std::size_t i = 0; i < segment.count; ++i) sum_m += segments.points[segment.first + i].p_level_m;
    EXPECT_LT((detection.middle_level_m - sum_m / static_cast<double>(segment.count)).norm(), 1e-12);
  }
  EXPECT_NEAR(detections.detections[0].time_offset_s, 135.0 * 4.0 * 2e-5, 1e-12);
  EXPECT_NEAR(detections.detections[1].time_offset_s, 225.0 * 4.0 * 2e-5, 1e-12);
}

TEST(EllipseFitParams, RefusesWrongValuesByName) {
  EllipseFitParams params;
  params.range_sigma_m = 0.0;
  EXPECT_THROW(LeastSquaresDetector{params}, std::invalid_argument);
  params = {};
  params.min_radius_m = 1.0;
  EXPECT_THROW(LeastSquaresDetector{params}, std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness::least_squares_test
