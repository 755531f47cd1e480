// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/image/label_network.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <utility>

#include <opencv2/core.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/dnn.hpp>
#include <opencv2/imgproc.hpp>

#include "situation_awareness/common/model_file.hpp"

namespace situation_awareness {
namespace {

constexpr int kMultiple = 32;  // of the parameters
// Of probabilities. Processors differ by 1e-6, damaged weights by more.
constexpr double kLabelTolerance = 1e-4;
constexpr int kMaxGoldenSize = 1024, kMaxStride = 256;

struct LabelManifest {
  std::string input, output;
  int multiple = 1, stride = 1;
  std::vector<std::string> classes;
  std::array<float, 3> mean{}, deviation{};
  int golden_size = 0;
  std::vector<float> golden;
};

std::array<float, 3> read_colors(const YAML::Node& node) {
  const auto numbers = node.as<std::vector<float>>();
  if (numbers.size() != 3) throw std::runtime_error("a normalisation does not have three numbers");
  return {numbers[0], numbers[1], numbers[2]};
}

LabelManifest read_label_manifest(const ModelFile& file) {
  LabelManifest manifest;
  try {
    const YAML::Node root = YAML::Load(file.manifest);
    const auto image_shape = root["input"]["shape"].as<std::vector<std::string>>();
    if (image_shape != std::vector<std::string>{"batch", "3", "height", "width"}) {
      throw std::runtime_error("the input's shape is not [batch, 3, height, width]");
    }
    manifest.input = root["input"]["name"].as<std::string>();
    manifest.multiple = root["input"]["multiple"].as<int>();
    manifest.output = root["output"]["name"].as<std::string>();
    manifest.stride = root["stride"].as<int>();
    manifest.classes = root["classes"].as<std::vector<std::string>>();
    manifest.mean = read_colors(root["normalisation"]["mean"]);
    manifest.deviation = read_colors(root["normalisation"]["deviation"]);
    manifest.golden_size = root["golden"]["size"].as<int>();
    manifest.golden = root["golden"]["output"].as<std::vector<float>>();
    if (manifest.stride < 1 || manifest.stride > kMaxStride || manifest.multiple < manifest.stride ||
        manifest.multiple % manifest.stride != 0) {
      throw std::runtime_error("its stride or multiple cannot be used");
    }
    if (manifest.golden_size < 1 || manifest.golden_size > kMaxGoldenSize ||
        manifest.golden_size % manifest.multiple != 0) {
      throw std::runtime_error("the size of its golden image cannot be used");
    }
    if (manifest.classes.empty()) throw std::runtime_error("it has no classes");
    for (const float deviation : manifest.deviation) {
      if (!std::isfinite(deviation) || deviation <= 0.0F) throw std::runtime_error("a deviation is not above 0");
    }
    const auto side = static_cast<std::size_t>(manifest.golden_size / manifest.stride);
    if (manifest.golden.size() != manifest.classes.size() * side * side) {
      throw std::runtime_error("its golden answer does not have the network's shape");
    }
  } catch (const std::exception& error) {
    throw std::runtime_error(file.manifest_path + ": not a manifest of a network that labels images (" + error.what() +
                             ")");
  }
  return manifest;
}

std::vector<std::uint8_t> golden_image(int size) {
  std::vector<std::uint8_t> rgb;
  rgb.reserve(3 * static_cast<std::size_t>(size) * static_cast<std::size_t>(size));
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      for (int c = 0; c < 3; ++c) rgb.push_back(static_cast<std::uint8_t>((7 * x + 13 * y + 61 * c + x * y / 3) % 256));
    }
  }
  return rgb;
}

}  // namespace

void LabelNetworkParams::validate() const {
  check_bounds(*this, "label_network");
  for (const auto& [name, size] : {std::pair("width", width), std::pair("height", height)}) {
    if (size % kMultiple == 0) continue;
    throw std::invalid_argument(std::string("label_network.") + name + " = " + std::to_string(size) +
                                " is not a multiple of " + std::to_string(kMultiple));
  }
}

class LabelNetwork::Impl {
 public:
  Impl(const std::string& onnx_path, const LabelNetworkParams& params) : params_((params.validate(), params)) {
    const ModelFile file = read_model_file(onnx_path);
    sha256_ = file.sha256;
    manifest_ = read_label_manifest(file);
    if (params.width % manifest_.multiple != 0 || params.height % manifest_.multiple != 0) {
      throw std::runtime_error(onnx_path + ": not for images of " + std::to_string(params.width) + " x " +
                               std::to_string(params.height) + ", which are not multiples of " +
                               std::to_string(manifest_.multiple));
    }
    labels_.resize(manifest_.classes.size());
    try {
      net_ = cv::dnn::readNetFromONNX(file.onnx.data(), file.onnx.size());
      net_.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
      net_.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
      if (net_.getUnconnectedOutLayersNames() != std::vector<std::string>{manifest_.output}) {
        throw std::runtime_error("its only output is not '" + manifest_.output + "'");
      }
      check_golden();
    } catch (const cv::Exception& error) {  // its what() is too long for a message
      throw std::runtime_error(onnx_path + ": not usable as a network (" + error.err + ")");
    } catch (const std::exception& error) {
      throw std::runtime_error(onnx_path + ": not usable as a network (" + error.what() + ")");
    }
  }

  const LabelNetworkParams& params() const { return params_; }
  const std::vector<std::string>& class_names() const { return manifest_.classes; }
  const std::string& file_sha256() const { return sha256_; }

  const std::vector<SoftLabels>& label(const ColorImage& image) {
    check(image);
    forward(image.rgb, image.camera.width, image.camera.height, params_.width, params_.height);
    const int width = params_.width / manifest_.stride, height = params_.height / manifest_.stride;
    const PinholeCamera camera = scaled(image.camera, width, height);
    const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    const float* probability = output_.ptr<float>();
    for (SoftLabels& labels : labels_) {
      labels.stamp_ns = image.stamp_ns;
      labels.camera = camera;
      labels.probability.assign(probability, probability + pixels);
      probability += pixels;
    }
    return labels_;
  }

 private:
  void check_golden() {
    const int size = manifest_.golden_size;
    forward(golden_image(size), size, size, size, size);
    const float* const answer = output_.ptr<float>();
    for (std::size_t i = 0; i < manifest_.golden.size(); ++i) {
      if (std::abs(answer[i] - manifest_.golden[i]) <= kLabelTolerance) continue;  // false for NaN
      throw std::runtime_error("its output for the golden image of its manifest is wrong");
    }
  }

  void forward(const std::vector<std::uint8_t>& rgb, int width, int height, int input_width, int input_height) {
    const cv::Mat image(height, width, CV_8UC3, const_cast<std::uint8_t*>(rgb.data()));
    // One iteration on the calling thread, as in src/detections/onnx_model.cpp.
    cv::parallel_for_(cv::Range(0, 1), [&](const cv::Range&) {
      const cv::Size size(input_width, input_height);
      const cv::Mat* pixels = &image;
      if (size != image.size()) {
        // Of several pixels their mean, so that fine patterns do not become coarse ones.
        const bool shrinks = size.width < width || size.height < height;
        cv::resize(image, scaled_, size, 0.0, 0.0, shrinks ? cv::INTER_AREA : cv::INTER_LINEAR);
        pixels = &scaled_;
      }
      fill_input(*pixels);
      net_.setInput(input_, manifest_.input);
      net_.forward(output_);
    });
    const std::array<int, 4> expected = {1, static_cast<int>(manifest_.classes.size()), input_height / manifest_.stride,
                                         input_width / manifest_.stride};
    if (output_.dims != 4 || !std::equal(expected.begin(), expected.end(), output_.size.p) ||
        output_.type() != CV_32F || !output_.isContinuous()) {
      throw std::runtime_error("its output does not have a number for each class and label pixel");
    }
  }

  /// Three planes of normalised numbers.
  void fill_input(const cv::Mat& rgb) {
    const std::array<int, 4> shape = {1, 3, rgb.rows, rgb.cols};
    input_.create(4, shape.data(), CV_32F);
    float* to = input_.ptr<float>();
    for (std::size_t c = 0; c < 3; ++c) {
      const float scale = 1.0F / (255.0F * manifest_.deviation[c]);
      const float offset = manifest_.mean[c] / manifest_.deviation[c];
      for (int row = 0; row < rgb.rows; ++row) {
        const std::uint8_t* from = rgb.ptr<std::uint8_t>(row) + c;
        for (int column = 0; column < rgb.cols; ++column, from += 3) {
          *to++ = scale * static_cast<float>(*from) - offset;
        }
      }
    }
  }

  LabelNetworkParams params_;
  std::string sha256_;
  LabelManifest manifest_;
  cv::dnn::Net net_;
  cv::Mat scaled_, input_, output_;
  std::vector<SoftLabels> labels_;
};

LabelNetwork::LabelNetwork(const std::string& onnx_path, const LabelNetworkParams& params)
    : impl_(std::make_unique<Impl>(onnx_path, params)) {}
LabelNetwork::~LabelNetwork() = default;
LabelNetwork::LabelNetwork(LabelNetwork&&) noexcept = default;
LabelNetwork& LabelNetwork::operator=(LabelNetwork&&) noexcept = default;

const LabelNetworkParams& LabelNetwork::params() const { return impl_->params(); }
const std::vector<std::string>& LabelNetwork::class_names() const { return impl_->class_names(); }
const std::string& LabelNetwork::file_sha256() const { return impl_->file_sha256(); }
const std::vector<SoftLabels>& LabelNetwork::label(const ColorImage& image) { return impl_->label(image); }

std::size_t LabelNetwork::index_of(const std::string& class_name) const {
  const std::vector<std::string>& names = class_names();
  const auto at = std::find(names.begin(), names.end(), class_name);
  if (at != names.end()) return static_cast<std::size_t>(at - names.begin());
  std::string known;
  for (const std::string& name : names) known += (known.empty() ? "" : ", ") + name;
  throw std::invalid_argument("the network has no class '" + class_name + "', but " + known);
}

}  // namespace situation_awareness
