// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/probable_detector.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

namespace situation_awareness::probable_detector_test {
namespace {

/// Detects an ellipse of the given probability in each segment.
class Dice final : public Detector {
 public:
  explicit Dice(std::vector<double> p_ellipse) : p_ellipse_(std::move(p_ellipse)) {}

  void set_fit(const EllipseFitParams& /*fit*/) override {}

  void find(const Segments& /*segments*/, Detections& found) override {
    found.refused["ellipse too large"] = 3;
    for (std::size_t i = 0; i < p_ellipse_.size(); ++i) {
      Detection detection;
      detection.p_ellipse = p_ellipse_[i];
      detection.segment = i;
      found.detections.push_back(detection);
    }
  }

 private:
  std::vector<double> p_ellipse_;
};

TEST(ProbableDetector, KeepsProbableDetectionsInOrderAndCountsTheOthers) {
  Segments segments;
  segments.stamp_ns = 7;
  ProbableDetector detector(std::make_unique<Dice>(std::vector<double>{0.2, 0.6, std::nan(""), 0.59, 1.0}), 0.6,
                            EllipseFitParams{});
  const Detections detections = detector.detect(segments);
  EXPECT_EQ(detections.stamp_ns, 7);
  ASSERT_EQ(detections.detections.size(), 2U);
  EXPECT_EQ(detections.detections[0].segment, 1U);
  EXPECT_EQ(detections.detections[1].segment, 4U);
  EXPECT_EQ(detections.refused, (Counters{{"ellipse too large", 3}, {"not one ellipse", 3}}));
  ASSERT_EQ(detections.refused_segments.size(), 3U);
  const std::size_t refused[] = {0, 2, 3};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(detections.refused_segments[i].segment, refused[i]);
    EXPECT_STREQ(detections.refused_segments[i].why, "not one ellipse");
  }
}

TEST(ProbableDetector, AcceptsAnotherBound) {
  ProbableDetector detector(std::make_unique<Dice>(std::vector<double>{0.2, 0.6}), 0.6, EllipseFitParams{});
  EXPECT_EQ(detector.detect(Segments()).detections.size(), 1U);
  detector.set_min_p_ellipse(0.1);
  EXPECT_EQ(detector.detect(Segments()).detections.size(), 2U);
}

TEST(ProbableDetector, CountsOnlyRefusals) {
  ProbableDetector detector(std::make_unique<Dice>(std::vector<double>{0.0, 1.0}), 0.0, EllipseFitParams{});
  const Detections detections = detector.detect(Segments());
  EXPECT_EQ(detections.detections.size(), 2U);
  EXPECT_EQ(detections.refused.of("not one ellipse"), 0U);
}

}  // namespace
}  // namespace situation_awareness::probable_detector_test
