// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/network.hpp"

#include <gtest/gtest.h>

#include <string>

#include "support/lone_segments.hpp"

namespace situation_awareness {
namespace {

const std::string kModel = SITUATION_AWARENESS_SOURCE_DIR "/models/ellipse_vgg.onnx";

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
  const std::vector<Ellipse> answers = PaperNetwork(PaperNetwork::Kind::kPolarEllipse, kModel).infer(segments, {0, 1});
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
