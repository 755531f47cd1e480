// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/segment_encoding.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/evaluation/synthetic_segments.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness::segment_encoding_test {
namespace {

constexpr double kMaxRadiusM = 0.5;

void place(Point& point, double azimuth_rad, double range_m) {
  point.azimuth_rad = azimuth_rad;
  point.range_m = range_m;
  point.p_level_m = range_m * Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad));
}

SegmentEncoding encode_first(const SyntheticSegment& sample) {
  return encode(sample.segments, sample.segments.segments.front(), sample.range_sigma_m, kMaxRadiusM);
}

TEST(SegmentEncoding, TurnsWithTheScene) {
  Random random(1);
  const Pose2 turn{Eigen::Vector2d::Zero(), 0.7};
  for (int i = 0; i < 100; ++i) {
    SyntheticSegment sample = draw_segment(SegmentCase::kProduct, random);
    const SegmentEncoding before = encode_first(sample);
    for (Point& point : sample.segments.points) place(point, point.azimuth_rad + turn.yaw_rad, point.range_m);
    const SegmentEncoding after = encode_first(sample);
    for (std::size_t k = 0; k < SegmentEncoding::kInputs; ++k) EXPECT_NEAR(after.inputs[k], before.inputs[k], 1e-5);
    EXPECT_NEAR(after.azimuth_rad, before.azimuth_rad + turn.yaw_rad, 1e-12);
    if (!sample.ellipse_level) continue;
    const Vector5d truth = to_segment_frame(before, *sample.ellipse_level);
    EXPECT_NEAR((to_segment_frame(after, turn * *sample.ellipse_level) - truth).norm(), 0.0, 1e-9);
  }
}

TEST(SegmentEncoding, DoesNotChangeWithTheUnitOfLength) {
  Random random(2);
  constexpr double kScale = 3.0;
  for (int i = 0; i < 100; ++i) {
    SyntheticSegment sample = draw_segment(SegmentCase::kProduct, random);
    const SegmentEncoding before = encode_first(sample);
    for (Point& point : sample.segments.points) place(point, point.azimuth_rad, kScale * point.range_m);
    const SegmentEncoding after =
        encode(sample.segments, sample.segments.segments.front(), kScale * sample.range_sigma_m, kScale * kMaxRadiusM);
    for (std::size_t k = 0; k < SegmentEncoding::kInputs; ++k) EXPECT_NEAR(after.inputs[k], before.inputs[k], 1e-5);
    EXPECT_NEAR(after.half_width_m, kScale * before.half_width_m, 1e-9);
  }
}

TEST(SegmentEncoding, OfAMirroredSceneIsMirrored) {
  Random random(3);
  for (int i = 0; i < 100; ++i) {
    SyntheticSegment sample = draw_segment(SegmentCase::kProduct, random);
    const SegmentEncoding before = encode_first(sample);
    std::reverse(sample.segments.points.begin(), sample.segments.points.end());
    for (Point& point : sample.segments.points) place(point, -point.azimuth_rad, point.range_m);
    Segment& segment = sample.segments.segments.front();
    std::swap(segment.right_end, segment.left_end);
    std::swap(segment.right_hidden_rad, segment.left_hidden_rad);
    const SegmentEncoding after = encode_first(sample);
    constexpr std::size_t n = SegmentEncoding::kSlots;
    for (std::size_t k = 0; k < n; ++k) EXPECT_NEAR(after.inputs[k], before.inputs[n - 1 - k], 1e-4);
    for (std::size_t k = 0; k < 6; ++k) EXPECT_NEAR(after.inputs[n + k], before.inputs[n + k], 1e-4);
    for (std::size_t k = 6; k < 9; ++k) {
      EXPECT_NEAR(after.inputs[n + k], before.inputs[n + k + 3], 1e-6);
      EXPECT_NEAR(after.inputs[n + k + 3], before.inputs[n + k], 1e-6);
    }
  }
}

TEST(SegmentEncoding, KeepsEveryRangeOfAShortSegment) {
  // With as many slots as points, and with a divisor of them, each slot holds one point's range.
  for (const std::size_t count : {std::size_t{8}, std::size_t{16}, SegmentEncoding::kSlots}) {
    Random random(4);
    Segments segments;
    segments.resolution_rad = radians(0.5);
    double mean_m = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      Point point;
      place(point, 0.3 + static_cast<double>(i) * segments.resolution_rad, random.uniform(3.0, 3.2));
      mean_m += point.range_m / static_cast<double>(count);
      segments.points.push_back(point);
    }
    Segment segment;
    segment.count = count;
    const SegmentEncoding encoding = encode(segments, segment, 0.01, kMaxRadiusM);
    EXPECT_NEAR(encoding.mean_range_m, mean_m, 1e-9);
    const std::size_t slots = SegmentEncoding::kSlots / count;
    for (std::size_t k = 0; k < SegmentEncoding::kSlots; ++k) {
      const double range_m = encoding.mean_range_m + encoding.half_width_m * encoding.inputs[k];
      EXPECT_NEAR(range_m, segments.points[k / slots].range_m, 1e-6);
    }
  }
}

TEST(SegmentEncoding, ProfileOfALongSegmentIsThatOfTheCurve) {
  // Far more beams than slots: each slot is the mean of the curve over it, here by an independent quadrature.
  const Ellipse ellipse{{2.0, 0.3}, 0.6, 0.45, 0.2};
  Segments segments;
  segments.resolution_rad = radians(0.01);
  for (int i = 0; i < 36000; ++i) {
    const double azimuth_rad = -kPi + (i + 0.5) * segments.resolution_rad;
    const Eigen::Vector2d u(std::cos(azimuth_rad), std::sin(azimuth_rad));
    if (const auto range_m = intersect_ray(ellipse, Eigen::Vector2d::Zero(), u)) {
      Point point;
      place(point, azimuth_rad, *range_m);
      segments.points.push_back(point);
    }
  }
  Segment segment;
  segment.count = segments.points.size();
  const SegmentEncoding encoding = encode(segments, segment, 0.01, kMaxRadiusM);
  const double right_rad = segments.points.front().azimuth_rad - 0.5 * segments.resolution_rad;
  const double left_rad = segments.points.back().azimuth_rad + 0.5 * segments.resolution_rad;
  for (std::size_t k = 1; k + 1 < SegmentEncoding::kSlots; ++k) {
    double sum_m = 0.0;
    constexpr int kParts = 200;
    for (int i = 0; i < kParts; ++i) {
      const double place = (static_cast<double>(k) + (i + 0.5) / kParts) / SegmentEncoding::kSlots;
      const double azimuth_rad = right_rad + place * (left_rad - right_rad);
      const Eigen::Vector2d u(std::cos(azimuth_rad), std::sin(azimuth_rad));
      sum_m += intersect_ray(ellipse, Eigen::Vector2d::Zero(), u).value() / kParts;
    }
    EXPECT_NEAR(encoding.mean_range_m + encoding.half_width_m * encoding.inputs[k], sum_m, 1e-4);
  }
}

TEST(SegmentEncoding, FramesAreInverseToEachOther) {
  Random random(6);
  for (int i = 0; i < 100; ++i) {
    const SyntheticSegment sample = draw_segment(SegmentCase::kEllipse, random);
    const SegmentEncoding encoding = encode_first(sample);
    const Vector5d back = to_level_frame(encoding, to_segment_frame(encoding, *sample.ellipse_level));
    EXPECT_NEAR((back - smooth_parameters(*sample.ellipse_level)).norm(), 0.0, 1e-9);
  }
}

TEST(SegmentEncoding, DistinguishesHiddenEnds) {
  Random random(8);
  SyntheticSegment sample = draw_segment(SegmentCase::kEllipse, random);
  Segment& segment = sample.segments.segments.front();
  constexpr std::size_t n = SegmentEncoding::kSlots;
  EXPECT_EQ(encode_first(sample).inputs[n + 6], 0.0F);
  segment.right_end = SegmentEnd::kOccluded;
  const double width_rad = static_cast<double>(segment.count) * sample.segments.resolution_rad;
  segment.right_hidden_rad = width_rad;
  EXPECT_EQ(encode_first(sample).inputs[n + 6], 1.0F);
  EXPECT_NEAR(encode_first(sample).inputs[n + 8], 0.5, 1e-5);  // as much again is hidden
  segment.right_end = SegmentEnd::kBackground;
  segment.right_hidden_rad = 0.0;
  EXPECT_EQ(encode_first(sample).inputs[n + 7], 1.0F);
}

}  // namespace
}  // namespace situation_awareness::segment_encoding_test
