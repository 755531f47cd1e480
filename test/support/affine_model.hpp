// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "support/onnx_proto.hpp"

namespace situation_awareness {

/// The network y = A x + b, with known outputs, as an ONNX file and its manifest.
struct AffineModel {
  Eigen::MatrixXf A;  ///< outputs by inputs
  Eigen::VectorXf b;
  bool image_like = true;  ///< input [batch, 1, 1, N], else [batch, N]
  float fill = 0.0F;       ///< of the golden vector

  static AffineModel zero(int inputs, int outputs) {
    AffineModel model;
    model.A = Eigen::MatrixXf::Zero(outputs, inputs);
    model.b = Eigen::VectorXf::Zero(outputs);
    return model;
  }

  /// The file.
  std::string onnx() const {
    using namespace onnx_proto;
    const auto inputs = static_cast<std::uint64_t>(A.cols());
    const auto outputs = static_cast<std::uint64_t>(A.rows());
    std::string graph;
    if (image_like) graph += node("Flatten", {"x"}, "row");
    graph += node("Gemm", {image_like ? "row" : "x", "A", "b"}, "y", integer("transB", 1));
    graph += text(2, "affine");
    const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows = A;
    graph += text(5, tensor("A", {outputs, inputs}, rows.data(), static_cast<std::size_t>(rows.size())));
    graph += text(5, tensor("b", {outputs}, b.data(), static_cast<std::size_t>(b.size())));
    graph += text(11, value_info("x", image_like ? std::vector<std::uint64_t>{1, 1, inputs}
                                                 : std::vector<std::uint64_t>{inputs}));
    graph += text(12, value_info("y", {outputs}));
    return model(graph);
  }

  std::string manifest() const {
    std::ostringstream text;
    text << "version: 1\nsha256: " << sha256_of(onnx()) << "\ninput: {name: x, shape: [batch, "
         << (image_like ? "1, 1, " : "") << A.cols() << "]}\noutput: {name: y, shape: [batch, " << A.rows() << "]}\n";
    text.precision(9);
    Eigen::VectorXf x = Eigen::VectorXf::Constant(A.cols(), fill);
    x(0) = 0.5F;
    const Eigen::VectorXf y = A * x + b;
    text << "golden:\n  first: 0\n  input: [0.5]\n";
    if (fill != 0.0F) text << "  fill: " << fill << '\n';
    text << "  output: [";
    for (Eigen::Index i = 0; i < y.size(); ++i) text << (i > 0 ? ", " : "") << y(i);
    text << "]\n";
    return text.str();
  }

  void write(const std::filesystem::path& onnx_path) const {
    std::ofstream(onnx_path, std::ios::binary | std::ios::trunc) << onnx();
    std::ofstream(std::filesystem::path(onnx_path).replace_extension(".manifest.yaml")) << manifest();
  }
};

}  // namespace situation_awareness
