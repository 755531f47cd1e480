// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/onnx_model.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/dnn.hpp>
#include <opencv2/dnn/all_layers.hpp>

#include "situation_awareness/common/model_file.hpp"
#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/detections/dense_layers.hpp"

namespace situation_awareness {
namespace {

constexpr double kGoldenTolerance = 1e-4;  // relative above 1: processors differ by 1e-6, damaged weights by more
constexpr int kMaxRowSize = 1 << 20;

struct Tensor {
  std::string name;
  std::vector<int> shape;  ///< without the batch

  int size() const { return shape.back(); }
};

struct Golden {
  int first = 0;  ///< index of the first input that `input` has
  std::vector<float> input;
  float fill = 0.0F;  ///< value of the other inputs
  std::vector<float> output;
};

struct Manifest {
  Tensor input;
  Tensor output;
  Golden golden;
};

Tensor read_tensor(const YAML::Node& node) {
  Tensor tensor;
  tensor.name = node["name"].as<std::string>();
  const auto shape = node["shape"].as<std::vector<std::string>>();
  if (shape.size() < 2 || shape[0] != "batch") throw std::runtime_error("a shape is not [batch, ...]");
  for (std::size_t i = 1; i < shape.size(); ++i) {
    const int size = YAML::Node(shape[i]).as<int>();
    if (size < 1 || size > kMaxRowSize || (size > 1 && i + 1 < shape.size())) {
      throw std::runtime_error("a shape is not that of rows");
    }
    tensor.shape.push_back(size);
  }
  return tensor;
}

Manifest read_manifest(const ModelFile& file) {
  Manifest manifest;
  try {
    const YAML::Node root = YAML::Load(file.manifest);
    manifest.input = read_tensor(root["input"]);
    manifest.output = read_tensor(root["output"]);
    if (manifest.input.shape.size() != 1 && manifest.input.shape.size() != 3) {
      throw std::runtime_error("the input's shape is neither [batch, N] nor [batch, 1, 1, N]");
    }
    if (manifest.output.shape.size() != 1) throw std::runtime_error("the output's shape is not [batch, M]");
    const YAML::Node golden = root["golden"];
    manifest.golden.first = golden["first"].as<int>();
    manifest.golden.input = golden["input"].as<std::vector<float>>();
    if (golden["fill"]) manifest.golden.fill = golden["fill"].as<float>();
    manifest.golden.output = golden["output"].as<std::vector<float>>();
  } catch (const std::exception& error) {
    throw std::runtime_error(file.manifest_path + ": not a manifest of a network (" + error.what() + ")");
  }
  const Golden& golden = manifest.golden;
  const auto last = static_cast<long>(golden.first) + static_cast<long>(golden.input.size());
  if (golden.first < 0 || last > manifest.input.size() ||
      golden.output.size() != static_cast<std::size_t>(manifest.output.size())) {
    throw std::runtime_error(file.manifest_path + ": its golden vector does not have the network's shape");
  }
  return manifest;
}

/// Whether the layer multiplies rows by a matrix, of which it has the transpose, and adds a vector: an InnerProduct of
/// OpenCV, or a Gemm, as which versions since 4.9 read what ONNX calls so.
bool is_fully_connected(const cv::Ptr<cv::dnn::Layer>& layer) {
  if (layer->blobs.size() != 2) return false;
#if CV_VERSION_MAJOR > 4 || CV_VERSION_MINOR >= 9
  if (const auto gemm = layer.dynamicCast<cv::dnn::GemmLayer>()) {
    return !gemm->trans_a && gemm->trans_b && gemm->alpha == 1.0F && gemm->beta == 1.0F;
  }
#endif
  return !layer.dynamicCast<cv::dnn::InnerProductLayer>().empty();
}

/// In one line, without the indents of OpenCV's messages.
std::string one_line(const std::string& text) {
  std::string line;
  for (const char c : text) {
    if (c != '\n') {
      line += c;
    } else if (!line.empty() && line.back() != ' ') {
      line += ' ';
    }
  }
  return line.substr(0, line.find_last_not_of(' ') + 1);
}

/// The layers of `net` if they are a chain of fully connected ones, with or without a ReLU behind each; else none.
DenseLayers dense_layers_of(const cv::dnn::Net& net) {
  struct Layer {
    cv::Mat A;
    cv::Mat b;
    bool relu;
  };
  std::vector<Layer> chain;
  cv::Ptr<cv::dnn::Layer> previous;
  for (const std::string& name : net.getLayerNames()) {
    const int id = net.getLayerId(name);
    const cv::Ptr<cv::dnn::Layer> layer = net.getLayer(id);
    const std::vector<cv::Ptr<cv::dnn::Layer>> inputs = net.getLayerInputs(id);
    if (inputs.size() != 1 || (previous && inputs.front() != previous)) return {};
    const auto relu = layer.dynamicCast<cv::dnn::ReLULayer>();
    const bool flattens_rows = chain.empty() && layer.dynamicCast<cv::dnn::FlattenLayer>();
    if (is_fully_connected(layer)) {
      chain.push_back({layer->blobs[0], layer->blobs[1].reshape(1, 1).clone(), false});
    } else if (relu && relu->negativeSlope == 0.0F && !chain.empty()) {
      chain.back().relu = true;
    } else if (!flattens_rows && !layer.dynamicCast<cv::dnn::BlankLayer>()) {
      return {};
    }
    previous = layer;
  }
  DenseLayers layers;
  for (const auto& [A, b, relu] : chain) {
    const cv::Mat rows = A.clone();  // continuous
    layers.add(Eigen::Map<const DenseLayers::Rows>(rows.ptr<float>(), rows.rows, rows.cols),
               Eigen::Map<const Eigen::VectorXf>(b.ptr<float>(), b.cols), relu);
  }
  return layers;
}

}  // namespace

class OnnxModel::Impl {
 public:
  explicit Impl(const std::string& onnx_path) {
    const ModelFile file = read_model_file(onnx_path);
    const Manifest manifest = read_manifest(file);
    sha256_ = file.sha256;
    input_tensor_ = manifest.input;
    output_tensor_ = manifest.output;
    try {
      net_ = cv::dnn::readNetFromONNX(file.onnx.data(), file.onnx.size());
      net_.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
      net_.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
      const std::vector<std::string> outputs = net_.getUnconnectedOutLayersNames();
      if (outputs != std::vector<std::string>{output_tensor_.name}) {
        throw std::runtime_error("its only output is not '" + output_tensor_.name + "'");
      }
      check_golden(manifest.golden);
      dense_ = dense_layers_of(net_);
      if (dense_.empty()) return;
      net_ = cv::dnn::Net();
      check_golden(manifest.golden);
    } catch (const cv::Exception& error) {  // its what() is too long for a message
      throw std::runtime_error(onnx_path + ": not usable as a network (" + one_line(error.err) + ")");
    } catch (const std::exception& error) {
      throw std::runtime_error(onnx_path + ": not usable as a network (" + error.what() + ")");
    }
  }

  int inputs() const { return input_tensor_.size(); }
  int outputs() const { return output_tensor_.size(); }
  const std::string& file_sha256() const { return sha256_; }

  float* resize(int rows, float value) {
    rows_ = rows;
    assign_with_room(input_, static_cast<std::size_t>(rows) * static_cast<std::size_t>(inputs()), value);
    return input_.data();
  }

  const float* forward() { return dense_.empty() ? forward_by_opencv() : dense_.forward(input_.data(), rows_); }

 private:
  void check_golden(const Golden& golden) {
    std::copy(golden.input.begin(), golden.input.end(), resize(1, golden.fill) + golden.first);
    const float* const answer = forward();
    for (std::size_t i = 0; i < golden.output.size(); ++i) {
      const double tolerance = kGoldenTolerance * std::max(1.0, std::abs(static_cast<double>(golden.output[i])));
      if (std::abs(answer[i] - golden.output[i]) <= tolerance) continue;  // false for NaN
      throw std::runtime_error("its output for the golden vector of its manifest is wrong");
    }
  }

  const float* forward_by_opencv() {
    std::vector<int> shape{rows_};
    shape.insert(shape.end(), input_tensor_.shape.begin(), input_tensor_.shape.end());
    const cv::Mat input(shape, CV_32F, input_.data());
    // OpenCV runs nested parallel loops on the calling thread, so an outer loop of one iteration keeps this forward
    // from using a thread per core beside the nodelet manager's; cv::setNumThreads would affect all other users of
    // OpenCV in the process.
    cv::parallel_for_(cv::Range(0, 1), [this, &input](const cv::Range&) {
      net_.setInput(input, input_tensor_.name);
      net_.forward(output_);
    });
    if (output_.dims != 2 || output_.rows != rows_ || output_.cols != outputs() || output_.type() != CV_32F ||
        !output_.isContinuous()) {
      throw std::runtime_error("its output does not have " + std::to_string(outputs()) + " numbers per row");
    }
    return output_.ptr<float>();
  }

  std::string sha256_;
  Tensor input_tensor_;
  Tensor output_tensor_;
  DenseLayers dense_;  ///< the network if it is a chain of them, because a forward of OpenCV allocates; else none
  cv::dnn::Net net_;   ///< the network if it is another one
  cv::Mat output_;     ///< of net_
  int rows_ = 0;
  std::vector<float> input_;
};

OnnxModel::OnnxModel(const std::string& onnx_path) : impl_(std::make_unique<Impl>(onnx_path)) {}
OnnxModel::~OnnxModel() = default;
OnnxModel::OnnxModel(OnnxModel&&) noexcept = default;
OnnxModel& OnnxModel::operator=(OnnxModel&&) noexcept = default;

int OnnxModel::inputs() const { return impl_->inputs(); }
int OnnxModel::outputs() const { return impl_->outputs(); }
const std::string& OnnxModel::file_sha256() const { return impl_->file_sha256(); }
float* OnnxModel::resize(int rows, float value) { return impl_->resize(rows, value); }
const float* OnnxModel::forward() { return impl_->forward(); }

}  // namespace situation_awareness
