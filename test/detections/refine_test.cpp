// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/refine.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::refine_test {
namespace {

const EllipseFitParams kParams;

/// An ellipse whose left third is behind something nearer.
LevelScene half_hidden(const Ellipse& ellipse) {
  LevelScene scene;
  scene.ellipses = {ellipse, {{1.5, 0.27}, 0.0, 0.22, 0.22}};
  return scene;
}

/// The far segment alone.
Segments far_segment(const LevelScene& scene, Random* random) {
  Segments segments = segment(project_horizontally(scene.scan(random), Eigen::Isometry3d::Identity()), {});
  std::vector<Segment> far;
  for (const Segment& segment : segments.segments) {
    if (segments.points[segment.first].range_m > 2.0) far.push_back(segment);
  }
  segments.segments = std::move(far);
  return segments;
}

Detections detected(const Segments& segments) { return LeastSquaresDetector(kParams).detect(segments); }

double center_distance_m(const Ellipse& a, const Ellipse& b) { return (a.center_m - b.center_m).norm(); }

/// Kalman average of detections of a standing object.
struct Average {
  Vector5d x;
  Matrix5d P;

  void add(const Detection& detection) {
    const Matrix5d K = P * (P + detection.covariance).inverse();
    x += K * (smooth_parameters(detection.ellipse_level) - x);
    P = ((Matrix5d::Identity() - K) * P).eval();
    P = (0.5 * (P + P.transpose())).eval();
  }
};

// Fits of single scans have the same bias each time; refined detections have none.
TEST(RefineStatistics, AveragesConvergeToTheTruthWhereThoseOfFitsDoNot) {
  double refined_m = 0.0;
  double fitted_m = 0.0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Random random(seed);
    const Ellipse truth{{4.0, 0.1}, random.uniform(-1.5, 1.5), 0.35, 0.16};
    const LevelScene scene = half_hidden(truth);
    Average refined;
    Average fitted;
    for (int scan = 0; scan < 400; ++scan) {
      const Segments segments = far_segment(scene, &random);
      ASSERT_EQ(segments.segments.size(), 1U);
      const Detection fit = fit_ellipse(segments, 0, kParams);
      if (scan == 0) {
        refined = fitted = {smooth_parameters(fit.ellipse_level), fit.covariance};
        continue;
      }
      fitted.add(fit);
      refined.add(refit_ellipse(segments, 0, kParams, ellipse_from_smooth_parameters(refined.x)));
    }
    refined_m += center_distance_m(ellipse_from_smooth_parameters(refined.x), truth) / 5.0;
    fitted_m += center_distance_m(ellipse_from_smooth_parameters(fitted.x), truth) / 5.0;
  }
  RecordProperty("refined_mm", static_cast<int>(1e3 * refined_m));
  RecordProperty("fitted_mm", static_cast<int>(1e3 * fitted_m));
  EXPECT_LT(refined_m, 0.5 * fitted_m);
}

TEST(Refine, HasItsFixedPointAtTheTruth) {
  const Ellipse truth{{4.0, 0.1}, 0.4, 0.35, 0.16};
  const Segments segments = far_segment(half_hidden(truth), nullptr);
  const Detections refined = refine(detected(segments), segments, {truth}, kParams);
  ASSERT_EQ(refined.detections.size(), 1U);
  // Up to the uncertainty of a tangent within the beam beside the last hit.
  EXPECT_LT(center_distance_m(refined.detections[0].ellipse_level, truth), 4.0 * segments.resolution_rad);
  EXPECT_LT(symmetric_characteristic_distance(refined.detections[0].ellipse_level, truth), 0.01);
}

// Twice the noise is twice the change, so that averages have no bias.
TEST(Refine, IsLinearInTheNoiseOfTheHits) {
  const Ellipse known{{4.02, 0.12}, 0.5, 0.33, 0.18};
  const Segments clean = far_segment(half_hidden({{4.0, 0.1}, 0.4, 0.35, 0.16}), nullptr);
  ASSERT_EQ(clean.segments.size(), 1U);
  Random random(7);
  std::vector<double> noise_m;
  for (std::size_t i = 0; i < clean.points.size(); ++i) noise_m.push_back(1e-4 * random.normal());
  const auto answer = [&](double scale) {
    Segments noisy = clean;
    for (std::size_t i = 0; i < noisy.points.size(); ++i) {
      Point& point = noisy.points[i];
      point.p_level_m *= 1.0 + scale * noise_m[i] / point.range_m;
      point.range_m += scale * noise_m[i];
    }
    return smooth_parameters(refit_ellipse(noisy, 0, kParams, known).ellipse_level);
  };
  const Vector5d none = answer(0.0);
  const Vector5d once = answer(1.0) - none;
  const Vector5d twice = answer(2.0) - none;
  ASSERT_GT(once.norm(), 1e-5);
  EXPECT_LT((twice - 2.0 * once).norm(), 0.02 * once.norm());
}

TEST(Refine, TurnsWithTheScene) {
  const Ellipse truth{{4.0, 0.1}, 0.4, 0.35, 0.16};
  const Ellipse known{{4.03, 0.12}, 0.5, 0.33, 0.18};
  const LevelScene scene = half_hidden(truth);
  LevelScene turned = scene;
  const Pose2 rotation{Eigen::Vector2d::Zero(), 200 * scene.angle_increment_rad};
  for (Ellipse& ellipse : turned.ellipses) ellipse = rotation * ellipse;
  const Segments a = far_segment(scene, nullptr);
  const Segments b = far_segment(turned, nullptr);
  const Detections of_a = refine(detected(a), a, {known}, kParams);
  const Detections of_b = refine(detected(b), b, {rotation * known}, kParams);
  ASSERT_EQ(of_a.detections.size(), 1U);
  ASSERT_EQ(of_b.detections.size(), 1U);
  EXPECT_LT(
      symmetric_characteristic_distance(rotation * of_a.detections[0].ellipse_level, of_b.detections[0].ellipse_level),
      1e-4);
  const auto spread = [](const Detections& detections) {
    return detections.detections[0].covariance.topLeftCorner(2, 2).trace();
  };
  EXPECT_NEAR(spread(of_a), spread(of_b), 1e-6);
}

TEST(Refine, LeavesDetectionsOfNewObjectsUnchanged) {
  Random random(8);
  const Segments segments = far_segment(half_hidden({{4.0, 0.1}, 0.4, 0.35, 0.16}), &random);
  const Detections plain = detected(segments);
  ASSERT_EQ(plain.detections.size(), 1U);
  const Ellipse behind{{5.5, 0.1}, 0.4, 0.35, 0.16};
  const Ellipse beside{{4.0, -0.9}, 0.4, 0.35, 0.16};
  const Ellipse around_the_sensor{{0.0, 0.0}, 0.0, 4.0, 4.0};
  for (const std::vector<ExpectedOutline>& known :
       {std::vector<ExpectedOutline>{}, std::vector<ExpectedOutline>{behind, beside, around_the_sensor}}) {
    const Detections same = refine(plain, segments, known, kParams);
    ASSERT_EQ(same.detections.size(), 1U);
    EXPECT_EQ(smooth_parameters(same.detections[0].ellipse_level),
              smooth_parameters(plain.detections[0].ellipse_level));
    EXPECT_EQ(same.detections[0].covariance, plain.detections[0].covariance);
  }
}

TEST(Refine, StartsFromTheNearestOutlineAndKeepsTheDetectorsOtherFields) {
  Random random(9);
  const Ellipse truth{{4.0, 0.1}, 0.4, 0.35, 0.16};
  const Segments segments = far_segment(half_hidden(truth), &random);
  Detections plain = detected(segments);
  ASSERT_EQ(plain.detections.size(), 1U);
  plain.detections[0].p_ellipse = 0.93;
  const Ellipse near = truth;
  const Ellipse off{{4.07, 0.1}, 0.4, 0.35, 0.16};
  const Detections both = refine(plain, segments, {off, near}, kParams);
  const Detections one = refine(plain, segments, {near}, kParams);
  EXPECT_EQ(smooth_parameters(both.detections[0].ellipse_level), smooth_parameters(one.detections[0].ellipse_level));
  EXPECT_EQ(one.detections[0].p_ellipse, 0.93);
  EXPECT_EQ(one.detections[0].segment, plain.detections[0].segment);
  EXPECT_EQ(one.detections[0].hidden_end, plain.detections[0].hidden_end);
  EXPECT_EQ(one.detections[0].beams, plain.detections[0].beams);
  const Eigen::LLT<Matrix5d> llt(one.detections[0].covariance);
  EXPECT_EQ(llt.info(), Eigen::Success);
}

// The first and the last beam of a turn meet there, and a car that drives and turns is hit at two places.
TEST(Refine, PutsTheHitsOfAMovingBoxAtOneTimeWhereATurnOfTheScannerBeginsAndEnds) {
  constexpr int kBeams = 720;
  constexpr double kIncrement_s = 0.1 / kBeams;
  ExpectedOutline known(moment_equal_ellipse({{-1.5, 0.05}, 0.4, 0.4, 0.2}));
  known.box = {{-1.5, 0.05}, 0.4, 0.4, 0.2};
  known.p_box = 1.0;
  known.velocity_m_s = {0.3, -1.0};
  known.angular_velocity_rad_s = 2.0;
  Scan scan;
  scan.angle_min_rad = -kPi;
  scan.angle_increment_rad = 2.0 * kPi / kBeams;
  scan.time_increment_s = kIncrement_s;
  for (int i = 0; i < kBeams; ++i) {
    LevelScene scene;
    const std::array<Eigen::Vector2d, 4> at = corners(later(known, i * kIncrement_s).box);
    for (std::size_t k = 0; k < at.size(); ++k) scene.walls.push_back({at[k], at[(k + 1) % at.size()]});
    scene.angle_min_rad = scan.angle_min_rad + i * scan.angle_increment_rad;
    scene.beams = 1;
    scan.beams.push_back(scene.scan().beams[0]);
  }
  const Segments segments = segment(project_horizontally(scan, Eigen::Isometry3d::Identity()), {});
  ASSERT_EQ(segments.segments.size(), 1U);
  Detections found;
  found.detections.resize(1);
  const Detections one = refine(found, segments, {known}, kParams);
  ASSERT_EQ(one.detections.size(), 1U);
  ASSERT_EQ(one.detections[0].shape, Shape::kBox);
  const Box truth = later(known, one.detections[0].time_offset_s).box;
  EXPECT_LT((one.detections[0].box_level.center_m - truth.center_m).norm(), 0.015);
  EXPECT_NEAR(one.detections[0].box_level.psi_rad, truth.psi_rad, 0.01);
}

// A small object whose prediction lags: its hits lie on the far side of the expected outline, where no beam can end. A
// step from there would give an ellipse on the wrong side of the hits.
TEST(Refine, IgnoresOutlinesWithTheHitsOnTheirFarSide) {
  const Ellipse truth{{7.5, 0.1}, 0.3, 0.1, 0.08};
  LevelScene scene;
  scene.ellipses = {truth};
  Random random(10);
  for (const double ahead_m : {0.12, 0.15, 0.18, 0.21}) {
    SCOPED_TRACE(ahead_m);
    const Segments segments = far_segment(scene, &random);
    const Detections plain = detected(segments);
    ASSERT_EQ(plain.detections.size(), 1U);
    Ellipse known = truth;
    known.center_m.x() -= ahead_m;
    const Detections refined = refine(plain, segments, {known}, kParams);
    EXPECT_LE(center_distance_m(refined.detections[0].ellipse_level, truth),
              center_distance_m(plain.detections[0].ellipse_level, truth));
  }
}

}  // namespace
}  // namespace situation_awareness::refine_test
