// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/synthetic_segments.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <stdexcept>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness::synthetic_segments_test {
namespace {

constexpr double kResolutionRad = radians(0.25);
constexpr SegmentCase kAll[] = {SegmentCase::kEllipse, SegmentCase::kCircle, SegmentCase::kOccluded,
                                SegmentCase::kProduct, SegmentCase::kWall,   SegmentCase::kCorner,
                                SegmentCase::kBox,     SegmentCase::kBush,   SegmentCase::kTwo,
                                SegmentCase::kBoxes,   SegmentCase::kFaces,  SegmentCase::kShapes};

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

/// Where a beam enters a box, infinite where it misses: by clipping it at the box's two pairs of parallel lines.
double range_to(const Box& box, const Eigen::Vector2d& u) {
  const Eigen::Rotation2Dd to_box(-box.psi_rad);
  const Eigen::Array2d sensor = (to_box * -box.center_m).array();
  const Eigen::Array2d direction = (to_box * u).array();
  const Eigen::Array2d half(box.half_length_m, box.half_width_m);
  const Eigen::Array2d first = (-half - sensor) / direction;
  const Eigen::Array2d second = (half - sensor) / direction;
  const double enter_m = first.min(second).maxCoeff();
  const double leave_m = first.max(second).minCoeff();
  return enter_m > 0.0 && enter_m <= leave_m ? enter_m : std::numeric_limits<double>::infinity();
}

TEST(SyntheticSegments, BoxesAreSeenByAllBeamsThatMeetThemAndByNoOther) {
  for (const SegmentCase which : {SegmentCase::kBoxes, SegmentCase::kFaces}) {
    Random random(3);
    double sum = 0.0;
    int points = 0;
    for (int i = 0; i < 300; ++i) {
      const SyntheticSegment sample = draw_segment(which, random);
      ASSERT_TRUE(sample.box_level);
      ASSERT_FALSE(sample.ellipse_level);
      const Box& box = *sample.box_level;
      for (const double half_m : {box.half_length_m, box.half_width_m}) {
        ASSERT_GE(2.0 * half_m, 0.1);
        ASSERT_LE(2.0 * half_m, 1.5);
      }
      ASSERT_GE(sample.segments.points.size(), 5U);
      std::size_t meet = 0;
      for (int beam = 0; beam < 1081; ++beam) {
        const double azimuth_rad = radians(-135.0) + beam * kResolutionRad;
        const bool met = std::isfinite(range_to(box, {std::cos(azimuth_rad), std::sin(azimuth_rad)}));
        meet += met ? 1U : 0U;
      }
      ASSERT_EQ(sample.segments.points.size(), meet);
      for (const Point& point : sample.segments.points) {
        const double error = (point.range_m - range_to(box, point.p_level_m.normalized())) / 0.01;
        ASSERT_LT(std::abs(error), 6.0);
        sum += error * error;
        ++points;
      }
    }
    EXPECT_NEAR(sum / points, 1.0, 4.0 * std::sqrt(2.0 / points)) << name_of(which);
  }
}

TEST(SyntheticSegments, FacesShowOneFace) {
  Random random(4);
  for (int i = 0; i < 300; ++i) {
    const Box box = *draw_segment(SegmentCase::kFaces, random).box_level;
    const Eigen::Vector2d sensor_box = Eigen::Rotation2Dd(-box.psi_rad) * -box.center_m;
    EXPECT_NE(std::abs(sensor_box.x()) > box.half_length_m, std::abs(sensor_box.y()) > box.half_width_m);
  }
}

TEST(SyntheticSegments, OfShapesTwoInFiveAreEllipsesAndAsManyBoxes) {
  constexpr int kCount = 4000;
  constexpr double kMaxDepthM = 0.30;  // of noise, roughness, what is set back, and a mixed pixel
  Random random(6);
  int ellipses = 0;
  int boxes = 0;
  int near_outline = 0;
  int hits = 0;
  int square_on = 0;
  for (int i = 0; i < kCount; ++i) {
    const SyntheticSegment sample = draw_segment(SegmentCase::kShapes, random);
    ASSERT_FALSE(sample.ellipse_level && sample.box_level);
    ellipses += sample.ellipse_level ? 1 : 0;
    if (!sample.box_level) continue;
    ++boxes;
    const Box& box = *sample.box_level;
    for (const Point& point : sample.segments.points) {
      const double depth_m = std::abs(offset_m(box, point.p_level_m));
      ASSERT_LT(depth_m, kMaxDepthM);
      near_outline += depth_m < 3.0 * sample.range_sigma_m ? 1 : 0;
      ++hits;
    }
    const double bearing_rad = std::atan2(box.center_m.y(), box.center_m.x());
    square_on += std::abs(std::sin(2.0 * (box.psi_rad - bearing_rad))) < std::sin(radians(20.0)) ? 1 : 0;
  }
  const double deviation = std::sqrt(kCount * 0.4 * 0.6);
  EXPECT_NEAR(ellipses, 0.4 * kCount, 4.0 * deviation);
  EXPECT_NEAR(boxes, 0.4 * kCount, 4.0 * deviation);
  EXPECT_GT(near_outline, 0.85 * hits);
  EXPECT_GT(square_on, 0.4 * boxes);  // 22 % of random orientations
}

TEST(SyntheticSegments, ProductIsWhatTheEllipseNetworkWasTrainedWith) {
  // FNV-1a over the bits of the first samples: the published tables and weights stand on these.
  std::uint64_t hash = 0xcbf29ce484222325;
  const auto add = [&hash](std::uint64_t bits) {
    for (int byte = 0; byte < 8; ++byte) hash = (hash ^ ((bits >> (8 * byte)) & 0xff)) * 0x100000001b3;
  };
  for (std::uint64_t seed = 1; seed <= 500; ++seed) {
    Random random(seed);
    const SyntheticSegment sample = draw_segment(SegmentCase::kProduct, random);
    const Segment& segment = sample.segments.segments.front();
    add(static_cast<std::uint64_t>(segment.right_end));
    add(static_cast<std::uint64_t>(segment.left_end));
    for (const Point& point : sample.segments.points) {
      add(static_cast<std::uint64_t>(std::llround(point.range_m * 1e9)));
      add(static_cast<std::uint64_t>(std::llround(point.azimuth_rad * 1e9)));
    }
  }
  EXPECT_EQ(hash, 9121434649492657997U);
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
    const SyntheticSegment sample = draw_segment(which, random);
    EXPECT_FALSE(sample.ellipse_level) << name_of(which);
    EXPECT_EQ(sample.box_level.has_value(), which == SegmentCase::kBox) << name_of(which);
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
}  // namespace situation_awareness::synthetic_segments_test
