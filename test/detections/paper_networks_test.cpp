// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/paper_networks.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>

#include "support/affine_model.hpp"
#include "support/lone_segments.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::paper_networks_test {
namespace {

namespace fs = std::filesystem;
using Kind = PaperNetwork::Kind;

const std::string kModel = SITUATION_AWARENESS_SOURCE_DIR "/models/paper_vgg_polar.onnx";

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
Errors errors_on_near_grid(PaperNetwork& network, const std::vector<double>& azimuths_rad, Random* random) {
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

class PolarEllipseNetworkTest : public testing::Test {
 protected:
  PaperNetwork network_{PaperNetwork::Kind::kPolarEllipse, kModel};
};

TEST_F(PolarEllipseNetworkTest, IsNearTheTruthWithoutNoise) {
  const Errors errors = errors_on_near_grid(network_, level_scanner(0.25), nullptr);
  EXPECT_LT(errors.mean_m, 0.02);
  EXPECT_LT(errors.max_m, 0.06);
}

TEST_F(PolarEllipseNetworkTest, IsNearTheTruthWithNoise) {
  Random random(1);
  const Errors errors = errors_on_near_grid(network_, level_scanner(0.25), &random);
  EXPECT_LT(errors.mean_m, 0.025);
  EXPECT_LT(errors.max_m, 0.08);
}

TEST_F(PolarEllipseNetworkTest, FindsCircles) {
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
TEST_F(PolarEllipseNetworkTest, KeepsItsPublishedLossOnThePapersDistribution) {
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

TEST_F(PolarEllipseNetworkTest, TurnsWithTheScene) {
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

TEST_F(PolarEllipseNetworkTest, WorksForOtherScanners) {
  // Without noise the loss is due to the coarser beams at the ends of the segment.
  EXPECT_LT(errors_on_near_grid(network_, level_scanner(0.1), nullptr).mean_m, 0.025);
  EXPECT_LT(errors_on_near_grid(network_, level_scanner(0.3516), nullptr).mean_m, 0.035);
  EXPECT_LT(errors_on_near_grid(network_, level_scanner(0.5), nullptr).mean_m, 0.042);
  EXPECT_LT(errors_on_near_grid(network_, level_scanner(1.0), nullptr).mean_m, 0.07);
}

TEST_F(PolarEllipseNetworkTest, WorksForTiltedScanners) {
  for (const double tilt_deg : {5.0, 15.0, 30.0}) {
    EXPECT_LT(errors_on_near_grid(network_, tilted_scanner(0.25, radians(tilt_deg)), nullptr).mean_m, 0.03);
  }
}

TEST_F(PolarEllipseNetworkTest, BridgesMissingBeams) {
  const std::vector<double> azimuths_rad = level_scanner(0.25);
  Segments segments = empty_segments(azimuths_rad);
  ASSERT_TRUE(append_segment({{2.0, 0.5}, 0.4, 0.3, 0.2}, azimuths_rad, nullptr, segments));
  const Ellipse answer = network_.infer(segments, {0})[0];
  segments.points.erase(segments.points.begin() + 7, segments.points.begin() + 9);
  segments.segments[0].count -= 2;
  EXPECT_LT(symmetric_characteristic_distance(answer, network_.infer(segments, {0})[0]), 0.02);
}

TEST_F(PolarEllipseNetworkTest, GivesTheSameInABatchAsOneByOne) {
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

TEST_F(PolarEllipseNetworkTest, SurvivesSegmentsOfEveryWidth) {
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

/// The papers' networks in the sensor's frame, replaced by affine networks that show inputs and outputs.
class SensorFrameTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
    std::replace(name.begin(), name.end(), '/', '_');
    folder_ = fs::path(testing::TempDir()) / ("situation_awareness_paper_" + name);
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }

  void TearDown() override { fs::remove_all(folder_); }

  std::string write(const AffineModel& model) const {
    const fs::path path = folder_ / "paper.onnx";
    model.write(path);
    return path.string();
  }

  static AffineModel zero(Kind kind) {
    AffineModel model = AffineModel::zero(PaperNetwork::kBeams, kind == Kind::kCircle ? 3 : 5);
    model.fill = kind == Kind::kCircle ? -1.0F : 0.0F;
    return model;
  }

  /// Outputs the point that beam `k` hits, along its azimuth by ten times its input.
  std::string hit_of_beam(Kind kind, int k) const {
    AffineModel model = zero(kind);
    const double azimuth_rad = radians(-135.0 + 0.25 * k);
    model.A(0, k) = static_cast<float>(10.0 * std::cos(azimuth_rad));
    model.A(1, k) = static_cast<float>(10.0 * std::sin(azimuth_rad));
    return write(model);
  }

  /// Constant output for every segment.
  std::string constant(Kind kind, const std::vector<float>& answer) const {
    AffineModel model = zero(kind);
    std::copy(answer.begin(), answer.end(), model.b.begin());
    return write(model);
  }

  fs::path folder_;
};

TEST_F(SensorFrameTest, EveryBeamFeedsItsOwnInput) {
  const std::vector<double> azimuths_rad = level_scanner(0.25);
  Segments segments = empty_segments(azimuths_rad);
  for (const Ellipse& ellipse : {Ellipse{{2.0, 0.3}, 0.4, 0.3, 0.2}, Ellipse{{-2.0, -2.0}, 0.0, 0.5, 0.3},
                                 Ellipse{{-1.0, 1.6}, 1.0, 0.4, 0.2}}) {
    ASSERT_TRUE(append_segment(ellipse, azimuths_rad, nullptr, segments));
  }
  for (const Kind kind : {Kind::kEllipse, Kind::kCircle}) {
    for (std::size_t i = 0; i < segments.points.size(); i += 11) {
      const Point& point = segments.points[i];
      PaperNetwork network(kind, hit_of_beam(kind, point.beam));
      const std::vector<Ellipse> answers = network.infer(segments, {0, 1, 2});
      for (std::size_t s = 0; s < 3; ++s) {
        const Segment& segment = segments.segments[s];
        const bool own = i >= segment.first && i < segment.first + segment.count;
        const Eigen::Vector2d u = point.p_level_m / point.range_m;
        const Eigen::Vector2d no_return = kind == Kind::kCircle ? Eigen::Vector2d(-10.0 * u) : Eigen::Vector2d::Zero();
        EXPECT_LT((answers[s].center_m - (own ? point.p_level_m : no_return)).norm(), 2e-6);
      }
    }
  }
}

TEST_F(SensorFrameTest, InterpolatesTheBeamsOfOtherScanners) {
  const std::vector<double> azimuths_rad = level_scanner(0.5);
  Segments segments = empty_segments(azimuths_rad);
  ASSERT_TRUE(append_segment({{2.0, 0.3}, 0.4, 0.3, 0.2}, azimuths_rad, nullptr, segments));
  const Point& a = segments.points[5];
  const Point& b = segments.points[6];
  PaperNetwork network(Kind::kEllipse, hit_of_beam(Kind::kEllipse, 2 * a.beam + 1));
  EXPECT_NEAR(network.infer(segments, {0})[0].center_m.norm(), 0.5 * (a.range_m + b.range_m), 2e-6);
}

TEST_F(SensorFrameTest, AzimuthsBeyondATurnAreTheSameAzimuths) {
  const std::vector<double> azimuths_rad = level_scanner(0.25);
  Segments segments = empty_segments(azimuths_rad);
  ASSERT_TRUE(append_segment({{-1.5, -1.6}, 0.4, 0.3, 0.2}, azimuths_rad, nullptr, segments));
  const Point point = segments.points[5];
  PaperNetwork network(Kind::kCircle, hit_of_beam(Kind::kCircle, point.beam));
  for (const double turns : {-1.0, 0.0, 1.0, 2.0}) {
    Segments turned = segments;
    for (Point& moved : turned.points) moved.azimuth_rad += turns * 2.0 * kPi;
    ASSERT_TRUE(network.sees(turned, 0));
    EXPECT_LT((network.infer(turned, {0})[0].center_m - point.p_level_m).norm(), 2e-6);
  }
}

TEST_F(SensorFrameTest, SeesWithinItsFieldOfViewOnly) {
  std::vector<double> azimuths_rad;  // a full circle
  for (int i = 0; i < 1440; ++i) azimuths_rad.push_back(radians(-180.0 + 0.25 * i));
  Segments segments = empty_segments(azimuths_rad);
  const auto at = [](double azimuth_deg) {
    return Ellipse{2.0 * Eigen::Vector2d(std::cos(radians(azimuth_deg)), std::sin(radians(azimuth_deg))), 0.0, 0.3,
                   0.3};
  };
  for (const double azimuth_deg : {-160.0, -137.0, 134.0, 150.0}) {
    ASSERT_TRUE(append_segment(at(azimuth_deg), azimuths_rad, nullptr, segments));
  }
  AffineModel sum = zero(Kind::kEllipse);  // of all inputs, as rx
  sum.A.row(3).setConstant(10.0F);
  PaperNetwork network(Kind::kEllipse, write(sum));
  EXPECT_FALSE(network.sees(segments, 0));
  EXPECT_FALSE(network.sees(segments, 3));
  for (const std::size_t s : {1U, 2U}) {
    ASSERT_TRUE(network.sees(segments, s));
    double ranges_m = 0.0;
    for (std::size_t i = segments.segments[s].first; i < segments.segments[s].first + segments.segments[s].count; ++i) {
      if (std::abs(segments.points[i].azimuth_rad) < radians(135.01)) ranges_m += segments.points[i].range_m;
    }
    EXPECT_NEAR(network.infer(segments, {s})[0].rx_m, ranges_m, 1e-5 * ranges_m);
  }

  PaperNetworkDetector detector(Kind::kCircle, constant(Kind::kCircle, {0.0F, 0.0F, 0.3F}), EllipseFitParams{});
  EXPECT_EQ(detector.detect(segments).refused["outside the network's field of view"], 2U);
}

TEST_F(SensorFrameTest, OutputsAreEllipsesInTheSensorsFrame) {
  const std::vector<double> azimuths_rad = level_scanner(0.25);
  Segments segments = empty_segments(azimuths_rad);
  ASSERT_TRUE(append_segment({{1.0, 2.0}, 0.4, 0.3, 0.2}, azimuths_rad, nullptr, segments));
  const auto ellipse = [&](const std::vector<float>& answer) {
    return PaperNetwork(Kind::kEllipse, constant(Kind::kEllipse, answer)).infer(segments, {0})[0];
  };
  EXPECT_LT(characteristic_distance(ellipse({1.0F, 2.0F, 0.4F, 0.3F, 0.2F}), {{1.0, 2.0}, 0.4, 0.3, 0.2}), 1e-6);
  EXPECT_LT(characteristic_distance(ellipse({1.0F, 2.0F, 7.0F, 0.2F, 0.3F}), canonical({{1.0, 2.0}, 7.0, 0.2, 0.3})),
            1e-6);
  const Ellipse none = ellipse({1.0F, 2.0F, 0.4F, -0.3F, 0.0F});
  EXPECT_GE(none.rx_m, none.ry_m);
  EXPECT_GT(none.ry_m, 0.0);

  const Ellipse circle =
      PaperNetwork(Kind::kCircle, constant(Kind::kCircle, {1.0F, -2.0F, 0.25F})).infer(segments, {0})[0];
  EXPECT_LT((circle.center_m - Eigen::Vector2d(1.0, -2.0)).norm(), 1e-6);
  EXPECT_NEAR(circle.rx_m, 0.25, 1e-6);
  EXPECT_EQ(circle.rx_m, circle.ry_m);
}

TEST_F(SensorFrameTest, RefusesNetworksOfOtherShapes) {
  const std::string ellipse = constant(Kind::kEllipse, {});
  for (const auto& [kind, path] : {std::make_pair(Kind::kCircle, kModel), std::make_pair(Kind::kCircle, ellipse)}) {
    EXPECT_TRUE(names(refusal_of<std::runtime_error>([kind = kind, path = path] { PaperNetwork(kind, path); }),
                      {path, "5", "3", "1081"}));
  }
  EXPECT_THROW(PaperNetwork(Kind::kEllipse, write(AffineModel::zero(1080, 5))), std::runtime_error);
  EXPECT_THROW(PaperNetwork(Kind::kPolarEllipse, constant(Kind::kCircle, {})), std::runtime_error);
}

/// Each network by its detector, on one object with ends of every kind.
class PaperNetworkDetectorTest : public SensorFrameTest, public testing::WithParamInterface<Kind> {
 protected:
  const Ellipse truth_{{1.5, -1.0}, 0.0, 0.25, 0.25};
  const std::vector<float> answer_ = GetParam() == Kind::kCircle ? std::vector<float>{1.5F, -1.0F, 0.25F}
                                                                 : std::vector<float>{1.5F, -1.0F, 0.0F, 0.25F, 0.25F};

  PaperNetworkDetector detector() const {
    const bool polar = GetParam() == Kind::kPolarEllipse;
    return {GetParam(), polar ? kModel : constant(GetParam(), answer_), EllipseFitParams{}};
  }
};

TEST_P(PaperNetworkDetectorTest, DetectsEveryObjectWithAnyEnds) {
  const std::vector<double> azimuths_rad = level_scanner(0.25);
  PaperNetworkDetector detector = this->detector();
  for (const SegmentEnd right : {SegmentEnd::kFree, SegmentEnd::kOccluded, SegmentEnd::kScanEdge}) {
    for (const SegmentEnd left : {SegmentEnd::kBackground, SegmentEnd::kOccluded, SegmentEnd::kScanEdge}) {
      Segments segments = empty_segments(azimuths_rad);
      segments.stamp_ns = 123;
      segments.height_world_m = 1.5;
      segments.T_world_level = {{1.0, 2.0}, 0.3};
      for (int i = 0; i < 3; ++i) ASSERT_TRUE(append_segment(truth_, azimuths_rad, nullptr, segments));
      segments.segments[0].kind = SegmentKind::kStructure;
      for (Segment& segment : segments.segments) {
        segment.right_end = right;
        segment.left_end = left;
      }
      const Detections detections = detector.detect(segments);
      EXPECT_EQ(detections.stamp_ns, 123);
      EXPECT_EQ(detections.height_world_m, 1.5);
      EXPECT_EQ(detections.T_world_level.yaw_rad, 0.3);
      EXPECT_TRUE(detections.refused.empty());
      ASSERT_EQ(detections.detections.size(), 2U);
      for (std::size_t i = 0; i < 2; ++i) {
        const Detection& detection = detections.detections[i];
        EXPECT_EQ(detection.segment, i + 1);
        EXPECT_LT((detection.ellipse_level.center_m - truth_.center_m).norm(), 0.05);
        EXPECT_GT(detection.covariance.diagonal().minCoeff(), 0.0);
        EXPECT_EQ(detection.hidden_end, !is_silhouette(right) || !is_silhouette(left));
      }
    }
  }
  EXPECT_TRUE(detector.detect(Segments()).detections.empty());
}

TEST_P(PaperNetworkDetectorTest, RefusesParametersOutOfBounds) {
  EllipseFitParams params;
  params.max_radius_m = -1.0;
  EXPECT_THROW(PaperNetworkDetector(GetParam(),
                                    GetParam() == Kind::kPolarEllipse ? kModel : constant(GetParam(), answer_), params),
               std::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(EveryKind, PaperNetworkDetectorTest,
                         testing::Values(Kind::kEllipse, Kind::kCircle, Kind::kPolarEllipse));

}  // namespace
}  // namespace situation_awareness::paper_networks_test
