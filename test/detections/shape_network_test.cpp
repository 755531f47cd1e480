// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/shape_network.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/evaluation/synthetic_segments.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "support/covariance.hpp"
#include "support/refusal.hpp"

namespace situation_awareness {
namespace {

const std::string kModels = SITUATION_AWARENESS_SOURCE_DIR "/models/";
constexpr double kMaxRadiusM = 0.5;
constexpr double kQuarterTurn = 0.5 * kPi;

void place(Point& point, double azimuth_rad, double range_m) {
  point.azimuth_rad = azimuth_rad;
  point.range_m = range_m;
  point.p_level_m = range_m * Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad));
}

std::vector<SyntheticSegment> draw(SegmentCase which, std::uint64_t seed, int count) {
  Random random(seed);
  std::vector<SyntheticSegment> samples;
  for (int i = 0; i < count; ++i) samples.push_back(draw_segment(which, random));
  return samples;
}

/// The scene seen in a mirror along the x axis.
SyntheticSegment mirrored(SyntheticSegment sample) {
  std::vector<Point>& points = sample.segments.points;
  for (Point& point : points) place(point, -point.azimuth_rad, point.range_m);
  std::reverse(points.begin(), points.end());
  Segment& segment = sample.segments.segments.front();
  std::swap(segment.right_end, segment.left_end);
  std::swap(segment.right_hidden_rad, segment.left_hidden_rad);
  return sample;
}

double largest_difference(const ShapeEstimate& a, const ShapeEstimate& b) {
  return std::max({std::abs(a.p_ellipse - b.p_ellipse), std::abs(a.p_box - b.p_box), std::abs(a.p_other - b.p_other)});
}

/// Of two orientations of a box; 0 where they differ by right angles.
double turn_between(double a_rad, double b_rad) { return std::abs(std::remainder(a_rad - b_rad, kQuarterTurn)); }

class Shapes : public testing::Test {
 protected:
  ShapeEstimate estimate(const SyntheticSegment& sample, double scale = 1.0) {
    return network_.infer(sample.segments, {0}, scale * sample.range_sigma_m, scale * kMaxRadiusM).front();
  }

  ShapeNetwork network_{kModels + "shape.onnx"};
};

TEST_F(Shapes, TurnWithTheScene) {
  const double turn_rad = -1.1;
  Matrix5d J = Matrix5d::Identity();
  J.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(turn_rad).toRotationMatrix();
  J.bottomRightCorner<2, 2>() = Eigen::Rotation2Dd(2.0 * turn_rad).toRotationMatrix();
  for (SyntheticSegment& sample : draw(SegmentCase::kShapes, 1, 200)) {
    const ShapeEstimate before = estimate(sample);
    for (Point& point : sample.segments.points) place(point, point.azimuth_rad + turn_rad, point.range_m);
    const ShapeEstimate after = estimate(sample);
    EXPECT_NEAR((after.smooth_level - J * before.smooth_level).norm(), 0.0, 1e-4);
    EXPECT_NEAR((after.covariance - J * before.covariance * J.transpose()).norm() / before.covariance.norm(), 0.0,
                1e-2);
    EXPECT_LT(largest_difference(after, before), 1e-3);
    EXPECT_LT(turn_between(after.box_psi_level_rad, before.box_psi_level_rad + turn_rad), 1e-2);
  }
}

TEST_F(Shapes, AreMirroredWithTheScene) {
  // The network learned it from its samples: only nearly.
  const Eigen::Array<double, 5, 1> flip = (Eigen::Array<double, 5, 1>() << 1.0, -1.0, 1.0, 1.0, -1.0).finished();
  double difference = 0.0;
  double p_difference = 0.0;
  constexpr int kCount = 500;
  for (const SyntheticSegment& sample : draw(SegmentCase::kShapes, 5, kCount)) {
    const ShapeEstimate shape = estimate(sample);
    const ShapeEstimate image = estimate(mirrored(sample));
    const Vector5d expected = (flip * shape.smooth_level.array()).matrix();
    difference += mahalanobis2(image.smooth_level - expected, shape.covariance) / kCount;
    p_difference += largest_difference(image, shape) / kCount;
  }
  EXPECT_LT(difference, 5.0);  // of 5 on average between truth and estimate
  EXPECT_LT(p_difference, 0.12);
}

TEST_F(Shapes, AreInvariantUnderScaling) {
  constexpr double kScale = 0.4;
  for (SyntheticSegment& sample : draw(SegmentCase::kShapes, 2, 200)) {
    const ShapeEstimate before = estimate(sample);
    for (Point& point : sample.segments.points) place(point, point.azimuth_rad, kScale * point.range_m);
    const ShapeEstimate after = estimate(sample, kScale);
    EXPECT_NEAR((after.smooth_level - kScale * before.smooth_level).norm(), 0.0, 1e-4);
    EXPECT_LT(largest_difference(after, before), 1e-3);
    EXPECT_LT(turn_between(after.box_psi_level_rad, before.box_psi_level_rad), 1e-2);
  }
}

TEST_F(Shapes, OfABatchAreThoseOfEachAlone) {
  const std::vector<SyntheticSegment> samples = draw(SegmentCase::kBoxes, 3, 16);
  Segments scan;
  std::vector<std::size_t> which;
  scan.resolution_rad = samples.front().segments.resolution_rad;
  for (const SyntheticSegment& sample : samples) {
    Segment segment = sample.segments.segments.front();
    segment.first = scan.points.size();
    scan.points.insert(scan.points.end(), sample.segments.points.begin(), sample.segments.points.end());
    which.push_back(scan.segments.size());
    scan.segments.push_back(segment);
  }
  const std::vector<ShapeEstimate> together = network_.infer(scan, which, 0.01, kMaxRadiusM);
  ASSERT_EQ(together.size(), samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_NEAR((together[i].smooth_level - estimate(samples[i]).smooth_level).norm(), 0.0, 1e-5);
  }
  EXPECT_TRUE(network_.infer(scan, {}, 0.01, kMaxRadiusM).empty());
}

TEST(ShapeAnswer, GivesProbabilitiesAndTheAxisNearestToTheMajorOne) {
  SegmentEncoding encoding;
  encoding.azimuth_rad = 0.4;
  encoding.mean_range_m = 2.0;
  encoding.half_width_m = 0.2;
  Random random(4);
  for (int i = 0; i < 1000; ++i) {
    std::array<float, kShapeAnswer> answer{};
    for (float& number : answer) number = static_cast<float>(random.normal() * (i % 2 == 0 ? 1.0 : 1e3));
    const ShapeEstimate shape = shape_of(answer.data(), encoding, kMaxRadiusM);
    EXPECT_NEAR(shape.p_ellipse + shape.p_box + shape.p_other, 1.0, 1e-12);
    EXPECT_EQ(shape.covariance, shape.covariance.transpose());
    if (i % 2 == 0) {
      EXPECT_GT(smallest_eigenvalue(shape.covariance), 0.0);
    }
    EXPECT_LE(std::abs(shape.box_psi_level_rad), kQuarterTurn);
    const double psi_rad = encoding.azimuth_rad + 0.25 * std::atan2(answer[25], answer[24]);
    EXPECT_LT(turn_between(shape.box_psi_level_rad, psi_rad), 1e-6);
    const double major_rad = 0.5 * std::atan2(shape.smooth_level(4), shape.smooth_level(3));
    EXPECT_LE(std::abs(std::remainder(shape.box_psi_level_rad - major_rad, kPi)), 0.25 * kPi + 1e-6);
  }
}

TEST(ShapeNetwork, RefusesANetworkOfAnotherShape) {
  for (const std::string name : {"ellipse.onnx", "paper_vgg_polar.onnx"}) {
    const std::string path = kModels + name;
    EXPECT_TRUE(names(refusal_of<std::runtime_error>([&] { ShapeNetwork{path}; }), {path}));
  }
  const std::string nowhere = kModels + "no_such_shape.onnx";
  EXPECT_TRUE(names(refusal_of<std::runtime_error>([&] { ShapeNetwork{nowhere}; }), {nowhere}));
}

}  // namespace
}  // namespace situation_awareness
