// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/network.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

const std::string kModel = SITUATION_AWARENESS_SOURCE_DIR "/models/ellipse_vgg.onnx";

/// Azimuths of a scanner's beams in the level frame, by growing azimuth.
std::vector<double> level_scanner(double resolution_deg) {
  std::vector<double> azimuths_rad;
  for (int i = 0; - 135.0 + i * resolution_deg <= 135.0; ++i) {
    azimuths_rad.push_back(radians(-135.0 + i * resolution_deg));
  }
  return azimuths_rad;
}

/// The same scanner with its plane tilted about an axis 30 degrees off its x axis: its beams are unevenly spaced in the
/// level frame, as horizontal projection leaves them.
std::vector<double> tilted_scanner(double resolution_deg, double tilt_rad) {
  const double axis_rad = radians(30.0);
  std::vector<double> azimuths_rad = level_scanner(resolution_deg);
  for (double& azimuth_rad : azimuths_rad) {
    const double from_axis_rad = azimuth_rad - axis_rad;
    const double level_rad = std::atan2(std::sin(from_axis_rad) * std::cos(tilt_rad), std::cos(from_axis_rad));
    azimuth_rad += std::remainder(level_rad - from_axis_rad, 2.0 * kPi);
  }
  return azimuths_rad;
}

Segments empty_segments(const std::vector<double>& azimuths_rad) {
  Segments segments;
  segments.resolution_rad = (azimuths_rad.back() - azimuths_rad.front()) / static_cast<double>(azimuths_rad.size() - 1);
  return segments;
}

/// Append what a scanner sees of one ellipse alone, noiseless unless `random` is given. False if that is nothing.
bool append_segment(const Ellipse& ellipse, const std::vector<double>& azimuths_rad, Random* random,
                    Segments& segments) {
  Segment segment;
  segment.first = segments.points.size();
  for (std::size_t i = 0; i < azimuths_rad.size(); ++i) {
    const Eigen::Vector2d u(std::cos(azimuths_rad[i]), std::sin(azimuths_rad[i]));
    const auto range_m = intersect_ray(ellipse, Eigen::Vector2d::Zero(), u);
    if (!range_m) continue;
    Point point;
    point.azimuth_rad = azimuths_rad[i];
    point.range_m = *range_m + (random != nullptr ? 0.01 * random->normal() : 0.0);
    point.p_level_m = point.range_m * u;
    point.beam = static_cast<int>(i);
    point.state = BeamState::kHit;
    segments.points.push_back(point);
  }
  segment.count = segments.points.size() - segment.first;
  if (segment.count > 0) segments.segments.push_back(segment);
  return segment.count > 0;
}

std::vector<std::size_t> all_of(const Segments& segments) {
  std::vector<std::size_t> which(segments.segments.size());
  for (std::size_t i = 0; i < which.size(); ++i) which[i] = i;
  return which;
}

/// Ellipses of several shapes at 1 to 4 m, where a multirotor needs them, wherever around it. No circles: the axes of a
/// circle, and so its characteristic points, are unknowable.
std::vector<Ellipse> near_grid() {
  std::vector<Ellipse> ellipses;
  for (const double distance_m : {1.0, 1.7, 2.5, 4.0}) {
    for (const double rx_m : {0.1, 0.2, 0.4}) {
      for (const double ratio : {0.4, 0.55, 0.7}) {
        for (int i = 0; i < 6; ++i) {
          const double azimuth_rad = radians(-100.0 + 37.3 * i);
          Ellipse ellipse;
          ellipse.center_m = distance_m * Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad));
          ellipse.psi_rad = wrap_to_half_pi(radians(-80.0 + 30.0 * i));
          ellipse.rx_m = rx_m;
          ellipse.ry_m = ratio * rx_m;
          ellipses.push_back(ellipse);
        }
      }
    }
  }
  return ellipses;
}

struct Errors {
  double mean_m = 0.0;
  double max_m = 0.0;
  double mean_center_m = 0.0;
};

Errors errors_of(const std::vector<Ellipse>& estimates, const std::vector<Ellipse>& truths) {
  Errors errors;
  const auto n = static_cast<double>(truths.size());
  for (std::size_t i = 0; i < truths.size(); ++i) {
    const double distance_m = symmetric_characteristic_distance(estimates[i], truths[i]);
    errors.mean_m += distance_m / n;
    errors.max_m = std::max(errors.max_m, distance_m);
    errors.mean_center_m += (estimates[i].center_m - truths[i].center_m).norm() / n;
  }
  std::printf("%zu ellipses: mean %.4f m, max %.4f m, centre %.4f m\n", truths.size(), errors.mean_m, errors.max_m,
              errors.mean_center_m);
  return errors;
}

/// Over the ellipses of the near grid that a scanner sees with at least the 4 points that segmentation asks for.
Errors errors_on_near_grid(EllipseNetwork& network, const std::vector<double>& azimuths_rad, Random* random) {
  std::vector<Ellipse> truths;
  Segments segments = empty_segments(azimuths_rad);
  for (const Ellipse& truth : near_grid()) {
    EXPECT_TRUE(append_segment(truth, azimuths_rad, random, segments));
    if (segments.segments.back().count >= 4) {
      truths.push_back(truth);
    } else {
      segments.segments.pop_back();
    }
  }
  return errors_of(network.infer(segments, all_of(segments)), truths);
}

class EllipseNetworkTest : public testing::Test {
 protected:
  EllipseNetwork network_{kModel};
};

TEST_F(EllipseNetworkTest, IsNearTheTruthWithoutNoise) {
  const Errors errors = errors_on_near_grid(network_, level_scanner(0.25), nullptr);
  EXPECT_LT(errors.mean_m, 0.02);
  EXPECT_LT(errors.max_m, 0.06);
}

TEST_F(EllipseNetworkTest, IsNearTheTruthWithNoise) {
  Random random(1);
  const Errors errors = errors_on_near_grid(network_, level_scanner(0.25), &random);
  EXPECT_LT(errors.mean_m, 0.025);
  EXPECT_LT(errors.max_m, 0.08);
}

TEST_F(EllipseNetworkTest, FindsCircles) {
  const std::vector<double> azimuths_rad = level_scanner(0.25);
  for (const double distance_m : {1.0, 2.0, 4.0}) {
    for (const double radius_m : {0.1, 0.2, 0.3, 0.4}) {
      Segments segments = empty_segments(azimuths_rad);
      const Ellipse truth{{0.6 * distance_m, -0.8 * distance_m}, 0.0, radius_m, radius_m};
      ASSERT_TRUE(append_segment(truth, azimuths_rad, nullptr, segments));
      const Ellipse answer = network_.infer(segments, {0})[0];
      EXPECT_LT((answer.center_m - truth.center_m).norm(), 0.05) << distance_m << " m, radius " << radius_m;
      EXPECT_NEAR(answer.rx_m, radius_m, 0.06) << distance_m << " m, radius " << radius_m;
      EXPECT_NEAR(answer.ry_m, radius_m, 0.06) << distance_m << " m, radius " << radius_m;
    }
  }
}

// The distribution that the model card's losses are measured on, sampled anew (ellipse paper, Sect. IV-C).
TEST_F(EllipseNetworkTest, KeepsItsPublishedLossOnThePapersDistribution) {
  const std::vector<double> azimuths_rad = level_scanner(0.25);
  const double resolution_rad = radians(0.25);
  Random random(2);
  std::vector<Ellipse> truths;
  std::vector<Ellipse> estimates;
  while (truths.size() < 2000) {
    Segments segments = empty_segments(azimuths_rad);
    std::vector<Ellipse> batch;
    while (batch.size() < 50) {
      Ellipse ellipse;
      const double distance_m = 10.0 * std::sqrt(random.uniform());
      const double azimuth_rad = radians(random.uniform(-120.0, 120.0));
      ellipse.center_m = distance_m * Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad));
      ellipse.psi_rad = random.uniform(-kPi / 2.0, kPi / 2.0);
      ellipse.rx_m = random.uniform(0.05, 0.5);
      ellipse.ry_m = random.uniform(0.05, ellipse.rx_m);
      if (distance_m < ellipse.rx_m + 0.1 || distance_m > 10.0 - ellipse.rx_m) continue;
      // Beams beyond those that can hit it cost time only.
      const double half_width_rad = std::asin(ellipse.rx_m / distance_m) + resolution_rad;
      const auto low = std::lower_bound(azimuths_rad.begin(), azimuths_rad.end(), azimuth_rad - half_width_rad);
      const auto high = std::lower_bound(azimuths_rad.begin(), azimuths_rad.end(), azimuth_rad + half_width_rad);
      if (!append_segment(ellipse, {low, high}, &random, segments)) continue;
      if (segments.segments.back().count < 5) {
        segments.points.resize(segments.segments.back().first);
        segments.segments.pop_back();
        continue;
      }
      batch.push_back(ellipse);
    }
    const std::vector<Ellipse> answers = network_.infer(segments, all_of(segments));
    estimates.insert(estimates.end(), answers.begin(), answers.end());
    truths.insert(truths.end(), batch.begin(), batch.end());
  }
  EXPECT_LT(errors_of(estimates, truths).mean_m, 0.041);
}

TEST_F(EllipseNetworkTest, TurnsWithTheScene) {
  const std::vector<double> azimuths_rad = level_scanner(0.25);
  Segments segments = empty_segments(azimuths_rad);
  for (const Ellipse& ellipse : near_grid()) append_segment(ellipse, azimuths_rad, nullptr, segments);
  const std::vector<Ellipse> answers = network_.infer(segments, all_of(segments));
  for (const int beams : {1, -333, 720, 1440}) {  // the last is a whole turn: azimuths are not wrapped
    const Pose2 turn{Eigen::Vector2d::Zero(), beams * radians(0.25)};
    Segments turned = segments;
    for (Point& point : turned.points) {
      point.azimuth_rad += turn.yaw_rad;
      point.p_level_m = turn * point.p_level_m;
    }
    const std::vector<Ellipse> turned_answers = network_.infer(turned, all_of(turned));
    for (std::size_t i = 0; i < answers.size(); ++i) {
      EXPECT_LT(symmetric_characteristic_distance(turn * answers[i], turned_answers[i]), 2e-6);
    }
  }
}

TEST_F(EllipseNetworkTest, ServesOtherScanners) {
  // Without noise what is lost is what wider beams leave open about the ends of the segment.
  EXPECT_LT(errors_on_near_grid(network_, level_scanner(0.1), nullptr).mean_m, 0.025);
  EXPECT_LT(errors_on_near_grid(network_, level_scanner(0.3516), nullptr).mean_m, 0.035);
  EXPECT_LT(errors_on_near_grid(network_, level_scanner(0.5), nullptr).mean_m, 0.042);
  EXPECT_LT(errors_on_near_grid(network_, level_scanner(1.0), nullptr).mean_m, 0.07);
}

TEST_F(EllipseNetworkTest, ServesTiltedScanners) {
  for (const double tilt_deg : {5.0, 15.0, 30.0}) {
    EXPECT_LT(errors_on_near_grid(network_, tilted_scanner(0.25, radians(tilt_deg)), nullptr).mean_m, 0.03);
  }
}

TEST_F(EllipseNetworkTest, BridgesMissingBeams) {
  const std::vector<double> azimuths_rad = level_scanner(0.25);
  Segments segments = empty_segments(azimuths_rad);
  ASSERT_TRUE(append_segment({{2.0, 0.5}, 0.4, 0.3, 0.2}, azimuths_rad, nullptr, segments));
  const Ellipse answer = network_.infer(segments, {0})[0];
  segments.points.erase(segments.points.begin() + 7, segments.points.begin() + 9);
  segments.segments[0].count -= 2;
  EXPECT_LT(symmetric_characteristic_distance(answer, network_.infer(segments, {0})[0]), 0.02);
}

TEST_F(EllipseNetworkTest, AnswersInABatchAsOneByOne) {
  const std::vector<double> azimuths_rad = level_scanner(0.25);
  Random random(3);
  Segments segments = empty_segments(azimuths_rad);
  for (const Ellipse& ellipse : near_grid()) append_segment(ellipse, azimuths_rad, &random, segments);
  const std::vector<Ellipse> answers = network_.infer(segments, all_of(segments));
  ASSERT_EQ(answers.size(), segments.segments.size());
  for (std::size_t i = 0; i < answers.size(); i += 5) {
    const std::vector<Ellipse> alone = network_.infer(segments, {i});
    ASSERT_EQ(alone.size(), 1U);
    EXPECT_LT(symmetric_characteristic_distance(answers[i], alone[0]), 2e-6);
  }
  EXPECT_TRUE(network_.infer(segments, {}).empty());
}

TEST_F(EllipseNetworkTest, SurvivesSegmentsOfEveryWidth) {
  for (const std::size_t count : {1U, 2U, 3U, 1081U, 1082U, 3000U}) {
    Segments segments;
    segments.resolution_rad = radians(0.36);
    segments.segments.push_back({0, count, SegmentKind::kObject, SegmentEnd::kFree, SegmentEnd::kFree});
    for (std::size_t i = 0; i < count; ++i) {
      Point point;
      point.azimuth_rad = radians(-170.0) + static_cast<double>(i) * segments.resolution_rad;
      point.range_m = 2.0;
      point.p_level_m = 2.0 * Eigen::Vector2d(std::cos(point.azimuth_rad), std::sin(point.azimuth_rad));
      segments.points.push_back(point);
    }
    const Ellipse answer = network_.infer(segments, {0})[0];
    EXPECT_TRUE(answer.center_m.allFinite());
    EXPECT_GE(answer.rx_m, answer.ry_m);
    EXPECT_GT(answer.ry_m, 0.0);
  }
}

class NetworkDetectorTest : public testing::Test {
 protected:
  /// Two ellipses of the same shape, with the ends that are asked for.
  Segments scene(SegmentKind kind, SegmentEnd right_end, SegmentEnd left_end) const {
    const std::vector<double> azimuths_rad = level_scanner(0.25);
    Random random(4);
    Segments segments = empty_segments(azimuths_rad);
    segments.stamp_ns = 123;
    segments.height_world_m = 1.5;
    segments.T_world_level = {{1.0, 2.0}, 0.3};
    append_segment({{1.5, -1.0}, 0.4, 0.3, 0.2}, azimuths_rad, &random, segments);
    append_segment({{2.0, 0.5}, -0.9, 0.3, 0.2}, azimuths_rad, &random, segments);
    segments.segments[1].kind = kind;
    segments.segments[1].right_end = right_end;
    segments.segments[1].left_end = left_end;
    return segments;
  }

  EllipseFitParams params_;
  NetworkDetector detector_{kModel, params_};
};

TEST_F(NetworkDetectorTest, DetectsWholeObjectsByTheNetwork) {
  const Segments segments = scene(SegmentKind::kObject, SegmentEnd::kFree, SegmentEnd::kBackground);
  const Detections detections = detector_.detect(segments);
  EXPECT_EQ(detections.stamp_ns, segments.stamp_ns);
  EXPECT_EQ(detections.height_world_m, segments.height_world_m);
  EXPECT_EQ(detections.T_world_level.yaw_rad, segments.T_world_level.yaw_rad);
  EXPECT_TRUE(detections.refused.empty());
  ASSERT_EQ(detections.detections.size(), 2U);
  const std::vector<Ellipse> answers = EllipseNetwork(kModel).infer(segments, {0, 1});
  for (std::size_t i = 0; i < 2; ++i) {
    const Detection& detection = detections.detections[i];
    EXPECT_EQ(detection.segment, i);
    EXPECT_EQ(detection.beams, static_cast<int>(segments.segments[i].count));
    EXPECT_LT(symmetric_characteristic_distance(detection.ellipse_level, answers[i]), 2e-6);
    EXPECT_GT(detection.covariance.diagonal().minCoeff(), 0.0);
  }
}

TEST_F(NetworkDetectorTest, DetectsObjectsWithAHiddenEndByLeastSquares) {
  for (const SegmentEnd hidden : {SegmentEnd::kOccluded, SegmentEnd::kScanEdge}) {
    const Segments segments = scene(SegmentKind::kObject, hidden, SegmentEnd::kFree);
    const Detections detections = detector_.detect(segments);
    ASSERT_EQ(detections.detections.size(), 2U) << detections.refused.begin()->first;
    EXPECT_EQ(detections.detections[1].ellipse_level.center_m,
              fit_ellipse(segments, 1, params_).ellipse_level.center_m);
  }
}

TEST_F(NetworkDetectorTest, CountsWhatItRefuses) {
  const Detections hidden = detector_.detect(scene(SegmentKind::kObject, SegmentEnd::kOccluded, SegmentEnd::kScanEdge));
  EXPECT_EQ(hidden.detections.size(), 1U);
  ASSERT_EQ(hidden.refused.size(), 1U);
  EXPECT_EQ(hidden.refused.begin()->second, 1U);

  EllipseFitParams strict;
  strict.max_residual_m = 1e-3;  // a tenth of the noise
  const Detections refused =
      NetworkDetector(kModel, strict).detect(scene(SegmentKind::kObject, SegmentEnd::kFree, SegmentEnd::kFree));
  EXPECT_TRUE(refused.detections.empty());
  ASSERT_EQ(refused.refused.size(), 1U);
  EXPECT_EQ(refused.refused.begin()->second, 2U);
}

TEST_F(NetworkDetectorTest, NeverDetectsStructure) {
  Segments segments = scene(SegmentKind::kStructure, SegmentEnd::kFree, SegmentEnd::kFree);
  const Detections detections = detector_.detect(segments);
  ASSERT_EQ(detections.detections.size(), 1U);
  EXPECT_EQ(detections.detections[0].segment, 0U);
  EXPECT_TRUE(detections.refused.empty());
  EXPECT_TRUE(detector_.detect(Segments()).detections.empty());
}

TEST_F(NetworkDetectorTest, RefusesParametersOutOfBounds) {
  EllipseFitParams params;
  params.range_sigma_m = 0.0;
  EXPECT_THROW(NetworkDetector(kModel, params), std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness
