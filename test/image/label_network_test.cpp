// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/image/label_network.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "support/onnx_proto.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::label_network_test {
namespace {

namespace fs = std::filesystem;

constexpr int kStride = 16;

/// One convolution of stride 16 and softmax: the score of the second class is the mean of the normalised red times
/// `gain`, that of the first is 0.
struct MeanRedModel {
  float gain = 3.0F;
  float mean = 0.4F, deviation = 0.2F;

  double probability(double mean_red) const {
    return 1.0 / (1.0 + std::exp(-static_cast<double>(gain) * (mean_red / 255.0 - static_cast<double>(mean)) /
                                 static_cast<double>(deviation)));
  }

  std::string onnx() const {
    using namespace onnx_proto;
    constexpr std::size_t kArea = kStride * kStride;
    std::vector<float> weights(2 * 3 * kArea, 0.0F);
    std::fill_n(weights.begin() + 3 * kArea, kArea, gain / static_cast<float>(kArea));
    std::string graph = node("Conv", {"x", "W"}, "score",
                             integers("kernel_shape", {kStride, kStride}) + integers("strides", {kStride, kStride}));
    graph += node("Softmax", {"score"}, "p", integer("axis", 1));
    graph += text(2, "mean_red") + text(5, tensor("W", {2, 3, kStride, kStride}, weights.data(), weights.size()));
    graph += text(11, value_info("x", {3, 0, 0})) + text(12, value_info("p", {2, 0, 0}));
    return model(graph);
  }

  std::string manifest() const {
    std::ostringstream text;
    text.precision(9);
    text << "version: 1\nsha256: " << sha256_of(onnx())
         << "\ninput: {name: x, shape: [batch, 3, height, width], multiple: 32}\noutput: {name: p}\nstride: 16\n"
         << "classes: [background, car]\nnormalisation: {mean: [" << mean << ", 0, 0], deviation: [" << deviation
         << ", 1, 1]}\ngolden:\n  size: 32\n  output: [";
    std::vector<double> car;
    for (int y = 0; y < 32; y += kStride) {
      for (int x = 0; x < 32; x += kStride) {
        int sum = 0;
        for (int i = y; i < y + kStride; ++i) {
          for (int j = x; j < x + kStride; ++j) sum += (7 * j + 13 * i + j * i / 3) % 256;
        }
        car.push_back(probability(sum / 256.0));
      }
    }
    for (const double p : car) text << 1.0 - p << ", ";
    for (std::size_t i = 0; i < car.size(); ++i) text << car[i] << (i + 1 < car.size() ? ", " : "]\n");
    return text.str();
  }
};

class LabelNetworkTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        fs::path(testing::TempDir()) /
        ("situation_awareness_labels_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    write(model_.manifest());
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string path() const { return (folder_ / "red.onnx").string(); }

  void write(const std::string& manifest) const {
    std::ofstream(path(), std::ios::binary | std::ios::trunc) << model_.onnx();
    std::ofstream(folder_ / "red.manifest.yaml") << manifest;
  }

  LabelNetwork network(int width, int height) const {
    LabelNetworkParams params;
    params.width = width;
    params.height = height;
    return {path(), params};
  }

  std::string refusal() const {
    return refusal_of<std::runtime_error>([this] { network(64, 64); });
  }

  /// The manifest with one text in place of another.
  std::string manifest_with(const std::string& from, const std::string& to) const {
    std::string manifest = model_.manifest();
    const std::size_t at = manifest.find(from);
    EXPECT_NE(at, std::string::npos);
    return manifest.replace(at, from.size(), to);
  }

  static ColorImage image(int width, int height) {
    ColorImage image;
    image.stamp_ns = 123;
    image.camera.width = width;
    image.camera.height = height;
    image.camera.fx_px = image.camera.fy_px = width;
    image.camera.cx_px = 0.5 * width - 0.5;
    image.camera.cy_px = 0.5 * height - 0.5;
    image.rgb.resize(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    Random random(1);
    for (auto& number : image.rgb) number = static_cast<std::uint8_t>(random.uniform(0.0, 255.99));
    return image;
  }

  /// Mean of red in a part of the image.
  static double mean_red(const ColorImage& image, int left, int top, int width, int height) {
    double sum = 0.0;
    for (int y = top; y < top + height; ++y) {
      for (int x = left; x < left + width; ++x)
        sum += image.rgb[3 * static_cast<std::size_t>(y * image.camera.width + x)];
    }
    return sum / (width * height);
  }

  MeanRedModel model_;
  fs::path folder_;
};

TEST_F(LabelNetworkTest, LabelsImagesOfItsSize) {
  for (const auto& [width, height] : {std::pair(64, 64), std::pair(160, 96), std::pair(32, 224)}) {
    LabelNetwork network = this->network(width, height);
    ASSERT_EQ(network.class_names(), (std::vector<std::string>{"background", "car"}));
    const ColorImage image = this->image(width, height);
    const std::vector<SoftLabels>& labels = network.label(image);
    ASSERT_EQ(labels.size(), 2U);
    for (const SoftLabels& of_class : labels) {
      EXPECT_NO_THROW(check(of_class));
      EXPECT_EQ(of_class.stamp_ns, 123);
      EXPECT_EQ(of_class.camera.width, width / kStride);
      EXPECT_EQ(of_class.camera.height, height / kStride);
    }
    for (int row = 0; row < height / kStride; ++row) {
      for (int column = 0; column < width / kStride; ++column) {
        const auto pixel = static_cast<std::size_t>(row * (width / kStride) + column);
        const double expected = model_.probability(mean_red(image, kStride * column, kStride * row, kStride, kStride));
        EXPECT_NEAR(static_cast<double>(labels[1].probability[pixel]), expected, 1e-5);
        EXPECT_NEAR(static_cast<double>(labels[0].probability[pixel]), 1.0 - expected, 1e-5);
      }
    }
  }
}

// The mean of an area does not depend on the size that it is shrunk to.
TEST_F(LabelNetworkTest, ScalesImages) {
  const ColorImage image = this->image(320, 192);
  LabelNetwork network = this->network(160, 32);
  const SoftLabels labels = network.label(image).at(1);
  for (int row = 0; row < 2; ++row) {
    for (int column = 0; column < 10; ++column) {
      const double expected = model_.probability(mean_red(image, 32 * column, 96 * row, 32, 96));
      // The shrunk image is rounded to whole numbers.
      EXPECT_NEAR(static_cast<double>(labels.probability[static_cast<std::size_t>(10 * row + column)]), expected, 0.01);
    }
  }
  // A point of the image is at the same part of its width and height in the labels.
  EXPECT_NEAR(labels.camera.fx_px, image.camera.fx_px / 32.0, 1e-12);
  EXPECT_NEAR(labels.camera.fy_px, image.camera.fy_px / 96.0, 1e-12);
  EXPECT_NEAR(labels.camera.cx_px, 4.5, 1e-12);
  EXPECT_NEAR(labels.camera.cy_px, 0.5, 1e-12);
}

TEST_F(LabelNetworkTest, TakesImagesOfAnySizeAfterOneAnother) {
  LabelNetwork network = this->network(64, 64);
  for (const auto& [width, height] : {std::pair(64, 64), std::pair(17, 300), std::pair(1, 1), std::pair(64, 64)}) {
    ColorImage image = this->image(width, height);
    for (std::size_t i = 0; i < image.rgb.size(); i += 3) image.rgb[i] = 130;
    for (const float p : network.label(image)[1].probability) {
      EXPECT_NEAR(static_cast<double>(p), model_.probability(130), 1e-5);
    }
  }
}

TEST_F(LabelNetworkTest, RefusesImagesThatCannotBeUsed) {
  LabelNetwork network = this->network(64, 64);
  ColorImage image = this->image(40, 30);
  image.rgb.pop_back();
  EXPECT_TRUE(names(refusal_of<std::invalid_argument>([&] { network.label(image); }), {"numbers", "1200 pixels"}));
  EXPECT_TRUE(names(refusal_of<std::invalid_argument>([&] { network.label(ColorImage()); }), {"size"}));
}

TEST_F(LabelNetworkTest, NamesClasses) {
  const LabelNetwork network = this->network(64, 64);
  EXPECT_EQ(network.index_of("car"), 1U);
  EXPECT_TRUE(names(refusal_of<std::invalid_argument>([&] { network.index_of("cat"); }), {"'cat'", "background, car"}));
}

TEST_F(LabelNetworkTest, RefusesSizes) {
  const auto refusal_for = [this](int width, int height) {
    return refusal_of<std::invalid_argument>([&] { network(width, height); });
  };
  EXPECT_TRUE(names(refusal_for(40, 64), {"label_network.width", "40", "multiple of 32"}));
  EXPECT_TRUE(names(refusal_for(64, 48), {"label_network.height", "48", "multiple of 32"}));
  EXPECT_TRUE(names(refusal_for(64, 8192), {"label_network.height", "4096"}));
  write(manifest_with("multiple: 32", "multiple: 64"));
  EXPECT_TRUE(names(refusal(), {"golden image"}));
}

TEST_F(LabelNetworkTest, RefusesDamagedFiles) {
  std::ofstream(path(), std::ios::binary | std::ios::app) << ' ';
  EXPECT_TRUE(names(refusal(), {path(), "SHA-256"}));
  fs::remove(path());
  EXPECT_TRUE(names(refusal(), {path(), "cannot be read"}));
}

TEST_F(LabelNetworkTest, RefusesManifestsOfOtherNetworks) {
  for (const auto& [from, to, reason] :
       std::vector<std::array<std::string, 3>>{{"3, height, width", "1, 1, 10", "shape"},
                                               {"classes: [background, car]", "classes: []", "no classes"},
                                               {"deviation: [", "deviation: [0, ", "three numbers"},
                                               {"background, car", "background, car, tree", "golden answer"},
                                               {"stride: 16", "stride: 0", "stride"},
                                               {"version: 1", "version: 2", "version 2"}}) {
    write(manifest_with(from, to));
    EXPECT_TRUE(names(refusal(), {(folder_ / "red.manifest.yaml").string(), reason}));
  }
  write(manifest_with("name: p", "name: q"));
  EXPECT_TRUE(names(refusal(), {path(), "'q'"}));
}

TEST_F(LabelNetworkTest, RefusesAWrongGoldenAnswer) {
  write(manifest_with("mean: [0.4", "mean: [0.41"));
  EXPECT_TRUE(names(refusal(), {path(), "golden"}));
}

}  // namespace
}  // namespace situation_awareness::label_network_test
