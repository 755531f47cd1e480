// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/detections.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "situation_awareness/detections/least_squares.hpp"

namespace situation_awareness::detections_test {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

Detection good() {
  Detection detection;
  detection.ellipse_level = {{3.0, 1.0}, 0.4, 0.3, 0.2};
  detection.covariance = 1e-4 * Matrix5d::Identity();
  detection.beams = 20;
  return detection;
}

template <class Spoil>
std::string defect_of(Spoil&& spoil) {
  Detection detection = good();
  spoil(detection);
  return detection_defect(detection);
}

TEST(DetectionDefect, NamesTheDefectOfADetection) {
  EXPECT_EQ(defect_of([](Detection&) {}), "");
  EXPECT_EQ(defect_of([](Detection& d) { d.ellipse_level.center_m.x() = kNaN; }), "ellipse not finite");
  EXPECT_EQ(defect_of([](Detection& d) { d.ellipse_level.rx_m = kNaN; }), "ellipse not finite");
  EXPECT_EQ(defect_of([](Detection& d) { d.residual_rms_m = kNaN; }), "ellipse not finite");
  EXPECT_EQ(defect_of([](Detection& d) { d.covariance(1, 2) = kNaN; }), "ellipse not finite");
  EXPECT_EQ(defect_of([](Detection& d) { d.ellipse_level.ry_m = 0.0; }), "radii not rx >= ry > 0");
  EXPECT_EQ(defect_of([](Detection& d) { d.ellipse_level.ry_m = 0.4; }), "radii not rx >= ry > 0");
  EXPECT_EQ(defect_of([](Detection& d) { d.p_ellipse = 1.1; }), "p_ellipse not in [0, 1]");
  EXPECT_EQ(defect_of([](Detection& d) { d.covariance(2, 2) = -1e-4; }), "covariance not usable");
  EXPECT_EQ(defect_of([](Detection& d) { d.covariance(2, 2) = 0.0; }), "covariance not usable");
  EXPECT_EQ(defect_of([](Detection& d) { d.covariance *= 1e9; }), "covariance not usable") << "316 m";
  EXPECT_EQ(defect_of([](Detection& d) { d.covariance(0, 1) = 5e-5; }), "covariance not usable") << "not symmetric";
  EXPECT_EQ(defect_of([](Detection& d) { d.covariance(0, 1) = d.covariance(1, 0) = 2e-4; }), "covariance not usable")
      << "a correlation of 2";
}

// A network's output may have any value.
TEST(DetectionDefect, IsOneForEveryDetector) {
  Detection detection = good();
  EXPECT_STREQ(detection_defect(detection, EllipseFitParams{}), "");
  detection.ellipse_level.rx_m = detection.ellipse_level.ry_m = kNaN;
  EXPECT_STREQ(detection_defect(detection, EllipseFitParams{}), "ellipse not finite");
}

}  // namespace
}  // namespace situation_awareness::detections_test
