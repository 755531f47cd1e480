// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <filesystem>
#include <stdexcept>
#include <string>

#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "support/affine_model.hpp"
#include "support/lone_segments.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::make_detector_test {
namespace {

namespace fs = std::filesystem;

/// A folder with a model for every detector that needs one: networks with a constant ellipse as output.
class MakeDetectorTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / (std::string("situation_awareness_make_detector_") +
                                              testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    for (const char* name : {"paper_vgg.onnx", "paper_alex.onnx", "paper_circle.onnx", "other.onnx"}) {
      const bool circle = std::string(name) == "paper_circle.onnx";
      AffineModel model = AffineModel::zero(1081, circle ? 3 : 5);
      model.b(0) = name == std::string("other.onnx") ? 2.1F : 2.0F;
      model.b.tail(circle ? 1 : 2).setConstant(0.2F);
      model.write(folder_ / name);
    }
    const fs::path models = SITUATION_AWARENESS_SOURCE_DIR "/models";
    for (const char* name : {"ellipse.onnx", "ellipse.manifest.yaml", "shape.onnx", "shape.manifest.yaml",
                             "paper_vgg_polar.onnx", "paper_vgg_polar.manifest.yaml"}) {
      fs::copy_file(models / name, folder_ / name);
    }
  }

  void TearDown() override { fs::remove_all(folder_); }

  DetectionParams params(const std::string& detector) const {
    DetectionParams params;
    params.detector = detector;
    params.model_folder = folder_.string();
    return params;
  }

  static std::string refusal(const DetectionParams& params) {
    return refusal_of<std::exception>([&] { make_detector(params); });
  }

  fs::path folder_;
};

TEST_F(MakeDetectorTest, EveryNameMakesADetectorThatDetectsAnEllipse) {
  const std::vector<double> azimuths_rad = level_scanner(0.25);
  Segments segments = empty_segments(azimuths_rad);
  ASSERT_TRUE(append_segment({{2.0, 0.0}, 0.0, 0.2, 0.2}, azimuths_rad, nullptr, segments));
  for (const std::string& name : detector_names()) {
    const Detections detections = make_detector(params(name))->detect(segments);
    ASSERT_EQ(detections.detections.size(), 1U) << name;
    EXPECT_LT((detections.detections[0].ellipse_level.center_m - Eigen::Vector2d(2.0, 0.0)).norm(), 0.05) << name;
  }
}

TEST_F(MakeDetectorTest, EveryDetectorTakesOtherFitParameters) {
  const std::vector<double> azimuths_rad = level_scanner(0.25);
  Segments segments = empty_segments(azimuths_rad);
  ASSERT_TRUE(append_segment({{2.0, 0.0}, 0.0, 0.2, 0.2}, azimuths_rad, nullptr, segments));
  for (const std::string& name : detector_names()) {
    const auto detector = make_detector(params(name));
    EllipseFitParams fit = params(name).fit;
    fit.max_radius_m = 0.02;
    detector->set_fit(fit);
    EXPECT_TRUE(detector->detect(segments).detections.empty()) << name;
    EXPECT_EQ(detector->model_sha256().size(), model_path(params(name)).empty() ? 0U : 64U) << name;
    detector->set_fit(params(name).fit);
    EXPECT_EQ(detector->detect(segments).detections.size(), 1U) << name;
  }
}

TEST_F(MakeDetectorTest, AnUnknownNameIsRefusedWithTheKnownOnes) {
  EXPECT_THROW(make_detector(params("magic")), std::invalid_argument);
  ASSERT_FALSE(detector_names().empty());
  EXPECT_TRUE(names(refusal(params("magic")), {"detections.detector", "magic"}));
  EXPECT_TRUE(names(refusal(params("magic")), detector_names()));
  EXPECT_TRUE(names(refusal(params("")), {"detections.detector"}));
}

TEST_F(MakeDetectorTest, AModelReplacesTheDetectorsOwn) {
  const std::vector<double> azimuths_rad = level_scanner(0.25);
  Segments segments = empty_segments(azimuths_rad);
  ASSERT_TRUE(append_segment({{2.1, 0.0}, 0.0, 0.2, 0.2}, azimuths_rad, nullptr, segments));
  DetectionParams other = params("vgg");
  for (const std::string& model : {std::string("other.onnx"), (folder_ / "other.onnx").string()}) {
    other.model = model;
    const Detections detections = make_detector(other)->detect(segments);
    ASSERT_EQ(detections.detections.size(), 1U);
    EXPECT_NEAR(detections.detections[0].ellipse_level.center_m.x(), 2.1, 1e-6);
  }
  other.model = "none.onnx";
  EXPECT_TRUE(names(refusal(other), {(folder_ / "none.onnx").string()}));
  other = params("least_squares");
  other.model = "other.onnx";
  EXPECT_TRUE(names(refusal(other), {"detections.model", "other.onnx", "detections.detector", "least_squares"}));
}

TEST_F(MakeDetectorTest, ParametersOutOfBoundsAreRefusedByName) {
  DetectionParams wrong = params("least_squares");
  wrong.min_p_ellipse = -0.1;
  EXPECT_TRUE(names(refusal(wrong), {"detections.min_p_ellipse", "-0.1", "0", "1"}));
  wrong = params("least_squares");
  wrong.fit.range_sigma_m = 0.0;
  EXPECT_TRUE(names(refusal(wrong), {"detections.fit.range_sigma_m", "0", "1e-04", "1"}));
}

}  // namespace
}  // namespace situation_awareness::make_detector_test
