// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/network.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <stdexcept>
#include <string>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/evaluation/synthetic_segments.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "support/covariance.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::network_test {
namespace {

const std::string kModels = SITUATION_AWARENESS_SOURCE_DIR "/models/";
constexpr double kMaxRadiusM = 0.5;

void place(Point& point, double azimuth_rad, double range_m) {
  point.azimuth_rad = azimuth_rad;
  point.range_m = range_m;
  point.p_level_m = range_m * Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad));
}

/// The segments of several samples, all of one resolution, as those of one scan.
Segments merge(const std::vector<SyntheticSegment>& samples) {
  Segments scan = samples.front().segments;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    Segment segment = samples[i].segments.segments.front();
    segment.first = scan.points.size();
    scan.points.insert(scan.points.end(), samples[i].segments.points.begin(), samples[i].segments.points.end());
    scan.segments.push_back(segment);
  }
  return scan;
}

std::vector<SyntheticSegment> draw(SegmentCase which, std::uint64_t seed, int count) {
  Random random(seed);
  std::vector<SyntheticSegment> samples;
  for (int i = 0; i < count; ++i) samples.push_back(draw_segment(which, random));
  return samples;
}

class Network : public testing::Test {
 protected:
  EllipseEstimate estimate(const SyntheticSegment& sample, double scale = 1.0) {
    return network_.infer(sample.segments, {0}, scale * sample.range_sigma_m, scale * kMaxRadiusM).front();
  }

  EllipseNetwork network_{kModels + "ellipse.onnx"};
};

TEST_F(Network, TurnsWithTheScene) {
  const Pose2 turn{Eigen::Vector2d::Zero(), -1.1};
  Matrix5d J = Matrix5d::Identity();
  J.topLeftCorner<2, 2>() = turn.rotation();
  J.bottomRightCorner<2, 2>() = Eigen::Rotation2Dd(2.0 * turn.yaw_rad).toRotationMatrix();
  for (SyntheticSegment& sample : draw(SegmentCase::kProduct, 1, 100)) {
    const EllipseEstimate before = estimate(sample);
    for (Point& point : sample.segments.points) place(point, point.azimuth_rad + turn.yaw_rad, point.range_m);
    const EllipseEstimate after = estimate(sample);
    EXPECT_NEAR((after.smooth_level - J * before.smooth_level).norm(), 0.0, 1e-4);
    EXPECT_NEAR((after.covariance - J * before.covariance * J.transpose()).norm() / before.covariance.norm(), 0.0,
                1e-2);
    EXPECT_NEAR(after.p_ellipse, before.p_ellipse, 1e-3);
  }
}

TEST_F(Network, IsInvariantUnderScaling) {
  constexpr double kScale = 0.4;
  for (SyntheticSegment& sample : draw(SegmentCase::kProduct, 2, 100)) {
    const EllipseEstimate before = estimate(sample);
    for (Point& point : sample.segments.points) place(point, point.azimuth_rad, kScale * point.range_m);
    const EllipseEstimate after = estimate(sample, kScale);
    EXPECT_NEAR((after.smooth_level - kScale * before.smooth_level).norm(), 0.0, 1e-4);
    EXPECT_NEAR((after.covariance - kScale * kScale * before.covariance).norm() / before.covariance.norm(), 0.0, 1e-2);
    EXPECT_NEAR(after.p_ellipse, before.p_ellipse, 1e-3);
  }
}

TEST_F(Network, GivesTheSameInABatchAsOneByOne) {
  const std::vector<SyntheticSegment> samples = draw(SegmentCase::kOccluded, 3, 16);
  std::vector<std::size_t> which(samples.size());
  for (std::size_t i = 0; i < which.size(); ++i) which[i] = i;
  const std::vector<EllipseEstimate> together = network_.infer(merge(samples), which, 0.01, kMaxRadiusM);
  ASSERT_EQ(together.size(), samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_NEAR((together[i].smooth_level - estimate(samples[i]).smooth_level).norm(), 0.0, 1e-5);
  }
  EXPECT_TRUE(network_.infer(merge(samples), {}, 0.01, kMaxRadiusM).empty());
}

using NetworkStatistics = Network;

TEST_F(NetworkStatistics, IsBetterThanLeastSquaresWithTheSensorsModel) {
  // On the paper's data: the published figures are those of scripts/evaluate, with more samples.
  constexpr int kCount = 3000;
  double network_m = 0.0;
  double least_squares_m = 0.0;
  for (const SyntheticSegment& sample : draw(SegmentCase::kEllipse, 4, kCount)) {
    const Ellipse answer = ellipse_from_smooth_parameters(estimate(sample).smooth_level);
    const Ellipse fitted = fit_ellipse(sample.segments, 0, EllipseFitParams{}).ellipse_level;
    network_m += symmetric_characteristic_distance(answer, *sample.ellipse_level) / kCount;
    least_squares_m += symmetric_characteristic_distance(fitted, *sample.ellipse_level) / kCount;
  }
  EXPECT_LT(network_m, 0.040);
  EXPECT_LT(network_m, 0.9 * least_squares_m);
}

TEST_F(Network, DistinguishesAHiddenEndFromAFreeOne) {
  // With the hidden end marked as free, it must be much worse.
  constexpr int kCount = 2000;
  double told_m = 0.0;
  double deceived_m = 0.0;
  for (SyntheticSegment& sample : draw(SegmentCase::kOccluded, 5, kCount)) {
    told_m += symmetric_characteristic_distance(ellipse_from_smooth_parameters(estimate(sample).smooth_level),
                                                *sample.ellipse_level);
    Segment& segment = sample.segments.segments.front();
    segment.right_end = SegmentEnd::kFree;
    segment.left_end = SegmentEnd::kFree;
    segment.right_hidden_rad = 0.0;
    segment.left_hidden_rad = 0.0;
    deceived_m += symmetric_characteristic_distance(ellipse_from_smooth_parameters(estimate(sample).smooth_level),
                                                    *sample.ellipse_level);
  }
  EXPECT_LT(told_m / kCount, 0.105);
  EXPECT_LT(told_m, 0.6 * deceived_m);
}

TEST_F(NetworkStatistics, CovarianceIsPositiveDefiniteAndContains90PercentOfTruths) {
  constexpr double kChiSquare90 = 9.2364;  // of 5 degrees of freedom
  for (const SegmentCase which : {SegmentCase::kEllipse, SegmentCase::kOccluded, SegmentCase::kProduct}) {
    int inside = 0;
    int count = 0;
    for (const SyntheticSegment& sample : draw(which, 6, 4000)) {
      const EllipseEstimate answer = estimate(sample);
      ASSERT_TRUE(answer.covariance.allFinite());
      ASSERT_EQ(answer.covariance, answer.covariance.transpose());
      ASSERT_GT(smallest_eigenvalue(answer.covariance), 0.0);
      if (!sample.ellipse_level) continue;
      const Vector5d error = smooth_parameters(*sample.ellipse_level) - answer.smooth_level;
      inside += mahalanobis2(error, answer.covariance) < kChiSquare90 ? 1 : 0;
      ++count;
    }
    EXPECT_NEAR(static_cast<double>(inside) / count, 0.9, 0.025) << name_of(which);
  }
}

TEST_F(Network, KeepsEllipsesAndRefusesWallsAndCorners) {
  constexpr double kThreshold = 0.98;  // near where 99 % of ellipses are kept
  const auto share_kept = [&](SegmentCase which) {
    constexpr int kCount = 1000;
    int kept = 0;
    for (const SyntheticSegment& sample : draw(which, 7, kCount))
      kept += estimate(sample).p_ellipse >= kThreshold ? 1 : 0;
    return static_cast<double>(kept) / kCount;
  };
  EXPECT_GT(share_kept(SegmentCase::kEllipse), 0.98);
  EXPECT_GT(share_kept(SegmentCase::kOccluded), 0.97);
  EXPECT_LT(share_kept(SegmentCase::kWall), 0.02);
  EXPECT_LT(share_kept(SegmentCase::kCorner), 0.02);
}

TEST(NetworkDetector, DetectsObjectsThatShowAnEdgeInTheirOrder) {
  std::vector<SyntheticSegment> samples = draw(SegmentCase::kEllipse, 8, 6);
  Segments segments = merge(samples);
  segments.stamp_ns = 5;
  segments.segments[1].kind = SegmentKind::kStructure;
  segments.segments[3].right_end = SegmentEnd::kOccluded;
  segments.segments[3].left_end = SegmentEnd::kScanEdge;
  segments.segments[4].right_end = SegmentEnd::kOccluded;
  segments.segments[4].right_hidden_rad = 0.01;
  NetworkDetector detector(kModels + "ellipse.onnx", EllipseFitParams{});
  const Detections detections = detector.detect(segments);
  EXPECT_EQ(detections.stamp_ns, 5);
  EXPECT_EQ(detections.refused.of("both ends hidden"), 1U);
  std::map<std::size_t, const Detection*> found;
  for (const Detection& detection : detections.detections) found[detection.segment] = &detection;
  EXPECT_EQ(found.count(1), 0U);
  EXPECT_EQ(found.count(3), 0U);
  for (const std::size_t i : {0U, 2U, 4U, 5U}) {
    ASSERT_EQ(found.count(i), 1U) << i;
    EXPECT_EQ(found[i]->beams, static_cast<int>(segments.segments[i].count));
    EXPECT_EQ(found[i]->hidden_end, i == 4);
    EXPECT_LT((found[i]->ellipse_level.center_m - samples[i].ellipse_level->center_m).norm(), 0.5);
    EXPECT_GT(found[i]->p_ellipse, 0.5);
    EXPECT_GE(found[i]->ellipse_level.ry_m, EllipseFitParams{}.min_radius_m);
  }
}

TEST(EllipseNetwork, RefusesANetworkOfAnotherShape) {
  const std::string path = kModels + "paper_vgg_polar.onnx";
  EXPECT_TRUE(names(refusal_of<std::runtime_error>([&] { EllipseNetwork{path}; }), {path}));
}

}  // namespace
}  // namespace situation_awareness::network_test
