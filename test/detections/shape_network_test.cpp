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
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "support/covariance.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::shape_network_test {
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
  std::vector<double> differences;
  double p_difference = 0.0;
  constexpr int kCount = 500;
  for (const SyntheticSegment& sample : draw(SegmentCase::kShapes, 5, kCount)) {
    const ShapeEstimate shape = estimate(sample);
    const ShapeEstimate image = estimate(mirrored(sample));
    p_difference += largest_difference(image, shape) / kCount;
    if (!sample.box_level) continue;  // of others the box means nothing
    const Vector5d expected = (flip * shape.smooth_level.array()).matrix();
    differences.push_back(mahalanobis2(image.smooth_level - expected, image.covariance));
  }
  std::sort(differences.begin(), differences.end());
  EXPECT_LT(differences[differences.size() / 2], 2.5);  // that of a truth is 4.4 in the median
  EXPECT_LT(p_difference, 0.06);
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

using ShapesStatistics = Shapes;

TEST_F(ShapesStatistics, ProbabilitiesAreFrequencies) {
  constexpr int kCount = 20000;
  constexpr std::array<double, 7> kBounds = {0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0 + 1e-9};
  struct Bin {
    int count = 0;
    int found = 0;
    double sum = 0.0;
  };
  std::array<std::array<Bin, kBounds.size() - 1>, 3> bins;
  for (const SyntheticSegment& sample : draw(SegmentCase::kShapes, 6, kCount)) {
    const ShapeEstimate shape = estimate(sample);
    const std::size_t truth = sample.ellipse_level ? 0 : sample.box_level ? 1 : 2;
    const std::array<double, 3> p = {shape.p_ellipse, shape.p_box, shape.p_other};
    for (std::size_t k = 0; k < p.size(); ++k) {
      const auto above = std::upper_bound(kBounds.begin(), kBounds.end(), p[k]);
      Bin& bin = bins[k][static_cast<std::size_t>(above - kBounds.begin()) - 1];
      ++bin.count;
      bin.found += truth == k ? 1 : 0;
      bin.sum += p[k];
    }
  }
  for (const auto& of_kind : bins) {
    for (const Bin& bin : of_kind) {
      ASSERT_GT(bin.count, 100);
      const double p = bin.sum / bin.count;
      EXPECT_NEAR(static_cast<double>(bin.found) / bin.count, p, 0.025 + 3.0 * std::sqrt(p * (1.0 - p) / bin.count));
    }
  }
}

TEST_F(ShapesStatistics, RegionsHoldNineTenthsOfTheBoxes) {
  constexpr double kChiSquare90 = 9.2364;  // of 5 degrees of freedom
  for (const SegmentCase which : {SegmentCase::kBoxes, SegmentCase::kFaces, SegmentCase::kShapes}) {
    int inside = 0;
    int count = 0;
    for (const SyntheticSegment& sample : draw(which, 7, 6000)) {
      const ShapeEstimate shape = estimate(sample);
      ASSERT_GT(smallest_eigenvalue(shape.covariance), 0.0);
      if (!sample.box_level) continue;
      const Vector5d error = smooth_parameters(moment_equal_ellipse(*sample.box_level)) - shape.smooth_level;
      inside += mahalanobis2(error, shape.covariance) < kChiSquare90 ? 1 : 0;
      ++count;
    }
    EXPECT_NEAR(static_cast<double>(inside) / count, 0.9, 0.03 + 0.012) << name_of(which);  // and chance
  }
}

TEST_F(Shapes, TurnOfABoxIsKnownWhereItsSidesAreEqual) {
  std::vector<double> errors;
  for (const SyntheticSegment& sample : draw(SegmentCase::kBoxes, 8, 5000)) {
    const Box& box = *sample.box_level;
    if (std::abs(std::log(box.half_length_m / box.half_width_m)) > 0.1) continue;
    errors.push_back(turn_between(estimate(sample).box_psi_level_rad, box.psi_rad));
  }
  ASSERT_GT(errors.size(), 100U);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], radians(1.0));
  EXPECT_LT(errors[errors.size() * 9 / 10], radians(4.0));
}

TEST_F(Shapes, AFaceIsNoEllipse) {
  // As of a car seen from behind: 19 cm, 13 hits of 1 degree.
  Random random(9);
  for (int i = 0; i < 20; ++i) {
    SyntheticSegment sample;
    sample.range_sigma_m = 0.01;
    sample.segments.resolution_rad = radians(1.0);
    for (int k = -6; k <= 6; ++k) {
      Point point;
      const double azimuth_rad = k * sample.segments.resolution_rad;
      place(point, azimuth_rad, 0.84 / std::cos(azimuth_rad) + 0.005 * random.normal());
      sample.segments.points.push_back(point);
    }
    Segment segment;
    segment.count = sample.segments.points.size();
    sample.segments.segments = {segment};
    const ShapeEstimate shape = estimate(sample);
    EXPECT_LT(shape.p_ellipse, 0.1);
    EXPECT_GT(shape.p_box, 0.7);
    EXPECT_LT(std::abs(std::sin(2.0 * shape.box_psi_level_rad)), std::sin(2.0 * radians(10.0)));
  }
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
}  // namespace situation_awareness::shape_network_test
