// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/synthetic_segments.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <stdexcept>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

constexpr double kResolutionRad = radians(0.25);
constexpr SegmentCase kAll[] = {SegmentCase::kEllipse, SegmentCase::kCircle, SegmentCase::kOccluded,
                                SegmentCase::kProduct, SegmentCase::kWall,   SegmentCase::kCorner,
                                SegmentCase::kBox,     SegmentCase::kBush,   SegmentCase::kTwo};

bool hits(const Ellipse& ellipse, int beam) {
  const double azimuth_rad = radians(-135.0) + beam * kResolutionRad;
  const Eigen::Vector2d u(std::cos(azimuth_rad), std::sin(azimuth_rad));
  return intersect_ray(ellipse, Eigen::Vector2d::Zero(), u).has_value();
}

/// Number of the paper's beams that would hit an ellipse.
int beams_on(const Ellipse& ellipse) {
  int count = 0;
  for (int beam = 0; beam < 1081; ++beam) count += hits(ellipse, beam) ? 1 : 0;
  return count;
}

TEST(SyntheticSegments, AreTheSameForTheSameSeed) {
  for (const SegmentCase which : kAll) {
    Random first(7);
    Random second(7);
    for (int i = 0; i < 20; ++i) {
      const SyntheticSegment a = draw_segment(which, first);
      const SyntheticSegment b = draw_segment(which, second);
      ASSERT_EQ(a.segments.points.size(), b.segments.points.size());
      for (std::size_t k = 0; k < a.segments.points.size(); ++k) {
        ASSERT_EQ(a.segments.points[k].range_m, b.segments.points[k].range_m);
      }
    }
  }
}

TEST(SyntheticSegments, KeepTheInvariantsOfSegments) {
  for (const SegmentCase which : kAll) {
    Random random(11);
    for (int i = 0; i < 300; ++i) {
      const SyntheticSegment sample = draw_segment(which, random);
      ASSERT_EQ(sample.segments.segments.size(), 1U);
      const Segment& segment = sample.segments.segments.front();
      ASSERT_EQ(segment.count, sample.segments.points.size());
      ASSERT_GE(segment.count, 3U);
      ASSERT_GT(sample.range_sigma_m, 0.0);
      for (std::size_t k = 0; k < segment.count; ++k) {
        const Point& point = sample.segments.points[k];
        ASSERT_TRUE(std::isfinite(point.range_m));
        ASSERT_NEAR((point.p_level_m -
                     point.range_m * Eigen::Vector2d(std::cos(point.azimuth_rad), std::sin(point.azimuth_rad)))
                        .norm(),
                    0.0, 1e-9);
        if (k > 0) {
          ASSERT_GT(point.azimuth_rad, sample.segments.points[k - 1].azimuth_rad);
        }
      }
      ASSERT_EQ(is_silhouette(segment.right_end), segment.right_hidden_rad == 0.0);
      ASSERT_EQ(is_silhouette(segment.left_end), segment.left_hidden_rad == 0.0);
    }
  }
}

TEST(SyntheticSegments, EllipsesAreSeenAsInThePaperAndByNoOtherBeam) {
  Random random(3);
  double sum = 0.0;
  int points = 0;
  for (int i = 0; i < 500; ++i) {
    const SyntheticSegment sample = draw_segment(SegmentCase::kEllipse, random);
    ASSERT_TRUE(sample.ellipse_level);
    const Ellipse& truth = *sample.ellipse_level;
    ASSERT_GE(truth.ry_m, 0.05);
    ASSERT_GE(truth.rx_m, truth.ry_m);
    ASSERT_LE(truth.rx_m, 0.5);
    ASSERT_GE(sample.segments.points.size(), 5U);
    ASSERT_EQ(static_cast<int>(sample.segments.points.size()), beams_on(truth));
    for (const Point& point : sample.segments.points) {
      const Eigen::Vector2d u = point.p_level_m.normalized();
      const auto range_m = intersect_ray(truth, Eigen::Vector2d::Zero(), u);
      ASSERT_TRUE(range_m);
      const double error = (point.range_m - *range_m) / 0.01;
      ASSERT_LT(std::abs(error), 6.0);
      sum += error * error;
      ++points;
    }
  }
  EXPECT_NEAR(sum / points, 1.0, 4.0 * std::sqrt(2.0 / points));  // the noise is the stated one
}

TEST(SyntheticSegments, CirclesLieOnTheGrid) {
  Random random(5);
  std::set<long> radii;
  for (int i = 0; i < 500; ++i) {
    const SyntheticSegment sample = draw_segment(SegmentCase::kCircle, random);
    const Ellipse& truth = *sample.ellipse_level;
    EXPECT_DOUBLE_EQ(truth.rx_m, truth.ry_m);
    for (const double value : {truth.rx_m, truth.center_m.x(), truth.center_m.y()}) {
      EXPECT_NEAR(value / 0.05, std::round(value / 0.05), 1e-9);
    }
    radii.insert(std::lround(truth.rx_m / 0.05));
  }
  EXPECT_EQ(radii.size(), 10U);
}

TEST(SyntheticSegments, AnOccluderHidesThirtyToSeventyPercentOfOneEnd) {
  Random random(9);
  int right = 0;
  for (int i = 0; i < 500; ++i) {
    const SyntheticSegment sample = draw_segment(SegmentCase::kOccluded, random);
    const Segment& segment = sample.segments.segments.front();
    ASSERT_NE(is_silhouette(segment.right_end), is_silhouette(segment.left_end));
    const int n = beams_on(*sample.ellipse_level);
    const int hidden = n - static_cast<int>(segment.count);
    EXPECT_GE(hidden, std::ceil(0.3 * n));
    EXPECT_LE(hidden, std::floor(0.7 * n));
    const double blocked = (segment.right_hidden_rad + segment.left_hidden_rad) / kResolutionRad;
    EXPECT_GE(blocked, hidden - 1e-6);
    EXPECT_LE(blocked, hidden + 20 + 1e-6);
    // The other end is a silhouette: the beam beside it misses.
    const bool hidden_right = !is_silhouette(segment.right_end);
    right += hidden_right ? 1 : 0;
    const int beside = hidden_right ? sample.segments.points.back().beam + 1 : sample.segments.points.front().beam - 1;
    EXPECT_FALSE(hits(*sample.ellipse_level, beside));
  }
  EXPECT_NEAR(right, 250, 4 * std::sqrt(125.0));
}

TEST(SyntheticSegments, OthersAreNoEllipses) {
  for (const SegmentCase which :
       {SegmentCase::kWall, SegmentCase::kCorner, SegmentCase::kBox, SegmentCase::kBush, SegmentCase::kTwo}) {
    Random random(13);
    EXPECT_FALSE(draw_segment(which, random).ellipse_level) << name_of(which);
  }
}

TEST(SyntheticSegments, CentresAreUniformOverTheRange) {
  // Of large objects nearly none is discarded inside 7 m, so there the share within a radius grows as its square.
  Random random(17);
  int within_7 = 0;
  int within_5 = 0;
  for (int i = 0; i < 20000; ++i) {
    const SyntheticSegment sample = draw_segment(SegmentCase::kEllipse, random);
    if (sample.ellipse_level->ry_m < 0.2) continue;
    const double distance_m = sample.ellipse_level->center_m.norm();
    within_7 += distance_m > 1.0 && distance_m < 7.0 ? 1 : 0;
    within_5 += distance_m > 1.0 && distance_m < 5.0 ? 1 : 0;
  }
  const double share = (25.0 - 1.0) / (49.0 - 1.0);
  EXPECT_NEAR(within_5, within_7 * share, 4.0 * std::sqrt(within_7 * share * (1.0 - share)));
}

TEST(SyntheticSegments, CasesHaveNames) {
  for (const SegmentCase which : kAll) EXPECT_EQ(segment_case(name_of(which)), which);
  EXPECT_THROW(segment_case("square"), std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness
