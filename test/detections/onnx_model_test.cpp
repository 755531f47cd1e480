// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/onnx_model.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "situation_awareness/common/random.hpp"
#include "support/affine_model.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::onnx_model_test {
namespace {

namespace fs = std::filesystem;

const std::string kModel = SITUATION_AWARENESS_SOURCE_DIR "/models/paper_vgg_polar.onnx";

/// A copy of the published model to be damaged by a test.
class ModelFileTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) /
              ("situation_awareness_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    onnx_ = folder_ / "paper_vgg_polar.onnx";
    manifest_ = folder_ / "paper_vgg_polar.manifest.yaml";
    fs::copy_file(kModel, onnx_);
    fs::copy_file(fs::path(kModel).replace_extension(".manifest.yaml"), manifest_);
  }

  void TearDown() override { fs::remove_all(folder_); }

  static std::string read(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }

  static void write(const fs::path& path, const std::string& content) {
    std::ofstream(path, std::ios::binary | std::ios::trunc) << content;
  }

  /// The message of the exception on loading.
  std::string refusal() const {
    return refusal_of<std::runtime_error>([this] { OnnxModel model(onnx_.string()); });
  }

  fs::path folder_;
  fs::path onnx_;
  fs::path manifest_;
};

TEST_F(ModelFileTest, LoadsIntactFiles) { EXPECT_NO_THROW(OnnxModel{onnx_.string()}); }

TEST_F(ModelFileTest, RefusesAFlippedBit) {
  std::string content = read(onnx_);
  for (const std::size_t byte : {std::size_t{0}, content.size() / 2, content.size() - 1}) {
    content[byte] = static_cast<char>(content[byte] ^ 0x10);
    write(onnx_, content);
    EXPECT_TRUE(names(refusal(), {onnx_.string(), "SHA-256"}));
    content[byte] = static_cast<char>(content[byte] ^ 0x10);
  }
}

TEST_F(ModelFileTest, RefusesATruncatedFile) {
  fs::resize_file(onnx_, fs::file_size(onnx_) - 1000);
  EXPECT_TRUE(names(refusal(), {onnx_.string(), "SHA-256"}));
  fs::resize_file(onnx_, 0);
  EXPECT_TRUE(names(refusal(), {onnx_.string(), "SHA-256"}));
}

TEST_F(ModelFileTest, RefusesAMissingFile) {
  fs::remove(onnx_);
  EXPECT_TRUE(names(refusal(), {onnx_.string()}));
  fs::create_directory(onnx_);
  EXPECT_TRUE(names(refusal(), {onnx_.string()}));
}

TEST_F(ModelFileTest, RefusesAMissingManifest) {
  fs::remove(manifest_);
  EXPECT_TRUE(names(refusal(), {manifest_.string()}));
}

TEST_F(ModelFileTest, RefusesADamagedManifest) {
  const std::string content = read(manifest_);
  for (const std::string& damaged :
       {std::string(), std::string("a: [1, 2"), content.substr(0, content.find("output: ["))}) {
    write(manifest_, damaged);
    EXPECT_TRUE(names(refusal(), {manifest_.string()}));
  }
}

TEST_F(ModelFileTest, RefusesAWrongOutputForTheGoldenVector) {
  std::string content = read(manifest_);
  const std::size_t golden = content.find("  output: [");
  ASSERT_NE(golden, std::string::npos);
  content.replace(golden, 11, "  output: [1");
  write(manifest_, content);
  EXPECT_TRUE(names(refusal(), {onnx_.string(), "golden"}));
}

// A file with a valid manifest that is no network: the importer's error becomes one message, too.
TEST_F(ModelFileTest, RefusesOtherFiles) {
  write(onnx_, "no network at all");
  const std::string hex = sha256_of(read(onnx_));
  std::string manifest = read(manifest_);
  const std::size_t at = manifest.find("sha256: ") + 8;
  manifest.replace(at, hex.size(), hex);
  write(manifest_, manifest);
  EXPECT_TRUE(names(refusal(), {onnx_.string()}));
}

/// A network with known outputs, in both shapes of input.
class AffineModelTest : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    fs::path name = testing::UnitTest::GetInstance()->current_test_info()->name();
    std::string folder = "situation_awareness_affine_" + name.string();
    std::replace(folder.begin(), folder.end(), '/', '_');
    folder_ = fs::path(testing::TempDir()) / folder;
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    Random random(1);
    affine_ = AffineModel::zero(7, 3);
    affine_.image_like = GetParam();
    for (float& value : affine_.A.reshaped()) value = static_cast<float>(random.normal());
    for (float& value : affine_.b) value = static_cast<float>(random.normal());
  }

  void TearDown() override { fs::remove_all(folder_); }

  std::string path() const { return (folder_ / "affine.onnx").string(); }
  std::string manifest_path() const { return (folder_ / "affine.manifest.yaml").string(); }

  std::string refusal(const std::string& part, const std::string& instead) const {
    affine_.write(path());
    std::string manifest = affine_.manifest();
    const std::size_t at = manifest.find(part);
    if (at == std::string::npos) return "'" + part + "' is not in the manifest";
    std::ofstream(manifest_path()) << manifest.replace(at, part.size(), instead);
    return refusal_of<std::runtime_error>([this] { OnnxModel model(path()); });
  }

  fs::path folder_;
  AffineModel affine_;
};

TEST_P(AffineModelTest, AnswersEveryRowOfABatch) {
  affine_.write(path());
  OnnxModel model(path());
  ASSERT_EQ(model.inputs(), 7);
  ASSERT_EQ(model.outputs(), 3);
  Random random(2);
  for (const int rows : {1, 5, 2}) {  // a batch may be smaller than the one before
    float* const inputs = model.resize(rows, -1.0F);
    Eigen::MatrixXf X = Eigen::MatrixXf::Constant(7, rows, -1.0F);
    for (int row = 0; row < rows; ++row) {
      inputs[7 * row + row % 7] = X(row % 7, row) = static_cast<float>(random.normal());
    }
    const Eigen::MatrixXf Y = (affine_.A * X).colwise() + affine_.b;
    const Eigen::Map<const Eigen::MatrixXf> answers(model.forward(), 3, rows);
    EXPECT_LT((answers - Y).cwiseAbs().maxCoeff(), 1e-5F);
  }
}

TEST_P(AffineModelTest, StartsEveryBatchAnew) {
  affine_.write(path());
  OnnxModel model(path());
  std::fill_n(model.resize(3), 21, 5.0F);
  model.forward();
  const float* const inputs = model.resize(3);
  EXPECT_TRUE(std::all_of(inputs, inputs + 21, [](float x) { return x == 0.0F; }));
}

TEST_P(AffineModelTest, TheGoldenVectorMayBeFilled) {
  affine_.fill = -1.0F;
  affine_.write(path());
  EXPECT_NO_THROW(OnnxModel{path()});
  EXPECT_TRUE(names(refusal("fill: -1", "fill: 1"), {path(), "golden"}));
  EXPECT_TRUE(names(refusal("  fill: -1\n", ""), {path(), "golden"})) << "0 where it is left out";
  EXPECT_TRUE(names(refusal("fill: -1", "fill: .nan"), {path(), "golden"}));
}

TEST_P(AffineModelTest, RefusesOtherNamesThanTheManifests) {
  EXPECT_TRUE(names(refusal("name: x", "name: z"), {path()}));
  EXPECT_TRUE(names(refusal("name: y", "name: z"), {path(), "z"}));
}

TEST_P(AffineModelTest, RefusesOtherShapesThanTheManifests) {
  EXPECT_TRUE(names(refusal("7]", "8]"), {path()}));
  EXPECT_TRUE(names(refusal("7]", "6]"), {path()}));
  EXPECT_TRUE(names(refusal("3]", "4]"), {manifest_path(), "golden", "shape"}));
  const std::string input = GetParam() ? "1, 1, 7]" : "7]";
  for (const char* shape : {"2, 1, 7]", "1, 7]", "0]", "-7]", "1, 1, 2000000000]", "seven]"}) {
    EXPECT_TRUE(names(refusal(input, shape), {manifest_path()})) << shape;
  }
  EXPECT_TRUE(names(refusal("[batch", "[7"), {manifest_path()}));
  EXPECT_TRUE(names(refusal("[batch, 3]", "[batch, 1, 1, 3]"), {manifest_path()}));
}

TEST_P(AffineModelTest, RefusesAGoldenVectorThatDoesNotFit) {
  EXPECT_TRUE(names(refusal("first: 0", "first: 7"), {manifest_path(), "golden"}));
  EXPECT_TRUE(names(refusal("first: 0", "first: -1"), {manifest_path(), "golden"}));
  EXPECT_TRUE(names(refusal("first: 0", "first: 1"), {path(), "golden"}));
  EXPECT_TRUE(names(refusal("output: [", "output: [0, "), {manifest_path(), "golden"}));
}

INSTANTIATE_TEST_SUITE_P(BothShapes, AffineModelTest, testing::Bool());

// A nodelet manager has its own threads: the forward must not use further ones.
TEST(OnnxModel, StaysOnTheCallingThread) {
  const auto threads = [] {
    const fs::path tasks = "/proc/self/task";
    return fs::exists(tasks) ? std::distance(fs::directory_iterator(tasks), fs::directory_iterator()) : 0;
  };
  OnnxModel model(kModel);
  const auto before = threads();
  model.resize(50);
  model.forward();
  EXPECT_EQ(threads(), before);
}

}  // namespace
}  // namespace situation_awareness::onnx_model_test
