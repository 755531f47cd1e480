// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/dense_layers.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include <opencv2/dnn.hpp>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/detections/onnx_model.hpp"

namespace situation_awareness::dense_layers_test {
namespace {

using Rows = DenseLayers::Rows;

Rows random_rows(Eigen::Index rows, Eigen::Index columns, Random& random) {
  Rows result(rows, columns);
  for (float& value : result.reshaped()) value = static_cast<float>(random.normal());
  return result;
}

struct Layer {
  Rows A;
  Eigen::VectorXf b;
  bool relu;
};

/// Three layers of widths that are and are not multiples of a tile's.
std::vector<Layer> three_layers() {
  Random random(1);
  std::vector<Layer> layers;
  const std::vector<Eigen::Index> widths{7, 33, 16, 5};
  for (std::size_t i = 0; i + 1 < widths.size(); ++i) {
    layers.push_back({random_rows(widths[i + 1], widths[i], random), random_rows(widths[i + 1], 1, random), i < 2});
  }
  return layers;
}

DenseLayers built_of(const std::vector<Layer>& layers) {
  DenseLayers result;
  for (const auto& [A, b, relu] : layers) result.add(A, b, relu);
  return result;
}

TEST(DenseLayers, AreTheProductsOfTheirMatrices) {
  const std::vector<Layer> layers = three_layers();
  DenseLayers network = built_of(layers);
  ASSERT_EQ(network.inputs(), 7);
  ASSERT_EQ(network.outputs(), 5);
  Random random(2);
  for (const int rows : {1, 3, 4, 11, 2, 43}) {
    const Rows inputs = random_rows(rows, 7, random);
    Eigen::MatrixXd expected = inputs.cast<double>();
    for (const auto& [A, b, relu] : layers) {
      expected = (expected * A.cast<double>().transpose()).rowwise() + b.cast<double>().transpose();
      if (relu) expected = expected.cwiseMax(0.0);
    }
    const Eigen::Map<const Rows> outputs(network.forward(inputs.data(), rows), rows, 5);
    EXPECT_LT((outputs.cast<double>() - expected).cwiseAbs().maxCoeff(), 1e-6 * expected.cwiseAbs().maxCoeff());
  }
}

TEST(DenseLayers, ARowDoesNotDependOnTheOthers) {
  DenseLayers network = built_of(three_layers());
  Random random(3);
  constexpr int kRows = 43;  // large enough for all products that a processor may have
  const Rows inputs = random_rows(kRows, 7, random);
  const Rows together = Eigen::Map<const Rows>(network.forward(inputs.data(), kRows), kRows, 5);
  for (int row = 0; row < kRows; ++row) {
    const Rows input = inputs.row(row);
    const Rows alone = Eigen::Map<const Rows>(network.forward(input.data(), 1), 1, 5);
    EXPECT_EQ(alone, together.row(row)) << row;
  }
}

TEST(DenseLayers, RefuseALayerThatDoesNotFit) {
  DenseLayers network;
  EXPECT_THROW(network.add(Rows(0, 3), Eigen::VectorXf(0), false), std::invalid_argument);
  EXPECT_THROW(network.add(Rows::Zero(2, 3), Eigen::VectorXf::Zero(3), false), std::invalid_argument);
  EXPECT_TRUE(network.empty());
  network.add(Rows::Zero(2, 3), Eigen::VectorXf::Zero(2), false);
  EXPECT_THROW(network.add(Rows::Zero(2, 3), Eigen::VectorXf::Zero(2), false), std::invalid_argument);
  EXPECT_EQ(network.outputs(), 2);
}

// OpenCV dnn runs the shipped network as the oracle.
TEST(DenseLayers, AnswerAsOpenCvDoes) {
  const std::string path = SITUATION_AWARENESS_SOURCE_DIR "/models/ellipse.onnx";
  OnnxModel model(path);
  cv::dnn::Net oracle = cv::dnn::readNetFromONNX(path);
  Random random(4);
  constexpr int kRows = 50;
  float* const inputs = model.resize(kRows);
  for (int i = 0; i < kRows * model.inputs(); ++i) inputs[i] = static_cast<float>(random.uniform(-1.0, 1.0));
  oracle.setInput(cv::Mat(kRows, model.inputs(), CV_32F, inputs));
  const cv::Mat expected = oracle.forward();
  ASSERT_EQ(expected.cols, model.outputs());
  const float* const answers = model.forward();
  for (int i = 0; i < kRows * model.outputs(); ++i) {
    const float value = expected.ptr<float>()[i];
    EXPECT_NEAR(answers[i], value, 1e-5F * std::max(1.0F, std::abs(value))) << i;
  }
}

}  // namespace
}  // namespace situation_awareness::dense_layers_test
